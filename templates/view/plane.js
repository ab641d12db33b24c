/* The plane: where points are in the world and on the screen, and how marks are drawn there. */

import { player } from './player.js';
import { multiples, stepText, units } from './units.js';
import { DASHES, distanceBetween, hullOf, isGround, MOST_PIECES, ownerOf, towards } from './draw.js';
import { stage } from './stage.js';
import { tipLine, tipTitle } from './tip.js';

export const isSpatial = false;
export const AXES = ['x', 'y'];
export const orbit = null;  // of space: what turns the drawing
const TRUE_SIZES = new Set(['wheel', 'ring', 'rack']);  // teeth of gears are as far apart as those of racks

/* The angle of a frame. */
function angleOf(q, { columns: [, , phi] }) {
  return phi === undefined ? 0 : q[phi];
}

/* World to screen: lengths are true, and the whole extent fits, unless a camera { zoom, centre } says
   what is looked at. */
export class View {
  constructor([left, right, low, high], width, height, margin, camera = null) {
    this.fit = Math.min((width - 2 * margin) / (right - left), (height - 2 * margin) / (high - low));
    this.scale = this.fit * (camera ? camera.zoom : 1);
    const [x, y] = camera ? camera.centre : [(left + right) / 2, (low + high) / 2];
    this.left = width / 2 - this.scale * x;
    this.top = height / 2 + this.scale * y;
  }

  /** @param {number[]} place */
  toScreen([x, y]) {
    return [this.left + this.scale * x, this.top - this.scale * y];
  }

  /** @param {number[]} place */
  toWorld([x, y]) {
    return [(x - this.left) / this.scale, (this.top - y) / this.scale];
  }

  /* A way to the right and up on the screen. */
  way(right, up) {
    return [right, up];
  }

  /* How far apart two places are seen. */
  apart(from, to) {
    return distanceBetween(from, to);
  }
}

/* Width by height of what is seen of an extent. */
export function proportions([left, right, low, high]) {
  return (right - left) / (high - low);
}

/** Where a point of a frame is.
 * @param {any} q @param {any} frame @param {number[]} point */
export function inWorld(q, frame, [xi, eta]) {
  if (isGround(frame)) return [xi, eta];
  const [x, y, phi] = frame.columns;
  const c = Math.cos(q[phi]), s = Math.sin(q[phi]);
  return [q[x] + c * xi - s * eta, q[y] + s * xi + c * eta];
}

/* Velocity and acceleration of a point of a frame. */
export function ratesInWorld(state, frame, [xi, eta]) {
  if (isGround(frame)) return { velocity: [0, 0], acceleration: [0, 0] };
  const { q, q_dot, q_ddot } = state, [x, y, phi] = frame.columns;
  const c = Math.cos(q[phi]), s = Math.sin(q[phi]), w = q_dot[phi], a = q_ddot[phi];
  const arm = [c * xi - s * eta, s * xi + c * eta];
  return {
    velocity: [q_dot[x] - w * arm[1], q_dot[y] + w * arm[0]],
    acceleration: [
      q_ddot[x] - a * arm[1] - w * w * arm[0], q_ddot[y] + a * arm[0] - w * w * arm[1],
    ],
  };
}

/* Components of a point of the world in a frame. */
export function inFrame(q, frame, place) {
  const [x, y] = place;
  if (isGround(frame)) return [x, y];
  const [column_x, column_y, phi] = frame.columns, [dx, dy] = [x - q[column_x], y - q[column_y]];
  const c = Math.cos(q[phi]), s = Math.sin(q[phi]);
  return [c * dx + s * dy, c * dy - s * dx];
}

/* ---- the points of a stroke ---- */

export function drawMarks(pen, { marks, shapes }) {
  for (const mark of marks) for (const stroke of shapes[mark.shape]) drawStroke(pen, mark, stroke);
}

