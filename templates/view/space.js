/* Space: where points are in the world and on the screen, from where the mechanism is seen, and the
   solids that stand for bodies and joints.

   What a shape consists of is in the data (kincompile/view/solid_shapes.py); kincompile/view/solids.py
   evaluates the same table for figures. */

import { player } from './player.js';
import { multiples, stepText, units } from './units.js';
import { arrow, blended, DASHES, distanceBetween, hullOf, isGround, MOST_PIECES, ownerOf, SAME_POINT, towards } from './draw.js';
import { middleOf, stage } from './stage.js';
import { tipLine, tipTitle } from './tip.js';

export const isSpatial = true;
export const AXES = ['x', 'y', 'z'];
const LIGHT = [-0.42, 0.55, 0.72];  // to the right, up, and towards the viewer
const SHADES = 16;
const PIECE = 8;  // sizes, the longest part of a solid: what is nearer is drawn later
const MARKS = 3;  // sizes that a mark reaches beyond its place
const FLAT = 1e-6;  // part of a body's size up to which points are in a plane or on a line
const EYE = 4.5;  // how far the eye is, in half diagonals of the extent
const STANDARD = {  // azimuth of the viewer, and how high it stands
  front: [-Math.PI / 2, 0], side: [0, 0], top: [-Math.PI / 2, Math.PI / 2],
  isometric: [-Math.PI / 4, Math.atan(Math.SQRT1_2)],
};
const TURNS = Math.PI / 600;  // by which the drawing turns for a pixel

/* ---- vectors ---- */

const plus = (a, b, by = 1) => [a[0] + by * b[0], a[1] + by * b[1], a[2] + by * b[2]];
const minus = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
const product = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const unitOf = a => a.map(x => x / (Math.hypot(...a) || 1));

/* ---- frames: x, y, z and Euler parameters, of any length ---- */

/* A v, or with the sign -1 its inverse. */
function turned([e0, ...e], v, sign = 1) {
  const across = cross(e, v), square = e0 * e0 + product(e, e);
  return plus(plus(v, across, 2 * sign * e0 / square), cross(e, across), 2 / square);
}

function parametersOf(q, { columns }) {
  return columns.slice(3).map(column => q[column]);
}

function originOf(q, { columns: [x, y, z] }) {
  return [q[x], q[y], q[z]];
}

/** Where a point of a frame is.
 * @param {any} q @param {any} frame @param {number[]} point */
export function inWorld(q, frame, [xi, eta, zeta = 0]) {
  if (isGround(frame)) return [xi, eta, zeta];
  return plus(originOf(q, frame), turned(parametersOf(q, frame), [xi, eta, zeta]));
}

/* Components of a point of the world in a frame. */
export function inFrame(q, frame, place) {
  return isGround(frame) ? place : turned(parametersOf(q, frame), minus(place, originOf(q, frame)), -1);
}

/* The global components of a direction of a frame. */
function directionOf(q, frame, v) {
  return isGround(frame) ? v : turned(parametersOf(q, frame), v);
}

/* Twice E w, of p_dot the angular velocity, of p_ddot the angular acceleration. */
function turningOf([e0, ...e], [w0, ...w]) {
  return plus(plus(w.map(x => e0 * x), e, -w0), cross(e, w)).map(x => 2 * x);
}

/* Velocity and acceleration of a point of a frame. */
export function ratesInWorld(state, frame, point) {
  if (isGround(frame)) return { velocity: [0, 0, 0], acceleration: [0, 0, 0] };
  const p = parametersOf(state.q, frame), arm = turned(p, [point[0], point[1], point[2] ?? 0]);
  const omega = turningOf(p, parametersOf(state.q_dot, frame)), alpha = turningOf(p, parametersOf(state.q_ddot, frame));
  return {
    velocity: plus(originOf(state.q_dot, frame), cross(omega, arm)),
    acceleration: plus(plus(originOf(state.q_ddot, frame), cross(alpha, arm)), cross(omega, cross(omega, arm))),
  };
}

