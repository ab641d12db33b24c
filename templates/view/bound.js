/* Bodies and constraints with numbers as what the emitted solver takes: each constraint is an instance
   of its type's emitted kernel, bound to coordinates of its bodies and to numbers.

   `Bound` has the constants and functions of an emitted module: position_at, nu_at, factor_at, ...  Where
   only numbers change it takes others and stays, with all that the browser has learnt to do fast. */

import { Factors } from './sparse.js';

const LETTERS = ['x', 'y', 'phi'];
const RANK_TOLERANCE = 1e-8;  // part of a row's own size up to which it depends on others
const GENERIC_TIMES = [0.037, 0.113, 0.291];  // parts of the whole time at which positions are looked at
const STIR = 0.05;  // of a size and a radian, by which positions are changed to find another one

export class Bound {
  /** @param {any} model what `modelOf` gives */
  constructor(model) {
    this.NAME = model.name;
    this.BODIES = model.bodies.map(({ name }, k) => [name, 3 * k, 3]);
    this.COORDINATES = model.bodies.flatMap(({ name }) => LETTERS.map(letter => `${letter}_${name}`));
    this.EQUATIONS = [];
    this.PATTERN = [];
    this.OUTPUTS = [];
    this.DEFAULTS = new Float64Array(0);
    this.bind(model);
    this.N_COORDINATES = this.COORDINATES.length;
    this.N_EQUATIONS = this.EQUATIONS.length;
    const n = this.N_COORDINATES, m = this.N_EQUATIONS, owned = 3 * model.bodies.length;
    this.ANGULAR = this.COORDINATES.map((_, k) => k >= owned || k % 3 === 2);
    this.MAY_TURN = this.ANGULAR;
    this.COVER = this.COORDINATES.map(() => n);
    this.PROBE = kernels.probe.slice(0, Math.max(n, m));
    this.IS_REDUNDANT = this.EQUATIONS.map(() => false);
    this.rank = this.rankAtStart = 0;
    this.isAssembled = false;
    /** @type {any} */
    this.start = null;  // the position at the first time
    /** @type {number[]} */
    this.free = [];  // columns that may still move
    /** @type {number[]} */
    this.scales = [];
    for (const name of ['point', 'position_at', 'nu_at', 'gamma_at', 'factor_at', 'solve_at', 'rows_of']) this[name] = this[name].bind(this);
    this.take(model);
    this.solver = kernels.solverOf(this);
    this.judge(model);
  }

  /* Give each constraint its rows, and places for what it reads. */
  bind({ bodies, constraints }) {
    const contacts = [];
    for (const { type, name } of constraints) {
      const found = kernels.types[type].contacts;
      contacts.push(found.map((_, k) => this.COORDINATES.length + k));
      this.COORDINATES.push(...found.map(index => (found.length > 1 ? `alpha_${index}_${name}` : `alpha_${name}`)));
    }
    const n = this.COORDINATES.length, frames = 2 * n, zero = frames + 2 * bodies.length, one = zero + 1;
    let free = one + 1;
    this.frames = bodies.map((_, k) => [3 * k, frames + 2 * k]);
    this.instances = constraints.map(({ type, name, frames: owners }, k) => {
      const kernel = kernels.types[type], row = this.EQUATIONS.length, slots = new Map();
      this.EQUATIONS.push(...kernel.rows.length ? kernel.rows.map(each => `${name}.${each}`) : [name]);
      const columnOf = (owner, component) => {
        if (owner >= kernel.frames) return contacts[k][owner - kernel.frames];
        return owners[owner] < 0 ? -1 : 3 * owners[owner] + component;
      };
      const slotOf = (symbol, size) => {
        if (!slots.has(symbol)) {
          slots.set(symbol, free);
          free += size;
        }
        return slots.get(symbol);
      };
      const from = Int32Array.from(kernel.inputs, ([kind, which, component, order]) => {
        if (kind === 'attribute') return slotOf(which, 2) + component;
        if (kind === 'function') return slotOf(which, 4) + component;
        if (kind === 'frame') return owners[which] < 0 ? (component ? zero : one) : frames + 2 * owners[which] + component;
        const column = columnOf(which, component);
        return column < 0 ? zero : order * n + column;
      });
      const places = kernel.pattern.map(([i, j]) => {
        const column = columnOf(Math.min(Math.floor(j / 3), kernel.frames) + Math.max(0, j - 3 * kernel.frames), j % 3);
        return column < 0 ? -1 : this.PATTERN.push([row + i, column]) - 1;
      });
      const owner = symbol => kernel.inputs.find(([kind, which]) => kind === 'function' && which === symbol)[3];
      return { kernel, row, from, places, slots, columnOf: symbol => (owner(symbol) === null ? -1 : columnOf(owner(symbol), 0)) };
    });
    // What is on the ground has one place, behind all others.
    for (const item of this.instances) item.places = Int32Array.from(item.places, k => (k < 0 ? this.PATTERN.length : k));
    this.values = new Float64Array(free);
    this.values[one] = 1;
  }

