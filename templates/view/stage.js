'use strict';
/* The canvas: what is drawn on it, and what a pointer does there.

   stage.view            world to screen, for the size the canvas has now
   stage.extent          function that gives what the picture must show
   stage.overlays        functions (ctx, view, palette) that draw on top: ghost bodies, handles
   stage.pointer         null, or { down, move, up } that get (world point, event) before hovering;
                         true from `down` keeps the event
   stage.points          what can be pointed at: named points, joints and the origins of bodies */

const NEAR = 16;  // pixels within which a point is meant, twice that with a finger
const PLACES = 1000;  // points of a traced path
const ARROW = 0.2;  // part of the canvas that the longest velocity and acceleration take

class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.ctx = canvas.getContext('2d');
    this.extent = () => player.data.extent;
    this.overlays = [];
    this.pointer = null;
    this.points = pointsOf(player.data.drawing);
    this.traced = new Set(this.points.filter(point => point.isNamed));
    this.selected = null;  // kept by a click
    this.hovered = null;
    this.showsNames = false;
    this.paths = new Map();  // of traced points, in the world
    this.resize();
  }

  resize() {
    const [left, right, low, high] = player.data.extent;
    const width = this.canvas.parentElement.clientWidth;
    const most = Math.max(240, Math.min(560, innerHeight * 0.62));
    const height = Math.max(220, Math.min(most, width * (high - low) / (right - left) + 2 * NEAR));
    const dense = devicePixelRatio || 1;
    this.canvas.width = Math.round(width * dense);
    this.canvas.height = Math.round(height * dense);
    this.canvas.style.height = `${height}px`;
    this.ctx.setTransform(dense, 0, 0, dense, 0, 0);
    [this.width, this.height] = [width, height];
    this.palette = paletteNow();
  }

  draw(state) {
    this.view = new View(this.extent(), this.width, this.height, NEAR);
    const { ctx, view, palette } = this;
    ctx.clearRect(0, 0, this.width, this.height);
    const violated = state.isFound ? null : violatedJoints();
    const style = { view, palette, violated, alpha: state.isFound || !hasMotion() ? 1 : 0.55 };
    drawShapes(ctx, state.q, style);
    for (const point of this.traced) this.drawPath(point);
    for (const overlay of this.overlays) overlay(ctx, view, palette);
    this.drawNames(state, this.points.filter(point => this.showsNames || point.isNamed));
    const point = this.hovered || this.selected;
    if (point) this.drawPoint(point, state);
  }

  where(point, state) {
    return inWorld(state.q, point.frame, point.point);
  }

  drawPath(point) {
    if (!this.paths.has(point)) this.paths.set(point, pathOf(point));
    const { ctx, view } = this;
    ctx.beginPath();
    let isDown = false;
    for (const place of this.paths.get(point)) {
      if (place === null) {
        isDown = false;
        continue;
      }
      const [x, y] = view.toScreen(place);
      if (isDown) ctx.lineTo(x, y); else ctx.moveTo(x, y);
      isDown = true;
    }
    Object.assign(ctx, { strokeStyle: this.palette.velocity, lineWidth: 1.5, lineJoin: 'round' });
    ctx.setLineDash([2, 4]);
    ctx.stroke();
    ctx.setLineDash([]);
  }

  drawNames(state, points) {
    const { ctx, palette } = this;
    Object.assign(ctx, { font: '12px system-ui, sans-serif', textBaseline: 'bottom', lineWidth: 3 });
    const taken = [];
    for (const point of points) {
      const [x, y] = this.view.toScreen(this.where(point, state));
      const isTaken = taken.some(([a, b]) => Math.abs(a - x) < 60 && Math.abs(b - y) < 13);
      if (isTaken) continue;
      taken.push([x, y]);
      Object.assign(ctx, { strokeStyle: palette.paper, fillStyle: palette.ink });
      ctx.strokeText(point.name, x + 9, y - 6);
      ctx.fillText(point.name, x + 9, y - 6);
    }
  }

  /* A ring around the point, and arrows for velocity and acceleration. */
  drawPoint(point, state) {
    const at = this.view.toScreen(this.where(point, state));
    const pen = new Pen(this.ctx, state.q, this, player.data.drawing.size);
    const rates = ratesInWorld(state, point.frame, point.point);
    const most = greatestRates(point);
    const length = ARROW * Math.min(this.width, this.height);
    for (const kind of ['acceleration', 'velocity']) {
      if (!(most[kind] > 0)) continue;
      const [x, y] = rates[kind].map(part => part * length / most[kind]);
      arrow(pen, at, [at[0] + x, at[1] - y], this.palette[kind], 2.5);
    }
    pen.circle(at, 1.3 * pen.unit);
    pen.stroke(this.palette.velocity, 2);
  }

  /* The point nearest to a place on the screen, or null. */
  near([x, y], reach) {
    let best = null, least = reach;
    for (const point of this.points) {
      const [a, b] = this.view.toScreen(this.where(point, player.state));
      const distance = Math.hypot(a - x, b - y);
      if (distance < least) [best, least] = [point, distance];
    }
    return best;
  }

  /* A point with all others of its body that are at the same place. */
  together(point, state) {
    const at = this.where(point, state), least = player.data.drawing.size / 100;
    const isHere = other => other.frame.index === point.frame.index && towards(at, this.where(other, state))[2] < least;
    return [point, ...this.points.filter(other => other !== point && isHere(other))];
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
    this.hovered = point;
    this.canvas.style.cursor = point ? 'pointer' : '';
    player.refresh();
  }

  listen() {
    const { canvas } = this;
    const at = event => [event.offsetX, event.offsetY];
    const handled = (kind, event) => {
      const isKept = this.pointer?.[kind]?.(this.view.toWorld(at(event)), event);
      if (isKept) event.preventDefault();
      return isKept;
    };
    const reach = event => (event.pointerType === 'touch' ? 2 * NEAR : NEAR);
    canvas.addEventListener('pointerdown', event => {
      if (handled('down', event)) return;
      const point = this.near(at(event), reach(event));
      this.hovered = null;
      if (point === null || point === this.selected) {
        this.traced.delete(this.selected);
        this.select(null);
      } else {
        this.traced.add(point);
        this.select(point);
      }
    });
    canvas.addEventListener('pointermove', event => {
      if (handled('move', event) || event.pointerType === 'touch') return;
      this.hover(this.near(at(event), reach(event)));
    });
    canvas.addEventListener('pointerup', event => handled('up', event));
    canvas.addEventListener('pointercancel', event => handled('up', event));
    canvas.addEventListener('pointerleave', () => this.hover(null));
  }
}