/* ---- what is looked at ---- */

export const orbit = {
  azimuth: STANDARD.isometric[0],
  height: STANDARD.isometric[1],
  fitted: STANDARD.isometric,  // the direction for which all of it fits: turning does not change sizes
  isPerspective: false,
  reach: null,  // how far the motion goes from the middle of its extent, as fitted: to the side, and up
  first: null,  // { marks, states, size } of the motion that the page was made with: it stays in view
  spans: null,  // of that motion, as fitted

  /* Turn the drawing as it is dragged, in pixels. */
  pan(right, down) {
    this.azimuth -= right * TURNS;
    this.height = Math.max(-Math.PI / 2, Math.min(Math.PI / 2, this.height + down * TURNS));
    player.refresh();
  },

  /* One of the standard views, all of it seen. */
  look(name) {
    [this.azimuth, this.height] = this.fitted = STANDARD[name];
    this.spans = null;
    this.forget();
    stage.fit();
  },

  forget() {
    this.reach = null;
  },

  /* Find how far this motion and the first one go from the middle of the extent. */
  measured() {
    const { drawing: { marks, size }, extent } = player.data, axes = axesSeenFrom(this.fitted).slice(0, 2);
    const own = { marks, states: player.seen, size };
    this.first ??= { ...own, marks: structuredClone(marks) };
    this.spans ??= spansOf(this.first, axes);
    const spans = spansOf(own, axes), middle = middleOfExtent(extent);
    return axes.map((axis, k) => {
      const at = product(axis, middle), ends = [...this.spans[k], ...spans[k].filter(Number.isFinite)];
      return Math.max(...ends.map(end => Math.abs(end - at)));
    });
  },

  /* What has to be seen of an extent: of the motion's own, what is there, of another one all of it. */
  reachOf(extent) {
    if (extent.every((x, k) => x === player.data.extent[k])) return this.reach ??= this.measured();
    const half = minus(extent.filter((_, k) => k % 2), middleOfExtent(extent));
    return axesSeenFrom(this.fitted).slice(0, 2).map(axis => product(axis.map(Math.abs), half));
  },

  keys: {
    1: () => orbit.look('front'),
    2: () => orbit.look('side'),
    3: () => orbit.look('top'),
    4: () => orbit.look('isometric'),
    p: () => document.getElementById('perspective').click(),
  },

  build() {
    const bar = document.createElement('div');
    Object.assign(bar, { id: 'views', className: 'buttons', role: 'group', ariaLabel: 'Views' });
    const button = (id, text, title, act) => {
      const made = document.createElement('button');
      Object.assign(made, { type: 'button', id, textContent: text, title });
      made.addEventListener('click', () => act(made));
      bar.append(made);
      return made;
    };
    Object.keys(STANDARD).forEach((name, k) =>
      button(name, name[0].toUpperCase() + name.slice(1), `Seen from the ${name} (${k + 1})`, () => this.look(name)));
    const made = button('perspective', 'Perspective', 'Perspective or parallel (P)', () => {
      this.isPerspective = !this.isPerspective;
      made.ariaPressed = String(this.isPerspective);
      player.refresh();
    });
    made.ariaPressed = 'false';
    document.getElementById('tools').before(bar);
    stage.canvas.addEventListener('contextmenu', event => event.preventDefault());
    for (const id of ['poles', 'centrodes']) document.getElementById(id).closest('label').hidden = true;
    const pointing = document.getElementById('pointing'), moves = 'moves the drawing';
    const said = [...pointing.childNodes].find(node => node.nodeValue?.includes(moves));
    said.nodeValue = said.nodeValue.replace(moves, 'turns the drawing, with Shift or the right button it moves');
    pointing.append(' 1 front, 2 side, 3 top, 4 isometric, P perspective.');
  },
};

/* World to screen: at the centre lengths across the view are true, and the whole extent fits, unless a
   camera { zoom, centre } says what is looked at. */
