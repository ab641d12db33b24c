/* What can be plotted, listed and saved: columns of numbers over the solved times.

   columns.groups()     [{ title, items: [{ label, unit, isLog, values() }] }], what the model names first
   columns.find(label)  one of them; 'path of P' has `path`, the labels of its two columns */

import { player } from './player.js';
import { LARGEST, symbolText, units } from './units.js';
import { AXES, inWorld, isSpatial, liveliestOf, ratesInWorld } from '#world';
import { stage } from './stage.js';
import { reactions } from './forces.js';
import { settings } from './settings.js';

const RATES = [['', ''], ['_dot', '/s'], ['_ddot', '/s²']];

export const columns = {
  forget() {
    this.kept = new Map();
  },

  kept: new Map(),
  made: null,  // groups, and the number of points they were made for

  groups() {
    if (this.made?.count !== stage.points.length) {
      const groups = this.all();
      for (const item of groups.flatMap(group => group.items)) item.title ??= item.label;
      const items = groups.flatMap(group => group.items);
      this.made = { count: stage.points.length, groups, items: new Map(items.map(item => [item.label, item])) };
    }
    return this.made.groups;
  },

  all() {
    const { data } = player;
    const groups = [
      ...ordersOf(['Outputs', 'Rates of outputs', 'Second rates of outputs'], named(data), 'y', data.outputs),
      { title: 'Four-bars', items: fourBarItems() },
      { title: 'Forces', items: reactions.items() },
      { title: 'Paths', items: stage.points.flatMap(pathItems) },
      { title: 'Points', items: stage.points.flatMap(pointItems) },
      ...ordersOf(['Positions', 'Velocities', 'Accelerations'], data.coordinates, 'q', data.coordinates),
      { title: 'Residuals', items: residualItems(data) },
      { title: 'Jacobian', items: jacobianItems(data) },
    ];
    return groups.filter(group => group.items.length);
  },

  find(label) {
    this.groups();
    return this.made.items.get(label) ?? null;
  },

  /* The numbers of a column of the motion that is shown, or of a setting; computed once. */
  values(item, setting = null) {
    const kept = setting ? setting.columns : this.kept;
    if (!kept.has(item.label)) kept.set(item.label, setting ? settings.as(setting, () => item.values()) : item.values());
    return kept.get(item.label);
  },
};

/* A number that has a place on an axis, else null. */
export function finite(value) {
  return Math.abs(value) < LARGEST ? value : null;
}

function entries(name, k, width) {
  return Array.from({ length: player.count }, (_, row) => finite(player.data.arrays[name][row * width + k]));
}

/* Outputs, those of the model before the coordinates of its points. */
export function named({ outputs, drawing }) {
  const dots = drawing.marks.filter(mark => mark.kind === 'dot').flatMap(({ name }) => AXES.map(axis => `${axis}_${name}`));
  const isDot = ({ name }) => dots.includes(name);
  return [...outputs.filter(output => !isDot(output)), ...outputs.filter(isDot)];
}

function ordersOf(titles, owners, array, all) {
  return RATES.map(([order, per], k) => ({
    title: titles[k],
    items: owners.map(owner => ({
      label: owner.name + order, title: symbolText(owner.name, k), unit: owner.unit ? owner.unit + per : '',
      values: () => entries(array + order, all.indexOf(owner), all.length),
    })),
  }));
}

/* Numbers of a point over the motion. */
function along(point, number) {
  return player.states.map(state => (state.isFound ? finite(number(state, point)) : null));
}

const titleOf = point => (point.kind.startsWith('origin') ? `origin of ${point.name}` : point.name);

function pointItems(point) {
  const unit = player.data.lengthUnit, name = titleOf(point);
  const speed = kind => state => Math.hypot(...ratesInWorld(state, point.frame, point.point)[kind]);
  const items = [
    ...AXES.map((axis, k) => [`${axis} of ${name}`, unit, state => stage.where(point, state)[k]]),
    [`|v| of ${name}`, `${unit}/s`, speed('velocity')],
    [`|a| of ${name}`, `${unit}/s²`, speed('acceleration')],
  ];
  return items.map(([label, own, number]) => ({ label, unit: own, values: () => along(point, number) }));
}

/* The path of a point, in space as it is seen from above, from the front and from the side. */
function pathItems(point) {
  const name = titleOf(point), pairs = isSpatial ? ['xy', 'xz', 'yz'] : ['xy'];
  return pairs.map(([first, second]) => ({
    label: isSpatial ? `path of ${name} in ${first}${second}` : `path of ${name}`,
    unit: player.data.lengthUnit, path: [`${first} of ${name}`, `${second} of ${name}`],
  }));
}

