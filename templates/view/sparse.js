/* Factors of a sparse matrix whose pattern stays while its numbers change.

   An order of pivots is chosen once, by numbers and by what it fills in (Markowitz).  From it follow a
   list of products that every factorization goes through.  Where a factor grows too large the order is
   chosen again. */

const LARGE_ENOUGH = 0.1;  // part of the largest in its row that a pivot has at least
const TOO_LARGE = 1e4;  // of a factor, after which the order is chosen again
const NO_PIVOT = 1e-9;  // part of a row's own size up to which what is left of it is rounding

/** An order of pivots, and the work that follows from it.
 * @param {number[][]} pattern row and column of each entry
 * @param {ArrayLike<number>} entries
 * @param {number} rowCount @param {number} columnCount
 * @param {number[]} scales of the columns
 * @returns {{ rank: number, rows: number[], columns: number[], left: number[] }} pivots in order; rows without one */
export function pivotsOf(pattern, entries, rowCount, columnCount, scales) {
  const rows = Array.from({ length: rowCount }, () => new Map());
  pattern.forEach(([i, j], k) => rows[i].set(j, (rows[i].get(j) ?? 0) + entries[k] * scales[j]));
  const largestOf = row => Math.max(0, ...[...row.values()].map(Math.abs));
  const sizes = rows.map(row => largestOf(row) || 1), waiting = new Set(rows.keys());
  const found = { rank: 0, rows: [], columns: [], left: [] };
  for (;;) {
    const counts = new Int32Array(columnCount);
    for (const i of waiting) for (const j of rows[i].keys()) counts[j] += 1;
    let best = null;
    for (const i of waiting) {
      const most = largestOf(rows[i]);
      if (!(most > NO_PIVOT * sizes[i])) continue;
      for (const [j, x] of rows[i]) {
        if (Math.abs(x) < LARGE_ENOUGH * most) continue;
        const cost = (rows[i].size - 1) * (counts[j] - 1), size = Math.abs(x) / sizes[i];
        if (!best || cost < best.cost || (cost === best.cost && size > best.size)) best = { i, j, cost, size };
      }
    }
    if (!best) break;
    const { i, j } = best, own = rows[i], pivot = own.get(j);
    waiting.delete(i);
    for (const other of waiting) {
      if (!rows[other].has(j)) continue;
      const part = rows[other].get(j) / pivot;
      rows[other].delete(j);
      for (const [k, x] of own) if (k !== j) rows[other].set(k, (rows[other].get(k) ?? 0) - part * x);
    }
    found.rows.push(i);
    found.columns.push(j);
    found.rank += 1;
  }
  found.left = [...waiting].sort((a, b) => a - b);
  return found;
}

/** Factors of a matrix by an order of pivots; `kept` are the rows that count, one for each column. */
export class Factors {
  /** @param {number[][]} pattern @param {number[]} kept @param {number[]} scales of the columns */
  constructor(pattern, kept, scales) {
    this.n = kept.length;
    this.scales = scales;
    this.kept = kept;
    const place = new Map(kept.map((row, k) => [row, k]));
    this.entries = [...pattern.keys()].filter(k => place.has(pattern[k][0]));
    this.pattern = this.entries.map(k => [place.get(pattern[k][0]), pattern[k][1]]);
    this.work = new Float64Array(this.n);
    this.determinant = 0;
    this.steps = this.lower = this.upper = new Int32Array(0);  // what is done, as places
  }

  /* Choose the order for a matrix, and list what is to be done. */
  plan(Phi_q) {
    const { n, pattern } = this, found = pivotsOf(pattern, this.entries.map(k => Phi_q[k]), n, n, this.scales);
    const missing = [...Array(n).keys()].filter(j => !found.columns.includes(j));
    const rows = [...found.rows, ...found.left], columns = [...found.columns, ...missing];
    this.rowOrder = Int32Array.from(rows, row => this.kept[row]);
    this.columnOrder = Int32Array.from(columns);
    const rowPlace = inverseOf(rows), columnPlace = inverseOf(columns);
    this.sign = parityOf(rows) * parityOf(columns);
    const filled = Array.from({ length: n }, () => new Set());
    for (const [i, j] of pattern) filled[rowPlace[i]].add(columnPlace[j]);
    for (let k = 0; k < n; k++) {
      filled[k].add(k);
      for (let i = k + 1; i < n; i++) if (filled[i].has(k)) for (const j of filled[k]) if (j > k) filled[i].add(j);
    }
    this.list(filled, pattern.map(([i, j]) => [rowPlace[i], columnPlace[j]]));
  }