export class View {
  constructor(extent, width, height, margin, camera = null) {
    const [wide, tall] = orbit.reachOf(extent), middle = middleOfExtent(extent);
    this.fit = Math.min((width / 2 - margin) / wide, (height / 2 - margin) / tall);
    this.scale = this.fit * (camera ? camera.zoom : 1);
    this.centre = camera ? camera.centre : middle;
    const [right, up, back] = axesSeenFrom([orbit.azimuth, orbit.height]);
    this.right = right;
    this.up = up;
    this.back = back;
    this.eye = orbit.isPerspective ? EYE * distanceBetween(middle, extent.filter((_, k) => k % 2)) : Infinity;
    this.left = width / 2;
    this.top = height / 2;
  }

  /** The place on the screen, and how near it is.
   * @param {number[]} place */
  toScreen([x, y, z = 0]) {
    const way = minus([x, y, z], this.centre), depth = product(way, this.back), by = this.scale * this.nearness(depth);
    return [this.left + by * product(way, this.right), this.top - by * product(way, this.up), depth];
  }

  /* How much larger than at the centre something is seen; what is behind the eye is far away. */
  nearness(depth) {
    return this.eye === Infinity ? 1 : this.eye / Math.max(this.eye - depth, 0.02 * this.eye);
  }

  /** The place as near as another one.
   * @param {number[]} place */
  toWorld([x, y], depth = 0) {
    const by = this.scale * this.nearness(depth);
    return plus(plus(this.centre, this.way((x - this.left) / by, (this.top - y) / by)), this.back, depth);
  }

  /* A way to the right and up on the screen. */
  way(right, up) {
    return this.right.map((x, k) => right * x + up * this.up[k]);
  }

  /* How far apart two places are seen. */
  apart(from, to) {
    return towards(this.toScreen(from), this.toScreen(to))[2] / this.scale;
  }

  /* Whether a place of a plane is seen from the side to which its normal points. */
  isFacing(place, normal) {
    const way = this.eye === Infinity ? this.back : minus(plus(this.centre, this.back, this.eye), place);
    return product(normal, way) > 0;
  }
}

function middleOfExtent(extent) {
  return [0, 2, 4].map(k => (extent[k] + extent[k + 1]) / 2);
}

/* To the right, up and towards the viewer. */
/** @param {number[]} direction */
function axesSeenFrom([azimuth, height]) {
  const [c, s, a, b] = [Math.cos(azimuth), Math.sin(azimuth), Math.cos(height), Math.sin(height)];
  return [[-s, c, 0], [-b * c, -b * s, a], [a * c, a * s, b]];
}

/* From where to where marks go along axes, in all states, and MARKS sizes beyond. */
function spansOf({ marks, states, size }, axes) {
  const spans = axes.map(() => [Infinity, -Infinity]), beyond = MARKS * size;
  for (const [frame, point] of marks.flatMap(reachOf)) {
    for (const { q } of isGround(frame) ? states.slice(0, 1) : states) {
      const place = inWorld(q, frame, point);
      axes.forEach((axis, k) => {
        const at = product(axis, place), [low, high] = spans[k];
        spans[k] = [Math.min(low, at - beyond), Math.max(high, at + beyond)];
      });
    }
  }
  return spans;
}

/* Width by height of what is seen of an extent. */
export function proportions(extent) {
  return 1.5;
}

/* ---- solids ---- */

