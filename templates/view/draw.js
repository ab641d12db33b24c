/* The marks of a drawing on a canvas: what plane.js and space.js share.

   drawShapes(ctx, q, style) draws the mechanism at coordinates q, any number of times on one canvas.
   style: { view, palette } and, where wanted, alpha, ghost (one colour for everything), violated (a
   set of joint names that are drawn as broken), drawing (of another mechanism than the player's).

   What a mark looks like is in the data: drawing.shapes has the strokes of each shape, drawing.looks
   what a stroke is drawn like (kincompile/view/shapes.py, solid_shapes.py).  They are evaluated from the
   numbers of the marks whenever they are drawn, by one of

   plane.js, space.js    AXES and isSpatial; View, between the world and the screen; inWorld, inFrame,
                         ratesInWorld: points of frames; drawMarks, areasOf: what is drawn

   fitMarks makes rails and barrels fit a motion. */

import { player } from './player.js';
import { drawMarks, inWorld } from '#world';

export const GROUND = { index: -1, columns: [] };  // a frame: a body's index, and its columns of q
const BARREL = 0.85;  // part of a cylinder's shortest length that its barrel has
export const SAME_POINT = 1e-9;  // relative distance up to which two points of a body are one
const THICK = 8;  // pixels of a mark's size from which on lines grow with it
export const MOST_PIECES = 1000;  // of a line: one that has more goes off every screen
export const DASHES = { '': [], '--': [5, 4], ':': [4, 3] };

export function isGround(frame) {
  return frame.index === GROUND.index;
}

/* What is drawn with: positions on the screen, sizes and colours. */
export class Pen {
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

  /** @param {number[]} place */
  circle([x, y], radius) {
    this.ctx.beginPath();
    this.ctx.arc(x, y, Math.max(radius, 0.1), 0, 2 * Math.PI);
  }

  /* Colours of the line and of the area of a stroke, in its look. */
  inks(mark, { look: name, on }) {
    const { style, palette } = this, look = style.looks[name];
    const [strong, tint] = this.colours(ownerOf(mark, on));
    const isViolated = style.violated && style.violated.has(mark.joint);
    const line = isViolated ? palette.bad : style.ghost ?? palette[look.line] ?? strong;
    const isSolid = look.face !== '' && look.face === look.line;
    const pale = isViolated ? palette.badTint : style.ghost ? blended(style.ghost, palette.paper, 0.12) : palette[look.face] ?? tint;
    return { line, face: isSolid ? line : pale };
  }

  /* A width of a look, in pixels. */
  width(width) {
    return width * Math.max(1, this.unit / THICK);
  }
}

/* How far apart two places are. */
export function distanceBetween(from, to) {
  return Math.hypot(...to.map((x, k) => x - from[k]));
}

/* The direction from one point to another, of length one, and the distance. */
export function towards(from, to) {
  const [x0, y0] = from, [x1, y1] = to;
  const length = Math.hypot(x1 - x0, y1 - y0);
  return length ? [(x1 - x0) / length, (y1 - y0) / length, length] : [1, 0, 0];
}

export function arrow(pen, from, to, colour, width = 2) {
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

/* The frame whose colour a stroke of a mark has. */
export function ownerOf(mark, on) {
  if (mark.first) return on === 'first' || on === 'barrel' ? mark.first.frame : mark.second.frame;
  return mark.place ? mark.place.frame : mark.frame;
}

/* The convex hull of points, counterclockwise; of points on a line its two ends. */
export function hullOf(points) {
  const turn = (a, b, c) => (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  const isNear = ([a, b], [x, y]) =>
    Math.max(Math.abs(a - x), Math.abs(b - y)) <= SAME_POINT * (1 + Math.max(Math.abs(x), Math.abs(y)));
  const found = points.filter((point, k) => !points.slice(0, k).some(other => isNear(other, point)));
  const ordered = found.sort(([a, b], [x, y]) => a - x || b - y);
  if (ordered.length < 3) return ordered;
  return [ordered, ordered.slice().reverse()].flatMap(chain => {
    const kept = [];
    for (const point of chain) {
      while (kept.length > 1 && turn(kept[kept.length - 2], kept[kept.length - 1], point) <= 0) kept.pop();
      kept.push(point);
    }
    return kept.slice(0, -1);
  });
}

export function drawShapes(ctx, q, style) {
  const drawing = style.drawing ?? player.data.drawing;
  const pen = new Pen(ctx, q, { ...style, looks: drawing.looks }, drawing.size);
  ctx.save();
  ctx.globalAlpha = style.alpha ?? 1;
  Object.assign(ctx, { lineJoin: 'round', lineCap: 'round' });
  drawMarks(pen, drawing);
  ctx.restore();
}

/* Rails as long as a motion, with their overhang, and barrels as long as they can be: as Python made
   them for the motion that the page was given (kincompile/view/geometry.py). */
export function fitMarks(motion) {
  const { marks, overhang } = motion.data.drawing;
  const states = motion.seen.map(state => state.q);
  const least = (values, from) => values.reduce((a, b) => Math.min(a, b), from);
  for (const mark of marks) {
    if (mark.kind === 'span' && mark.style === 'cylinder') {
      const [from, to] = [mark.first, mark.second];
      const lengths = states.map(q => distanceBetween(
        inWorld(q, from.frame, from.point), inWorld(q, to.frame, to.point)));
      mark.barrel = BARREL * least(lengths, Infinity);
    } else if (mark.follower) {
      const over = mark.style === 'rack' || mark.style === 'face' ? 0 : overhang;
      const along = [...mark.at_least ?? [0], ...states.map(q => distanceAlong(q, mark))];
      mark.reach = [least(along, Infinity) - over, over - least(along.map(x => -x), Infinity)];
    }
  }
}

/* How far along a rail its follower is. */
function distanceAlong(q, mark) {
  const { frame, point: base } = mark.place ?? { frame: mark.frame, point: mark.base }, { axis, follower } = mark;
  const at = inWorld(q, follower.frame, follower.point);
  const from = inWorld(q, frame, base), to = inWorld(q, frame, base.map((x, k) => x + axis[k]));
  return at.reduce((sum, x, k) => sum + (x - from[k]) * (to[k] - from[k]), 0);
}

/* ---- colours ---- */

const COLOURS = ['paper', 'ink', 'quiet', 'line', 'tint', 'bad', 'velocity', 'acceleration', 'drive',
  'plot', 'pole', 'force', 'measure'];

/* The colours of the style sheet, and so of the theme; of each body a strong one and a tint. */
export function paletteNow(drawing = player.data.drawing) {
  const probe = document.createElement('span');
  document.body.append(probe);
  /** @type {Object<string, any>} */
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

export function blended(colour, paper, part) {
  const over = channels(paper);
  return `rgb(${channels(colour).map((c, k) => Math.round(part * c + (1 - part) * over[k])).join()})`;
}

function luminance(colour) {
  const [r, g, b] = channels(colour);
  return (0.3 * r + 0.6 * g + 0.1 * b) / 255;
}