/* Named points, joints that are somewhere, then the origins of bodies. */
function pointsOf(drawing) {
  const named = drawing.marks.filter(mark => mark.kind === 'dot').map(({ name, place }) => ({
    name, kind: `point of ${drawing.bodies[place.frame.index] || 'the ground'}`,
    frame: place.frame, point: place.point, isNamed: true,
  }));
  const joints = drawing.joints.filter(joint => joint.place).map(joint => ({
    name: joint.name, kind: joint.is_driver ? `${joint.kind}, a driver` : joint.kind,
    frame: joint.place.frame, point: joint.place.point,
  }));
  const isBearing = joint => !joint.kind.endsWith('driver');
  const origins = drawing.bodies.map((name, body) => ({
    name, kind: 'origin of the body', frame: drawing.frames[body], point: [0, 0],
  }));
  // Of several at one place a joint comes first: it is the one that is met by the pointer.
  return [...named, ...joints.filter(isBearing), ...joints.filter(joint => !isBearing(joint)), ...origins];
}

function hasMotion() {
  return player.data.status.some(status => status === 0);
}

/* Where a point is at solved times, at most PLACES of them; null where it is not known. */
function pathOf(point) {
  const count = Math.min(player.count, PLACES);
  return Array.from({ length: count }, (_, k) => {
    const state = player.solved(Math.round(k * (player.count - 1) / Math.max(count - 1, 1)));
    return state.isFound ? inWorld(state.q, point.frame, point.point) : null;
  });
}

/* The greatest speed and acceleration of a point in the motion, kept with it. */
function greatestRates(point) {
  if (point.greatest) return point.greatest;
  const most = { velocity: 0, acceleration: 0 };
  for (let k = 0; k < player.count; k++) {
    const rates = ratesInWorld(player.solved(k), point.frame, point.point);
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

const player = new Player(withArrays(JSON.parse(document.getElementById('data').textContent)));
const stage = new Stage(document.getElementById('canvas'));
