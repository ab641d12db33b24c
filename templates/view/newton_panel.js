/* The panel on which Newton's method is stepped through, from a guess of the user's. */

import { player } from './player.js';
import { placeAnywhere } from '#world';
import { hasBodies } from './stage.js';
import { newton } from './newton.js';
import { newtonTables } from './newton_tables.js';
import { NewtonStage } from './newton_stage.js';
import { live } from './live.js';

const MOST_ENTRIES = 60;  // coordinates up to which every entry of Phi_q is shown
const PAUSE = 700;  // milliseconds between the steps of a run

const NEWTON_MARKUP = `
  <p>\u03a6<sub>q</sub>\u202f\u0394q = \u2212\u03a6, then q + \u0394q, until \u0394q is small: from a
    <b class="guess">guess</b> through its <b class="iterate">iterates</b>, at the time that is shown.
    <span class="hint">Drag a body of the guess, or turn it by its knob; by keys, <kbd>Tab</kbd>
      to it, then arrows and <kbd>+</kbd> <kbd>\u2212</kbd>.</span></p>
  <div class="buttons" role="group" aria-label="Guess">Guess
    <button type="button" data-guess="model">of the model</button>
    <button type="button" data-guess="motion">of the motion</button>
    <button type="button" data-guess="random">at random</button></div>
  <div class="buttons iterating" role="group" aria-label="Iterations">
    <button type="button" data-go="reset">Reset</button>
    <button type="button" data-go="back">Back</button>
    <button type="button" data-go="step">Step</button>
    <button type="button" data-go="run">Run</button>
    <output class="count"></output></div>
  <p class="statement" role="status"></p>
  <h2>Convergence</h2>
  <p><b class="correction">log\u2081\u2080|\u0394q|</b> and <b class="residual">log\u2081\u2080|\u03a6|</b>
    by iteration</p>
  <svg class="convergence" viewBox="0 0 340 200" role="img"
    aria-label="log10 of correction and residual by iteration; the numbers are in the table"></svg>
  <div class="wide"><table class="iterations"></table></div>
  <h2>Residual of each constraint by iteration</h2>
  <div class="wide"><table class="residuals"></table></div>
  <h2>\u03a6<sub>q</sub></h2>
  <p class="entry" role="status">Point at an entry, or go through them with the arrow keys.</p>
  <div class="wide"><table class="jacobian"></table></div>
  <h2>Coordinates</h2>
  <div class="wide"><table class="coordinates"></table></div>`;

class NewtonPanel {
  constructor(root, model) {
    this.root = root;
    this.model = model;
    this.timer = null;
    root.innerHTML = NEWTON_MARKUP;
    this.cells = newtonTables.jacobian(this.part('.jacobian'), model, (i, j) => this.entry(i, j));
    this.rows = newtonTables.coordinates(this.part('.coordinates'), model,
      (k, value) => this.start(this.guess.map((x, j) => (j === k ? value : x))));
    this.part('.hint').hidden = !hasBodies();
    if (hasBodies()) this.stage = new NewtonStage(() => this.isShown, guess => this.start(guess));
    this.listen();
    this.start(player.data.guess);
  }

  get isShown() {
    return !this.root.hidden && !player.isPlaying;
  }

  get p() {
    return player.data.parameters.map(({ value }) => value);
  }

  part(selector) {
    return this.root.querySelector(selector);
  }

  listen() {
    const guesses = {
      model: () => player.data.guess, motion: () => this.motion, random: () => this.random(),
    };
    const moves = {
      reset: () => this.go(0), back: () => this.go(this.shown - 1),
      step: () => this.go(this.shown + 1), run: () => this.toggleRun(),
    };
    this.root.addEventListener('click', event => {
      const { guess, go } = event.target.dataset;
      if (guess) this.start(guesses[guess]());
      if (go && go !== 'run') this.stop();
      if (go) moves[go]();
    });
    player.onChange(state => {
      // A hidden panel takes the time when it is shown, which is also reported here.
      if (this.isShown && (state.time !== this.t || live.motion !== this.solved)) this.start(this.guess);
    });
  }

