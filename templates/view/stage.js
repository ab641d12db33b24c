/* The canvas: what is drawn on it, and what a pointer does there.

   stage.view            world to screen, for the size the canvas has now
   stage.first           extent of the motion that the page was made with: it stays in view
   stage.extent          function that gives what the picture must show
   stage.camera          null where all of it is seen, or { zoom, centre }
   stage.held            null, or the view that stays while something is pulled
   stage.underlays       functions (ctx, view, palette, state) that draw below: a grid, kept settings
   stage.overlays        functions (ctx, view, palette, state) that draw on top: measures, poles
   stage.pointer         null, or { down, move, up } that get (world point, event) before hovering;
                         true from `down` keeps the event
   stage.points          what can be pointed at: named points, joints and the origins of bodies
   stage.forget()        the motion is another one */

import { player, Player, share, withArrays } from './player.js';
import { arrow, distanceBetween, drawShapes, paletteNow, Pen, towards } from './draw.js';
import { areasOf, AXES, inWorld, isSpatial, orbit, proportions, ratesInWorld, stacked, View } from '#world';

export const NEAR = 16;  // pixels within which a point is meant, twice that with a finger
export const ORIGIN = 'origin of the body';
const PLACES = 1000;  // points of a traced path
const DOTS = 24;  // equal times that are marked on it
const APART = 10;  // pixels between them, on the mean
const ARROW = 0.2;  // part of the canvas that the longest velocity and acceleration take
const SAME_PLACE = 0.01;  // of a mark's size: two joints on one pin have one arrow
const CLOSEST = 200;  // largest zoom
const UPRIGHT = 0.36;  // part of a phone's height that the drawing takes at most
export const CLICK = 4;  // pixels that a pointer may move in a click