/* One stroke of a mark, in the colours of its look. */
function drawStroke(pen, mark, stroke) {
  const look = pen.style.looks[stroke.look], points = pointsOfStroke(pen, mark, stroke);
  if (stroke.look === 'gap' && towards(points[0], points[1])[2] < 2) return;
  pen.path(points, stroke.is_area);
  const { line, face } = pen.inks(mark, stroke);
  if (stroke.is_area) pen.fill(face);
  if (look.width) pen.stroke(line, pen.width(look.width), DASHES[look.dash]);
}

/* The points of a stroke on the screen; null interrupts a line. */
export function pointsOfStroke(pen, mark, stroke) {
  const size = TRUE_SIZES.has(mark.shape) ? pen.size : pen.unit / pen.view.scale;
  if (!stroke.corners.length) return curveOf(pen, mark, stroke, size);
  const axes = axesOf(pen.q, mark, stroke.on);
  if (stroke.on === 'circle') return around(pen, stroke, axes, size);
  const { start, along: [x, y], length } = axes, points = [];
  const placed = (part, ahead, left) => {
    const far = part * length + ahead * size;
    return pen.view.toScreen([start[0] + far * x - left * size * y, start[1] + far * y + left * size * x]);
  };
  const last = stroke.every ? Math.min(Math.max(length / size, stroke.every), MOST_PIECES * stroke.every) : 1;
  for (let foot = stroke.every / 2; foot < last; foot += stroke.every || 1) {
    for (const corner of stroke.corners) {
      points.push(corner && placed(corner[0], corner[1] + foot, corner[2]));
    }
  }
  return points;
}

/* The line a stroke is drawn on: its start, its direction of length one and its length. */
function axesOf(q, mark, on) {
  const at = place => inWorld(q, place.frame, place.point);
  const between = (start, end, most = Infinity) => {
    const [x, y, length] = towards(start, end);
    return { start, along: [x, y], length: Math.min(length, most) };
  };
  if (mark.kind === 'rail') return between(...endsOf(mark).map(point => inWorld(q, mark.frame, point)));
  if (mark.kind === 'span') return between(at(mark.first), at(mark.second), on === 'barrel' ? mark.barrel : Infinity);
  if (on === 'line') return between(at(mark.first), at(mark.second));
  const start = at(on === 'first' || on === 'second' ? mark[on] : mark.place);
  if (mark.kind === 'wheel') {
    const angle = mark.theta + angleOf(q, mark.place.frame);
    return { start, along: [Math.cos(angle), Math.sin(angle)], length: mark.radius };
  }
  if (!mark.axis) return { start, along: [1, 0], length: 0 };
  const turn = mark.guide ? angleOf(q, mark.guide) : 0, [x, y] = mark.axis;
  const c = Math.cos(turn), s = Math.sin(turn);
  return { start, along: [c * x - s * y, s * x + c * y], length: 0 };
}

function endsOf({ base, axis, reach }) {
  return reach.map(far => [base[0] + far * axis[0], base[1] + far * axis[1]]);
}

/* A closed curve, widened: a circle, a polygon, or the hull of a link with round corners. */
function curveOf(pen, mark, { grow, is_area }, size) {
  let points = mark.points;
  if (mark.kind === 'wheel') {
    const [x, y] = mark.place.point, radius = mark.radius + grow * size;
    points = CIRCLE.map(([c, s]) => [x + radius * c, y + radius * s]);
  } else if (mark.kind === 'hull') points = rounded(points, grow * size);
  else if (grow) points = points.map((point, k) => widened(points, k, grow * size));
  const frame = mark.frame ?? mark.place.frame;
  const curve = points.map(point => pen.at(frame, point));
  return is_area ? curve : [...curve, curve[0]];
}

const CIRCLE = Array.from({ length: 180 }, (_, k) => [Math.cos(k * Math.PI / 90), Math.sin(k * Math.PI / 90)]);