/* A solid as flat pieces { points, normal, isRim }, in the world: corners turned about a line. */
function turnedSolid(corners, { start, axis, aside, length }, size, sides) {
  const third = cross(axis, aside), found = [];
  const first = sides === 4 ? Math.PI / 4 : 0;
  const circle = Array.from({ length: sides }, (_, k) => {
    const angle = first + 2 * Math.PI * k / sides, c = Math.cos(angle), s = Math.sin(angle);
    return aside.map((x, i) => c * x + s * third[i]);
  });
  const places = corners.map(([part, ahead, out]) => [part * length + ahead * size, out * size]);
  for (let k = 0; k + 1 < places.length; k++) {
    const [[far0, out0], [far1, out1]] = [places[k], places[k + 1]];
    const ring = (far, out) => circle.map(to => plus(plus(start, axis, far), to, out));
    if (far0 === far1) {  // an end: one polygon
      const isEnd = out0 > out1, points = ring(far0, Math.max(out0, out1));
      found.push({ points: isEnd ? points : points.reverse(), normal: isEnd ? axis : axis.map(x => -x), isRim: true });
      continue;
    }
    const count = out0 === out1 ? Math.max(1, Math.min(Math.ceil((far1 - far0) / (PIECE * size)), MOST_PIECES)) : 1;
    for (let i = 0; i < count; i++) {
      const at = part => ring(far0 + part * (far1 - far0), out0 + part * (out1 - out0));
      const [low, high] = [at(i / count), at((i + 1) / count)], slope = (out0 - out1) / (far1 - far0);
      for (let j = 0; j < sides; j++) {
        const n = (j + 1) % sides;
        const normal = unitOf(plus(plus(circle[j], circle[n]).map(x => x / 2), axis, slope));
        found.push({ points: [low[j], low[n], high[n], high[j]], normal, isRim: false });
      }
    }
  }
  return found;
}

/* The lines of a piece, each { start, axis, aside, length }. */
function linesOf(q, mark, on) {
  const at = place => inWorld(q, place.frame, place.point);
  const between = (start, end, most = Infinity) => {
    const way = minus(end, start), length = Math.hypot(...way), axis = length ? way.map(x => x / length) : [0, 0, 1];
    return { start, axis, aside: besideOf(axis), length: Math.min(length, most) };
  };
  if (on === 'edges') {
    return wiresOf(mark.points).edges.map(ends => between(...ends.map(point => inWorld(q, mark.frame, point))));
  }
  if (mark.kind === 'span') {
    const line = between(at(mark.first), at(mark.second), on === 'barrel' ? mark.barrel : Infinity);
    const inside = on === 'stem' ? Math.min(mark.barrel, line.length) : 0;
    return [{ ...line, start: plus(line.start, line.axis, inside), length: line.length - inside }];
  }
  if (mark.kind === 'drive') return [{ start: at(mark.place), axis: mark.axis, aside: besideOf(mark.axis), length: 0 }];
  const { place: { frame, point }, reach } = mark;
  const [axis, aside] = [mark.axis, mark.cross].map(v => directionOf(q, frame, v));
  const start = inWorld(q, frame, on === 'reach' ? plus(point, mark.axis, reach[0]) : point);
  return [{ start, axis, aside, length: on === 'reach' ? reach[1] - reach[0] : 0 }];
}

/* A direction at a right angle: to the coordinate axis that is farthest from it. */
function besideOf(axis) {
  const sizes = axis.map(Math.abs), nearest = sizes.indexOf(Math.min(...sizes));
  return unitOf(cross(axis, [0, 1, 2].map(k => Number(k === nearest))));
}

/* The parts of a mark: flat pieces, balls { centre, radius } and lines { line }. */
export function partsOf(q, mark, piece, size) {
  const { on, corners, every, sides } = piece;
  if (on === 'points') {
    return wiresOf(mark.points).faces.map(({ points, normal }) => ({
      points: points.map(point => inWorld(q, mark.frame, point)), normal: directionOf(q, mark.frame, normal), isRim: true,
    }));
  }
  if (!corners.length) return [{ centre: inWorld(q, mark.place.frame, mark.place.point), radius: piece.grow * size }];
  return linesOf(q, mark, on).flatMap(line => {
    if (!sides) return [flatPart(line, piece, size)];
    if (!every) return turnedSolid(corners, line, size, sides);
    const found = [], last = Math.min(line.length / size, MOST_PIECES * every);
    for (let foot = every / 2; foot < last; foot += every) {
      found.push(...turnedSolid(corners.map(([part, ahead, out]) => [part, ahead + foot, out]), line, size, sides));
    }
    return found;
  });
}