  /** Take the numbers of a model of the same structure. */
  take({ bodies, constraints, end }) {
    const guess = bodies.flatMap(body => body.guess);
    this.functions = [];
    constraints.forEach(({ numbers, functions, guess: own }, k) => {
      const { slots, columnOf, kernel } = this.instances[k];
      for (const [symbol, given] of Object.entries(numbers)) if (slots.has(symbol)) this.values.set(given, slots.get(symbol));
      for (const [symbol, jet] of Object.entries(functions)) this.functions.push({ slot: slots.get(symbol), jet, column: columnOf(symbol) });
      guess.push(...kernel.contacts.map((_, c) => own[c] ?? 0));
    });
    this.GUESS = Float64Array.from(guess);
    this.CORNERS = constraints.some(item => item.corners);
    this.end = end;
  }

  /** Find which equations repeat others, at positions without anything special, and order the pivots. */
  judge({ constraints }) {
    const n = this.N_COORDINATES, drives = new Set();
    constraints.forEach(({ functions }, k) => {
      if (Object.values(functions).some(jet => jet(0.1)[1] || jet(0.37)[1])) drives.add(this.instances[k].row);
    });
    this.factors = null;
    // Until it is known which equations repeat others, as many as are too many are left out of rates.
    this.REDUNDANT = this.EQUATIONS.slice(n);
    const ordered = [...Array(this.N_EQUATIONS).keys()].sort((a, b) => Number(drives.has(a)) - Number(drives.has(b)) || a - b);
    const start = this.assembledAt(0, this.GUESS);
    const stirred = part => start.q.map((x, i) => x + STIR * part * this.PROBE[i] * (this.ANGULAR[i] ? 1 : start.size));
    const states = [start, ...GENERIC_TIMES.map((part, k) => this.assembledAt(part * this.end, stirred(k)))].filter(state => state.isFound);
    // One position alone may be singular: then links of other lengths say what is redundant.
    if (states.length < 2) states.push({ ...start, q: stirred(1) });
    const ranks = states.map(state => this.rankAt(state, ordered));
    const best = ranks.reduce((most, found) => (found && found.kept.length > (most?.kept.length ?? -1) ? found : most), null) ?? this.rankAt(start, ordered);
    Object.assign(this, { start, rank: best.kept.length, free: best.free, isAssembled: start.isFound });
    this.rankAtStart = start.isFound ? ranks[0].kept.length : this.rank;
    const kept = new Set(best.kept);
    const redundant = this.EQUATIONS.map((_, i) => !kept.has(i));
    if (redundant.some((is, i) => is !== this.IS_REDUNDANT[i])) {
      this.IS_REDUNDANT = redundant;
      this.solver = kernels.solverOf(this);
    }
    this.REDUNDANT = this.EQUATIONS.filter((_, i) => redundant[i]);
    this.scales = this.ANGULAR.map(is => (is ? 1 : start.size));
    if (this.rank === n) this.factors = new Factors(this.PATTERN, [...kept].sort((a, b) => a - b), this.scales);
  }

  /* A position at a time near another one; the size of the mechanism there. */
  assembledAt(t, guess) {
    const motion = this.solver.solve(this, [t], this.DEFAULTS, guess);
    const size = motion.equations?.size ?? 1;
    return { t, q: motion.q.every(Number.isFinite) ? motion.q : Float64Array.from(guess), isFound: motion.q.every(Number.isFinite), size };
  }

