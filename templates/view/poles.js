/* Velocity poles: where two bodies have the same velocity, and the curves they run along.

   For r_P = r + A s the velocity is r_dot + omega k x (r_P - r), with k x (x, y) = (-y, x). */

import { player } from './player.js';
import { GROUND, isGround, Pen } from './draw.js';
import { inFrame } from '#world';
import { stage } from './stage.js';

/* Angular velocity of a body, and the velocity that its point at the world's origin would have. */
function spinOf(state, { columns }) {
  const [x, y, phi] = columns;
  if (phi === undefined) return { omega: 0, velocity: [0, 0] };
  const { q, q_dot } = state, omega = q_dot[phi];
  return { omega, velocity: [q_dot[x] + omega * q[y], q_dot[y] - omega * q[x]] };
}

/* The pole of two bodies; null where they turn alike, so that it is nowhere, or infinitely far away. */
function poleOf(state, first, second = GROUND) {
  if (!state.isFound) return null;
  const [a, b] = [spinOf(state, first), spinOf(state, second)];
  const omega = a.omega - b.omega, [x, y] = a.velocity.map((part, k) => part - b.velocity[k]);
  // omega k x P + (x, y) = 0
  const pole = [-y / omega, x / omega];
  const isFar = Math.hypot(...pole) > 1e6 * player.data.drawing.size;
  return Number.isFinite(pole[0]) && !isFar ? pole : null;
}

/* Where the pole of two bodies is over the motion, in the axes of the second: null where it is not.
   With the second as ground this is the fixed centrode, with the bodies exchanged the moving one. */
function centrode(first, second) {
  return player.states.map(state => {
    const pole = poleOf(state, first, second);
    return pole && inFrame(state.q, second, pole);
  });
}

export const poles = {
  pairs: [],  // of frames whose poles are shown
  showsCentrodes: false,
  curves: new Map(),  // centrodes by the indices of their bodies

  forget() {
    this.curves = new Map();
  },

  /* What can be chosen: no poles, those of all bodies against the ground, one of them, or all pairs. */
  choices() {
    const { bodies, frames } = player.data.drawing;
    const ofGround = frames.map(frame => [frame, GROUND]);
    const pairs = frames.flatMap((first, k) => frames.slice(k + 1).map(second => [first, second]));
    const one = ofGround.map(([frame, ground], k) => [`${bodies[k]} against the ground`, [[frame, ground]]]);
    const several = pairs.map(pair => [pair.map(frame => bodies[frame.index]).join(' against '), [pair]]);
    return new Map([['none', []], ['all bodies against the ground', ofGround], ...one,
      ['all pairs', [...ofGround, ...pairs]], ...several]);
  },

  curve(first, second) {
    const key = `${first.index} ${second.index}`;
    if (!this.curves.has(key)) this.curves.set(key, centrode(first, second));
    return this.curves.get(key);
  },

  draw(ctx, view, palette, state) {
    if (!this.pairs.length) return;
    const pen = new Pen(ctx, state.q, { view, palette }, player.data.drawing.size);
    if (this.showsCentrodes) for (const pair of this.pairs) this.drawCentrodes(pen, pair);
    for (const [first, second] of this.pairs) {
      const pole = poleOf(state, first, second);
      if (!pole) continue;
      const [x, y] = view.toScreen(pole), arm = 0.9 * pen.unit;
      pen.circle([x, y], arm);
      pen.fill(palette.paper);
      pen.stroke(palette.pole, 2);
      pen.path([[x - arm, y], [x + arm, y], null, [x, y - arm], [x, y + arm]]);
      pen.stroke(palette.pole, 2);
      stage.write(`P ${this.nameOf(first, second)}`, [x + 1.3 * arm, y + 2.4 * arm], palette.pole);
    }
  },

  nameOf(first, second) {
    const { bodies } = player.data.drawing;
    return isGround(second) ? bodies[first.index] : `${bodies[first.index]}, ${bodies[second.index]}`;
  },

  /* The fixed one unbroken, the moving one, which rolls on it, dashed. */
  drawCentrodes(pen, [first, second]) {
    const on = frame => place => place && pen.at(frame, place);
    const curves = [[this.curve(first, second).map(on(second)), []], [this.curve(second, first).map(on(first)), [6, 4]]];
    for (const [points, dash] of curves) {
      pen.path(apart(points, 4 * Math.max(stage.width, stage.height)));
      pen.stroke(pen.palette.pole, 1.6, dash);
    }
  },
};

/* Points of the screen, interrupted where one is far off it: a pole may run to infinity and come back
   from the other side. */
function apart(points, far) {
  return points.map(point => (point && Math.hypot(...point) < far ? point : null));
}