class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.ctx = canvas.getContext('2d');
    this.first = player.data.extent;
    this.extent = () => player.data.extent;
    this.camera = null;
    this.held = null;
    this.underlays = [];
    this.overlays = [];
    this.pointer = null;
    this.points = pointsOf(player.data.drawing);
    this.places = placesOf(player.data.drawing);  // further places of joints
    this.traced = new Set(this.points.filter(point => point.isNamed));
    this.selected = null;  // kept by a click
    this.hovered = null;
    this.showsNames = false;
    this.arrows = new Set();  // 'velocity', 'acceleration': of all points, as long as it is in
    this.fingers = new Map();  // pointers that are down, and where
    this.forget();
    this.resize();
  }

  forget() {
    this.paths = new Map();  // of traced points, in the world
    for (const point of this.points) delete point.greatest;
  }

  resize() {
    this.type = fontSize();
    const holder = this.canvas.parentElement, width = holder.clientWidth;
    const wanted = Math.max(0.45 * width, width / proportions(this.first) + 4 * NEAR);
    const isFilled = getComputedStyle(holder).getPropertyValue('--fills') !== '';
    const height = isFilled ? holder.clientHeight : Math.max(180, Math.min(UPRIGHT * innerHeight, wanted));
    const dense = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * dense);
    this.canvas.height = Math.round(height * dense);
    this.canvas.style.height = `${height}px`;
    this.ctx.setTransform(dense, 0, 0, dense, 0, 0);
    this.width = width;
    this.height = height;
    this.palette = paletteNow();
  }

  /* Sizes of the text on it. */
  font(weight = '') {
    return `${weight} ${Math.round(0.82 * this.type)}px system-ui, sans-serif`;
  }

  draw(state) {
    this.view = this.held ?? new View(this.extent(), this.width, this.height, NEAR, this.camera);
    const { ctx, view, palette } = this;
    ctx.fillStyle = palette.paper;  // a film has no other ground
    ctx.fillRect(0, 0, this.width, this.height);
    ctx.save();  // what a drawing sets is not left to the next one
    for (const underlay of this.underlays) underlay(ctx, view, palette, state);
    const violated = state.isFound ? null : violatedJoints();
    const largest = Math.max(9, Math.min(this.width, this.height) / 55);
    const style = { view, palette, violated, largest, alpha: state.isFound || !hasMotion() ? 1 : 0.55 };
    drawShapes(ctx, state.q, style);
    for (const point of this.traced) this.drawPath(point);
    for (const overlay of this.overlays) overlay(ctx, view, palette, state);
    if (state.isFound && !state.pose) this.drawArrows(state);
    this.drawNames(state);
    const point = this.hovered || this.selected;
    if (point && point.isBody) this.drawOutline(point, state, style);
    else if (point) this.drawPoint(point, state);
    ctx.restore();
  }

  where(point, state) {
    return inWorld(state.q, point.frame, point.point);
  }

  /* Every path has a colour of its own, as long as there are colours. */
  colourOf(point) {
    const { bodies } = this.palette;
    return bodies[(this.points.indexOf(point) + 4) % bodies.length][0];
  }

  drawPath(point) {
    if (!this.paths.has(point)) this.paths.set(point, pathOf(point));
    const { ctx, view, palette } = this, { line, dots } = this.paths.get(point);
    const colour = this.colourOf(point), pen = new Pen(ctx, null, this, player.data.drawing.size);
    ctx.lineJoin = 'round';
    pen.path(line.map(place => place && view.toScreen(place)));
    pen.stroke(palette.paper, 4);
    pen.stroke(colour, 2);
    // As many as have room, at equal times all the same.
    const length = dots.reduce((sum, place, k) => (k ? sum + distanceBetween(dots[k - 1], place) : 0), 0) * view.scale;
    const stride = [1, 2, 3, 4, 6, 8, 12].find(each => length * each > APART * dots.length) ?? 24;
    for (let k = 0; k < dots.length; k += stride) {
      pen.circle(view.toScreen(dots[k]), 3);
      pen.fill(palette.paper);
      pen.stroke(colour, 1.5);
    }
  }

  /* Names of points; where they are asked for, of joints and, in their colours, of bodies too. */
  drawNames(state) {
    const shown = this.points.filter(point => this.showsNames || point.isNamed);
    const taken = [];
    if (this.showsNames) {
      player.data.drawing.bodies.forEach((name, k) => {
        const frame = player.data.drawing.frames[k];
        const at = this.view.toScreen(inWorld(state.q, frame, middleOf(frame)));
        taken.push(at);
        this.write(name, at, this.palette.bodies[k % this.palette.bodies.length][0], 'bold');
      });
    }
    for (const point of shown) {
      if (point.kind === ORIGIN) continue;
      const [x, y] = this.view.toScreen(this.where(point, state));
      if (taken.some(([a, b]) => Math.abs(a - x) < 60 && Math.abs(b - y) < this.type)) continue;
      taken.push([x, y]);
      this.write(point.name, [x + 9, y - 6], this.palette.ink);
    }
  }

  /* Text on the drawing, with a seam of paper. */
  /** @param {any} text @param {number[]} place */
  write(text, [x, y], colour, weight = '', align = 'start') {
    const { ctx, palette } = this;
    Object.assign(ctx, { font: this.font(weight), textBaseline: 'bottom', textAlign: align, lineWidth: 4,
      lineJoin: 'round', strokeStyle: palette.paper, fillStyle: colour });
    ctx.strokeText(text, x, y);
    ctx.fillText(text, x, y);
    ctx.textAlign = 'start';
  }

  /* A body that is pointed at has a strong edge. */
  drawOutline(body, state, style) {
    const { drawing } = player.data;
    const pen = new Pen(this.ctx, state.q, { ...style, looks: drawing.looks }, drawing.size);
    for (const points of areasOf(pen, body.frame)) {
      pen.path(points, true);
      pen.stroke(pen.colours(body.frame)[0], 4);
    }
  }

  showArrows(kind, isOn) {
    this.arrows[isOn ? 'add' : 'delete'](kind);
  }

  /* Velocities and accelerations of all joints and named points, in one scale for each. */
  drawArrows(state) {
    const pen = new Pen(this.ctx, state.q, this, player.data.drawing.size);
    const length = ARROW * Math.min(this.width, this.height) / this.view.scale;
    const moving = this.points.filter(({ kind }) => kind !== ORIGIN);
    for (const kind of this.arrows) {
      const most = moving.reduce((found, point) => Math.max(found, greatestRates(point)[kind]), 0), taken = [];
      for (const point of moving) {
        const place = this.where(point, state), rate = ratesInWorld(state, point.frame, point.point)[kind];
        if (!(most > 0) || taken.some(other => distanceBetween(other, place) < SAME_PLACE * player.data.drawing.size)) continue;
        taken.push(place);
        arrow(pen, this.view.toScreen(place), this.view.toScreen(place.map((x, k) => x + rate[k] * length / most)), this.palette[kind], 2.5);
      }
    }
  }

  /* A ring around the point, and arrows for velocity and acceleration. */
  drawPoint(point, state) {
    const place = this.where(point, state), at = this.view.toScreen(place);
    const pen = new Pen(this.ctx, state.q, this, player.data.drawing.size);
    const rates = ratesInWorld(state, point.frame, point.point);
    const most = greatestRates(point);
    const length = ARROW * Math.min(this.width, this.height) / this.view.scale;
    for (const kind of ['acceleration', 'velocity']) {
      if (!(most[kind] > 0)) continue;
      const end = place.map((x, k) => x + rates[kind][k] * length / most[kind]);
      arrow(pen, at, this.view.toScreen(end), this.palette[kind], 2.5);
    }
    pen.circle(at, 1.3 * pen.unit);
    pen.stroke(this.palette.velocity, 2);
  }

  /* The point nearest to a place on the screen, or null. */
  /** @param {number[]} place */
  near([x, y], reach) {
    let best = null, least = reach;
    for (const point of [...this.points, ...this.places]) {
      const [a, b] = this.view.toScreen(this.where(point, player.state));
      const distance = Math.hypot(a - x, b - y);
      if (distance < least) [best, least] = [point, distance];
    }
    return best;
  }

  /* The body at a place on the screen, as something to be pointed at, or null. */
  bodyAt(at) {
    const { drawing } = player.data;
    const pen = new Pen(this.ctx, player.state.q, { view: this.view, palette: this.palette }, drawing.size);
    const found = stacked(drawing.frames, player.state.q, this.view).findLast(frame => areasOf(pen, frame).some(points => isInside(points, at)));
    return found ? bodyTarget(found) : null;
  }

  /* The point or the body that a pointer means; a finger means points from farther away. */
  targetAt({ offsetX, offsetY, pointerType }) {
    const at = [offsetX, offsetY];
    return this.near(at, pointerType === 'touch' ? 2 * NEAR : NEAR) ?? this.bodyAt(at);
  }

  /* All that is at the place of a point: named points, every joint, whatever body holds it. */
  together(point, state) {
    const at = this.where(point, state), least = player.data.drawing.size / 100, found = new Map();
    for (const other of [point, ...this.points, ...this.places]) {
      const isOrigin = other.kind === ORIGIN && other !== point;
      if (isOrigin && other.frame.index !== point.frame.index) continue;
      if (distanceBetween(at, this.where(other, state)) < least && !found.has(other.name)) found.set(other.name, other);
    }
    return [...found.values()];
  }

  toggleTrace(point) {
    if (!this.traced.delete(point)) this.traced.add(point);
    player.refresh();
  }

  select(point) {
    this.selected = point;
    player.refresh();
  }

  hover(point) {
    if (point === this.hovered) return;
    const isSameBody = point?.isBody && this.hovered?.isBody && point.frame === this.hovered.frame;
    if (isSameBody) return;
    this.hovered = point;
    this.canvas.style.cursor = point ? 'pointer' : '';
    player.refresh();
  }

  /* ---- what is looked at ---- */

  /* Look more closely, or less; what is at a place on the screen stays there. */
  zoom(factor, at = [this.width / 2, this.height / 2]) {
    const zoom = Math.min(CLOSEST, (this.camera?.zoom ?? 1) * factor);
    if (zoom <= 1 && factor < 1) return this.fit();
    const fixed = this.view.toWorld(at), scale = this.view.fit * zoom;
    const way = this.view.way(-(at[0] - this.width / 2) / scale, (at[1] - this.height / 2) / scale);
    return this.look({ zoom, centre: fixed.map((x, k) => x + way[k]) });
  }

  pan(right, down) {
    const centre = this.view.toWorld([this.width / 2, this.height / 2]), { scale } = this.view;
    const way = this.view.way(-right / scale, down / scale);
    this.look({ zoom: this.camera?.zoom ?? 1, centre: centre.map((x, k) => x + way[k]) });
  }

  fit() {
    this.look(null);
  }

  look(camera) {
    this.camera = camera;
    // A finger scrolls the page while all is seen, and moves the drawing otherwise.
    this.canvas.style.touchAction = camera || isSpatial ? 'none' : 'pan-y';
    player.refresh();
  }

  /* ---- pointers ---- */

  listen() {
    const { canvas } = this;
    this.look(null);
    const at = event => [event.offsetX, event.offsetY];
    const handled = (kind, event) => {
      const isKept = this.pointer?.[kind]?.(this.view.toWorld(at(event)), event);
      if (isKept) event.preventDefault();
      return isKept;
    };
    let pressed = null;
    canvas.addEventListener('pointerdown', event => {
      this.fingers.set(event.pointerId, at(event));
      if (this.fingers.size === 1 && handled('down', event)) return;
      pressed = this.fingers.size === 1 ? at(event) : null;
    });
    canvas.addEventListener('pointermove', event => {
      if (this.fingers.size < 2 && handled('move', event)) return;
      const before = this.fingers.get(event.pointerId);
      if (before) this.moveFinger(event, at(event), pressed);
      else if (event.pointerType !== 'touch') this.hover(this.targetAt(event));
    });
    const up = event => {
      const isClick = pressed && event.type === 'pointerup' && towards(pressed, at(event))[2] < CLICK;
      this.fingers.delete(event.pointerId);
      pressed = null;
      if (handled('up', event) || !isClick) return;
      this.click(this.targetAt(event));
    };
    canvas.addEventListener('pointerup', up);
    canvas.addEventListener('pointercancel', up);
    canvas.addEventListener('pointerleave', event => {
      this.fingers.delete(event.pointerId);
      this.hover(null);
    });
    canvas.addEventListener('wheel', event => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), at(event));
    }, { passive: false });
  }

  /* One finger moves the drawing; two move it, and what was between them stays between them. */
  moveFinger(event, to, pressed) {
    const id = event.pointerId, from = this.fingers.get(id);
    const [other] = [...this.fingers].filter(([key]) => key !== id).map(([, place]) => place);
    if (other) {
      const [before, after] = [from, to].map(place => towards(place, other)[2]);
      if (before > 0 && after > 0) this.zoom(after / before, [(to[0] + other[0]) / 2, (to[1] + other[1]) / 2]);
      this.pan((to[0] - from[0]) / 2, (to[1] - from[1]) / 2);
    } else {
      if (pressed && towards(pressed, to)[2] < CLICK) return;
      const isTurn = isSpatial && event.buttons === 1 && !event.shiftKey;
      (isTurn ? orbit : this).pan(to[0] - from[0], to[1] - from[1]);
    }
    this.fingers.set(id, to);
  }

  /* What is clicked is kept, a point with its path; clicked again, it is let go. */
  click(target) {
    this.hovered = null;
    const isSame = target?.isBody ? this.selected?.isBody && this.selected.frame === target.frame : target === this.selected;
    if (target === null || isSame) {
      if (this.selected && !this.selected.isNamed) this.traced.delete(this.selected);
      this.select(null);
      return;
    }
    if (!target.isBody && !this.places.includes(target)) this.traced.add(target);
    this.select(target);
  }
}

