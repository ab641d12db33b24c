/* The model on the page: its file, what the file means, its motion, and what is said of it.  No document. */

import { Bound, structureOf } from './bound.js';
import { FormulaError } from './formula.js';
import { newFile } from './edits.js';
import { History } from './history.js';
import { isDriver, ModelProblem, modelOf } from './sketched.js';
import { FileError, readToml } from './toml.js';

const MOST_COORDINATES = 150;  // as a page
const TRIES = 48;  // starts from which other assemblies are looked for
const SAME_ASSEMBLY = 1e-6;  // of a scale, up to which two positions are one

export class Editing {
  constructor(file = newFile()) {
    /** @type {Object<string, string>} */
    this.sentences = {};  // of events
    this.open(file);
    this.history = new History(() => JSON.stringify(this.file), text => {
      this.file = plain(JSON.parse(text));
      this.refresh();
    });
  }

  /** Take a file as text; a mistake leaves what was there. @param {string} text */
  openText(text) {
    const file = text.trimStart().startsWith('{') ? plain(JSON.parse(text)) : readToml(text);
    if (file.kincompile !== 1) throw new FileError('The file is no model of kincompile. Open one that begins with "kincompile = 1".');
    const model = modelOf(file);
    if (3 * model.bodies.length > MOST_COORDINATES) throw new FileError(`The model has ${model.bodies.length} bodies. Open one of at most ${MOST_COORDINATES / 3}.`);
    this.replace(file);
  }

  /* Take another file: a step of undo. */
  replace(file) {
    this.history.take();
    this.open(file);
    this.history.take();
  }

  open(file) {
    this.file = file;
    this.bound = null;
    this.refresh();
  }

  /** Change the file; a step of undo unless it goes on, as a pull does until it is let go.
   * @param {(file: any) => any} edit @param {{ goesOn?: boolean }} [how] */
  edit(edit, { goesOn = false } = {}) {
    const before = JSON.stringify(this.file);
    if (!goesOn) this.history.take();
    let said;
    try {
      said = edit(this.file);
    } catch (error) {
      this.file = plain(JSON.parse(before));
      this.refresh();
      throw error;
    }
    this.refresh();
    if (!goesOn) this.history.take();
    return said;
  }

  /* Find what the file means, and solve it. */
  refresh() {
    this.problem = '';
    try {
      this.model = modelOf(this.file);
      this.solve();
    } catch (error) {
      if (!(error instanceof ModelProblem || error instanceof FormulaError)) throw error;
      this.problem = error.message;
      this.motion = null;
    }
  }

  solve() {
    const { model } = this;
    this.motion = this.event = null;
    if (!model.bodies.length) {
      this.bound = null;
      return;
    }
    const structure = structureOf(model), isSame = this.bound && this.structure === structure && this.bound.factors;
    if (isSame) {
      this.bound.take(model);
      this.run();
      if (this.motion.failed?.index !== 0) return;
      this.motion = this.event = null;
      this.bound.judge(model);
    } else this.bound = new Bound(model);
    this.structure = structure;
    if (this.bound.factors) this.run();
  }

  run() {
    const { model, bound } = this, last = Math.max(model.count - 1, 1);
    const times = Float64Array.from({ length: model.count }, (_, k) => model.end * k / last);
    this.motion = bound.solver.solve(bound, times);
    this.event = bound.solver.explain(this.motion);
  }

  /** Coordinates at a time of the grid: the last that were found. */
  stateAt(index) {
    const { motion, bound } = this;
    if (!bound) return new Float64Array(0);
    const n = bound.N_COORDINATES;
    for (let k = Math.min(index, motion ? motion.t.length - 1 : -1); k >= 0; k--) {
      const q = motion.q.subarray(k * n, (k + 1) * n);
      if (q.every(Number.isFinite)) return q;
    }
    return bound.start.q;
  }