/* How well each driven four-bar transmits, as the outputs transmission_angle and mechanical_advantage are:
   the angle between coupler and follower, and the rate of the crank by that of the follower. */
function fourBarItems() {
  const { four_bars, joints, bodies, frames } = player.data.drawing;
  const placed = name => joints.find(joint => joint.name === name)?.place;
  return four_bars.filter(({ links, driven }) => driven && driven === links[1]).flatMap(({ joints: pins, links }) => {
    const places = pins.map(placed), [crank, follower] = [links[1], links[3]].map(name => frames[bodies.indexOf(name)]);
    if (!places.every(Boolean) || !crank || !follower) return [];
    const angle = ({ q }) => {
      const [a, b, c] = places.slice(1).map(({ frame, point }) => inWorld(q, frame, point)), [u, v] = [a, c].map(x => [x[0] - b[0], x[1] - b[1]]);
      return Math.atan2(Math.abs(u[0] * v[1] - u[1] * v[0]), u[0] * v[0] + u[1] * v[1]);
    };
    const rate = (state, { columns: [, , phi] }) => state.q_dot[phi];
    const over = number => () => player.states.map(state => (state.isFound ? finite(number(state)) : null));
    return [
      { label: `transmission angle at ${pins[2]}`, unit: 'rad', at: angle, values: over(angle) },
      ...[state => rate(state, crank) / rate(state, follower)].map(at => (
        { label: `mechanical advantage of ${links[3]}`, unit: '', at, values: over(at) })),
    ];
  });
}

/* A residual of exactly zero has no logarithm. */
function residualItems({ arrays, drawing: { joints } }) {
  const aboveZero = value => (value === null ? null : Math.max(value, 1e-18));
  return !arrays.residual ? [] : joints.map(({ name }, k) => ({
    label: `|Phi| of ${name}`, unit: '', isLog: true,
    values: () => entries('residual', k, joints.length).map(aboveZero),
  }));
}

function jacobianItems({ arrays }) {
  const all = [
    { name: 'condition', label: 'condition number of Phi_q', isLog: true },
    { name: 'determinant', label: 'determinant of Phi_q', isLog: false },
  ];
  return all.filter(({ name }) => arrays[name]).map(({ name, label, isLog }) => ({
    label, unit: '', isLog, values: () => entries(name, 0, 1),
  }));
}

/* Whether a column is more than rounding around a constant. */
function moves(item) {
  const values = columns.values(item).filter(value => value !== null);
  const size = Math.max(units.scale(item.unit), 1e-12);
  return values.some(value => Math.abs(value - values[0]) > 1e-9 * size);
}

/* What is plotted when the page opens: the first output that moves, with its rates; else of the
   first point of uneven speed its path, speed and acceleration; else the liveliest coordinate. */
export function plottedFirst() {
  const { data } = player, dots = stage.points.filter(point => point.isNamed);
  const outputs = named(data).slice(0, data.outputs.length - 2 * dots.length);
  const output = outputs.find(({ name }) => moves(columns.find(name)));
  if (output) return RATES.map(([order]) => output.name + order);
  const dot = dots.find(({ name }) => moves(columns.find(`|v| of ${name}`)));
  if (dot) return [pathItems(dot)[0].label, `|v| of ${dot.name}`, `|a| of ${dot.name}`];
  const name = liveliest();
  return RATES.map(([order]) => name + order);
}

/* Of bodies an angle, that of the largest acceleration, so that it is not one that a motor turns
   steadily; where all angles are steady, as of a cam and its follower, any coordinate of the largest
   acceleration; where nothing accelerates, the one that goes farthest. */
function liveliest() {
  const { data, n } = player, { frames } = data.drawing;
  const all = data.coordinates.map((_, k) => k);
  const sizes = (name, candidates) => candidates.map(k => {
    const values = data.arrays[name].filter((value, place) => place % n === k && Number.isFinite(value));
    return values.reduce((most, value) => Math.max(most, Math.abs(value - values[0])), 0);
  });
  const [angles, ofBodies] = frames.length ? liveliestOf(frames) : [[], all];
  for (const [name, candidates] of [['q_ddot', angles], ['q_ddot', ofBodies], ['q', all]]) {
    const found = sizes(name, candidates), largest = Math.max(0, ...found);
    if (largest > 1e-9) return data.coordinates[candidates[found.indexOf(largest)]].name;
  }
  return data.coordinates[0].name;
}

/* Pieces of time [from, to] in which something was not found. */
export function failures() {
  const { status } = player.data, pieces = [];
  for (let k = 0; k < player.count; k++) {
    if (status[k] === 0) continue;
    const begin = player.t[Math.max(0, k - 1)];
    while (k + 1 < player.count && status[k + 1] !== 0) k++;
    pieces.push([begin, player.t[k]]);
  }
  return pieces;
}