/* Whether the page is shown full screen, with large type. */
export function isProjected() {
  return document.documentElement.classList.contains('projected');
}

/* Height of the page's letters, in pixels. */
function fontSize() {
  return parseFloat(getComputedStyle(document.body).fontSize);
}

/* A body as something that can be pointed at. */
export function bodyTarget(frame) {
  return { name: player.data.drawing.bodies[frame.index], kind: 'body', frame, point: middleOf(frame), isBody: true };
}

/* A point in the middle of what is drawn of a body. */
export function middleOf(frame) {
  const own = player.data.drawing.marks.filter(mark => mark.points && mark.frame.index === frame.index);
  const corners = own.flatMap(mark => mark.points);
  if (!corners.length) return [0, 0];
  return AXES.map((_, axis) => corners.reduce((sum, corner) => sum + corner[axis], 0) / corners.length);
}

/* Whether a place is inside a closed polygon: a ray to the right crosses its sides an odd number of times. */
function isInside(points, [x, y]) {
  let isIn = false;
  points.forEach(([x1, y1], k) => {
    const [x0, y0] = points[(k + points.length - 1) % points.length];
    if ((y0 > y) !== (y1 > y) && x < x0 + (y - y0) * (x1 - x0) / (y1 - y0)) isIn = !isIn;
  });
  return isIn;
}

