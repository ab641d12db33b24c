/* The board of the editor: a canvas on which a pointer, fingers or keys draw a model. */

import { drawShapes, fitMarks, paletteNow, Pen, towards } from './draw.js';
import { boxOf, inWorld, View } from '#world';
import { drawingOf } from './model_marks.js';
import { GROUND_NAME } from './sketched.js';

const NEAR_JOINT = 14;  // pixels within which a joint is meant, twice that with a finger
const NEAR_LINK = 10;
const MOVED = 5;  // pixels from which on a press is a pull
const BOARD_MARGIN = 48;
const GRID = 24;  // pixels between lines of the grid, at least
const CLOSEST_ZOOM = 200;
const TURN_STEP = Math.PI / 12;  // of a direction that is snapped

export class Board {
  /** @param {HTMLCanvasElement} canvas @param {any} editing @param {any} tables shapes, looks, hues */
  constructor(canvas, editing, tables) {
    this.canvas = canvas;
    this.editing = editing;
    this.tables = tables;
    this.index = 0;  // of the time that is shown
    this.first = null;  // the end from which a tool goes on: { joint, place }
    this.held = this.hovered = null;  // names of joints
    /** @type {number[] | null} */
    this.cursor = null;  // where the pointer is, or the cross that stands for it
    this.fingers = new Map();
    this.width = this.height = 1;
    this.ctx = canvas.getContext('2d');
    this.extent = [-1, 1, -0.7, 0.7];
    this.camera = null;
    this.snaps = true;
    this.showsPaths = true;
    this.isShowingCursor = false;
    this.resize();
  }

  resize() {
    const { width, height } = this.canvas.parentElement.getBoundingClientRect(), dense = devicePixelRatio || 1;
    this.width = width;
    this.height = height;
    Object.assign(this.canvas, { width: Math.round(width * dense), height: Math.round(height * dense) });
    this.ctx.setTransform(dense, 0, 0, dense, 0, 0);
    this.palette = paletteNow({ hues: this.tables.hues });
  }

  /* The model is another one: make its marks. */
  renew() {
    const { model, bound, motion, problem } = this.editing;
    this.paths = null;
    if (problem || !bound) {
      this.drawing = null;
      return;
    }
    const states = this.states();
    this.drawing = drawingOf(model, this.tables, 1);
    const [left, right, low, high] = boxOf(this.drawing.marks.filter(mark => mark.kind !== 'rail'), states.map(state => state.q));
    this.drawing = drawingOf(model, this.tables, Math.hypot(right - left, high - low) || 1);
    fitMarks({ data: { drawing: this.drawing }, seen: states });
    this.index = Math.min(this.index, motion ? motion.t.length - 1 : 0);
  }

  /* Positions that were found, some thirty of them. */
  states() {
    const { editing } = this, count = editing.motion?.t.length ?? 1, step = Math.max(1, Math.floor(count / 30));
    return Array.from({ length: Math.ceil(count / step) }, (_, k) => ({ q: editing.stateAt(k * step) }));
  }

  /* Look at all of it. */
  fit() {
    const places = [...this.jointPlaces().values()], pad = 0.25;
    /** @type {any} */
    const box = this.drawing ? boxOf(this.drawing.marks, this.states().map(state => state.q)) : [Infinity, -Infinity, Infinity, -Infinity];
    let [left, right, low, high] = box;
    for (const [x, y] of places) [left, right, low, high] = [Math.min(left, x), Math.max(right, x), Math.min(low, y), Math.max(high, y)];
    const size = Math.max(right - left, high - low, 0) || 2;
    if (left <= right) this.extent = [left - pad * size, right + pad * size, low - pad * size, high + pad * size];
    this.camera = null;
  }

  get view() {
    return new View(/** @type {any} */ (this.extent), this.width, this.height, BOARD_MARGIN, this.camera);
  }

  /* ---- where things are ---- */

  get q() {
    return this.editing.stateAt(this.index);
  }

  frameOf(link) {
    const index = this.editing.model.bodies.findIndex(body => body.name === link);
    return index < 0 ? { index: -1, columns: [] } : { index, columns: [3 * index, 3 * index + 1, 3 * index + 2] };
  }

  /** Places of joints in the world. @returns {Map<string, number[]>} */
  jointPlaces() {
    const { model, problem } = this.editing, found = new Map();
    if (!model) return found;
    for (const [name, place] of model.joints) {
      const link = problem ? null : [...model.links.values()].find(item => item.places.has(name));
      found.set(name, link ? inWorld(this.q, this.frameOf(link.name), link.places.get(name)) : place);
    }
    return found;
  }

  /** The joint that is meant at a place, or where it snaps to. @param {number[]} place */
  jointAt(place, reach = NEAR_JOINT) {
    return this.nearestJoint(place, reach) ?? this.nearestJoint(this.snapped(place), 1);
  }

  nearestJoint(place, reach) {
    let best = null, least = reach / this.view.scale;
    for (const [name, [x, y]] of this.jointPlaces()) {
      const away = Math.hypot(x - place[0], y - place[1]);
      if (away <= least) [best, least] = [name, away];
    }
    return best;
  }