/* A line, or a flat area seen from both sides: beside an axis, or across it. */
function flatPart({ start, axis, aside, length }, { on, corners, is_area }, size) {
  const [along, left] = on === 'turn' ? [aside, cross(axis, aside)] : [axis, aside];
  const points = corners.map(([part, ahead, out]) =>
    plus(plus(start, along, part * length + ahead * size), left, out * size));
  return is_area ? { points, normal: cross(along, left), isFlat: true, isRim: true } : { line: points };
}

/* ---- the hull of the points of a body: faces and edges ---- */

const wires = new WeakMap();

function wiresOf(points) {
  if (!wires.has(points)) wires.set(points, wiresAround(points));
  return wires.get(points);
}

/* Flat faces, each counterclockwise seen from outside, and their edges; of points on a line its ends,
   of points in a plane both sides of it. Points nearer to each other, to a line or to a plane than FLAT
   of their size are one, on it: as in kincompile/view/solids.py. */
export function wiresAround(points) {
  const near = FLAT * Math.max(...points.map(point => distanceBetween(point, points[0])));
  const own = [...points.keys()].filter(k => !points.slice(0, k).some(other => distanceBetween(other, points[k]) <= near));
  const corners = spanningOf(points, own, near), [a, b, c] = corners;
  if (corners.length < 3) return { faces: [], edges: points.length > 1 ? [endsOf(points)] : [] };
  if (corners.length === 3) {
    const { normal } = triangleOf(points, [a, b, c]);
    return facesAndEdges(points, [1, -1].map(sign => ({ on: own, normal: normal.map(x => sign * x) })));
  }
  const faces = [], triangles = trianglesAround(points, own, corners, near);
  for (const triangle of triangles.sort((one, other) => other.area - one.area)) {
    const isPart = ({ on, normal }) => product(normal, triangle.normal) > 0 && triangle.corners.every(k => on.includes(k));
    if (faces.some(isPart)) continue;
    faces.push({ on: own.filter(k => Math.abs(beyond(points, triangle, k)) <= near), normal: triangle.normal });
  }
  const isBefore = (one, other) => {
    const at = one.findIndex((k, place) => k !== other[place]);
    return at < 0 ? one.length - other.length : one[at] - (other[at] ?? -1);
  };
  return facesAndEdges(points, faces.sort((one, other) => isBefore(one.on, other.on)));
}

/* Up to four points, by number, each the farthest from what those before it span. */
function spanningOf(points, own, near) {
  const found = [own[0]], axes = [];
  while (found.length < 4) {
    const ways = own.map(k => axes.reduce((way, axis) => plus(way, axis, -product(way, axis)), minus(points[k], points[own[0]])));
    const far = ways.map(way => Math.hypot(...way)), most = Math.max(...far), at = far.indexOf(most);
    if (!(most > near)) break;
    found.push(own[at]);
    axes.push(unitOf(ways[at]));
  }
  return found;
}

function triangleOf(points, corners) {
  const [a, b, c] = corners.map(k => points[k]), across = cross(minus(b, a), minus(c, a));
  return { corners, normal: unitOf(across), area: Math.hypot(...across) };
}

/* How far a point is outside the plane of a triangle. */
function beyond(points, { corners: [a], normal }, k) {
  return product(minus(points[k], points[a]), normal);
}

/* The triangles of a hull, counterclockwise seen from outside: from four points on, the triangles that a
   point sees give way to those between it and the edge of what it sees. */