  /* Rows that do not depend on those before them, and the columns that they leave free. */
  rankAt({ t, q, size }, ordered) {
    const at = this.point();
    at.q.set(q);
    at.t = t;
    this.position_at(at);
    const n = this.N_COORDINATES, all = this.rows_of(at), scales = this.ANGULAR.map(is => (is ? 1 : size));
    const reduced = [], kept = [];
    for (const i of ordered) {
      const row = all[i].map((x, j) => x * scales[j]), own = Math.max(...row.map(Math.abs));
      for (const { pivot, values } of reduced) {
        const part = row[pivot] / values[pivot];
        if (part) for (let j = 0; j < n; j++) row[j] = j === pivot ? 0 : row[j] - part * values[j];
      }
      const pivot = row.reduce((best, x, j) => (Math.abs(x) > Math.abs(row[best]) ? j : best), 0);
      if (!(Math.abs(row[pivot]) > RANK_TOLERANCE * own)) continue;
      reduced.push({ pivot, values: row });
      kept.push(i);
    }
    return { kept, free: freeColumns(reduced, n) };
  }

  /* ---- the functions of a point ---- */

  point() {
    const array = size => new Float64Array(size), n = this.N_COORDINATES, m = this.N_EQUATIONS;
    return {
      t: 0, p: this.DEFAULTS, q: array(n), q_dot: array(n), q_ddot: array(n), Phi: array(m), Phi_q: array(this.PATTERN.length + 1),
      nu: array(m), gamma: array(m), F: null, determinants: array(1),
    };
  }

  /* Put what kernels read at a point into the values. */
  read(at) {
    const { values, functions, frames, N_COORDINATES: n } = this;
    values.set(at.q, 0);
    values.set(at.q_dot, n);
    for (let k = 0; k < frames.length; k++) kernels.frame(values, frames[k][0], frames[k][1]);
    for (let k = 0; k < functions.length; k++) {
      const { slot, jet, column } = functions[k], found = jet(column < 0 ? at.t : at.q[column]);
      for (let order = 0; order < 4; order++) values[slot + order] = found[order];
    }
  }

  position_at(at) {
    this.read(at);
    for (const { kernel, from, row, places } of this.instances) kernel.position(this.values, from, row, places, at.Phi, at.Phi_q);
  }

  nu_at(at) {
    this.read(at);
    for (const { kernel, from, row } of this.instances) kernel.nu(this.values, from, row, at.nu);
  }

  gamma_at(at) {
    this.read(at);
    for (const { kernel, from, row } of this.instances) kernel.gamma(this.values, from, row, at.gamma);
  }

  factor_at(at) {
    if (!this.factors) {
      at.determinants[0] = NaN;
      return;
    }
    this.factors.factor(at.Phi_q);
    at.F = this.factors;
    at.determinants[0] = this.factors.determinant;
  }

  solve_at(factors, right, to) {
    if (factors) factors.solve(right, to);
    else to.fill(NaN);
  }

  rows_of(at) {
    const rows = Array.from({ length: this.N_EQUATIONS }, () => new Array(this.N_COORDINATES).fill(0));
    this.PATTERN.forEach(([i, j], k) => { rows[i][j] += at.Phi_q[k]; });
    return rows;
  }

  /* The right side of velocities at a time, for corners of drivers. */
  nu(q, t) {
    const at = this.point();
    at.q.set(q);
    at.t = t;
    this.nu_at(at);
    return Array.from(at.nu);
  }
}

/* Columns in which a movement is possible: those without a pivot, and those that move with them. */
function freeColumns(reduced, n) {
  const pivots = new Set(reduced.map(({ pivot }) => pivot));
  const free = [...Array(n).keys()].filter(j => !pivots.has(j)), moved = new Set(free);
  for (const wanted of free) {
    const direction = new Float64Array(n);
    direction[wanted] = 1;
    for (let k = reduced.length - 1; k >= 0; k--) {
      const { pivot, values } = reduced[k];
      let sum = 0;
      for (let j = 0; j < n; j++) if (j !== pivot) sum += values[j] * direction[j];
      direction[pivot] = -sum / values[pivot];
    }
    const most = Math.max(...direction.map(Math.abs));
    direction.forEach((x, j) => { if (Math.abs(x) > RANK_TOLERANCE * most) moved.add(j); });
  }
  return [...moved].sort((a, b) => a - b);
}

/** What tells mechanisms of one structure from others: for these a `Bound` takes other numbers.
 * @param {any} model */
export function structureOf({ bodies, constraints }) {
  return JSON.stringify([bodies.map(body => body.name), constraints.map(({ type, name, frames }) => [type, name, frames])]);
}
