/* The mechanism as a function of its inputs: `transmitted`, the emitted function, asked for poses.

   A pose is { u, q, x, J, all, status, last }: inputs, the coordinates that the function solves for, outputs and their derivatives by
   the inputs, all coordinates, what became of it, and the last inputs that were reached on the way to it: those of q. */

import { player } from './player.js';

const LED = 16;  // steps in which other parameters are led to
const AGAIN = 1e-3;  // part of a way that is followed again from its end
const NO_END = 4;  // sizes of the mechanism that a length is followed; an angle for a turn

/* The poses on one branch, with parameters: that of the first pose. */
export class Branch {
  constructor(p) {
    this.p = p;
    this.size = transmitted.start().size;
    const { inputs, outputs } = player.data.transmission, { lengthUnit } = player.data;
    const scaleOf = ({ unit }) => (unit === lengthUnit ? this.size : 1);
    this.scales = [inputs.map(scaleOf), outputs.map(scaleOf)];
    this.farthest = inputs.map(({ unit }) => (unit === 'rad' ? 2 * Math.PI : NO_END * this.size));
    this.isSquare = inputs.length === outputs.length;
    this.home = this.begin();
  }

  /* The first pose: that of the defaults, led to these parameters. */
  begin() {
    const { P, U, Q } = transmitted, isDefault = this.p.every((x, k) => x === P[k]);
    let q = Q, state;
    for (let k = isDefault ? LED : 1; k <= LED; k++) {
      const p = k === LED ? this.p : P.map((x, i) => x + k / LED * (this.p[i] - x));
      state = transmitted.start(p, U, q);
      if (state.status !== 0) break;
      q = state.q;
    }
    return this.asked(state, U);
  }

  asked(state, u) {
    const { x, J, status } = transmitted.transmission(state, u), n = player.data.transmission.outputs.length;
    return {
      u: Array.from(u), q: Array.from(state.q), last: Array.from(state.u), status: state.status || status,
      x: Array.from(x.slice(0, n)), J: J.slice(0, n).map(row => Array.from(row)), all: x.slice(n),
    };
  }

  /* The pose at inputs, on the straight way from another one. */
  go(from, u) {
    return this.asked(transmitted.start(this.p, from.u, from.q), u);
  }

  /* The last pose on a way that did not reach its inputs. */
  lastOf({ last, q }) {
    return this.go({ u: last, q }, last);
  }

  /* How far each input can go from a pose while the others are held: two numbers, null without an end. */
  limits(pose) {
    return this.farthest.map((far, k) => [-far, far].map(way => {
      const found = this.end(pose, pose.u.map((x, j) => (j === k ? x + way : x)));
      return found === null ? null : found.u[k];
    }));
  }

  /* The last pose on the straight way to inputs, null where it leads there. A way is followed to a part of it: of what is left at
     its end a short piece is followed again. */
  end(from, to) {
    const first = this.go(from, to);
    if (first.status === 0) return null;
    const last = { u: first.last, q: first.q }, again = this.go(last, last.u.map((x, k) => x + AGAIN * (to[k] - from.u[k])));
    return this.lastOf(again.status === 0 ? first : again);
  }

  /* det J; NaN where there are not as many outputs as inputs. */
  determinant({ J }) {
    return this.isSquare ? transmitted.factor(J).determinant : NaN;
  }

  /* Singular values of J, the smallest first; in scales or as it is. */
  stretches({ J }, inScales) {
    const [given, found] = this.scales;
    const rows = inScales ? J.map((row, i) => row.map((x, j) => x * given[j] / found[i])) : J;
    // Of fewer outputs than inputs those of the transposed matrix: the others are zero.
    const tall = rows.length < rows[0].length ? rows[0].map((_, j) => rows.map(row => row[j])) : rows;
    return transmitted.singularValues(tall).map(({ size }) => size);
  }

  /* The pose between two of them, the first reached, at which det J is zero. */
  zeroBetween(from, to) {
    const at = part => this.go(from, from.u.map((x, k) => x + part * (to.u[k] - x)));
    let [a, b, atA, atB] = [0, 1, this.determinant(from), this.determinant(to)], pose = from;
    for (let k = 0; k < 60; k++) {  // regula falsi, of Illinois: a zero is always between a and b
      const c = (a * atB - b * atA) / (atB - atA);
      pose = at(c);
      const atC = this.determinant(pose), isLast = Math.abs(c - b) < 1e-14 || atC === 0;
      if (isLast || !Number.isFinite(atC)) break;
      if (atC * atB < 0) [a, atA] = [b, atB]; else atA /= 2;
      [b, atB] = [c, atC];
    }
    return pose;
  }
}