  /* Take a guess, or a time: all iterates are computed at once, and shown one after the other. */
  start(guess) {
    this.stop();
    this.guess = Array.from(guess);
    this.t = player.state.time;
    this.solved = live.motion;
    this.motion = player.state.isFound ? Array.from(player.state.q) : null;
    this.run = newton.iterate(this.model, this.guess, this.t, this.p);
    this.last = this.run.iterates.length - 1;
    newtonTables.guessValues(this.rows, this.guess);
    this.go(0);
  }

  /* Show the iterates up to the k-th. */
  go(k) {
    this.shown = Math.max(0, Math.min(this.last, k));
    this.render();
  }

  toggleRun() {
    if (this.last === 0) return;
    if (this.timer) {
      this.stop();
      this.render();
      return;
    }
    this.timer = setInterval(() => {
      if (this.shown + 1 >= this.last) this.stop();
      this.go(this.shown + 1);
    }, PAUSE);
    this.go(this.shown === this.last ? 0 : this.shown + 1);
  }

  stop() {
    clearInterval(this.timer);
    this.timer = null;
  }

  /* Bodies anywhere in the picture at any angle; other coordinates within a size or a radian. */
  random() {
    const between = (a, b) => a + (b - a) * Math.random();
    const scale = newton.problem(this.model, this.p).reference;
    const guess = player.data.guess.map((value, k) => value + between(-scale[k], scale[k]));
    for (const frame of player.data.drawing.frames) placeAnywhere(guess, frame, player.data.extent, between);
    return guess;
  }

  render() {
    const iterates = this.run.iterates.slice(0, this.shown + 1);
    const current = iterates[this.shown];
    if (this.stage) this.stage.show({ guess: this.guess, iterates });
    newtonTables.convergence(this.part('.convergence'), iterates, this.last);
    newtonTables.iterations(this.part('.iterations'), iterates);
    newtonTables.residuals(this.part('.residuals'), iterates, player.data.drawing.joints);
    newtonTables.coordinateValues(this.rows, current);
    newtonTables.jacobianValues(this.cells, this.model, current.Phi_q);
    this.renderButtons();
  }

  renderButtons() {
    const isStart = this.shown === 0, isEnd = this.shown === this.last;
    // Not disabled, since the next key press would be the page's: a space plays the motion.
    const isUseless = { reset: isStart, back: isStart, step: isEnd, run: this.last === 0 };
    for (const [go, useless] of Object.entries(isUseless)) {
      this.part(`[data-go=${go}]`).ariaDisabled = String(useless);
    }
    this.part('[data-go=run]').textContent = this.timer ? 'Stop' : 'Run';
    this.part('[data-guess=motion]').disabled = !this.motion;
    this.part('.count').textContent = isStart ? 'the guess' : `iterate ${this.shown}`;
    this.part('.statement').textContent = isEnd
      ? newton.statement(this.model, this.run, this.t, this.p, this.motion) : '';
  }

  entry(i, j) {
    const { COORDINATES, EQUATIONS } = this.model;
    const value = this.run.iterates[this.shown].Phi_q[i][j];
    this.part('.entry').textContent = `\u2202 ${EQUATIONS[i]} / \u2202 ${COORDINATES[j]} = ${value}`;
  }
}

/* Fill the panel; without emitted functions it says why there are none. */
export function newtonPanel(root) {
  root.classList.add('newton');
  const count = player.data.coordinates.length;
  if (emitted.Phi && count <= MOST_ENTRIES) return new NewtonPanel(root, emitted);
  const reason = emitted.reason ?? `${count} coordinates are too many to show every entry of \u03a6_q.`;
  root.append(`Newton's method cannot be shown: ${reason}`);
  return null;
}
