/* Which inputs can be reached, of one or two, and where singular positions are among them; more inputs are held.

   Poses are found from neighbour to neighbour on a lattice of inputs that has the first pose as a point: all are on its branch. Where
   a way from one that was reached ends, the branch does, at an output singularity (type 2); where det J changes its sign there is an
   input singularity (type 1), which is looked for between the two. */

import { player } from './player.js';

const COARSE = 12;  // steps of a first lattice, which finds how far two inputs go
const FINEST = 36;  // steps of that which is shown
const FINEST_AXIS = 120;  // and of that of a single input
const MOST_POSES = 6000;  // that are tried on a lattice
const SLICE = 12;  // milliseconds that the search takes at a time

export class InputMap {
  constructor(branch, home) {
    this.branch = branch;
    this.home = home;
    this.poses = [];  // all that were reached
    this.ways = new Map();  // and where ways ended
    this.curves = [];  // { type: 'input' or 'output', ends: poses }, for one input one pose each
    this.areas = [];  // corners of the pieces of what can be reached, for one input a line
  }

  /* Search in slices, so that the page goes on; then call a function. */
  search(done) {
    const work = this.work();
    const slice = () => {
      for (const begin = performance.now(); performance.now() - begin < SLICE;) if (work.next().done) return done();
      this.timer = setTimeout(slice);
      return null;
    };
    slice();
  }

  stop() {
    clearTimeout(this.timer);
  }

  *work() {
    const chords = this.branch.limits(this.home).slice(0, 2), isPlane = chords.length === 2;
    this.bounds = chords.map((ends, k) => this.boundsOf(ends, k, isPlane));
    const found = chords.map((ends, k) => ends.map((end, side) => end ?? this.bounds[k][side]));
    if (isPlane) {
      yield* this.flood(found.map(([low, high]) => (high - low) / COARSE));
      for (const { last } of this.nodes.values()) found.forEach((box, k) => box.splice(0, 2, Math.min(box[0], last[k]), Math.max(box[1], last[k])));
    }
    this.box = found;
    yield* this.flood(found.map(([low, high]) => (high - low) / (isPlane ? FINEST : FINEST_AXIS)));
    this.poses = [...this.nodes.values()].filter(isReached);
    yield* isPlane ? this.plane() : this.axis();
    this.curves = ['output', 'input'].flatMap(type => joined(this.curves.filter(piece => piece.type === type)
      .map(({ ends }) => ends)).map(ends => ({ type, ends })));
  }

  /* Between what an input is looked at: at most a turn, or without an end the size of the mechanism. */
  boundsOf([low, high], k, isPlane) {
    const { unit } = player.data.transmission.inputs[k], home = this.home.u[k], isOpen = low === null || high === null;
    const half = unit === 'rad' ? Math.PI : isOpen ? this.branch.size : 1.5 * (high - low), middle = isOpen ? home : (low + high) / 2;
    if (isPlane) return [middle - half, middle + half];
    // Beyond an end, so that the way to it is tried.
    return [low === null ? home - half : low - half / 5, high === null ? home + half : high + half / 5];
  }

  inputsAt(place) {
    return this.home.u.map((x, k) => (k < place.length ? x + place[k] * this.steps[k] : x));
  }

  isWithin(u) {
    return this.bounds.every(([low, high], k) => u[k] >= low - 1e-9 * this.steps[k] && u[k] <= high + 1e-9 * this.steps[k]);
  }

  /* Reach what can be reached from the first pose, from neighbour to neighbour. */
  *flood(steps) {
    const first = steps.map(() => 0), queue = [first];
    this.steps = steps;
    this.nodes = new Map([[String(first), this.home]]);
    for (const place of queue) {
      const here = this.nodes.get(String(place));
      for (const [k, way] of steps.flatMap((_, axis) => [[axis, 1], [axis, -1]])) {
        const next = place.map((count, j) => (j === k ? count + way : count)), key = String(next);
        if (this.nodes.has(key) && isReached(this.nodes.get(key))) continue;
        const u = this.inputsAt(next);
        if (!this.isWithin(u) || this.nodes.size >= MOST_POSES) continue;
        const found = this.branch.go(here, u);
        this.nodes.set(key, found);
        if (isReached(found)) queue.push(next);
        yield;
      }
    }
  }