function trianglesAround(points, own, corners, near) {
  const [a, b, c, d] = corners;
  const isBelow = beyond(points, triangleOf(points, [a, b, c]), d) < 0, [p, q, r] = isBelow ? [a, b, c] : [a, c, b];
  let found = [[p, q, r], [q, p, d], [r, q, d], [p, r, d]].map(three => triangleOf(points, three));
  for (const k of own) {
    const seen = found.filter(triangle => beyond(points, triangle, k) > near);
    const sides = new Map(seen.flatMap(({ corners: [i, j, l] }) => [[i, j], [j, l], [l, i]].map(side => [`${side}`, side])));
    const edge = [...sides.values()].filter(([i, j]) => !sides.has(`${j},${i}`));
    found = [...found.filter(triangle => !seen.includes(triangle)), ...edge.map(([i, j]) => triangleOf(points, [i, j, k]))];
  }
  return found;
}

function facesAndEdges(points, faces) {
  const edges = new Map();
  const found = faces.map(({ on, normal }) => {
    const right = besideOf(normal), up = cross(normal, right);
    const flat = on.map(k => Object.assign([product(points[k], right), product(points[k], up)], { index: k }));
    const loop = hullOf(flat).map(({ index }) => index);
    loop.forEach((from, k) => {
      const ends = [from, loop[(k + 1) % loop.length]].sort((a, b) => a - b);
      edges.set(`${ends}`, ends.map(end => points[end]));
    });
    return { points: loop.map(k => points[k]), normal };
  });
  return { faces: found, edges: [...edges.values()] };
}

/* The ends of points on a line. */
function endsOf(points) {
  const far = from => points.reduce((best, point) =>
    (distanceBetween(from, point) > distanceBetween(from, best) ? point : best), from);
  const end = far(points[0]);
  return [far(end), end];
}

/* Hulls of bodies for other numbers: the points that differ. */
export function hullFor(attached) {
  const isNear = (a, b) =>
    Math.max(...a.map((x, k) => Math.abs(x - b[k]))) <= SAME_POINT * (1 + Math.max(...b.map(Math.abs)));
  return attached.filter((point, k) => !attached.slice(0, k).some(other => isNear(other, point)));
}

/* ---- drawing ---- */

/* All parts, from back to front. */
export function drawMarks(pen, { marks, shapes }) {
  const { view } = pen, size = sizeOf(pen), parts = [];
  for (const mark of marks) {
    for (const piece of shapes[mark.shape]) {
      const inks = pen.inks(mark, piece);
      for (const part of partsOf(pen.q, mark, piece, size)) {
        if (part.normal && !part.isFlat && !view.isFacing(part.points[0], part.normal)) continue;
        parts.push(placed(view, part, piece, inks));
      }
    }
  }
  parts.sort((a, b) => a.depth - b.depth);
  for (const part of parts) drawPart(pen, part);
}

/* Sizes of solids are true ones: they grow when the drawing is looked at more closely. */
function sizeOf(pen) {
  return pen.unit / pen.view.fit;
}

/* A part on the screen, with the depth of its middle. */
function placed(view, part, piece, inks) {
  const points = (part.points ?? part.line ?? [part.centre]).map(point => view.toScreen(point));
  const depth = points.reduce((sum, point) => sum + point[2], 0) / points.length;
  // A ball is seen up to its front; lines lie on what they measure.
  const before = part.radius ?? 0;
  return { ...part, screen: points, depth: depth + before, piece, inks };
}

function drawPart(pen, { screen, centre, radius, line, normal, isFlat, isRim, depth, piece, inks }) {
  const look = pen.style.looks[piece.look], width = pen.width(look.width);
  if (line) {
    if (piece.look === 'gap' && towards(screen[0], screen[1])[2] < 2) return;
    pen.path(screen);
    pen.stroke(inks.line, width, DASHES[look.dash]);
  } else if (centre) {
    pen.circle(screen[0], radius * pen.view.scale * pen.view.nearness(depth - radius));
    pen.fill(inks.face);
    pen.stroke(inks.line, width);
  } else {
    pen.path(screen, true);
    const { ctx } = pen, alpha = ctx.globalAlpha;
    const isPlate = piece.look === 'plate', shade = isFlat ? inks.face : shadeOf(pen, inks, normal);
    ctx.globalAlpha = alpha * (isPlate ? 0.55 : 1);
    pen.fill(shade);
    ctx.globalAlpha = alpha;
    // The seams of a round solid have its colour.
    pen.stroke(isRim ? inks.line : shade, isRim ? 0.6 * width : 0.8);
  }
}

