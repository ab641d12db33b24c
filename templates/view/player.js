/* The motion and its time. `player` is what the other scripts share, once start.js opened the page:

   player.data        what the page was given, arrays decoded (rows of n numbers, one after another)
   player.state       { index, time, q, q_dot, q_ddot, isFound } that is shown now
   player.setIndex(k) show the k-th solved time;  player.setTime(t) the one nearest to t
   player.play() pause() toggle() setSpeed(s)
   player.onChange(f) f(state) is called whenever the state changes
   player.onMotion(f) f() is called when the motion was replaced: after data.arrays or the drawing's
                      numbers were changed, call player.motionChanged() */

export const SPEEDS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];
const PLEASANT = 6;  // seconds that a motion takes when the page opens, about

function decoded(text) {
  const bytes = Uint8Array.from(atob(text), character => character.charCodeAt(0));
  return new Float64Array(bytes.buffer);
}

/* Data as the page was given it, its arrays as numbers. */
export function withArrays(data) {
  for (const [name, text] of Object.entries(data.arrays)) data.arrays[name] = decoded(text);
  return data;
}

/** What the scripts of a page share, once it is open.
 * @type {Player} */
export let player = null;

export function share(opened) {
  player = opened;
}

export class Player {
  constructor(data) {
    this.data = data;
    this.n = data.coordinates.length;
    this.t = data.arrays.t;
    this.count = this.t.length;
    this.elapsed = this.t.map(time => Math.abs(time - this.t[0]));  // times may fall
    this.duration = this.elapsed[this.count - 1];
    this.listeners = [];
    this.isPlaying = false;
    this.motionListeners = [];
    this.kept = null;
    this.more = [];
    this.speed = this.pleasantSpeed();
    this.state = this.solved(0);
  }

  /* Row k of an array, without a copy. */
  row(name, k) {
    return this.data.arrays[name].subarray(k * this.n, (k + 1) * this.n);
  }

  isFound(k) {
    return this.row('q', k).every(Number.isFinite);
  }

  /* The state at a solved time; where none was found, the last one before it, or the guess. */
  solved(k) {
    const isFound = this.isFound(k);
    let from = k;
    while (from >= 0 && !this.isFound(from)) from--;
    const still = new Float64Array(this.n);
    return {
      index: k, time: this.t[k], isFound,
      q: from < 0 ? Float64Array.from(this.data.guess) : this.row('q', from),
      q_dot: isFound ? this.row('q_dot', k) : still,
      q_ddot: isFound ? this.row('q_ddot', k) : still,
    };
  }

  /* The states at all solved times, made once a motion. */
  get states() {
    this.kept ??= Array.from({ length: this.count }, (_, k) => this.solved(k));
    return this.kept;
  }

  /* What a drawing has room for: the motion, and further states that are shown, as poses of a transmission. */
  get seen() {
    return [...this.states, ...this.more];
  }

  /* The state between solved times: Hermite's cubic through positions and velocities. */
  between(elapsed) {
    const k = this.indexBefore(elapsed);
    if (k + 1 >= this.count || !this.isFound(k) || !this.isFound(k + 1)) return this.solved(k);
    const h = this.t[k + 1] - this.t[k], width = Math.abs(h);
    const s = width > 0 ? (elapsed - this.elapsed[k]) / width : 0, r = 1 - s;
    const [q0, q1] = [this.row('q', k), this.row('q', k + 1)];
    const [v0, v1] = [this.row('q_dot', k), this.row('q_dot', k + 1)];
    const [a0, a1] = [this.row('q_ddot', k), this.row('q_ddot', k + 1)];
    const w = [r * r * (1 + 2 * s), s * r * r * h, s * s * (1 + 2 * r), -s * s * r * h];
    return {
      index: s < 0.5 ? k : k + 1, time: this.t[k] + s * h, isFound: true,
      q: q0.map((q, i) => w[0] * q + w[1] * (v0[i] || 0) + w[2] * q1[i] + w[3] * (v1[i] || 0)),
      q_dot: v0.map((v, i) => r * v + s * v1[i]),
      q_ddot: a0.map((a, i) => r * a + s * a1[i]),
    };
  }

  /* The last solved time that is not later. */
  indexBefore(elapsed) {
    let low = 0, high = this.count - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.elapsed[middle] <= elapsed) low = middle; else high = middle - 1;
    }
    return low;
  }

  indexNear(time) {
    const elapsed = Math.abs(time - this.t[0]), k = this.indexBefore(elapsed);
    const isNext = k + 1 < this.count && this.elapsed[k + 1] - elapsed < elapsed - this.elapsed[k];
    return isNext ? k + 1 : k;
  }

  setIndex(k) {
    this.show(this.solved(Math.max(0, Math.min(this.count - 1, k))));
  }

  setTime(time) {
    this.setIndex(this.indexNear(time));
  }

  step(frames) {
    this.pause();
    this.setIndex(this.state.index + frames);
  }

  show(state) {
    this.state = state;
    for (const listener of this.listeners) listener(state);
  }

  onChange(listener) {
    this.listeners.push(listener);
  }

  onMotion(listener) {
    this.motionListeners.push(listener);
  }

  motionChanged() {
    this.kept = null;
    for (const listener of this.motionListeners) listener();
    this.show(this.solved(this.state.index));
  }

  /* Tell everyone again: something other than the time has changed. */
  refresh() {
    this.show(this.state);
  }

  play() {
    if (this.isPlaying || this.count < 2) return;
    this.isPlaying = true;
    let elapsed = Math.abs(this.state.time - this.t[0]);
    if (elapsed >= this.duration) elapsed = 0;
    let last = null;
    const frame = now => {
      if (!this.isPlaying) return;
      if (last !== null) elapsed += this.speed * (now - last) / 1000;
      last = now;
      if (elapsed > this.duration) elapsed %= this.duration || 1;
      this.show(this.between(elapsed));
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
    this.refresh();
  }

  /* Stop at a solved time, whose numbers are the solution's own. */
  pause() {
    if (!this.isPlaying) return;
    this.isPlaying = false;
    this.setIndex(this.state.index);
  }

  toggle() {
    if (this.isPlaying) this.pause(); else this.play();
  }

  setSpeed(speed) {
    this.speed = speed;
    this.refresh();
  }

  faster(steps) {
    const k = SPEEDS.indexOf(this.speed) + steps;
    this.setSpeed(SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, k))]);
  }

  /* Real time, unless that is a blink or an age. */
  pleasantSpeed() {
    const wanted = this.duration / PLEASANT;
    if (wanted > 0.3 && wanted < 3) return 1;
    return SPEEDS.reduce((best, speed) =>
      Math.abs(Math.log(speed / wanted)) < Math.abs(Math.log(best / wanted)) ? speed : best, 1);
  }
}