  /* The moving link whose line is nearest. */
  /** @param {any} place */
  linkAt(place, reach = NEAR_LINK) {
    const places = this.jointPlaces();
    let best = null, least = reach / this.view.scale;
    for (const link of this.editing.model.links.values()) {
      const own = [...link.places.keys()].map(joint => places.get(joint));
      if (link.name === GROUND_NAME) continue;
      own.forEach((from, k) => {
        for (const to of own.slice(k + 1)) {
          const away = fromSegment(place, from, to);
          if (away < least) [best, least] = [link.name, away];
        }
      });
      if (own.length === 1 && Math.hypot(own[0][0] - place[0], own[0][1] - place[1]) < 2 * least && !best) best = link.name;
    }
    return best;
  }

  get step() {
    const wanted = GRID / this.view.scale, power = 10 ** Math.floor(Math.log10(wanted));
    return [1, 2, 5, 10].find(k => k * power >= wanted) * power;
  }

  /** A place, or that of the grid nearest to it. @returns {any} */
  snapped(place) {
    return this.snaps ? place.map(x => Number((Math.round(x / this.step) * this.step).toPrecision(12))) : place;
  }

  /* A direction, of length one; snapped to parts of a turn. */
  direction(from, to) {
    const [x, y] = towards(from, to), angle = Math.atan2(y, x), near = this.snaps ? Math.round(angle / TURN_STEP) * TURN_STEP : angle;
    return [Math.cos(near), Math.sin(near)].map(part => Number(part.toFixed(12)) + 0);
  }

  zoom(factor, place = this.view.toWorld([this.width / 2, this.height / 2])) {
    const zoom = Math.min(Math.max((this.camera?.zoom ?? 1) * factor, 1 / CLOSEST_ZOOM), CLOSEST_ZOOM), before = this.view.toScreen(place);
    const centre = this.camera?.centre ?? this.view.toWorld([this.width / 2, this.height / 2]);
    this.camera = { zoom, centre };
    const after = this.view.toScreen(place);
    this.pan(before[0] - after[0], before[1] - after[1]);
  }

  pan(right, down) {
    const { zoom, centre } = this.camera ?? { zoom: 1, centre: this.view.toWorld([this.width / 2, this.height / 2]) };
    this.camera = { zoom, centre: [centre[0] - right / this.view.scale, centre[1] + down / this.view.scale] };
  }

  /* ---- what is drawn ---- */

  draw() {
    const { ctx, view, palette, drawing, q } = this;
    ctx.fillStyle = palette.paper;
    ctx.fillRect(0, 0, this.width, this.height);
    this.drawGrid(view);
    if (drawing) {
      if (this.showsPaths) this.drawPaths(view);
      drawShapes(ctx, q, { view, palette, largest: 9, drawing });
    }
    const pen = new Pen(ctx, q, { view, palette, looks: {} }, 1 / view.scale);
    for (const [name, place] of this.jointPlaces()) this.drawJoint(pen, name, view.toScreen(place));
    if (this.first) this.drawBand(pen, view);
    if (this.isShowingCursor && this.cursor) this.drawCursor(pen, view.toScreen(this.cursor));
  }

  drawGrid(view) {
    const { step, palette } = this, [left, low] = view.toWorld([0, this.height]), [right, high] = view.toWorld([this.width, 0]);
    const pen = new Pen(this.ctx, null, { view, palette, looks: {} }, 1);
    const rule = (k, line) => {
      pen.path(line);
      pen.stroke(k === 0 ? palette.quiet : palette.line, k % 5 ? 0.5 : 1);
    };
    for (let k = Math.ceil(left / step); k * step <= right; k++) rule(k, [[k * step, low], [k * step, high]].map(place => view.toScreen(place)));
    for (let k = Math.ceil(low / step); k * step <= high; k++) rule(k, [[left, k * step], [right, k * step]].map(place => view.toScreen(place)));
  }

  drawJoint(pen, name, at) {
    const { ctx, palette } = this, isMarked = [this.first?.joint, this.held, this.hovered].includes(name);
    pen.circle(at, isMarked ? 8 : 3);
    if (isMarked) pen.stroke(palette.drive, 2.5);
    else if (!this.drawing || !this.isPinned(name)) {
      pen.fill(palette.paper);
      pen.stroke(palette.ink, 1.5);
    }
    Object.assign(ctx, { font: '600 13px system-ui, sans-serif', textAlign: 'left', textBaseline: 'bottom', lineWidth: 3, strokeStyle: palette.paper, fillStyle: palette.ink });
    ctx.strokeText(name, at[0] + 8, at[1] - 6);
    ctx.fillText(name, at[0] + 8, at[1] - 6);
  }

  /* Whether two links or more have a joint: then it has a mark. */
  isPinned(name) {
    return [...this.editing.model.links.values()].filter(link => link.places.has(name)).length > 1;
  }