const shades = new Map();

/* The colour of a piece in the light: on light paper paler, on dark paper stronger. */
function shadeOf({ view, palette }, { line, face }, normal) {
  const seen = [product(normal, view.right), product(normal, view.up), product(normal, view.back)];
  const lit = Math.round(SHADES * Math.max(0, product(seen, LIGHT))) / SHADES;
  const part = palette.isDark ? 0.3 + 0.6 * lit : 0.85 - 0.6 * lit, key = `${line} ${face} ${lit} ${palette.isDark}`;
  if (!shades.has(key)) shades.set(key, blended(line, palette.paper, part));
  return shades.get(key);
}

/* What is seen of a body, as closed outlines on the screen: one of each mark. */
export function areasOf(pen, frame) {
  const { marks, shapes } = player.data.drawing, size = sizeOf(pen);
  const isOwn = (mark, piece) => piece.is_area && piece.on !== 'turn' && ownerOf(mark, piece.on).index === frame.index;
  return marks.filter(mark => !['drive', 'dot'].includes(mark.kind)).flatMap(mark => {
    const points = shapes[mark.shape].filter(piece => isOwn(mark, piece))
      .flatMap(piece => partsOf(pen.q, mark, piece, size)).flatMap(part => part.points ?? []);
    return points.length ? [hullOf(points.map(point => pen.view.toScreen(point)))] : [];
  });
}

/* Bodies from back to front. */
export function stacked(frames, q, view) {
  const depth = frame => view.toScreen(inWorld(q, frame, middleOf(frame)))[2];
  return frames.toSorted((a, b) => depth(a) - depth(b));
}

/* The frame that is held at a place, and its point there: as near as the body is. */
export function heldAt(q, frame, place, view) {
  const [, , depth] = view.toScreen(inWorld(q, frame, middleOf(frame)));
  return { frame, point: inFrame(q, frame, view.toWorld(view.toScreen(place), depth)) };
}

/* ---- live numbers ---- */

/* The points of a mark, each with its frame. */
function reachOf(mark) {
  if (mark.kind === 'hull') return mark.points.map(point => [mark.frame, point]);
  if (mark.kind === 'span') return [mark.first, mark.second].map(({ frame, point }) => [frame, point]);
  const { frame, point } = mark.place;
  return (mark.reach ?? [0]).map(far => [frame, far ? plus(point, mark.axis, far) : point]);
}

/* Smallest x, largest x, and so on, of all marks over positions. */
export function boxOf(marks, positions) {
  const found = [Infinity, -Infinity, Infinity, -Infinity, Infinity, -Infinity];
  for (const [frame, point] of marks.flatMap(reachOf)) {
    for (const q of isGround(frame) ? positions.slice(0, 1) : positions) {
      inWorld(q, frame, point).forEach((x, k) => {
        found[2 * k] = Math.min(found[2 * k], x);
        found[2 * k + 1] = Math.max(found[2 * k + 1], x);
      });
    }
  }
  return found[0] <= found[1] ? found : [-1, 1, -1, 1, -1, 1];
}

/* ---- what is shown beside the drawing ---- */

