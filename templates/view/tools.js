/* What helps to read the drawing: grid and scale, distances and angles, what is looked at. */

import { player } from './player.js';
import { niceStep, stepText, units } from './units.js';
import { distanceBetween, GROUND, Pen } from './draw.js';
import { AXES, drawGrid, inWorld, isSpatial } from '#world';
import { bodyTarget, NEAR, stage } from './stage.js';
import { byId } from './elements.js';
import { poles } from './poles.js';
import { reactions } from './forces.js';
import { rowFinder } from './tables.js';

const GRID = 70;  // pixels between lines of the grid, about

const grid = {
  isShown: false,

  draw(ctx, view, palette) {
    const pen = new Pen(ctx, null, { view, palette }, player.data.drawing.size);
    if (this.isShown) drawGrid(pen, niceStep(GRID / view.scale));
    this.drawScale(pen, niceStep(0.12 * stage.width / view.scale));
  },

  /* A bar of a round length, at the lower right. */
  drawScale(pen, length) {
    const { view, palette } = pen, right = stage.width - 14, low = stage.height - 12;
    const left = right - length * view.scale;
    pen.path([[left, low - 5], [left, low], [right, low], [right, low - 5]]);
    pen.stroke(palette.quiet, 1.8);
    const text = `${stepText(length, length)} ${player.data.lengthUnit}`;
    stage.write(text, [(left + right) / 2, low - 5], palette.quiet, '', 'center');
  },
};

/* A distance between two points; with a third one, the angle at the second. */
const measure = {
  isOn: false,
  points: [],  // { name, frame, point }: they move with their bodies

  /* What was clicked: a point of the mechanism where one is near, else a place on the ground. */
  down(world) {
    if (!this.isOn) return false;
    const near = stage.near(stage.view.toScreen(world), NEAR);
    if (near || !isSpatial) this.take(near ?? { name: '', frame: GROUND, point: world });
    return true;
  },

  take(point) {
    this.points = this.points.length > 2 ? [point] : [...this.points, point];
    player.refresh();
  },

  /* What is measured at a state: lengths in the model's unit, angles in radians. */
  found(state) {
    const [a, b, c] = this.points.map(({ frame, point }) => inWorld(state.q, frame, point));
    if (!b) return null;
    const way = b.map((x, k) => x - a[k]);
    const found = { way, distance: Math.hypot(...way), slope: isSpatial ? null : Math.atan2(way[1], way[0]) };
    if (!c) return found;
    const unit = to => to.map((x, k) => (x - b[k]) / distanceBetween(b, to)), [u, v] = [unit(a), unit(c)];
    const angle = 2 * Math.atan2(distanceBetween(u, v), Math.hypot(...u.map((x, k) => x + v[k])));
    return { ...found, angle };
  },

  text(state) {
    const found = this.found(state), unit = player.data.lengthUnit;
    if (!found) return this.points.length ? 'Choose a second point.' : 'Choose two points, or three for an angle.';
    const { way, distance, slope, angle } = found;
    const length = value => units.full(value, unit), turn = value => units.full(value, 'rad', Math.PI);
    const parts = [`distance ${length(distance)}`, ...AXES.map((axis, k) => `Δ${axis} ${length(way[k])}`)];
    const line = [...parts, ...(slope === null ? [] : [`slope ${turn(slope)}`])].join(', ');
    return angle === undefined ? line : `angle ${turn(angle)}; first ${line}`;
  },

  draw(ctx, view, palette, state) {
    if (!this.isOn || !this.points.length) return;
    const pen = new Pen(ctx, state.q, { view, palette }, player.data.drawing.size);
    const places = this.points.map(({ frame, point }) => pen.at(frame, point));
    pen.path(places);
    pen.stroke(palette.paper, 5);
    pen.stroke(palette.measure, 2);
    for (const place of places) {
      pen.circle(place, 5);
      pen.fill(palette.paper);
      pen.stroke(palette.measure, 2);
    }
    const found = this.found(state);
    if (!found) return;
    const text = found.angle === undefined
      ? units.full(found.distance, player.data.lengthUnit) : units.full(found.angle, 'rad', Math.PI);
    const [x, y] = found.angle === undefined ? mixed(places[0], places[1], 0.5) : places[1];
    stage.write(text, [x + 10, y - 8], palette.measure, 'bold');
  },
};

