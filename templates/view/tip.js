/* The tip beside the point or body under the pointer. */

import { player } from './player.js';
import { units } from './units.js';
import { AXES, bodyTip, ratesInWorld } from '#world';
import { stage } from './stage.js';
import { byId } from './elements.js';
import { reactions } from './forces.js';

export function showTip(state) {
  const tip = byId('tip'), target = stage.hovered || stage.selected;
  tip.hidden = !target;
  if (!target) return;
  const parts = target.isBody ? bodyTip(target, state) : pointTip(target, state);
  tip.replaceChildren(...parts);
  const [left, top] = placeOfTip(tip, stage.view.toScreen(stage.where(target, state)), state);
  tip.style.left = `${left}px`;
  tip.style.top = `${top}px`;
}

export function tipLine(text, className = '') {
  const line = document.createElement('div');
  Object.assign(line, { className, textContent: text });
  return line;
}

export function tipTitle(text) {
  const title = document.createElement('strong');
  title.textContent = text;
  return title;
}

/* A point: every name at its place, then its position, velocity and acceleration. */
function pointTip(point, state) {
  const unit = player.data.lengthUnit, place = stage.where(point, state);
  const here = stage.together(point, state);
  const names = here.map(({ name, kind }) => tipLine(`${name}: ${kind}`));
  const lines = [tipLine(`${AXES.map((axis, k) => `${axis} = ${units.text(place[k], unit)}`).join(', ')} ${unit}`)];
  if (state.isFound && !state.pose) {
    const rates = ratesInWorld(state, point.frame, point.point);
    for (const [sign, kind, per] of [['v', 'velocity', '/s'], ['a', 'acceleration', '/s²']]) {
      const own = unit + per, parts = rates[kind].map(part => units.text(part, own)).join(', ');
      lines.push(tipLine(`${sign} = (${parts}), ${units.full(Math.hypot(...rates[kind]), own)}`, kind));
    }
    lines.push(...reactions.lines(here.map(({ name }) => name), state).map(line => tipLine(line, 'force')));
  }
  return [tipTitle(here.map(({ name }) => name).join(', ')), ...names, ...lines];
}

/* Beside the point or in a corner: the first place that hides the fewest other points. */
function placeOfTip(tip, at, state) {
  const [x, y] = at, [wide, tall] = [tip.offsetWidth, tip.offsetHeight];
  const [right, low] = [stage.width - wide - 4, stage.height - tall - 4];
  const beside = [[x + 18, y + 14], [x - 18 - wide, y + 14], [x + 18, y - 14 - tall], [x - 18 - wide, y - 14 - tall]];
  const inside = beside.filter(([a, b]) => a >= 4 && a <= right && b >= 4 && b <= low);
  /** @type {number[][]} */
  const others = stage.points.map(other => stage.view.toScreen(stage.where(other, state)));
  /** @param {number[]} place */
  const hidden = ([a, b]) => others.filter(([u, v]) => u > a && u < a + wide && v > b && v < b + tall).length;
  const places = [...inside, [4, 4], [right, 4], [4, low], [right, low]];
  return places.reduce((best, place) => (hidden(place) < hidden(best) ? place : best));
}
