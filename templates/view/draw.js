'use strict';
/* The marks of a drawing on a canvas.

   drawShapes(ctx, q, style) draws the mechanism at coordinates q, any number of times on one canvas.
   style: { view, palette } and, where wanted, alpha, ghost (one colour for everything), violated (a
   set of joint names that are drawn as broken), drawing (of another mechanism than the player's).

   What a mark looks like is in the data: drawing.shapes has the strokes of each shape, drawing.looks
   what a stroke is drawn like (kincompile/view/shapes.py).  They are evaluated from the numbers of the
   marks whenever they are drawn; fitMarks makes rails and barrels fit a motion. */

const GROUND = { index: -1, columns: [] };  // a frame: a body's index, and its columns of q
const BARREL = 0.85;  // part of a cylinder's shortest length that its barrel has
const TRUE_SIZES = new Set(['wheel', 'ring', 'rack']);  // teeth of gears are as far apart as those of racks
const THICK = 8;  // pixels of a mark's size from which on lines grow with it
const DASHES = { '': [], '--': [5, 4], ':': [4, 3] };

function isGround(frame) {
  return frame.index === GROUND.index;
}

/* The angle of a frame. */
function angleOf(q, { columns: [, , phi] }) {
  return phi === undefined ? 0 : q[phi];
}

/* World to screen: lengths are true, and the whole extent fits, unless a camera { zoom, centre } says
   what is looked at. */
class View {
  constructor([left, right, low, high], width, height, margin, camera = null) {
    this.fit = Math.min((width - 2 * margin) / (right - left), (height - 2 * margin) / (high - low));
    this.scale = this.fit * (camera ? camera.zoom : 1);
    const [x, y] = camera ? camera.centre : [(left + right) / 2, (low + high) / 2];
    this.left = width / 2 - this.scale * x;
    this.top = height / 2 + this.scale * y;
  }

  toScreen([x, y]) {
    return [this.left + this.scale * x, this.top - this.scale * y];
  }

  toWorld([x, y]) {
    return [(x - this.left) / this.scale, (this.top - y) / this.scale];
  }
}

/* Where a point of a frame is. */
function inWorld(q, frame, [xi, eta]) {
  if (isGround(frame)) return [xi, eta];
  const [x, y, phi] = frame.columns;
  const c = Math.cos(q[phi]), s = Math.sin(q[phi]);
  return [q[x] + c * xi - s * eta, q[y] + s * xi + c * eta];
}