/* Named points, joints that are somewhere, then the origins of bodies. */
function pointsOf(drawing) {
  const named = drawing.marks.filter(mark => mark.kind === 'dot').map(({ name, place }) => ({
    name, kind: `point of ${drawing.bodies[place.frame.index] || 'the ground'}`,
    frame: place.frame, point: place.point, isNamed: true,
  }));
  const joints = drawing.joints.filter(joint => joint.place).map(joint => ({
    name: joint.name, kind: kindOf(joint), frame: joint.place.frame, point: joint.place.point,
  }));
  const isBearing = joint => !joint.kind.endsWith('driver');
  const origins = drawing.bodies.map((name, body) => ({
    name, kind: ORIGIN, frame: drawing.frames[body], point: [0, 0],
  }));
  // Of several at one place a joint comes first: it is the one that is met by the pointer.
  return [...named, ...joints.filter(isBearing), ...joints.filter(joint => !isBearing(joint)), ...origins];
}

function kindOf(joint) {
  return joint.is_driver ? `${joint.kind}, a driver` : joint.kind;
}

/* All other places of joints: both ends of a rod, both centres of a pair of gears. */
function placesOf(drawing) {
  const joints = new Map(drawing.joints.map(joint => [joint.name, joint]));
  return drawing.marks.filter(mark => joints.has(mark.joint)).flatMap(mark =>
    [mark.place, mark.first, mark.second].filter(Boolean).map(place => ({
      name: mark.joint, kind: kindOf(joints.get(mark.joint)), frame: place.frame, point: place.point,
    })));
}

