/* The mechanism grabbed and moved: time follows the point of a body that is dragged. */

import { player } from './player.js';
import { distanceBetween } from './draw.js';
import { heldAt, inWorld } from '#world';
import { CLICK, hasMotion, stage } from './stage.js';

const REACH = 0.15;  // part of the motion that is searched at once, forth and back
const FINE = 8;  // places between two solved times

export class Grab {
  constructor() {
    this.held = null;  // { frame, point }: what of which body the pointer holds
    const listener = event => { if (this.held) event.preventDefault(); };  // nor does the page scroll
    stage.canvas.addEventListener('touchstart', listener, { passive: false });
  }

  down(place, event) {
    if (!hasMotion() || player.count < 2 || !player.state.isFound || player.state.pose) return false;
    const frame = stage.bodyAt([event.offsetX, event.offsetY])?.frame;
    if (!frame || stage.fingers.size > 1 || event.button > 0) return false;
    const held = heldAt(player.state.q, frame, place, stage.view);
    this.held = { ...held, from: [event.clientX, event.clientY], isMoved: false };
    stage.canvas.setPointerCapture(event.pointerId);
    return true;
  }

  move(place, event) {
    if (!this.held) return false;
    const { from } = this.held;
    if (!this.held.isMoved && Math.hypot(event.clientX - from[0], event.clientY - from[1]) <= CLICK) return true;
    if (!this.held.isMoved) player.pause();
    this.held.isMoved = true;
    stage.canvas.style.cursor = 'grabbing';
    player.show(player.between(this.nearest(place)));
    return true;
  }

  up(place, event) {
    if (!this.held) return false;
    const { isMoved } = this.held;
    this.held = null;
    stage.canvas.style.cursor = '';
    if (isMoved) player.setIndex(player.state.index);  // a solved time, whose numbers are the solution's own
    else if (event.type === 'pointerup') stage.click(stage.targetAt(event));  // a click is still a click
    return true;
  }

  /* The time near the one shown at which the point that is held is nearest to a place. A motion that
     ends where it began goes on there. */
  nearest(place) {
    const { duration } = player, now = Math.abs(player.state.time - player.t[0]);
    const apart = elapsed => {
      const state = player.between(this.within(elapsed));
      return state.isFound ? stage.view.apart(inWorld(state.q, this.held.frame, this.held.point), place) : Infinity;
    };
    const step = duration / (player.count - 1) / FINE, count = Math.ceil(REACH * duration / step);
    let best = now, least = apart(now);
    for (const way of [1, -1]) {
      for (let k = 1, before = least; k <= count; k++) {
        const elapsed = now + way * k * step, here = apart(elapsed);
        if (here < least) [best, least] = [elapsed, here];
        if (here > before && here > 2 * least + step) break;
        before = here;
      }
    }
    return this.within(best);
  }

  within(elapsed) {
    const { duration } = player;
    if (this.isCyclic) return ((elapsed % duration) + duration) % duration;
    return Math.max(0, Math.min(duration, elapsed));
  }

  /* Whether the motion ends where it began, but for whole turns. */
  get isCyclic() {
    const last = player.count - 1, { size, frames } = player.data.drawing;
    if (!player.isFound(0) || !player.isFound(last)) return false;
    const ends = [player.row('q', 0), player.row('q', last)];
    return frames.every(frame => [[0, 0], [10 * size, 0], [0, 10 * size]].every(point => {
      const [one, other] = ends.map(q => inWorld(q, frame, point));
      return distanceBetween(one, other) < 0.01 * size;
    }));
  }
}
