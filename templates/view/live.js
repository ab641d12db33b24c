/* The mechanism solved again in the page: parameters that are pulled, what they make of motion,
   drawing and messages.

   live.set({ r: 0.12 })  solve again with these values, the others as they are
   live.reset()           back to what the page was made with */

import { player } from './player.js';
import { fitMarks } from './draw.js';
import { AXES, boxOf, hullFor } from '#world';
import { hasMotion, stage } from './stage.js';
import { copied, numberText } from './tables.js';
import { Slider } from './sliders.js';
import { History } from './history.js';
import { settings } from './settings.js';
import { taken } from './taken.js';

// As in kincompile/view/drawing.py: the mechanism's diagonal, and how far a guide is longer than the motion, in sizes of marks.
const PARTS = 50;
const OVERHANG = 3;
const WARM = 120;  // milliseconds after which a page that rests solves once

/* ---- drawing: numbers that depend on parameters or on the motion ---- */

/* Give a drawing the numbers that parameters say. */
export function setNumbers(drawing, p) {
  const at = place => place.reduce((item, key) => item[key], drawing);
  const values = geometry.numbers(0, p);
  geometry.places.forEach((place, k) => { at(place.slice(0, -1))[place[place.length - 1]] = values[k]; });
  for (const { place, radius } of geometry.profiles) {
    const mark = at(place), count = mark.points.length, [x, y] = mark.centre;
    mark.points = mark.points.map((_, k) => {
      const angle = 2 * Math.PI * k / count, [length] = radius(angle, p);
      return [x + length * Math.cos(angle), y + length * Math.sin(angle)];
    });
    // A face is as long as its cam is wide.
    const face = drawing.marks.find(({ joint, style }) => joint === mark.joint && style === 'face');
    const widest = Math.max(...mark.points.map(([a, b]) => Math.hypot(a - x, b - y)));
    if (face) face.at_least = [-widest, widest];
  }
  for (const mark of drawing.marks) if (mark.kind === 'hull') mark.points = hullFor(mark.attached);
}

/* Make rails, barrels and the sizes of marks fit a motion; returns its extent. */
function fitDrawing(drawing, motion) {
  const found = motion.seen.filter(({ isFound }) => isFound);
  const positions = (found.length ? found : motion.states.slice(0, 1)).map(({ q }) => q);
  drawing.overhang = 0;
  fitMarks(motion);
  const box = boxOf(drawing.marks, positions);
  drawing.size = (Math.hypot(...AXES.map((_, k) => box[2 * k + 1] - box[2 * k])) || 1) / PARTS;
  drawing.overhang = OVERHANG * drawing.size;
  fitMarks(motion);
  const pad = 2 * drawing.size;
  return boxOf(drawing.marks, positions).map((x, k) => (k % 2 ? x + pad : x - pad));
}

/* ---- words: as the solver's own messages ---- */

function filled(text, values) {
  return text.replace(/\{(\w+)\}/g, (_, name) => values[name]);
}

function brieflyNumber(value) {
  return `${+value.toPrecision(10)}`;
}

function listed(bodies) {
  const shown = bodies.slice(0, 12).join(', ');
  return bodies.length > 12 ? `${shown} and ${bodies.length - 12} more` : shown;
}

/* A warning about a start on another branch than the guess may mean. */
function doubtOf({ t, other, strays }) {
  const { words } = player.data, said = [strays && words.strays, other && words.other].filter(Boolean);
  const values = { t: brieflyNumber(t[0]), bodies: other && listed(other), sides: '' };
  return said.length ? said.map(text => filled(text, values)).join('. ') + words.remedy : '';
}

/* The event that ended a motion, with its sentence. */
function withSentence(event, motion) {
  const { words } = player.data, bodies = listed(event.bodies);
  const later = motion.failed ? brieflyNumber(motion.failed.t) : '';
  return { ...event, message: filled(words[event.kind], { t: brieflyNumber(event.t), bodies, later }) };
}