  /* The places of entries, and the products in order: pivot, rows below, columns beyond. */
  list(filled, placed) {
    const { n } = this, places = filled.map(() => new Map());
    let count = 0;
    filled.forEach((row, i) => [...row].sort((a, b) => a - b).forEach(j => places[i].set(j, count++)));
    this.lu = new Float64Array(count);
    this.scatter = Int32Array.from(placed, ([i, j]) => places[i].get(j));
    const steps = [], lower = [], upper = [];
    for (let k = 0; k < n; k++) {
      const below = [...Array(n).keys()].filter(i => i > k && places[i].has(k));
      const beyond = [...places[k].keys()].filter(j => j > k);
      steps.push(places[k].get(k), below.length, beyond.length, ...beyond.map(j => places[k].get(j)));
      for (const i of below) steps.push(places[i].get(k), ...beyond.map(j => places[i].get(j)));
      lower.push(below.length, ...below.flatMap(i => [i, places[i].get(k)]));
    }
    for (let k = n - 1; k >= 0; k--) {
      const beyond = [...places[k].keys()].filter(j => j > k);
      upper.push(k, places[k].get(k), beyond.length, ...beyond.flatMap(j => [j, places[k].get(j)]));
    }
    [this.steps, this.lower, this.upper] = [steps, lower, upper].map(x => Int32Array.from(x));
  }

  factor(Phi_q) {
    if (!this.lu) this.plan(Phi_q);
    if (this.eliminate(Phi_q)) return;
    this.plan(Phi_q);
    this.eliminate(Phi_q);
  }

  /* Go through the products; return whether no factor was too large. */
  eliminate(Phi_q) {
    const { lu, steps, scatter, entries, n } = this;
    lu.fill(0);
    for (let k = 0; k < entries.length; k++) lu[scatter[k]] += Phi_q[entries[k]];
    let at = 0, determinant = this.sign, largest = 0;
    for (let k = 0; k < n; k++) {
      const pivot = lu[steps[at]], rows = steps[at + 1], columns = steps[at + 2], first = at + 3;
      determinant *= pivot;
      at = first + columns;
      for (let i = 0; i < rows; i++) {
        const part = lu[steps[at]] /= pivot;
        if (part > largest) largest = part;
        else if (-part > largest) largest = -part;
        for (let j = 0; j < columns; j++) lu[steps[at + 1 + j]] -= part * lu[steps[first + j]];
        at += 1 + columns;
      }
    }
    this.determinant = determinant;
    return largest <= TOO_LARGE;
  }

  solve(right, to) {
    const { work: y, lu, lower, upper, rowOrder, columnOrder, n } = this;
    for (let k = 0; k < n; k++) y[k] = right[rowOrder[k]];
    for (let k = 0, at = 0; k < n; k++) {
      const count = lower[at++], value = y[k];
      for (let i = 0; i < count; i++, at += 2) y[lower[at]] -= lu[lower[at + 1]] * value;
    }
    for (let step = 0, at = 0; step < n; step++) {
      const k = upper[at], pivot = upper[at + 1], count = upper[at + 2];
      at += 3;
      let value = y[k];
      for (let j = 0; j < count; j++, at += 2) value -= lu[upper[at + 1]] * y[upper[at]];
      y[k] = value / lu[pivot];
    }
    for (let k = 0; k < n; k++) to[columnOrder[k]] = y[k];
  }
}

function inverseOf(order) {
  const found = new Int32Array(order.length);
  order.forEach((from, k) => { found[from] = k; });
  return found;
}

/* 1 or -1: whether an order is reached by an even number of exchanges. */
function parityOf(order) {
  const seen = new Set();
  let sign = 1;
  for (const start of order.keys()) {
    for (let k = order[start]; !seen.has(start) && k !== start; k = order[k]) {
      seen.add(k);
      sign = -sign;
    }
    seen.add(start);
  }
  return sign;
}