/* A point between two, or beyond them. */
function mixed([x0, y0], [x1, y1], part) {
  return [x0 + part * (x1 - x0), y0 + part * (y1 - y0)];
}

/* ---- buttons and choices ---- */

export const tools = {
  build() {
    const pressed = (id, toggle) => {
      const button = byId(id);
      button.addEventListener('click', () => {
        button.ariaPressed = String(button.ariaPressed !== 'true');
        toggle(button.ariaPressed === 'true');
        player.refresh();
      });
    };
    pressed('names', isOn => { stage.showsNames = isOn; });
    pressed('grid', isOn => { grid.isShown = isOn; });
    pressed('velocities', isOn => stage.showArrows('velocity', isOn));
    pressed('accelerations', isOn => stage.showArrows('acceleration', isOn));
    pressed('measure', isOn => { measure.isOn = isOn; });
    const acts = { fit: () => stage.fit(), closer: () => stage.zoom(1.4), wider: () => stage.zoom(1 / 1.4) };
    for (const [id, act] of Object.entries(acts)) byId(id).addEventListener('click', act);
    this.buildMeasure();
    if (!isSpatial) this.buildPoles();
    reactions.build();
    this.buildLegend();
    stage.underlays.push((...given) => grid.draw(...given));
    stage.overlays.push((...given) => measure.draw(...given));
    if (!isSpatial) stage.overlays.push((...given) => poles.draw(...given));
    const next = stage.pointer;
    stage.pointer = {
      down: (world, event) => measure.down(world) || next?.down?.(world, event),
      move: (world, event) => !measure.isOn && next?.move?.(world, event),
      up: (world, event) => !measure.isOn && next?.up?.(world, event),
    };
  },

  /* Points of the mechanism by name, for those who do not point. */
  buildMeasure() {
    const choice = byId('measured-point');
    choice.append(new Option('a point …', ''), ...stage.points.map((point, k) => new Option(point.name, String(k))));
    choice.addEventListener('change', () => {
      if (choice.value) measure.take(stage.points[choice.value]);
      choice.value = '';
    });
    byId('measure-again').addEventListener('click', () => {
      measure.points = [];
      player.refresh();
    });
  },

  buildPoles() {
    const choices = poles.choices(), choice = byId('poles'), centrodes = byId('centrodes');
    choice.append(...[...choices.keys()].map(name => new Option(name, name)));
    choice.addEventListener('change', () => {
      poles.pairs = choices.get(choice.value);
      centrodes.disabled = !poles.pairs.length;
      player.refresh();
    });
    centrodes.disabled = true;
    centrodes.addEventListener('change', () => {
      poles.showsCentrodes = centrodes.checked;
      player.refresh();
    });
  },

  /* The bodies in their colours: each is a button that shows how it turns. */
  buildLegend() {
    this.chips = player.data.drawing.bodies.map((name, k) => {
      const chip = document.createElement('button');
      Object.assign(chip, { type: 'button', textContent: name });
      const target = bodyTarget(player.data.drawing.frames[k]);
      chip.addEventListener('click', () => stage.click(target));
      chip.addEventListener('pointerenter', event => { if (event.pointerType !== 'touch') stage.hover(target); });
      chip.addEventListener('pointerleave', () => stage.hover(null));
      return chip;
    });
    const find = rowFinder('Find a body', () => this.chips.map(chip => [chip.textContent, chip]));
    byId('legend').replaceChildren(find, ...this.chips);
  },

  colour() {
    const { bodies } = stage.palette;
    this.chips.forEach((chip, k) => { chip.style.setProperty('--body', bodies[k % bodies.length][0]); });
  },

  show(state) {
    byId('measuring').hidden = !measure.isOn;
    if (measure.isOn) byId('measured').textContent = measure.text(state);
    const { selected } = stage;
    this.chips.forEach((chip, k) => { chip.ariaPressed = String(Boolean(selected?.isBody) && selected.frame.index === k); });
  },
};
