/* A slider with a box beside it, for a number with a unit.

   new Slider(holder, id, { name, unit, low, high }, pull, done)
   pull(value)   is called while it is pulled, done() when it is let go
   show(value)   what it says
   begin(), rest()   it goes back and forth by itself, or no more */

import { symbolNodes, units } from './units.js';
import { buttonOf } from './elements.js';

const SWAY = 6000;  // milliseconds from end to end and back

/* Whether what is pulled takes round values. */
export const snapping = { isOn: false };

export class Slider {
  constructor(holder, id, { name, unit, low, high }, pull, done) {
    this.name = name;
    this.unit = unit;
    this.pull = pull;
    this.done = done;
    const label = this.label = document.createElement('label');
    const slider = this.slider = document.createElement('input');
    const box = this.box = document.createElement('input');
    label.htmlFor = id;
    Object.assign(slider, { type: 'range', id, step: 'any' });
    box.type = 'number';
    slider.addEventListener('input', () => pull(this.rounded(Number(slider.value))));
    slider.addEventListener('keydown', event => this.key(event));
    box.addEventListener('input', () => {
      if (box.value !== '' && Number.isFinite(box.valueAsNumber)) pull(box.valueAsNumber / units.factor(unit));
    });
    for (const element of [slider, box]) element.addEventListener('change', done);
    this.row = document.createElement('div');
    this.sway = buttonOf('⇄', () => (this.swaying ? this.rest() : this.begin()), `Move ${name} back and forth`);
    this.sway.ariaPressed = 'false';
    slider.addEventListener('pointerdown', () => this.rest());
    this.row.append(label, box, slider, this.sway);
    holder.append(this.row);
    this.reach(low, high);
  }

  /* Go from end to end and back, from where it is. */
  begin() {
    const part = Math.max(0, Math.min(1, (this.value - this.low) / (this.high - this.low)));
    const from = Math.acos(1 - 2 * part), begin = performance.now(), own = this.swaying = {};
    this.sway.ariaPressed = 'true';
    const frame = now => {
      if (this.swaying !== own) return;
      const phase = from + 2 * Math.PI * (now - begin) / SWAY;
      this.pull(+(this.low + (this.high - this.low) * (1 - Math.cos(phase)) / 2).toPrecision(6));
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  rest() {
    if (!this.swaying) return;
    this.swaying = null;
    this.sway.ariaPressed = 'false';
    this.done();
  }

  /* Of six digits, or, where it snaps, a multiple of what an arrow moves it by. */
  rounded(value) {
    if (!snapping.isOn) return +value.toPrecision(6);
    return this.within(Math.round(value / this.step) * this.step);
  }

  within(value) {
    return +Math.max(this.low, Math.min(this.high, value)).toPrecision(12);
  }

  /* Take other ends. */
  reach(low, high) {
    this.low = low;
    this.high = high;
    this.step = 10 ** Math.floor(Math.log10((high - low) / 200));
    Object.assign(this.slider, { min: low, max: high });
  }

  /* Arrows move it by a two-hundredth of its way; a slider of any step has none of its own. */
  key(event) {
    const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1, PageUp: 10, PageDown: -10 }[event.key];
    if (!way) return;
    event.preventDefault();
    event.stopPropagation();
    const value = Math.round(this.value / this.step + way * (event.shiftKey ? 10 : 1)) * this.step;
    this.pull(this.within(value));
    this.done();
  }

  show(value) {
    const { name, unit, slider, box, label, step } = this, factor = units.factor(unit), shown = units.name(unit);
    this.value = value;
    label.replaceChildren(...symbolNodes(name), unit ? ` [${shown}]` : '');
    slider.ariaLabel = units.titled(name, unit);
    Object.assign(box, { step: factor === 1 ? step : 'any', ariaLabel: shown ? `${name} in ${shown}` : name });
    slider.value = String(value);
    if (document.activeElement !== box) box.value = String(+(factor * value).toPrecision(6));
    slider.setAttribute('aria-valuetext', `${box.value} ${shown}`.trim());
  }
}