/* What is to be said of a motion: that it converged, or where and why it ended. */
function verdictOf(motion, event) {
  const { words, sentences, name } = player.data, { failed, t } = motion;
  if (!failed) {
    const points = t.length > 1 ? `all ${t.length} points` : 'the point';
    const residual = motion.residual.reduce((most, x) => Math.max(most, x), 0).toPrecision(2);
    return filled(words.converged, { name, points, residual: +residual });
  }
  const { index, state, position, status } = failed, [title, general] = splitSentence(sentences[status]);
  const parts = [filled(words.failed, {
    name, t: brieflyNumber(t[index]), point: index + 1, count: t.length, status: title,
  })];
  if (state) {
    const before = filled(words[index > 1 ? 'before' : 'one before'], { before: index });
    const reached = position ? '' : filled(words.followed, { t: brieflyNumber(state.t) });
    parts.push(`${before}${reached}.`);
  }
  if (status === 6) parts.push(words['not assembled']);
  else if (failed.isExhausted) parts.push(words.exhausted);
  else parts.push(event ? event.message : general);
  if (position) parts.push(words.found);
  else if (failed.jumps) parts.push(words.jumps);
  return parts.join(' ');
}

export function splitSentence(text) {
  const place = text.indexOf(': ');
  return [text.slice(0, place), text.slice(place + 2)];
}

/* The first length that is not positive, as a sentence. */
function wrongLength(drawing) {
  for (const { name, distances } of drawing.joints) {
    const wrong = distances.find(value => !(value > 0));
    if (wrong !== undefined) return `${name}: the distance is ${brieflyNumber(wrong)}, but must be positive.`;
  }
  return '';
}

/* ---- what is known of positions: residuals, condition, determinant, each when it is asked for ---- */

function withChecks(arrays, motion) {
  const { solver } = emitted, { equations } = motion, { n } = equations;
  const over = (width, values) => {
    const result = new Float64Array(player.count * width).fill(NaN);
    for (let k = 0; k < player.count; k++) {
      const q = arrays.q.subarray(k * n, (k + 1) * n);
      if (q.every(Number.isFinite)) result.set(values(equations.evaluate(q, player.t[k])), k * width);
    }
    return result;
  };
  const joints = player.data.drawing.joints;
  const lazily = (name, width, values) => {
    if (!(name in arrays)) return;
    let known = null;
    Object.defineProperty(arrays, name, {
      configurable: true, enumerable: true, get: () => (known ??= over(width, values)),
    });
  };
  lazily('residual', joints.length, ({ Phi }) => residualsOf(Phi));
  lazily('determinant', 1, at => [equations.factors(at).determinant]);
  lazily('condition', 1, at => {
    const sizes = solver.linear.singularValues(solver.scaledRows(equations, at)).map(({ size }) => size);
    return [sizes[sizes.length - 1] / sizes[0]];
  });
}

function residualsOf(Phi) {
  return player.data.drawing.joints.map(({ rows: [first, count] }) => Math.hypot(...Phi.slice(first, first + count)));
}

/* ---- the panel ---- */