/* Velocity and acceleration of a point of a frame. */
function ratesInWorld(state, frame, [xi, eta]) {
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

/* What is drawn with: positions on the screen, sizes and colours. */
class Pen {
  constructor(ctx, q, style, size) {
    this.ctx = ctx;
    this.q = q;
    this.style = style;
    this.view = style.view;
    this.palette = style.palette;
    this.size = size;  // the drawing's unit of marks, in the model's lengths
    // And in pixels, which do not grow when the picture is looked at more closely.
    this.unit = Math.max(3.2, Math.min(style.largest ?? 9, size * this.view.fit));
  }

  at(frame, point) {
    return this.view.toScreen(inWorld(this.q, frame, point));
  }

  place(place) {
    return this.at(place.frame, place.point);
  }

  /* Strong colour and tint of a body, or of the ground. */
  colours(frame) {
    const { bodies, quiet, tint } = this.palette;
    return isGround(frame) ? [quiet, tint] : bodies[frame.index % bodies.length];
  }

  path(points, isClosed) {
    this.ctx.beginPath();
    let isDown = false;
    for (const point of points) {
      if (point && isDown) this.ctx.lineTo(point[0], point[1]);
      else if (point) this.ctx.moveTo(point[0], point[1]);
      isDown = point !== null;
    }
    if (isClosed) this.ctx.closePath();
  }

  stroke(colour, width, dash = []) {
    Object.assign(this.ctx, { strokeStyle: colour, lineWidth: width });
    this.ctx.setLineDash(dash);
    this.ctx.stroke();
    this.ctx.setLineDash([]);
  }

  fill(colour) {
    this.ctx.fillStyle = colour;
    this.ctx.fill();
  }

  circle([x, y], radius) {
    this.ctx.beginPath();
    this.ctx.arc(x, y, Math.max(radius, 0.1), 0, 2 * Math.PI);
  }

  /* One stroke of a mark, in the colours of its look. */
  draw(mark, stroke) {
    const { style, palette } = this, look = this.style.looks[stroke.look];
    const points = pointsOfStroke(this, mark, stroke);
    if (stroke.look === 'gap' && towards(points[0], points[1])[2] < 2) return;
    this.path(points, stroke.is_area);
    const [strong, tint] = this.colours(ownerOf(mark, stroke.on));
    const isViolated = style.violated && style.violated.has(mark.joint);
    const line = isViolated ? palette.bad : style.ghost ?? palette[look.line] ?? strong;
    const isSolid = look.face !== '' && look.face === look.line;
    const pale = isViolated ? palette.badTint : style.ghost ? palette.paper : palette[look.face] ?? tint;
    if (stroke.is_area) this.fill(isSolid ? line : pale);
    if (look.width) this.stroke(line, look.width * Math.max(1, this.unit / THICK), DASHES[look.dash]);
  }
}

/* The direction from one point to another, of length one, and the distance. */
function towards([x0, y0], [x1, y1]) {
  const length = Math.hypot(x1 - x0, y1 - y0);
  return length ? [(x1 - x0) / length, (y1 - y0) / length, length] : [1, 0, 0];
}

function arrow(pen, from, to, colour, width = 2) {
  const [x, y, length] = towards(from, to);
  if (length < 1) return;
  const head = Math.min(9, 0.6 * length + 3);
  pen.path([from, [to[0] - 0.8 * head * x, to[1] - 0.8 * head * y]]);
  pen.stroke(colour, width);
  pen.path([
    to, [to[0] - head * x - 0.45 * head * y, to[1] - head * y + 0.45 * head * x],
    [to[0] - head * x + 0.45 * head * y, to[1] - head * y - 0.45 * head * x],
  ], true);
  pen.fill(colour);
}

/* ---- the points of a stroke ---- */

/* The frame whose colour a stroke of a mark has. */
function ownerOf(mark, on) {
  if (mark.first) return on === 'first' || on === 'barrel' ? mark.first.frame : mark.second.frame;
  return mark.place ? mark.place.frame : mark.frame;
}

/* The points of a stroke on the screen; null interrupts a line. */
function pointsOfStroke(pen, mark, stroke) {
  const size = TRUE_SIZES.has(mark.shape) ? pen.size : pen.unit / pen.view.scale;
  if (!stroke.corners.length) return curveOf(pen, mark, stroke, size);
  const axes = axesOf(pen.q, mark, stroke.on);
  if (stroke.on === 'circle') return around(pen, stroke, axes, size);
  const { start, along: [x, y], length } = axes, points = [];
  const placed = (part, ahead, left) => {
    const far = part * length + ahead * size;
    return pen.view.toScreen([start[0] + far * x - left * size * y, start[1] + far * y + left * size * x]);
  };
  const last = stroke.every ? Math.max(length / size, stroke.every) : 1;
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
  const count = Math.max(8, Math.round(2 * Math.PI * length / (every * size))), points = [];
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

function drawShapes(ctx, q, style) {
  const drawing = style.drawing ?? player.data.drawing;
  const pen = new Pen(ctx, q, { ...style, looks: drawing.looks }, drawing.size);
  ctx.save();
  ctx.globalAlpha = style.alpha ?? 1;
  Object.assign(ctx, { lineJoin: 'round', lineCap: 'round' });
  for (const mark of drawing.marks) for (const stroke of drawing.shapes[mark.shape]) pen.draw(mark, stroke);
  ctx.restore();
}

/* Rails as long as a motion, with their overhang, and barrels as long as they can be: as Python made
   them for the motion that the page was given (kincompile/view/geometry.py). */
function fitMarks(motion) {
  const { marks, overhang } = motion.data.drawing;
  const states = Array.from({ length: motion.count }, (_, k) => motion.solved(k).q);
  const least = (values, from) => values.reduce((a, b) => Math.min(a, b), from);
  for (const mark of marks) {
    if (mark.kind === 'span' && mark.style === 'cylinder') {
      mark.barrel = BARREL * least(states.map(q => axesOf(q, mark, 'line').length), Infinity);
    } else if (mark.kind === 'rail') {
      const over = mark.style === 'guide' || mark.style === 'slot' ? overhang : 0;
      const along = [...mark.at_least, ...states.map(q => distanceAlong(q, mark))];
      mark.reach = [least(along, Infinity) - over, over - least(along.map(x => -x), Infinity)];
    }
  }
}

/* How far along a rail its follower is. */
function distanceAlong(q, { frame, base, axis, follower }) {
  const [x, y] = inWorld(q, follower.frame, follower.point);
  const from = inWorld(q, frame, base), to = inWorld(q, frame, [base[0] + axis[0], base[1] + axis[1]]);
  return (x - from[0]) * (to[0] - from[0]) + (y - from[1]) * (to[1] - from[1]);
}

/* ---- colours ---- */

const COLOURS = ['paper', 'ink', 'quiet', 'line', 'tint', 'bad', 'velocity', 'acceleration', 'drive',
  'plot', 'pole', 'measure'];

/* The colours of the style sheet, and so of the theme; of each body a strong one and a tint. */
function paletteNow(drawing = player.data.drawing) {
  const probe = document.createElement('span');
  document.body.append(probe);
  const palette = Object.fromEntries(COLOURS.map(name => {
    probe.style.color = `var(--${name})`;
    return [name, getComputedStyle(probe).color];
  }));
  probe.remove();
  palette.isDark = luminance(palette.paper) < 0.5;
  palette.bodies = drawing.hues[palette.isDark ? 'dark' : 'light'].map(
    hue => [hue, blended(hue, palette.paper, palette.isDark ? 0.32 : 0.22)]);
  palette.badTint = blended(palette.bad, palette.paper, 0.25);
  return palette;
}

/* Red, green and blue of a colour, from 0 to 255. */
function channels(colour) {
  if (colour.startsWith('#')) return [1, 3, 5].map(k => parseInt(colour.slice(k, k + 2), 16));
  return colour.match(/[\d.]+/g).slice(0, 3).map(Number);
}

function blended(colour, paper, part) {
  const over = channels(paper);
  return `rgb(${channels(colour).map((c, k) => Math.round(part * c + (1 - part) * over[k])).join()})`;
}

function luminance(colour) {
  const [r, g, b] = channels(colour);
  return (0.3 * r + 0.6 * g + 0.1 * b) / 255;
}