/* A corner of a smooth curve, moved outwards. */
function widened(points, k, distance) {
  const count = points.length;
  const [x, y] = towards(points[(k + count - 1) % count], points[(k + 1) % count]);
  return [points[k][0] + distance * y, points[k][1] - distance * x];
}

/* A convex polygon, counterclockwise, at a distance, with arcs around its corners. */
function rounded(points, radius) {
  const count = points.length, found = [];
  const arc = ([x, y], first, turn) => {
    const steps = 1 + Math.floor(turn / (Math.PI / 12));
    for (let k = 0; k <= steps; k++) {
      const angle = first + turn * k / steps;
      found.push([x + radius * Math.cos(angle), y + radius * Math.sin(angle)]);
    }
  };
  points.forEach((corner, k) => {
    const [x0, y0, length] = towards(points[(k + count - 1) % count], corner);
    const [x1, y1] = towards(corner, points[(k + 1) % count]);
    const turn = Math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1);
    arc(corner, Math.atan2(-x0, y0), length ? (turn + 2 * Math.PI) % (2 * Math.PI) : 2 * Math.PI);
  });
  return found;
}

/* Corners repeated around a circle. */
function around(pen, { corners, every }, { start, along, length }, size) {
  const count = Math.max(8, Math.min(Math.round(2 * Math.PI * length / (every * size)), MOST_PIECES)), points = [];
  const first = Math.atan2(along[1], along[0]);
  for (let k = 0; k < count; k++) {
    const c = Math.cos(first + 2 * Math.PI * k / count), s = Math.sin(first + 2 * Math.PI * k / count);
    for (const corner of corners) {
      const [side, out] = corner ? [corner[1] * size, length + corner[2] * size] : [];
      points.push(corner && pen.view.toScreen([start[0] + out * c - side * s, start[1] + out * s + side * c]));
    }
  }
  return points;
}

/* The areas that are drawn of a body. */
export function areasOf(pen, frame) {
  const { marks, shapes } = player.data.drawing;
  const own = (mark, stroke) => stroke.is_area && ownerOf(mark, stroke.on).index === frame.index;
  const isBody = mark => !['pin', 'drive', 'dot'].includes(mark.kind);
  return marks.filter(isBody).flatMap(mark => shapes[mark.shape].filter(stroke => own(mark, stroke))
    .map(stroke => pointsOfStroke(pen, mark, stroke)));
}

/* The frame that is held at a place, and its point there. */
export function heldAt(q, frame, place, view) {
  return { frame, point: inFrame(q, frame, place) };
}

/* Frames from back to front. */
export function stacked(frames, q, view) {
  return frames;
}

/* Hulls of bodies for other numbers. */
export function hullFor(attached) {
  return hullOf(attached.slice());
}

/* The points of a mark, each with the frame it is fixed in and how far the mark reaches beyond it. */
function reachOf(mark) {
  switch (mark.kind) {
    case 'wheel': return [[mark.place.frame, mark.place.point, mark.radius]];
    case 'pin': case 'span': return [mark.first, mark.second].map(({ frame, point }) => [frame, point, 0]);
    case 'slider': case 'drive': case 'dot': return [[mark.place.frame, mark.place.point, 0]];
    case 'rail': return mark.reach.map(s =>
      [mark.frame, [mark.base[0] + s * mark.axis[0], mark.base[1] + s * mark.axis[1]], 0]);
    default: return mark.points.map(point => [mark.frame, point, 0]);
  }
}

