'use strict';
/* What outputs do over the motion: extremes, dead points, time ratio, mean and RMS, as sol.measures()
   finds them (kincompile/runtime/results/measures.py). Extremes lie between solved times: where a rate
   changes its sign, the motion is followed from the solved time beside it by the emitted solver. */

const STILL = 1e-11;  // movement, relative to the largest number of its unit, that is a rounding error
const AT_REST = 1e-10;  // rate, relative to the largest, that is zero
const REPEATS = 1e-7;  // difference, relative to its stroke, up to which an output repeats itself
const LOCATED = 1e-13;  // part of the span of times to which a zero is located
const ROOT_STEPS = 60;

class OutputMotion {
  /* An output over the times of a motion that were found. */
  constructor(motion, k) {
    const width = player.data.outputs.length, { unit, name } = player.data.outputs[k];
    const rows = [...motion.t.keys()].filter(row => Number.isFinite(motion.q_ddot[row * player.n]));
    if (motion.t[0] > motion.t[motion.t.length - 1]) rows.reverse();
    const column = values => rows.map(row => values[row * width + k]);
    this.motion = motion;
    this.k = k;
    this.name = name;
    this.unit = unit;
    this.t = rows.map(row => motion.t[row]);
    this.y = column(motion.y);
    this.y_dot = column(motion.y_dot);
    this.y_ddot = column(motion.y_ddot);
    this.span = this.t[this.t.length - 1] - this.t[0];
    this.most = largestOf(this.y_dot);
    this.known = new Map(this.t.map((t, row) => [t, [this.y[row], this.y_dot[row], this.y_ddot[row]]]));
    this.noise = STILL * this.scale(rows);
  }

  /* The largest number of its unit, of coordinates and outputs; of angles at least a radian. */
  scale(rows) {
    const { coordinates, outputs } = player.data, { motion, unit } = this;
    const of = (items, values) => items.flatMap((item, k) =>
      (item.unit === unit ? [largestOf(rows.map(row => values[row * items.length + k]))] : []));
    return Math.max(unit === 'rad' ? 1 : 0, ...of(coordinates, motion.q), ...of(outputs, motion.y));
  }

  /* The output and its rates at any time. */
  at(t) {
    if (!this.known.has(t)) {
      const state = emitted.solver.between(this.motion, t);
      const values = ({ outputs, outputs_dot, outputs_ddot }) => [outputs, outputs_dot, outputs_ddot].map(x => x[this.k]);
      this.known.set(t, state ? values(state) : [NaN, NaN, NaN]);
    }
    return this.known.get(t);
  }

  /* The times at which it turns back, and where it comes to rest. */
  deadPoints() {
    const { t, y, y_dot, y_ddot, most } = this;
    if (Math.max(...y) - Math.min(...y) <= this.noise || !(most > 0)) return [];
    const signs = y_dot.map(rate => (Math.abs(rate) > AT_REST * most ? Math.sign(rate) : 0));
    const found = [];
    for (let first = 0; first < t.length; first++) {
      if (signs[first] !== 0) continue;
      let last = first;
      while (signs[last + 1] === 0) last++;
      const [before, after] = [signs[Math.max(first - 1, 0)], signs[Math.min(last + 1, t.length - 1)]];
      if (last > first || before * after <= 0) found.push(t[first]);
      first = last;
    }
    for (let a = 0; a + 1 < t.length; a++) {
      if (signs[a] * signs[a + 1] < 0) found.push(this.zero(t[a], t[a + 1]));
      if (!(signs[a] * signs[a + 1] > 0)) continue;
      // Where both tangents of the rate reach zero within the step, it may have two zeros.
      const h = t[a + 1] - t[a], sign = signs[a], [one, other] = [y_ddot[a] * h, y_ddot[a + 1] * h];
      if (!(sign * one < -Math.abs(y_dot[a]) && sign * other > Math.abs(y_dot[a + 1]))) continue;
      const middle = t[a] + h * one / (one - other);
      if (this.at(middle)[1] * sign < 0) found.push(this.zero(t[a], middle), this.zero(middle, t[a + 1]));
    }
    return found.sort((a, b) => a - b);
  }

  /* When the rate is zero between two times: Newton's method, or secants where no second rate is
     emitted, with a bisection where either leaves the bracket. */
  zero(low, high) {
    const smallest = LOCATED * this.span, atLow = this.at(low)[1];
    let [before, rateBefore, t] = [low, atLow, (low + high) / 2];
    for (let k = 0; k < ROOT_STEPS; k++) {
      const [, rate, given] = this.at(t);
      if (!Number.isFinite(rate) || rate === 0) break;
      const slope = Number.isFinite(given) ? given : (rate - rateBefore) / (t - before);
      if (rate * atLow > 0) low = t; else high = t;
      [before, rateBefore] = [t, rate];
      const following = slope ? t - rate / slope : low;
      if (Math.abs(following - t) <= smallest || high - low <= smallest) break;
      t = following > low && following < high ? following : (low + high) / 2;
    }
    return t;
  }

  /* The first time of the least or the greatest value, by sign, and the value. */
  extreme(dead, sign) {
    const { t, y, noise } = this, last = t.length - 1;
    const times = [t[0], ...dead, t[last]], values = [y[0], ...dead.map(time => this.at(time)[0]), y[last]];
    const best = list => list.reduce((k, value, row) => (sign * value > sign * list[k] ? row : k), 0);
    const [row, onGrid] = [best(values), best(y)];
    if (sign * (y[onGrid] - values[row]) > noise) return [t[onGrid], y[onGrid]];
    const isSame = k => Math.abs(values[k] - values[row]) <= noise && times[row] - times[k] > 1e-3 * this.span;
    const first = [...times.keys()].find(isSame) ?? row;
    return [times[first], values[first]];
  }

