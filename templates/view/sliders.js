'use strict';
/* A slider with a box beside it, for a number with a unit.

   new Slider(holder, id, { name, unit, low, high }, pull, done)
   pull(value)   is called while it is pulled, done() when it is let go
   show(value)   what it says */

class Slider {
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
    slider.addEventListener('input', () => pull(+Number(slider.value).toPrecision(6)));
    slider.addEventListener('keydown', event => this.key(event));
    box.addEventListener('input', () => {
      if (box.value !== '' && Number.isFinite(box.valueAsNumber)) pull(box.valueAsNumber / units.factor(unit));
    });
    for (const element of [slider, box]) element.addEventListener('change', done);
    this.row = document.createElement('div');
    this.row.append(label, box, slider);
    holder.append(this.row);
    this.reach(low, high);
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
    this.pull(+Math.max(this.low, Math.min(this.high, value)).toPrecision(12));
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
