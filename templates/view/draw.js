'use strict';
/* The marks of a drawing on a canvas: one function for each kind.

   drawShapes(ctx, q, style) draws the mechanism at coordinates q, any number of times on one canvas.
   style: { view, palette } and, where wanted, alpha, ghost (one colour for everything), violated (a
   set of joint names that are drawn as broken), drawing (of another mechanism than the player's). */

const GROUND = { index: -1, columns: [] };  // a frame: a body's index, and its columns of q

function isGround(frame) {
  return frame.index === GROUND.index;
}

/* The angle of a frame. */
function angleOf(q, { columns: [, , phi] }) {
  return phi === undefined ? 0 : q[phi];
}

/* World to screen: the whole extent fits, and lengths are true. */
class View {
  constructor([left, right, low, high], width, height, margin) {
    const wide = right - left, tall = high - low;
    this.scale = Math.min((width - 2 * margin) / wide, (height - 2 * margin) / tall);
    this.left = width / 2 - this.scale * (left + right) / 2;
    this.top = height / 2 + this.scale * (low + high) / 2;
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

/* What the functions below draw with: positions on the screen, sizes and colours. */
class Pen {
  constructor(ctx, q, style, size) {
    this.ctx = ctx;
    this.q = q;
    this.style = style;
    this.view = style.view;
    this.palette = style.palette;
    this.size = size;  // the drawing's unit of marks, in the model's lengths
    this.unit = Math.max(3.2, Math.min(9, size * this.view.scale));  // and in pixels
  }

  at(frame, point) {
    return this.view.toScreen(inWorld(this.q, frame, point));
  }

  place(place) {
    return this.at(place.frame, place.point);
  }

  /* Strong colour and tint of a mark. */
  colours(frame, joint) {
    const { ghost, violated } = this.style;
    if (violated && violated.has(joint)) return [this.palette.bad, this.palette.badTint];
    if (ghost) return [ghost, this.palette.paper];
    if (isGround(frame)) return [this.palette.quiet, this.palette.tint];
    const bodies = this.palette.bodies;
    return bodies[frame.index % bodies.length];
  }

  path(points, isClosed) {
    this.ctx.beginPath();
    points.forEach(([x, y], k) => (k ? this.ctx.lineTo(x, y) : this.ctx.moveTo(x, y)));
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

  /* A plate with round corners: a wide line in the strong colour, a narrower one in the tint. */
  plate(points, width, [strong, tint], isFilled) {
    this.path(points, isFilled);
    if (points.length === 1) this.circle(points[0], 0.5);
    this.stroke(strong, width);
    if (isFilled) this.fill(tint);
    this.stroke(tint, Math.max(width - 3, 0.5));
  }
}

/* A point between two, or beyond them. */
function mixed([x0, y0], [x1, y1], part) {
  return [x0 + part * (x1 - x0), y0 + part * (y1 - y0)];
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

/* Short slanted lines on one side of a line: what stands still. */
function hatching(pen, from, to, depth, colour) {
  const [x, y, length] = towards(from, to);
  pen.ctx.beginPath();
  for (let along = depth / 2; along <= length; along += depth) {
    const foot = [from[0] + along * x, from[1] + along * y];
    pen.ctx.moveTo(...foot);
    pen.ctx.lineTo(foot[0] - depth * (0.7 * x + y), foot[1] - depth * (0.7 * y - x));
  }
  pen.stroke(colour, 1);
}

function drawGroundSupport(pen, [x, y], colour) {
  const half = 1.7 * pen.unit, low = y + 2.1 * pen.unit;
  pen.path([[x, y], [x - half, low], [x + half, low]], true);
  pen.fill(pen.palette.tint);
  pen.stroke(colour, 1.3);
  // From right to left, so that the hatching is below.
  hatching(pen, [x + 1.5 * half, low], [x - 1.5 * half, low], 0.8 * pen.unit, colour);
  pen.path([[x - 1.5 * half, low], [x + 1.5 * half, low]]);
  pen.stroke(colour, 1.3);
}

function drawGuide(pen, mark, from, to) {
  const [strong] = pen.colours(mark.frame, mark.joint);
  if (!isGround(mark.frame)) {
    pen.plate([from, to], 2.2 * pen.unit, [strong, pen.palette.paper], false);
    return;
  }
  const [x, y] = towards(from, to), gap = 1.15 * pen.unit;
  const moved = ([a, b], side) => [a - side * gap * y, b + side * gap * x];
  for (const side of [-1, 1]) {
    pen.path([moved(from, side), moved(to, side)]);
    pen.stroke(strong, 1.3);
    const ends = side < 0 ? [moved(to, side), moved(from, side)] : [moved(from, side), moved(to, side)];
    hatching(pen, ends[1], ends[0], 0.8 * pen.unit, strong);
  }
}

function drawRack(pen, mark, from, to) {
  const [strong, tint] = pen.colours(mark.frame, mark.joint);
  const [x, y, length] = towards(from, to), pitch = 1.2 * pen.size * pen.view.scale;
  const depth = 0.4 * pitch, points = [];
  for (let along = 0, up = 1; along <= length; along += pitch / 2, up = -up) {
    const foot = [from[0] + along * x, from[1] + along * y];
    for (const side of [up, -up]) points.push([foot[0] + side * depth * y, foot[1] - side * depth * x]);
  }
  const back = 3 * depth + 4;
  const closed = [...points, [to[0] - back * y, to[1] + back * x], [from[0] - back * y, from[1] + back * x]];
  pen.path(closed, true);
  pen.fill(tint);
  pen.stroke(strong, 1.3);
}

function drawCylinder(pen, mark, first, second) {
  const [, , length] = towards(first, second);
  const [inner, outer] = [mark.second, mark.first].map(place => pen.colours(place.frame, mark.joint));
  const barrel = Math.min(1, (mark.barrel || 0) * pen.view.scale / (length || 1));
  pen.plate([first, second], 1.1 * pen.unit, inner, false);
  pen.plate([first, mixed(first, second, barrel)], 2.1 * pen.unit, outer, false);
}

function drawTeeth(pen, [x, y], mark, angle, strong) {
  const radius = mark.radius * pen.view.scale;
  const count = Math.max(8, Math.round(2 * Math.PI * mark.radius / (1.2 * pen.size)));
  const depth = Math.min(0.3 * pen.size * pen.view.scale, 0.2 * radius);
  pen.ctx.beginPath();
  for (let k = 0; k < count; k++) {
    const c = Math.cos(angle + 2 * Math.PI * k / count), s = Math.sin(angle + 2 * Math.PI * k / count);
    pen.ctx.moveTo(x + (radius - depth) * c, y - (radius - depth) * s);
    pen.ctx.lineTo(x + (radius + depth) * c, y - (radius + depth) * s);
  }
  pen.stroke(strong, 1.5);
}

const DRAW = {
  hull(pen, mark) {
    const points = mark.points.map(point => pen.at(mark.frame, point));
    pen.plate(points, 2.1 * pen.unit, pen.colours(mark.frame), points.length > 2);
  },

  polygon(pen, mark) {
    pen.path(mark.points.map(point => pen.at(mark.frame, point)), true);
    const [strong, tint] = pen.colours(mark.frame);
    pen.fill(tint);
    pen.stroke(strong, 1.5);
  },

  pin(pen, mark) {
    const [first, second] = [pen.place(mark.first), pen.place(mark.second)];
    const isViolated = pen.style.violated && pen.style.violated.has(mark.joint);
    const [quiet] = pen.colours(GROUND, mark.joint);
    if (isGround(mark.first.frame)) drawGroundSupport(pen, first, quiet);
    const isApart = towards(first, second)[2] > 2;
    if (isApart) {
      pen.path([first, second]);
      pen.stroke(pen.palette.bad, 1.5, [4, 3]);
    }
    for (const point of isApart ? [first, second] : [second]) {
      pen.circle(point, 0.62 * pen.unit);
      pen.fill(pen.palette.paper);
      pen.stroke(isViolated ? pen.palette.bad : pen.style.ghost || pen.palette.ink, 1.6);
    }
  },

  rail(pen, mark) {
    const [from, to] = [pen.at(mark.frame, mark.start), pen.at(mark.frame, mark.end)];
    if (mark.style === 'rack') drawRack(pen, mark, from, to);
    else if (mark.style === 'guide') drawGuide(pen, mark, from, to);
    else {
      pen.path([from, to]);
      pen.stroke(pen.colours(mark.frame, mark.joint)[0], 4);
    }
  },

  slider(pen, mark) {
    const { frame, point } = mark.place, axis = mark.axis;
    const centre = pen.place(mark.place);
    const [x, y] = towards(centre, pen.at(frame, [point[0] + axis[0], point[1] + axis[1]]));
    const [long, wide] = [1.9 * pen.unit, 1.15 * pen.unit];
    const corner = (a, b) => [
      centre[0] + a * long * x - b * wide * y, centre[1] + a * long * y + b * wide * x,
    ];
    pen.path([corner(-1, -1), corner(1, -1), corner(1, 1), corner(-1, 1)], true);
    const [strong, tint] = pen.colours(frame, mark.joint);
    pen.fill(tint);
    pen.stroke(strong, 1.6);
  },

  span(pen, mark) {
    const [first, second] = [pen.place(mark.first), pen.place(mark.second)];
    if (mark.style === 'cylinder') drawCylinder(pen, mark, first, second);
    else if (mark.style === 'rod') pen.plate([first, second], 1.3 * pen.unit, pen.colours(GROUND, mark.joint));
    else if (mark.style === 'slide') {
      pen.plate([first, second], 1.5 * pen.unit, pen.colours(mark.second.frame, mark.joint));
    } else {
      pen.path([first, second]);
      pen.stroke(pen.colours(GROUND, mark.joint)[0], 1, [5, 4]);
    }
  },

  wheel(pen, mark) {
    const { frame, point } = mark.place, centre = pen.place(mark.place);
    const radius = mark.radius * pen.view.scale;
    const angle = mark.theta + angleOf(pen.q, frame);
    const [strong, tint] = pen.colours(frame, mark.joint);
    pen.circle(centre, radius);
    if (mark.is_internal) {
      pen.circle(centre, radius + pen.unit);
      pen.stroke(tint, 2 * pen.unit);
      pen.circle(centre, radius + 2 * pen.unit);
      pen.stroke(strong, 1.3);
      pen.circle(centre, radius);
    } else {
      pen.fill(tint);
    }
    pen.stroke(strong, 1.3);
    drawTeeth(pen, centre, mark, angle, strong);
    if (mark.is_internal) return;
    pen.path([centre, [centre[0] + radius * Math.cos(angle), centre[1] - radius * Math.sin(angle)]]);
    pen.stroke(strong, 1.3);
  },

  contour(pen, mark) {
    const [strong, tint] = pen.colours(mark.frame, mark.joint);
    const points = mark.points.map(point => pen.at(mark.frame, point));
    pen.path(points, true);
    if (mark.style === 'cam') {
      pen.fill(tint);
      pen.stroke(strong, 1.8);
      return;
    }
    pen.fill(tint);
    pen.stroke(strong, 1.7 * pen.unit + 2.6);
    pen.stroke(pen.palette.paper, 1.7 * pen.unit);
  },

  drive(pen, mark) {
    const [x, y] = pen.place(mark.place), radius = 2 * pen.unit;
    const violated = pen.style.violated && pen.style.violated.has(mark.joint);
    const colour = violated ? pen.palette.bad : pen.style.ghost || pen.palette.drive;
    if (mark.axis) {
      const [a, b] = [2.6 * radius * mark.axis[0], -2.6 * radius * mark.axis[1]];
      arrow(pen, [x, y], [x + a, y + b], colour);
      arrow(pen, [x, y], [x - a, y - b], colour);
      return;
    }
    pen.ctx.beginPath();
    pen.ctx.arc(x, y, radius, 0.25 * Math.PI, -0.55 * Math.PI, true);
    pen.stroke(colour, 2);
    const end = [x + radius * Math.cos(-0.6 * Math.PI), y + radius * Math.sin(-0.6 * Math.PI)];
    arrow(pen, [end[0] + 5, end[1] - 2], [end[0] - 3, end[1] + 1.5], colour);
  },
};

function drawShapes(ctx, q, style) {
  const drawing = style.drawing ?? player.data.drawing;
  const pen = new Pen(ctx, q, style, drawing.size);
  ctx.save();
  ctx.globalAlpha = style.alpha ?? 1;
  Object.assign(ctx, { lineJoin: 'round', lineCap: 'round' });
  for (const mark of drawing.marks) DRAW[mark.kind](pen, mark);
  ctx.restore();
}

/* A barrel keeps its length: most of the shortest that the cylinder has in the motion. */
function measureBarrels(motion) {
  for (const mark of motion.data.drawing.marks) {
    if (mark.kind !== 'span' || mark.style !== 'cylinder') continue;
    let shortest = Infinity;
    for (let k = 0; k < motion.count; k++) {
      const q = motion.solved(k).q;
      const ends = [mark.first, mark.second].map(place => inWorld(q, place.frame, place.point));
      shortest = Math.min(shortest, towards(...ends)[2]);
    }
    mark.barrel = 0.85 * shortest;
  }
}

/* ---- colours ---- */

const HUES = {  // strong colours of the bodies, on light and on dark paper
  light: ['#2563eb', '#b45309', '#047857', '#7c3aed', '#0e7490', '#be185d', '#4d7c0f', '#475569'],
  dark: ['#7aa7ff', '#f0b35a', '#4fd1a5', '#b99aff', '#4cc9e0', '#f48cc0', '#a5cf5a', '#a9b6c9'],
};
const COLOURS = ['paper', 'ink', 'quiet', 'line', 'tint', 'bad', 'velocity', 'acceleration', 'drive'];

/* The colours of the style sheet, and so of the theme; of each body a strong one and a tint. */
function paletteNow() {
  const probe = document.createElement('span');
  document.body.append(probe);
  const palette = Object.fromEntries(COLOURS.map(name => {
    probe.style.color = `var(--${name})`;
    return [name, getComputedStyle(probe).color];
  }));
  probe.remove();
  palette.isDark = luminance(palette.paper) < 0.5;
  palette.bodies = HUES[palette.isDark ? 'dark' : 'light'].map(
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