  /** Other ways to assemble the mechanism at the first time, found from many starts.
   * @returns {Float64Array[]} the first is the one that is shown */
  assemblies() {
    const { bound } = this, found = [Float64Array.from(this.stateAt(0))];
    if (!bound?.factors || (this.motion?.failed?.index === 0)) return [];
    const scales = bound.scales, angle = k => 2 * Math.PI * ((k * 0.6180339887498949) % 1);
    for (let k = 1; k <= TRIES; k++) {
      const guess = found[0].map((x, j) => (bound.ANGULAR[j] ? x + angle(k * (j + 1)) : x + scales[j] * kernels.probe[(k + j) % kernels.probe.length]));
      const { q, isFound } = bound.assembledAt(0, guess);
      const isSame = other => q.every((x, j) => {
        const away = x - other[j], whole = bound.ANGULAR[j] ? 2 * Math.PI * Math.round(away / (2 * Math.PI)) : 0;
        return Math.abs(away - whole) <= SAME_ASSEMBLY * scales[j];
      });
      if (isFound && !found.some(isSame)) found.push(q);
    }
    return found;
  }

  /** What `inspect` says: counts, rank, what is free, what repeats, where it locks up.
   * @returns {{ isGood: boolean, lines: string[] }} */
  findings() {
    const { model, bound, motion, problem } = this;
    if (problem) return { isGood: false, lines: [problem] };
    if (!bound) return { isGood: true, lines: ['Draw a link: press the pointer where it begins, and let go where it ends.'] };
    const n = bound.N_COORDINATES, drives = model.constraints.filter(item => isDriver(item));
    const driven = drives.length, joints = bound.N_EQUATIONS - driven, degrees = n - bound.rank;
    const lines = [
      `${n} coordinates, ${joints} joint equations: ${counted(n - joints, 'degree')} of freedom by Gruebler's count, ${counted(driven, 'driver equation')}.`,
      `Rank ${bound.rank} at generic ${bound.isAssembled ? 'assembled ' : ''}states: ${degrees ? `${counted(degrees, 'degree')} of freedom left to ${this.owners(bound.free)}` : 'nothing may move by itself'}.`,
    ];
    if (bound.REDUNDANT.length) lines.push(`Redundant${bound.isAssembled ? '' : ' or conflicting'}: ${bound.REDUNDANT.join(', ')}.`);
    if (!bound.isAssembled) lines.push('It cannot be assembled at t = 0, or not from this drawing. Change the lengths or the drivers so that the links reach each other.');
    else if (bound.rankAtStart < bound.rank) lines.push('Singular at t = 0, a dead point or a change point: velocities are not determined there. Let the drivers start from another position, or drive another body.');
    if (degrees && bound.isAssembled) lines.push(`It moves as soon as ${counted(degrees, 'driver')} ${degrees > 1 ? 'are' : 'is'} there: press Driver, then a link.`);
    if (this.event) lines.push(this.eventText());
    else if (motion?.failed && bound.isAssembled) lines.push(`No position was found at t = ${brief(motion.t[motion.failed.index])}. Change a length or a driver.`);
    return { isGood: Boolean(motion && !motion.failed), lines };
  }

  eventText() {
    const { kind, t, bodies } = this.event, { sentences } = this;
    const later = this.motion.failed ? brief(this.motion.failed.t) : '';
    return (sentences?.[kind] ?? kind).replace(/\{(\w+)\}/g, (_, name) => ({ t: brief(t), bodies: bodies.join(', '), later })[name]);
  }

  owners(columns) {
    const { BODIES, COORDINATES } = this.bound;
    return [...new Set(columns.map(k => BODIES.find(([, first, count]) => k >= first && k < first + count)?.[0] ?? COORDINATES[k]))].join(', ');
  }
}

const brief = x => `${Number(x.toPrecision(6))}`;
const counted = (count, what) => `${count} ${what}${count === 1 ? '' : 's'}`;

/* Objects of JSON without a prototype, as those of TOML are. */
function plain(value) {
  if (Array.isArray(value)) return value.map(plain);
  if (typeof value !== 'object' || value === null) return value;
  return Object.assign(Object.create(null), Object.fromEntries(Object.entries(value).map(([key, inner]) => [key, plain(inner)])));
}
