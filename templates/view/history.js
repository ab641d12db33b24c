/* Steps that can be undone, each as what was there after it.

   new History(now, show)   now() gives a copy of the present value, show(value) goes back to one
   take()           a step was made: what was undone before is dropped
   undo(), redo()
   onChange         called when there is more or less to undo */

export class History {
  constructor(now, show) {
    this.now = now;
    this.steps = [now()];
    this.at = 0;
    this.show = show;
    this.onChange = () => {};
  }

  get canUndo() { return this.at > 0; }
  get canRedo() { return this.at + 1 < this.steps.length; }

  take() {
    const value = this.now();
    if (isSame(value, this.steps[this.at])) return;
    this.steps = [...this.steps.slice(0, this.at + 1), value];
    this.go(this.at + 1);
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
