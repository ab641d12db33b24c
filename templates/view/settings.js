/* Settings of the parameters beside the one that is shown, each with its motion, a colour and a name.

   settings.kept      those that were kept: drawn behind, in plots, paths and measures
   settings.family    equally spaced values of one parameter: in plots and paths
   settings.curves    both, from back to front
   settings.as(setting, act)   what `act` gives with the numbers of a setting in place of those shown */

import { player } from './player.js';
import { symbolText, units } from './units.js';
import { blended, drawShapes, Pen } from './draw.js';
import { pathOf, stage } from './stage.js';
import { buttonOf, byId } from './elements.js';
import { reactions } from './forces.js';
import { plots } from './plots.js';
import { live, setNumbers } from './live.js';
import { equalParts, measures } from './measures.js';
import { shownPanel } from './tabs.js';

export const MOST_KEPT = 5;
export const MOST_OF_FAMILY = 9;
const REST_OF_PULL = 250;  // milliseconds without a pull, after which a family is solved for

export const settings = {
  kept: [],
  family: [],
  choose: (k, count) => {},  // a parameter for the family, by its number
  over: null,  // the parameter of the family: { k, count }

  get curves() {
    return [...this.family, ...this.kept];
  },

  /* The setting that is shown now. */
  now(name) {
    const { drawing, arrays, status } = player.data;
    return { name, values: live.values.slice(), motion: live.motionNow(), drawing: structuredClone(drawing), arrays, status,
      states: player.states, columns: new Map(), paths: new Map() };
  },

  /* A setting that is solved for, to be plotted. */
  solved(values, name) {
    const motion = live.solved(values), { arrays } = player.data;
    const own = Object.fromEntries(Object.keys(arrays).filter(key => motion[key]?.length).map(key => [key, motion[key]]));
    return { name, values, motion, arrays: { ...own, t: player.t }, status: Array.from(motion.status), states: null,
      columns: new Map(), paths: new Map() };
  },

  colourOf(setting) {
    const { bodies, plot, drive } = stage.palette, place = this.family.indexOf(setting);
    if (place < 0) return bodies[1 + this.kept.indexOf(setting) % (bodies.length - 1)][0];
    return blended(drive, plot, place / Math.max(1, this.family.length - 1));
  },

  as(setting, act) {
    const { data } = player, { arrays, status } = data, states = player.kept, values = data.parameters.map(({ value }) => value);
    const take = (p, given, own) => {
      data.parameters.forEach((parameter, k) => { parameter.value = p[k]; });
      setNumbers(data.drawing, p);
      Object.assign(data, given);
      player.kept = own;
      reactions.forget();
    };
    take(setting.values, { arrays: setting.arrays, status: setting.status }, setting.states);
    try {
      return act();
    } finally {
      setting.states = player.kept;
      take(values, { arrays, status }, states);
    }
  },

  pathOf(setting, point) {
    if (!setting.paths.has(point)) setting.paths.set(point, this.as(setting, () => pathOf(point).line));
    return setting.paths.get(point);
  },

  /* ---- kept ---- */

  titleOf(name, value, unit) {
    return `${symbolText(name)} = ${+(value * units.factor(unit)).toPrecision(5)} ${units.name(unit)}`.trim();
  },

  /* A name by the parameters with other values than those of the page. */
  nameOf(values) {
    const all = player.data.parameters.map((parameter, k) => ({ ...parameter, value: values[k] }));
    const said = all.filter(({ value }, k) => value !== live.given[k]).map(({ name, value, unit }) => this.titleOf(name, value, unit)).join(', ') || 'as made';
    const same = this.kept.filter(({ name }) => name === said || name.startsWith(`${said} (`)).length;
    return same ? `${said} (${same + 1})` : said;
  },

  keep() {
    if (this.kept.length === MOST_KEPT) this.kept.shift();
    this.kept.push(this.now(this.nameOf(live.values)));
    this.changed();
  },

  /* Keep a setting that is not shown. */
  keepOf(values) {
    const setting = this.solved(values, this.nameOf(values)), drawing = structuredClone(player.data.drawing);
    setNumbers(drawing, values);
    this.kept.push({ ...setting, drawing });
    this.changed();
  },

  forget(setting) {
    this.kept = this.kept.filter(other => other !== setting);
    this.changed();
  },

  changed() {
    this.list();
    measures.solved = null;
    if (shownPanel === 'measures') measures.show();
    plots.redraw();
    player.refresh();
  },

  /* The kept ones by name: a press goes back to one, × forgets it. */
  list() {
    byId('kept').replaceChildren(...this.kept.flatMap(setting => {
      const back = buttonOf(setting.name, () => {
        live.goTo(setting.values);
        live.commit();
      });
      back.title = 'Back to this setting';
      back.style.setProperty('--body', this.colourOf(setting));
      return [back, buttonOf('×', () => this.forget(setting), `Forget ${setting.name}`)];
    }));
  },

  draw(ctx, view, palette) {
    for (const setting of this.kept) {
      const { n, state } = player, q = setting.arrays.q.subarray(state.index * n, (state.index + 1) * n);
      const colour = this.colourOf(setting);
      if (q.every(Number.isFinite)) drawShapes(ctx, q, { view, palette, ghost: colour, alpha: 0.5, drawing: setting.drawing });
    }
    const pen = new Pen(ctx, null, { view, palette }, player.data.drawing.size);
    for (const setting of this.curves) {
      for (const point of stage.traced) {
        pen.path(this.pathOf(setting, point).map(place => place && view.toScreen(place)));
        pen.stroke(this.colourOf(setting), 1.5);
      }
    }
  },

  /* ---- a family ---- */

  /* Choice of a parameter, and of how many of its values. */
  familyBox() {
    const label = document.createElement('label'), choice = document.createElement('select'), count = document.createElement('input');
    Object.assign(choice, { id: 'family', ariaLabel: 'Family over' });
    choice.append(new Option('no family', ''), ...live.names.map((name, k) => new Option(`over ${symbolText(name)}`, String(k))));
    Object.assign(count, { type: 'number', id: 'family-count', ariaLabel: 'Curves of the family', value: 5, min: 2, max: MOST_OF_FAMILY });
    const take = () => {
      const wanted = Math.min(MOST_OF_FAMILY, Math.max(2, Math.round(count.valueAsNumber || 5)));
      count.hidden = choice.value === '';
      this.over = choice.value === '' ? null : { k: Number(choice.value), count: wanted };
      this.solveFamily();
      this.changed();
    };
    this.choose = (k, wanted) => {
      [choice.value, count.value] = [String(k), String(wanted)];
      take();
    };
    for (const element of [choice, count]) element.addEventListener('change', take);
    count.hidden = true;
    label.append(choice, count);
    return label;
  },

  /* The motion is another one: the family follows when it rests, so that a pull takes no longer. */
  follow() {
    if (!this.over) return;
    this.family = [];
    clearTimeout(this.waiting);
    this.waiting = setTimeout(() => {
      this.solveFamily();
      this.changed();
    }, REST_OF_PULL);
  },

  /* The other parameters are as they are shown. */
  solveFamily() {
    if (!this.over) {
      this.family = [];
      return;
    }
    const { k, count } = this.over, { name, unit, low, high } = player.data.parameters[k];
    this.family = equalParts(low, high, count - 1).map(value => {
      const values = live.values.map((own, j) => (j === k ? value : own));
      return this.solved(values, this.titleOf(name, value, unit));
    });
  },
};