  /* One input: its range as a line of poses, and its singular positions. */
  *axis() {
    const sorted = [...this.nodes.values()].sort((one, other) => one.u[0] - other.u[0]);
    const line = sorted.map((pose, k) => {
      const inner = [sorted[k - 1], sorted[k + 1]].find(other => other && isReached(other));
      return isReached(pose) ? pose : this.endOf(inner, pose.u);
    });
    line.filter(pose => pose.isEnd).forEach(pose => this.curves.push({ type: 'output', ends: [pose] }));
    for (let k = 1; k < line.length; k++) {
      const zero = this.zero(line[k - 1], line[k]);
      if (zero) this.curves.push({ type: 'input', ends: [zero] });
      yield;
    }
    this.areas = [line];
  }

  /* Two inputs: the lattice in triangles, each cut where ways end and where det J is zero. */
  *plane() {
    const cells = new Set();
    for (const [key, pose] of this.nodes) {
      const [i, j] = key.split(',').map(Number);
      if (isReached(pose)) for (const cell of [[i, j], [i - 1, j], [i, j - 1], [i - 1, j - 1]]) cells.add(String(cell));
    }
    for (const cell of cells) {
      const [i, j] = cell.split(',').map(Number);
      const corner = (right, up) => this.cornerAt([i + right, j + up]);
      const corners = [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)];
      const [a, b, c, d] = corners;
      for (const triangle of [[a, b, c], [a, c, d]]) if (triangle.every(Boolean)) this.cut(triangle);
      yield;
    }
  }

  /* A pose of the lattice, or inputs that were not tried; null beyond the bounds. */
  cornerAt(place) {
    const u = this.inputsAt(place), known = this.nodes.get(String(place));
    return known ?? (this.isWithin(u) ? { u, status: -1 } : null);
  }

  cut(corners) {
    const area = [];
    corners.forEach((here, k) => {
      const next = corners[(k + 1) % 3];
      if (isReached(here)) area.push(here);
      if (isReached(here) !== isReached(next)) area.push(isReached(here) ? this.endOf(here, next.u) : this.endOf(next, here.u));
    });
    if (area.length < 3) return;
    this.areas.push(area);
    const zeros = [];
    area.forEach((here, k) => {
      const next = area[(k + 1) % area.length], zero = this.zero(here, next);
      if (here.isEnd && next.isEnd) this.curves.push({ type: 'output', ends: [here, next] });
      if (zero) zeros.push(zero);
    });
    if (zeros.length === 2) this.curves.push({ type: 'input', ends: zeros });
  }

  /* Where the way from a pose to inputs ends: each way is gone once. */
  endOf(from, u) {
    const key = `${from.u} ${u}`;
    if (!this.ways.has(key)) {
      const found = this.branch.go(from, u);
      this.ways.set(key, isReached(found) ? found : { ...this.branch.lastOf(found), isEnd: true });
    }
    return this.ways.get(key);
  }

  /* The input singularity between two poses, if det J changes its sign there: each is looked for once. */
  zero(one, other) {
    const { branch } = this, isZero = branch.determinant(one) * branch.determinant(other) < 0;
    if (!isZero || (one.isEnd && other.isEnd)) return null;
    const [from, to] = one.isEnd || (!other.isEnd && String(other.u) < String(one.u)) ? [other, one] : [one, other];
    const key = `${from.u} ${to.u} 0`;
    if (!this.ways.has(key)) this.ways.set(key, branch.zeroBetween(from, to));
    return this.ways.get(key);
  }

  /* The pose that is nearest to inputs, in steps of the lattice. */
  near(u) {
    const apart = pose => Math.hypot(...this.steps.map((step, k) => (pose.u[k] - u[k]) / step));
    return this.poses.reduce((best, pose) => (apart(pose) < apart(best) ? pose : best), this.home);
  }
}

export function isReached(pose) {
  return pose.status === 0;
}

/* Pieces of curves, of one or two ends, as the curves that they make: pieces meet in one and the same pose. */
function joined(pieces) {
  const left = new Set(pieces), at = new Map();
  for (const piece of pieces) for (const end of piece) at.set(end, [...at.get(end) ?? [], piece]);
  const onward = curve => {
    for (let piece; (piece = at.get(curve[curve.length - 1]).find(other => left.has(other)));) {
      left.delete(piece);
      curve.push(piece[0] === curve[curve.length - 1] ? piece[1] : piece[0]);
    }
    return curve.reverse();
  };
  return pieces.filter(piece => left.has(piece)).flatMap(piece => {
    if (!left.delete(piece)) return [];
    return [onward(onward([...piece]))];
  });
}