export const live = {
  made: null,  // what of the data depends on the motion, as the page was made
  motion: null,  // the one shown, where the page solved for it; null for the one it was made with
  isChanged: false,  // whether a slider was pulled
  refused: '',  // why the last pull was not taken

  get names() {
    return player.data.parameters.map(({ name }) => name);
  },

  build(panel) {
    const { parameters } = player.data;
    panel.hidden = !parameters.length;
    if (!parameters.length) return;
    this.given = parameters.map(({ value }) => value);
    this.values = this.given.slice();
    const title = document.createElement('h2');
    title.textContent = 'Parameters';
    panel.append(title);
    if (emitted.reason) {
      const reason = document.createElement('p');
      reason.textContent = `This page cannot solve for other values: ${emitted.reason} Those of the motion shown: ${parameters
        .map(({ name, value, unit }) => `${name} = ${numberText(value)} ${unit}`.trim()).join(', ')}.`;
      panel.append(reason);
      return;
    }
    const { grid, drawn, folded, places } = this.grids();
    this.sliders = parameters.map((parameter, k) => new Slider(
      places.has(k) ? drawn : grid, `slider-${k}`, parameter, value => this.pull(k, value), () => this.commit()));
    this.history = new History(() => this.values.slice(), values => this.goTo(values));
    this.verdict = document.createElement('output');
    const kept = document.createElement('div');
    Object.assign(kept, { id: 'kept', className: 'buttons', role: 'group', ariaLabel: 'Kept settings' });
    panel.append(grid, ...(places.size ? [folded] : []), this.buttons(), kept, this.verdict);
    this.history.listen();
    const { arrays, status, events, success, message, guessResidual, guess } = player.data;
    this.made = { arrays, status, events, success, message, guessResidual, guess };
    // The first drawing has the very numbers that a Reset gives.
    setNumbers(player.data.drawing, this.given);
    this.fit();
    this.readFragment();
    setTimeout(() => this.motionNow(), WARM);  // the first pull is not the first solve: that takes longer
    addEventListener('hashchange', () => this.readFragment());
  },

  /* Where sliders are; those of the places of drawn joints, which are pulled in the drawing, are folded. */
  grids() {
    const places = new Set(player.data.drawing.hands.filter(hand => hand.is_drawn).flatMap(({ own }) => own));
    const [grid, drawn] = [0, 1].map(() => Object.assign(document.createElement('div'), { className: 'sliders' }));
    const folded = document.createElement('details'), summary = document.createElement('summary');
    summary.textContent = 'Joints: drag their rings, or type places';
    folded.append(summary, drawn);
    return { grid, drawn, folded, places };
  },

  buttons() {
    const bar = document.createElement('div');
    bar.className = 'bar';
    const button = (id, text, action) => {
      const element = document.createElement('button');
      Object.assign(element, { type: 'button', id, textContent: text });
      element.addEventListener('click', () => action(element));
      bar.append(element);
      return element;
    };
    const copy = (text, label) => async element => {
      element.textContent = await copied(text()) ? 'Copied' : 'Not allowed';
      setTimeout(() => { element.textContent = label; }, 1500);
    };
    const undo = button('undo', 'Undo', () => this.history.undo()), redo = button('redo', 'Redo', () => this.history.redo());
    this.history.onChange = () => {
      undo.disabled = !this.history.canUndo;
      redo.disabled = !this.history.canRedo;
    };
    this.history.onChange();
    button('reset', 'Reset', () => this.reset());
    button('keep', 'Keep to compare', () => settings.keep());
    button('link', 'Copy link', copy(() => taken.address(), 'Copy link'));
    for (const [id, kind] of [['set', '--set'], ['python', 'Python'], ['toml', 'TOML']]) {
      if (kind === 'TOML' && !player.data.toml) continue;
      button(id, `Copy as ${kind}`, copy(() => taken.setting(kind), `Copy as ${kind}`));
    }
    return bar;
  },

  /* The motion shown, as the solver gives it. */
  motionNow() {
    return this.motion ?? (this.first ??= this.solved(this.given ?? []));
  },

  solved(p) {
    return emitted.solver.solve(emitted, player.t, Float64Array.from(p), this.startAt(p));
  },

  /* Where the solver starts: the guess, which may follow the drawing. */
  startAt(p) {
    const start = Array.from(player.data.start), values = geometry.numbers(0, p);
    geometry.places.forEach(([kind, column], k) => { if (kind === 'guess') start[column] = values[k]; });
    return start;
  },

  pull(k, value) {
    this.set({ [this.names[k]]: value });
  },

  /* Take values, and solve before the next frame: of several pulls in a frame the last one counts. */
  set(values) {
    this.names.forEach((name, k) => { if (name in values) this.values[k] = values[name]; });
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = null;
      this.solve();
    });
  },

  reset() {
    this.goTo(this.given);
    this.commit();
  },

  /* Take all values, as those of a step that is undone. */
  goTo(values) {
    this.sliders.forEach(slider => slider.rest());
    this.set(Object.fromEntries(this.names.map((name, k) => [name, values[k]])));
    this.writeFragment();
  },

  /* What was pulled is let go: a step that can be undone. */
  commit() {
    this.history.take();
    this.writeFragment();
  },

  /* Take values with which there is a position at the time shown; else what is shown stays, and the reason is
     returned. `refused` is why others were not taken. */
  attempt(values, refused) {
    if (values.every((value, k) => value === this.values[k])) {
      if (refused) this.refuse(refused);
      return '';
    }
    const motion = this.solved(values), { n, state: { index } } = player;
    if (motion.q.subarray(index * n, (index + 1) * n).every(Number.isFinite)) {
      this.values = values;
      this.solve(motion, refused);
      return '';
    }
    const event = emitted.solver.explain(motion);
    return verdictOf(motion, event && withSentence(event, motion));
  },

  refuse(why) {
    this.refused = why;
    this.showVerdict();
  },

  showValues() {
    this.sliders?.forEach((slider, k) => slider.show(this.values[k]));
  },

  /* Solve over the page's own times, and show what comes out. */
  solve(motion = null, refused = '') {
    const begin = performance.now(), { data } = player;
    data.parameters.forEach((parameter, k) => { parameter.value = this.values[k]; });
    this.isChanged = true;
    this.refused = refused;
    this.motion = this.values.every((value, k) => value === this.given[k]) ? null : motion ?? this.solved(this.values);
    Object.assign(data, this.made);
    setNumbers(data.drawing, this.values);
    if (this.motion) data.guess = this.startAt(this.values);
    settings.follow();
    if (this.motion) {
      // What ended it is looked for first: the status of the point says so.
      const event = emitted.solver.explain(this.motion);
      this.takeMotion(this.motion);
      this.takeVerdict(event);
    }
    this.showVerdict();
    this.showValues();
    player.motionChanged();
    this.time = performance.now() - begin;
  },

  /* Make the drawing fit a motion; what was seen first stays in view. */
  fit() {
    const { data } = player, extent = fitDrawing(data.drawing, player);
    const farther = (x, y, k) => (k % 2 ? Math.max(x, y) : Math.min(x, y));
    data.extent = stage.first.map((x, k) => (extent.every(Number.isFinite) ? farther(x, extent[k], k) : x));
  },

  /* Put a motion in the place of the one that is shown. */
  takeMotion(motion) {
    const { data } = player, names = ['q', 'q_dot', 'q_ddot', ...(data.outputs.length ? ['y', 'y_dot', 'y_ddot'] : [])];
    data.arrays = { ...data.arrays, ...Object.fromEntries(names.map(name => [name, motion[name]])) };
    withChecks(data.arrays, motion);
    data.status = Array.from(motion.status);
    if (!hasMotion()) data.guessResidual = residualsOf(motion.equations.evaluate(data.guess, player.t[0]).Phi);
  },

  takeVerdict(event) {
    const { data } = player, wrong = wrongLength(data.drawing);
    const passed = event ? [withSentence(event, this.motion)] : [];
    data.events = passed;
    data.success = !this.motion.failed && !wrong;
    data.message = [wrong, verdictOf(this.motion, passed[0]), doubtOf(this.motion)].filter(Boolean).join(' ');
  },

  showVerdict() {
    this.verdict.textContent = this.refused || player.data.message;
    this.verdict.classList.toggle('failed', Boolean(this.refused) || !player.data.success);
  },

  /* ---- values in a link and on the command line ---- */

  fragment() {
    const changed = this.names.map((name, k) => [name, k]).filter(([, k]) => this.values[k] !== this.given[k]);
    return changed.length ? `#${changed.map(([name, k]) => `${encodeURIComponent(name)}=${this.values[k]}`).join('&')}` : '';
  },

  writeFragment() {
    // A page inside a notebook has no address.
    try { history.replaceState(null, '', this.fragment() || ' '); } catch { /* so be it */ }
  },

  /* Take the values of the page's address; unknown names and wrong numbers are left out. */
  readFragment() {
    const all = new URLSearchParams(location.hash.slice(1));
    const given = [...all].map(([name, text]) => [name, text.trim() === '' ? NaN : Number(text)])
      .filter(([name, value]) => this.names.includes(name) && Number.isFinite(value));
    if (given.length) this.set(Object.fromEntries(given));
    else this.showValues();
    this.history.take();
    // A page that opens is shown first; values are solved for before the next frame.
    setTimeout(() => requestAnimationFrame(() => taken.show(all)));
  },
};