export function hasBodies() {
  return player.data.drawing.bodies.length > 0;
}

export function hasMotion() {
  return player.data.status.some(status => status === 0);
}

/* Where a point is: a line through at most PLACES solved times, interrupted where it is not known, and
   dots at equal times. */
export function pathOf(point) {
  const count = Math.min(player.count, PLACES);
  const line = Array.from({ length: count }, (_, k) => {
    const state = player.states[Math.round(k * (player.count - 1) / Math.max(count - 1, 1))];
    return state.isFound ? inWorld(state.q, point.frame, point.point) : null;
  });
  const round = firstRound(line) * player.duration;
  const states = Array.from({ length: DOTS }, (_, k) => player.between(k * round / DOTS));
  const dots = states.filter(state => state.isFound).map(state => inWorld(state.q, point.frame, point.point));
  return { line, dots };
}

/* The part of a path that is one round: up to where it meets its start in the same direction, so that
   dots of several rounds do not mix. */
function firstRound(line) {
  if (line.length < 4 || !line[0] || !line[1]) return 1;
  const way = (from, to) => to.map((x, k) => x - from[k]);
  const product = (a, b) => a.reduce((sum, x, k) => sum + x * b[k], 0);
  const first = way(line[0], line[1]);
  for (let k = 2; k + 1 < line.length; k++) {
    if (!line[k] || !line[k + 1]) return 1;
    const step = way(line[k], line[k + 1]), back = way(line[k], line[0]), square = product(step, step);
    const part = product(step, back) / square, aside = back.map((x, i) => x - part * step[i]);
    const isAlong = product(step, first) > 0.9 * Math.sqrt(square * product(first, first))
      && product(aside, aside) < square / 4;
    if (isAlong && part >= 0 && part <= 1) return (k + part) / (line.length - 1);
  }
  return 1;
}

/* The greatest speed and acceleration of a point in the motion, kept with it. */
function greatestRates(point) {
  if (point.greatest) return point.greatest;
  const most = { velocity: 0, acceleration: 0 };
  for (const state of player.states) {
    const rates = ratesInWorld(state, point.frame, point.point);
    for (const kind of Object.keys(most)) {
      const size = Math.hypot(...rates[kind]);
      if (size > most[kind]) most[kind] = size;
    }
  }
  // A rounding error is not a movement.
  const size = player.data.drawing.size;
  for (const kind of Object.keys(most)) if (most[kind] < 1e-9 * size) most[kind] = 0;
  point.greatest = most;
  return most;
}

/* The joints that do not hold at the guess; none where nothing is known. */
function violatedJoints() {
  if (hasMotion()) return null;
  const { guessResidual, violated, drawing } = player.data;
  const broken = drawing.joints.filter((_, k) => guessResidual[k] > violated);
  return new Set(broken.map(joint => joint.name));
}

/** The stage of the page, once it is open.
 * @type {Stage} */
export let stage = null;

/* Open a page: its data, arrays still as text, and its canvas. */
export function openPage(data, canvas) {
  share(new Player(withArrays(data)));
  stage = new Stage(canvas);
}