  /* After what time it repeats itself; null if it does not, or was not solved for so long. */
  period(dead) {
    if (!dead.length) return null;
    const candidates = [...new Set([...dead.slice(1).map(time => time - dead[0]), this.span])];
    return candidates.sort((a, b) => a - b).find(period => this.repeats(dead[0], period)) ?? null;
  }

  repeats(first, period) {
    const { t, y, most } = this, start = t[0], end = t[t.length - 1];
    const limits = [Math.max(...y) - Math.min(...y), most].map(x => REPEATS * x);
    const until = Math.max(start, end - period), spread = [0, 1, 2, 3].map(k => start + k / 3 * (until - start));
    return [...spread, first].every(time => {
      if (time + period > end + 1e-9 * this.span) return true;
      const [here, there] = [this.at(time), this.at(Math.min(time + period, end))];
      return limits.every((limit, k) => !(Math.abs(there[k] - here[k]) > limit));
    });
  }

  /* The longer by the shorter time between the two dead points of a period. */
  timeRatio(dead, period) {
    const own = period === null ? [] : dead.filter(time => time < dead[0] + period - 1e-9 * this.span);
    if (own.length !== 2) return null;
    const one = own[1] - own[0];
    return Math.max(one, period - one) / Math.min(one, period - one);
  }

  /* The means of the output and of its square over time, by polynomials of fifth degree through values
     and rates; NaN where no second rate is emitted. */
  means() {
    const { t, y, y_dot, y_ddot } = this;
    if (t.length === 1) return [y[0], y[0] ** 2];
    const squares = [y.map(x => x * x), y.map((x, k) => 2 * x * y_dot[k]), y.map((x, k) => 2 * (y_dot[k] ** 2 + x * y_ddot[k]))];
    return [[y, y_dot, y_ddot], squares].map(([f, f_dot, f_ddot]) => {
      let sum = 0;
      for (let a = 0; a + 1 < t.length; a++) {
        const h = t[a + 1] - t[a];
        sum += h / 2 * (f[a] + f[a + 1]) + h * h / 10 * (f_dot[a] - f_dot[a + 1]) + h ** 3 / 120 * (f_ddot[a] + f_ddot[a + 1]);
      }
      return sum / this.span;
    });
  }

  measures() {
    const dead = this.deadPoints(), period = this.period(dead), [mean, square] = this.means();
    const [[tLeast, least], [tGreatest, greatest]] = [this.extreme(dead, -1), this.extreme(dead, 1)];
    return {
      name: this.name, unit: this.unit, least, tLeast, greatest, tGreatest, dead, period,
      timeRatio: this.timeRatio(dead, period), mean, rms: Math.sqrt(Math.max(square, 0)),
    };
  }
}

function largestOf(values) {
  return values.reduce((most, x) => (Math.abs(x) > most ? Math.abs(x) : most), 0);
}

/* The measures of all outputs of a motion. */
function measuresOf(motion) {
  return player.data.outputs.map((_, k) => new OutputMotion(motion, k)).filter(({ t }) => t.length)
    .map(output => output.measures());
}

function shortNumber(value) {
  return Number.isFinite(value) ? `${+value.toPrecision(6)}` : '–';
}

/* A number of an output in the unit that is shown, zero for a rounding error. */
function outputNumber({ least, greatest, unit }, value) {
  const size = Math.max(Math.abs(least), Math.abs(greatest));
  return shortNumber(Math.abs(value) < STILL * size ? 0 : value * units.factor(unit));
}

/** @type {[string, (item: any) => string][]} */
const MEASURES = [
  ['min', item => outputNumber(item, item.least)],
  ['at t', item => shortNumber(item.tLeast)],
  ['max', item => outputNumber(item, item.greatest)],
  ['at t', item => shortNumber(item.tGreatest)],
  ['stroke', item => outputNumber(item, item.greatest - item.least)],
  ['dead points at', ({ dead }) => {
    const shown = dead.slice(0, 4).map(shortNumber).join(', ');
    return dead.length > 4 ? `${shown}, ... (${dead.length})` : shown || '–';
  }],
  ['time ratio', ({ period, timeRatio }) => (period === null ? 'not cyclic' : shortNumber(timeRatio ?? NaN))],
  ['mean', item => outputNumber(item, item.mean)],
  ['rms', item => outputNumber(item, item.rms)],
];

const measures = {
  solved: null,  // the motion whose measures are shown

  build(panel) {
    this.holder = document.createElement('div');
    panel.append(this.holder);
  },

  /* Of the motion that the page solved for last; the one it was made with is solved for once. */
  show() {
    const motion = live.motionNow();
    if (motion === this.solved && units.angle === this.angle) return;
    this.solved = motion;
    this.angle = units.angle;
    const found = measuresOf(motion);
    const table = tableOf(['', ...found.map(({ name, unit }) => units.titled(name, unit))]);
    for (const [title, textOf] of MEASURES) {
      table.tBodies[0].insertRow().append(cell(title, 'th'), ...found.map(item => cell(textOf(item))));
    }
    this.holder.replaceChildren(wide(table));
  },
};