/* Smallest x, largest x, smallest y, largest y of all marks over positions. */
export function boxOf(marks, positions) {
  let [left, right, low, high] = [Infinity, -Infinity, Infinity, -Infinity];
  const fixed = new Map();
  for (const [frame, point, radius] of marks.flatMap(reachOf)) {
    if (!fixed.has(frame.index)) fixed.set(frame.index, { columns: frame.columns, circles: [] });
    fixed.get(frame.index).circles.push([point[0], point[1], radius]);
  }
  for (const { columns, circles } of fixed.values()) {
    const isBody = columns.length > 0, [i, j, k] = columns;
    for (const q of isBody ? positions : positions.slice(0, 1)) {
      const [x, y, phi] = isBody ? [q[i], q[j], q[k]] : [0, 0, 0], c = Math.cos(phi), s = Math.sin(phi);
      for (const [xi, eta, radius] of circles) {
        const a = x + c * xi - s * eta, b = y + s * xi + c * eta;
        if (a - radius < left) left = a - radius;
        if (a + radius > right) right = a + radius;
        if (b - radius < low) low = b - radius;
        if (b + radius > high) high = b + radius;
      }
    }
  }
  return left <= right ? [left, right, low, high] : [-1, 1, -1, 1];
}

/* ---- what is shown beside the drawing ---- */

export function drawGrid(pen, step) {
  const { view, palette, ctx } = pen, { width, height } = stage, unit = player.data.lengthUnit;
  const [left, low] = view.toWorld([0, height]), [right, high] = view.toWorld([width, 0]);
  const upright = multiples(step, left, right).map(x => [x, view.toScreen([x, 0])[0]]);
  const level = multiples(step, low, high).map(y => [y, view.toScreen([0, y])[1]]);
  const rule = (isAxis, line) => {
    pen.path(line);
    pen.stroke(isAxis ? palette.quiet : palette.line, isAxis ? 1.5 : 1);
  };
  for (const [x, at] of upright) rule(Math.abs(x) < step / 2, [[at, 0], [at, height]]);
  for (const [y, at] of level) rule(Math.abs(y) < step / 2, [[0, at], [width, at]]);
  Object.assign(ctx, { font: stage.font(), fillStyle: palette.quiet, textAlign: 'center', textBaseline: 'top' });
  for (const [x, at] of upright) if (at > 40 && at < width - 70) ctx.fillText(stepText(x, step), at, 4);
  ctx.textAlign = 'right';
  ctx.fillText(`x [${unit}]`, width - 6, 4);
  Object.assign(ctx, { textAlign: 'left', textBaseline: 'middle' });
  for (const [y, at] of level) if (at > 40 && at < height - 40) ctx.fillText(stepText(y, step), 5, at);
  ctx.textBaseline = 'top';
  ctx.fillText(`y [${unit}]`, 5, 4);
}

/* A body: its angle and how it turns. */
export function bodyTip({ name, frame }, state) {
  const [, , phi] = frame.columns, unit = player.data.coordinates[phi].unit;
  const lines = [tipLine(`φ = ${units.full(state.q[phi], unit)}`)];
  if (state.isFound && !state.pose) {
    lines.push(tipLine(`ω = ${units.full(state.q_dot[phi], `${unit}/s`)}`, 'velocity'));
    lines.push(tipLine(`α = ${units.full(state.q_ddot[phi], `${unit}/s²`)}`, 'acceleration'));
  }
  return [tipTitle(name), ' body', ...lines];
}

/* The knob that turns a body, from its origin on the screen: along its xi axis. */
export function knobOf(q, frame, view) {
  const phi = angleOf(q, frame);
  return [Math.cos(phi), -Math.sin(phi)];
}

/* Move a body and turn it, counterclockwise, on the screen. */
export function moveBody(q, { columns: [x, y, phi] }, [right, up], turn, view) {
  q[x] += right;
  q[y] += up;
  q[phi] += turn;
}

/* Put a body anywhere in an extent, at any angle; `between` gives a number between two. */
export function placeAnywhere(q, { columns: [x, y, phi] }, [left, right, low, high], between) {
  q[x] = between(left, right);
  q[y] = between(low, high);
  q[phi] = between(-Math.PI, Math.PI);
}

/* Coordinates that say most of a motion: angles, then all of the bodies. */
export function liveliestOf(frames) {
  return [frames.map(({ columns: [, , phi] }) => phi), frames.flatMap(frame => frame.columns)];
}
