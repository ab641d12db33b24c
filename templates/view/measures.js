/* What outputs do over the motion: extremes, dead points, time ratio, mean and RMS, as sol.measures()
   finds them (kincompile/runtime/results/measures.py, shapes.py). Extremes lie between solved times: where a rate
   changes its sign, the motion is followed from the solved time beside it by the emitted solver. */

import { player } from './player.js';
import { symbolNodes, units } from './units.js';
import { stage } from './stage.js';
import { named } from './columns.js';
import { cell, rowFinder, tableOf, wide } from './tables.js';
import { live } from './live.js';
import { settings } from './settings.js';

const STILL = 1e-11;  // movement, relative to the largest number of its unit, that is a rounding error
const AT_REST = 1e-10;  // rate, relative to the largest, that is zero
const REPEATS = 1e-7;  // difference, relative to its stroke, up to which an output repeats itself
const LOCATED = 1e-13;  // part of the span of times to which a zero is located
const ROOT_STEPS = 60;
const POLE = 1e6;  // how many times an output is larger at a pole than at the times beside it
const STEP_PARTS = 8;  // of a step, at which a path is looked at

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
    this.isFar = farOf(this.y);
    this.known = new Map(this.t.map((t, row) => [t, [this.y[row], this.y_dot[row], this.y_ddot[row]]]));
    this.noise = STILL * this.scale(rows);
  }

  /* The largest number of its unit, of coordinates and outputs; of angles at least a radian. */
  scale(rows) {
    const { coordinates, outputs } = player.data, { motion, unit } = this;
    const near = values => {
      const isFar = farOf(values);
      return values.filter((_, row) => !isFar[row]);
    };
    const of = (items, values) => items.flatMap((item, k) =>
      (item.unit === unit ? [largestOf(near(rows.map(row => values[row * items.length + k])))] : []));
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

  /* When it falls below and rises above all bounds: on the grid, and where it changes its sign against its rate. */
  poles() {
    const { t, y, y_dot, isFar } = this, found = [[], []];
    for (const row of t.keys()) {
      if (isFar[row]) for (const value of y.slice(Math.max(row - 1, 0), row + 2)) found[+(value > 0)].push(t[row]);
    }
    for (let a = 0; a + 1 < t.length; a++) {
      const rise = y[a + 1] - y[a];
      if (isFar[a] || isFar[a + 1] || !(y[a] * y[a + 1] < 0 && rise * y_dot[a] < 0 && rise * y_dot[a + 1] < 0)) continue;
      let [low, high] = [t[a], t[a + 1]], time = low, most = 0;
      for (let k = 0; k < ROOT_STEPS && high - low > LOCATED * this.span; k++) {
        const middle = (low + high) / 2, value = this.at(middle)[0];
        if (Math.abs(value) > most) [most, time] = [Math.abs(value), middle];
        if (value * y[a] > 0) low = middle; else high = middle;
      }
      if (most > POLE * Math.max(Math.abs(y[a]), Math.abs(y[a + 1]))) for (const times of found) times.push(time);
    }
    return found;
  }

  /* The extremes of an output with poles; it has no mean. */
  unbounded(below, above) {
    const { t, y, isFar, name, unit } = this;
    const best = sign => [...t.keys()].filter(row => !isFar[row]).reduce((k, row) => (sign * y[row] > sign * y[k] ? row : k));
    const [tLeast, least] = below.length ? [Math.min(...below), -Infinity] : [t[best(-1)], y[best(-1)]];
    const [tGreatest, greatest] = above.length ? [Math.min(...above), Infinity] : [t[best(1)], y[best(1)]];
    return { name, unit, least, tLeast, greatest, tGreatest, dead: [], period: null, rests: () => [0, 0], timeRatio: null, mean: NaN, rms: Infinity };
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

  /* The output at any time, by the polynomial of fifth degree of a step, as results/shapes.py has it. */
  between(t) {
    let [a, b] = [0, this.t.length - 1];
    while (b - a > 1) {
      const middle = (a + b) >> 1;
      if (this.t[middle] <= t) a = middle; else b = middle;
    }
    const h = this.t[b] - this.t[a] || 1, s = (t - this.t[a]) / h, r = 1 - s;
    const slope = (this.y_dot[b] - this.y_dot[a]) / h;
    const [first, last] = [a, b].map(row => (Number.isFinite(this.y_ddot[row]) ? this.y_ddot[row] : slope));
    return r ** 3 * ((1 + 3 * s + 6 * s * s) * this.y[a] + h * s * (1 + 3 * s) * this.y_dot[a] + h * h * s * s / 2 * first)
      + s ** 3 * ((1 + 3 * r + 6 * r * r) * this.y[b] - h * r * (1 + 3 * r) * this.y_dot[b] + h * h * r * r / 2 * last);
  }

  /* The longest time for which it is within a distance of a level; a motion that ends as it began goes on. */
  rest(level, within, dead) {
    const isNear = t => Math.abs(this.between(t) - level) <= within * (1 + 1e-9);
    const steps = this.t.slice(1).flatMap((t, a) => equalParts(this.t[a], t, STEP_PARTS).slice(0, -1));
    const times = [...steps, this.t[this.t.length - 1], ...dead].sort((a, b) => a - b);
    const edges = [];  // where it comes near, and where it goes
    for (let k = 0; k + 1 < times.length; k++) {
      let [low, high] = [times[k], times[k + 1]];
      const wasNear = isNear(low);
      if (wasNear === isNear(high)) continue;
      for (let halvings = 0; halvings < ROOT_STEPS; halvings++) {
        const middle = (low + high) / 2;
        if (isNear(middle) === wasNear) low = middle; else high = middle;
      }
      edges.push((low + high) / 2);
    }
    const [start, end] = [times[0], times[times.length - 1]], last = this.t.length - 1;
    if (isNear(start)) edges.unshift(start);
    if (edges.length % 2) edges.push(end);
    const rests = [];
    for (let k = 0; k < edges.length; k += 2) rests.push(edges[k + 1] - edges[k]);
    const isSame = (list, size) => Math.abs(list[last] - list[0]) <= REPEATS * size;
    const goesOn = rests.length > 1 && isNear(start) && isNear(end)
      && isSame(this.y, Math.max(...this.y) - Math.min(...this.y)) && isSame(this.y_dot, this.most);
    if (goesOn) rests.push(rests[0] + rests[rests.length - 1]);
    return Math.max(0, ...rests);
  }

  measures() {
    const [below, above] = this.poles();
    if (below.length || above.length) return this.unbounded(below, above);
    const dead = this.deadPoints(), period = this.period(dead), [mean, square] = this.means();
    const [[tLeast, least], [tGreatest, greatest]] = [this.extreme(dead, -1), this.extreme(dead, 1)];
    return {
      name: this.name, unit: this.unit, least, tLeast, greatest, tGreatest, dead, period,
      rests: part => [least, greatest].map(level => this.rest(level, part * (greatest - least), dead)),
      timeRatio: this.timeRatio(dead, period), mean, rms: Math.sqrt(Math.max(square, 0)),
    };
  }
}

/* Which values lie on a pole, as those of a ratio of rates. */
function farOf(values) {
  const sizes = values.map(x => (Number.isFinite(x) ? Math.abs(x) : 0)).sort((a, b) => a - b), half = sizes.length / 2;
  const middle = (sizes[Math.floor(half)] + sizes[Math.ceil(half) - 1]) / 2;
  return values.map(x => Math.abs(x) === Infinity || (middle > 0 && Math.abs(x) > middle / STILL));
}

function largestOf(values) {
  return values.reduce((most, x) => (Math.abs(x) > most ? Math.abs(x) : most), 0);
}

/* The measures of all outputs of a motion. */
function measuresOf(motion) {
  return player.data.outputs.map((_, k) => new OutputMotion(motion, k)).filter(({ t }) => t.length)
    .map(output => output.measures());
}

export function shortNumber(value) {
  if (Math.abs(value) === Infinity) return value > 0 ? '∞' : '−∞';
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

/** @type {[string, (item: any) => string][]} */
const PATH_MEASURES = [
  ['off a line', item => shortNumber(item.straight)],
  ['its angle', item => `${shortNumber(item.angle * units.factor('rad'))} ${units.name('rad')}`],
  ['off a circle', item => shortNumber(item.round)],
  ['its radius', item => shortNumber(item.radius)],
  ['its centre', item => item.centre.map(shortNumber).join(', ')],
];

export function equalParts(first, last, count) {
  return [...Array(count + 1).keys()].map(k => first + k / count * (last - first));
}

/* The line and the circle of least squares of a path (x, y) over a part of the motion. */
function pathMeasures(x, y, from, to) {
  const count = STEP_PARTS * Math.max(x.t.filter(t => t > from && t < to).length + 1, 4);
  const places = equalParts(from, to, count).map(t => [x.between(t), y.between(t)]);
  const mean = of => places.reduce((sum, place) => sum + of(place), 0) / places.length;
  const middle = [mean(p => p[0]), mean(p => p[1])];
  const moment = (f, g) => mean(p => f(p[0] - middle[0], p[1] - middle[1]) * g(p[0] - middle[0], p[1] - middle[1]));
  const [u, v, square] = [(a, b) => a, (a, b) => b, (a, b) => a * a + b * b];
  const [xx, xy, yy] = [moment(u, u), moment(u, v), moment(v, v)];
  const angle = Math.atan2(2 * xy, xx - yy) / 2, [c, s] = [Math.cos(angle), Math.sin(angle)];
  const most = of => places.reduce((found, p) => Math.max(found, Math.abs(of(p))), 0);
  const straight = most(([a, b]) => c * (b - middle[1]) - s * (a - middle[0]));
  const solve = (a, b, d, e, f) => [(e * d - b * f) / (a * d - b * b), (a * f - b * e) / (a * d - b * b)];
  let centre = solve(xx, xy, yy, moment(u, square) / 2, moment(v, square) / 2).map((value, k) => value + middle[k]);
  const away = p => Math.hypot(p[0] - centre[0], p[1] - centre[1]);
  let radius = mean(away);
  for (let step = 0; step < ROOT_STEPS; step++) {
    const way = k => p => (p[k] - centre[k]) / away(p), n = [mean(way(0)), mean(way(1))];
    const sum = (f, g) => mean(p => f(p) * g(p)), off = [0, 1].map(k => p => way(k)(p) - n[k]);
    const left = p => away(p) - radius;
    const move = solve(sum(off[0], off[0]), sum(off[0], off[1]), sum(off[1], off[1]), sum(off[0], left), sum(off[1], left));
    if (!move.every(Number.isFinite)) break;
    centre = centre.map((value, k) => value + move[k]);
    radius = mean(away);
    if (Math.hypot(...move) <= 1e-15 * radius) break;
  }
  return { straight, angle: Math.abs(angle) < 1e-12 ? 0 : angle, round: most(p => away(p) - radius), radius, centre };
}

/* The Grashof type of a four-bar, as kincompile/runtime/results/grashof.py finds it. */
function grashofOf({ joints, links, lengths }) {
  const { roles, triple, change, same } = player.data.grashof, least = Math.min(...lengths);
  const around = lengths.reduce((sum, length) => sum + length), shortest = lengths.indexOf(least);
  const margin = around - 2 * (least + Math.max(...lengths));
  const isChange = Math.abs(margin) <= same * around;
  const type = isChange ? change : margin > 0 ? roles[shortest] : triple;
  const full = isChange || margin < 0 ? [] : shortest ? [links[shortest]] : links.slice(1);
  return { name: joints.join(' '), type, shortest: links[shortest], margin, full };
}

/* The four-bars whose links have lengths, with the parameters that are shown. */
function fourBarsOf() {
  return player.data.drawing.four_bars.filter(({ lengths }) => Math.min(...lengths) > 0).map(grashofOf);
}

/** @type {[string, (item: any) => string][]} */
const GRASHOF = [
  ['Grashof type', ({ type }) => type], ['shortest', ({ shortest }) => shortest],
  ['p + q − s − l', ({ margin }) => shortNumber(margin)], ['turns wholly', ({ full }) => full.join(', ') || '–'],
];

export const measures = {
  solved: null,  // the motion whose measures are shown
  within: 0.01,  // part of its stroke by which an output at rest may be off
  part: [0, 1],  // of the motion, where paths are compared

  build(panel) {
    this.holder = document.createElement('div');
    const bar = document.createElement('p');
    const box = (name, value, take) => {
      const input = document.createElement('input');
      Object.assign(input, { type: 'number', ariaLabel: name, value, min: 0, max: 100, step: 'any' });
      input.style.width = '4.5em';
      input.addEventListener('change', () => {
        if (!(input.valueAsNumber >= 0 && input.valueAsNumber <= 100)) return;
        take(input.valueAsNumber / 100);
        this.solved = null;
        this.show();
      });
      return input;
    };
    bar.append('At rest within ', box('at rest within', 1, x => { this.within = x; }), ' % of the stroke; paths from ',
      box('paths from', 0, x => { this.part[0] = x; }), ' to ', box('paths to', 100, x => { this.part[1] = x; }), ' % of the time');
    panel.append(bar, this.holder);
  },

  /* One table for each output, path and four-bar: [{ name, unit, rows: [title, texts of each motion] }]. */
  blocks(shown) {
    const names = player.data.outputs.map(({ name }) => name), order = named(player.data).map(({ name }) => name);
    const motions = shown.map(item => item.motion), found = motions.map(measuresOf), [first] = found;
    const texts = (k, textOf) => found.map(items => (items[k] ? textOf(items[k]) : '–'));
    const outputs = first.map(({ name, unit }, k) => ({ name, unit, rows: [
      ...MEASURES.map(([title, textOf]) => [title, texts(k, textOf)]),
      ...['min', 'max'].map((end, side) => [`rests at ${end} [s]`, texts(k, item => shortNumber(item.rests(this.within)[side]))]),
    ] }));
    outputs.sort((a, b) => order.indexOf(a.name) - order.indexOf(b.name));
    const points = names.flatMap((name, k) => (name.startsWith('x_') ? [[name.slice(2), k, names.indexOf(`y_${name.slice(2)}`)]] : []))
      .filter(([name, , y]) => y >= 0 && !names.includes(`z_${name}`));
    const paths = points.map(([name, ...columns]) => {
      const each = motions.map(motion => this.path(...columns.map(k => new OutputMotion(motion, k))));
      return { name: `path of ${name}`, unit: player.data.outputs[columns[0]].unit,
        rows: PATH_MEASURES.map(([title, textOf]) => [title, each.map(item => (item ? textOf(item) : '–'))]) };
    });
    const types = shown.map(({ setting }) => (setting ? settings.as(setting, fourBarsOf) : fourBarsOf()));
    const fourBars = types[0].map(({ name }) => {
      const own = types.map(list => list.find(item => item.name === name));
      return { name: `four-bar ${name}`, unit: '', rows: GRASHOF.map(([title, textOf]) => [title, own.map(item => (item ? textOf(item) : '–'))]) };
    });
    return [...outputs, ...paths, ...fourBars];
  },

  /* What is found of the part of a path; null where there is none. */
  path(x, y) {
    const [start, end] = [x.t[0], x.t[x.t.length - 1]], [from, to] = this.part.map(part => start + part * (end - start));
    return to > from ? pathMeasures(x, y, from, to) : null;
  },

  /* Of the motion that the page solved for last; the one it was made with is solved for once. */
  show() {
    const motion = live.motionNow();
    if (motion === this.solved && units.angle === this.angle) return;
    this.solved = motion;
    this.angle = units.angle;
    const shown = [{ name: 'now', motion, colour: stage.palette.plot },
      ...settings.kept.map(setting => ({ ...setting, setting, colour: settings.colourOf(setting) }))];
    this.tables = this.blocks(shown).map(({ name, unit, rows }) => {
      const table = tableOf(['', ...shown.map(item => item.name)]);
      if (shown.length === 1) table.tHead.remove();
      else shown.forEach(({ colour }, k) => { table.tHead.rows[0].cells[k + 1].style.color = colour; });
      table.createCaption().append(...(name.includes(' ') ? [name] : symbolNodes(name)), unit ? ` [${units.name(unit)}]` : '');
      for (const [title, texts] of rows) table.tBodies[0].insertRow().append(cell(title, 'th'), ...texts.map(text => cell(text)));
      return [name, wide(table)];
    });
    const holder = document.createElement('div');
    holder.className = 'blocks';
    holder.append(...this.tables.map(([, element]) => element));
    this.holder.replaceChildren(rowFinder('Find a measure', () => this.tables), holder);
  },
};
