/* Steps that can be undone, each as what was there after it.

   new History(now, show)   now() gives a copy of the present value, show(value) goes back to one
   take()           a step was made: what was undone before is dropped
   undo(), redo()
   forget()         what is there now is where it begins
   onChange         called when there is more or less to undo */

const MOST = 200;  // steps that are kept

export class History {
  constructor(now, show) {
    this.now = now;
    this.show = show;
    this.onChange = () => {};
    this.forget();
  }

  forget() {
    this.steps = [this.now()];
    this.go(0);
  }

  get canUndo() { return this.at > 0; }
  get canRedo() { return this.at + 1 < this.steps.length; }

  /* What is there now is no step yet. */
  get isChanged() { return !isSame(this.now(), this.steps[this.at]); }

  take() {
    if (!this.isChanged) return;
    const value = this.now();
    this.steps = [...this.steps.slice(0, this.at + 1), value].slice(-MOST - 1);
    this.go(this.steps.length - 1);
  }

  undo() {
    this.take();
    if (!this.canUndo) return;
    this.go(this.at - 1);
    this.show(this.steps[this.at]);
  }

  redo() {
    this.take();
    if (!this.canRedo) return;
    this.go(this.at + 1);
    this.show(this.steps[this.at]);
  }

  go(place) {
    this.at = place;
    this.onChange();
  }

  /* Ctrl+Z, Ctrl+Shift+Z, Ctrl+Y; a field of text keeps them for itself. */
  listen() {
    document.addEventListener('keydown', event => {
      const key = event.key.toLowerCase(), target = /** @type {Element} */ (event.target);
      if (!(event.ctrlKey || event.metaKey) || event.altKey || !'zy'.includes(key)) return;
      if (target.matches('textarea, input:not([type=range], [type=checkbox])')) return;
      event.preventDefault();
      if (key === 'y' || event.shiftKey) this.redo();
      else this.undo();
    });
  }
}

function isSame(one, other) {
  return JSON.stringify(one) === JSON.stringify(other);
}