/* The floor, z = 0 where the mechanism is above it or in it, else below it, and the axes of the ground. */
export function drawGrid(pen, step) {
  const { view, palette, ctx } = pen, [left, right, front, behind, low] = player.data.extent;
  const z = Math.min(0, low), xs = [Math.floor(left / step), Math.ceil(right / step)].map(k => k * step);
  const ys = [Math.floor(front / step), Math.ceil(behind / step)].map(k => k * step);
  const rule = (from, to, isAxis) => {
    pen.path([view.toScreen(from), view.toScreen(to)]);
    pen.stroke(isAxis ? palette.quiet : palette.line, isAxis ? 1.5 : 1);
  };
  Object.assign(ctx, { font: stage.font(), fillStyle: palette.quiet, textAlign: 'center', textBaseline: 'middle' });
  for (const x of multiples(step, ...xs)) rule([x, ys[0], z], [x, ys[1], z], Math.abs(x) < step / 2);
  for (const y of multiples(step, ...ys)) rule([xs[0], y, z], [xs[1], y, z], Math.abs(y) < step / 2);
  const write = (value, at) => ctx.fillText(stepText(value, step), ...view.toScreen(at).slice(0, 2));
  for (const x of multiples(step, ...xs)) write(x, [x, ys[0] - 0.35 * step, z]);
  for (const y of multiples(step, ...ys)) write(y, [xs[1] + 0.35 * step, y, z]);
  AXES.forEach((name, k) => {
    const end = [0, 0, 0].map((_, i) => (i === k ? step : 0)), [from, to] = [view.toScreen([0, 0, 0]), view.toScreen(end)];
    arrow(pen, from, to, palette.ink, 1.8);
    ctx.fillText(name, to[0] + 10, to[1] - 8);
  });
}

/* A body: where it is and how it turns. */
export function bodyTip({ name, frame }, state) {
  const unit = player.data.lengthUnit, p = parametersOf(state.q, frame);
  const written = (values, own) => `(${values.map(value => units.text(value, own)).join(', ')})`;
  const lines = [
    tipLine(`r = ${written(originOf(state.q, frame), unit)} ${unit}`), tipLine(`p = ${written(p, '')}`),
  ];
  if (state.isFound && !state.pose) {
    for (const [sign, rates, kind, own] of [['ω', 'q_dot', 'velocity', 'rad/s'], ['α', 'q_ddot', 'acceleration', 'rad/s²']]) {
      const spin = turningOf(p, parametersOf(state[rates], frame)), scale = Math.hypot(...spin);
      const text = spin.map(value => units.text(value, own, scale)).join(', ');
      lines.push(tipLine(`${sign} = (${text}), ${units.full(scale, own, scale)}`, kind));
    }
  }
  return [tipTitle(name), ' body', ...lines];
}

/* ---- the guess of Newton's method ---- */

/* The knob that turns a body, from its origin on the screen: to where its xi axis points. */
export function knobOf(q, frame, view) {
  const [from, to] = [[0, 0, 0], [1, 0, 0]].map(point => view.toScreen(inWorld(q, frame, point)));
  return towards(from, to);
}

/* Move a body across the view and turn it about the direction of the view. */
export function moveBody(q, frame, [right, up], turn, view) {
  const way = view.way(right, up), [e0, ...e] = parametersOf(q, frame);
  const c = Math.cos(turn / 2), axis = view.back.map(x => Math.sin(turn / 2) * x);
  const p = [c * e0 - product(axis, e), ...plus(plus(e.map(x => c * x), axis, e0), cross(axis, e))];
  [...way.map((x, k) => q[frame.columns[k]] + x), ...p].forEach((value, k) => { q[frame.columns[k]] = value; });
}

/* Put a body anywhere in an extent, in any orientation; `between` gives a number between two. */
export function placeAnywhere(q, { columns }, extent, between) {
  const p = unitOf([0, 0, 0, 0].map(() => between(-1, 1) + between(-1, 1) + between(-1, 1)));
  [0, 1, 2].forEach(k => { q[columns[k]] = between(extent[2 * k], extent[2 * k + 1]); });
  p.forEach((value, k) => { q[columns[3 + k]] = value; });
}

/* Coordinates that say most of a motion: places, then all of the bodies. */
export function liveliestOf(frames) {
  return [frames.flatMap(({ columns }) => columns.slice(0, 3)), frames.flatMap(({ columns }) => columns)];
}