  drawBand(pen, view) {
    /** @type {any} */
    const from = this.first.joint ? this.jointPlaces().get(this.first.joint) : this.first.place;
    if (!from || !this.cursor) return;
    pen.path([from, this.cursor].map(place => view.toScreen(place)));
    pen.stroke(this.palette.drive, 2, [6, 5]);
  }

  /** @param {any} pen @param {any} place */
  drawCursor(pen, [x, y]) {
    pen.path([[x - 12, y], [x - 3, y], null, [x + 3, y], [x + 12, y], null, [x, y - 12], [x, y - 3], null, [x, y + 3], [x, y + 12]]);
    pen.stroke(this.palette.drive, 2);
  }

  /* Paths of the points: coupler curves. */
  drawPaths(view) {
    this.paths ??= this.pathsNow();
    const pen = new Pen(this.ctx, null, { view, palette: this.palette, looks: {} }, 1), { bodies } = this.palette;
    this.paths.forEach((path, k) => {
      pen.path(path.map(place => place && view.toScreen(place)));
      pen.stroke(bodies[(k + 4) % bodies.length][0], 2);
    });
  }

  pathsNow() {
    const { model, motion, bound } = this.editing, links = [...model.links.values()];
    if (!motion) return [];
    const alone = [...model.joints.keys()].filter(joint => !model.points.some(point => point.name === joint)).map(joint => [joint, links.filter(link => link.places.has(joint))])
      .filter(([, holders]) => holders.length === 1 && holders[0].name !== GROUND_NAME)
      .map(([joint, [link]]) => ({ frame: this.frameOf(link.name), place: link.places.get(joint) }));
    const named = model.points.filter(({ body }) => body >= 0).map(({ body, place }) => ({ frame: this.frameOf(model.bodies[body].name), place }));
    const n = bound.N_COORDINATES;
    return [...named, ...alone].map(({ frame, place }) => Array.from(motion.t, (_, k) => {
      const q = motion.q.subarray(k * n, (k + 1) * n);
      return Number.isFinite(q[0]) ? inWorld(q, frame, place) : null;
    }));
  }
}

/* How far a place is from a line between two. */
/** @param {any} place @param {any} from @param {any} to */
function fromSegment([x, y], [a, b], [c, d]) {
  const [u, v] = [c - a, d - b], square = u * u + v * v;
  const part = square ? Math.min(1, Math.max(0, ((x - a) * u + (y - b) * v) / square)) : 0;
  return Math.hypot(x - a - part * u, y - b - part * v);
}

/** What the board does with pointers and keys: `act` takes presses in the world.
 * @param {Board} board
 * @param {{ press: Function, pull: Function, release: Function, hover: Function, changed: Function }} act */
export function connectPointers(board, act) {
  const { canvas, fingers } = board;
  const at = event => {
    const box = canvas.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  };
  let start = null, isPull = false;
  canvas.addEventListener('pointerdown', event => {
    canvas.focus({ preventScroll: true });
    fingers.set(event.pointerId, at(event));
    canvas.setPointerCapture(event.pointerId);
    if (fingers.size > 1) {
      if (start && !isPull) act.release(null);
      start = null;
      return;
    }
    board.isShowingCursor = false;
    [start, isPull] = [at(event), false];
    act.press(board.view.toWorld(start), event.pointerType === 'mouse' ? NEAR_JOINT : 2 * NEAR_JOINT);
  });
  canvas.addEventListener('pointermove', event => {
    const now = at(event), before = fingers.get(event.pointerId);
    if (fingers.size === 2 && before) pinch(board, [...fingers.values()], [...fingers.entries()].map(([id, place]) => (id === event.pointerId ? now : place)));
    if (before) fingers.set(event.pointerId, now);
    if (fingers.size > 1) return act.changed();
    if (start && !isPull && Math.hypot(now[0] - start[0], now[1] - start[1]) < MOVED) return undefined;
    if (start) isPull = true;
    return start ? act.pull(board.view.toWorld(now), [now[0] - before[0], now[1] - before[1]]) : act.hover(board.view.toWorld(now));
  });
  const up = event => {
    fingers.delete(event.pointerId);
    if (!start) return;
    const place = board.view.toWorld(at(event));
    start = null;
    act.release(event.type === 'pointercancel' ? null : place, isPull);
  };
  canvas.addEventListener('pointerup', up);
  canvas.addEventListener('pointercancel', up);
  canvas.addEventListener('wheel', event => {
    event.preventDefault();
    board.zoom(Math.exp(-event.deltaY / 400), board.view.toWorld(at(event)));
    act.changed();
  }, { passive: false });
}

/* Two fingers: what was between them stays there. */
/** @param {Board} board @param {any} from @param {any} to */
function pinch(board, [a, b], [c, d]) {
  const middle = (one, other) => [(one[0] + other[0]) / 2, (one[1] + other[1]) / 2], before = middle(a, b), after = middle(c, d);
  board.pan(after[0] - before[0], after[1] - before[1]);
  board.zoom(Math.hypot(d[0] - c[0], d[1] - c[1]) / (Math.hypot(b[0] - a[0], b[1] - a[1]) || 1), board.view.toWorld(after));
}
