/* Plots of columns over time, over an angle or another column, and paths: SVG of our own, so that what
   is shown can be saved as it is. */

import { player } from './player.js';
import { multiples, niceStep, ROUNDING_PART, stepText, symbolText, units } from './units.js';
import { liveliestOf } from '#world';
import { hasMotion, isProjected, stage } from './stage.js';
import { buttonOf, byId, setAttributes, svgElement } from './elements.js';
import { save } from './save.js';
import { columns, failures, plottedFirst } from './columns.js';
import { contains, findBox } from './tables.js';
import { settings } from './settings.js';

const TIME = 'time';
const ZOOM = 0.7;  // part of the range that is left by a key press

const scalesOf = {
  linear: { to: x => x, from: x => x },
  log: { to: x => Math.log10(x), from: x => 10 ** x },
};

class Plot {
  constructor(label) {
    this.element = document.createElement('div');
    this.element.className = 'plot';
    const bar = document.createElement('div');
    bar.className = 'bar';
    this.choice = document.createElement('select');
    this.choice.setAttribute('aria-label', 'What is plotted');
    this.fill(label);
    this.choice.addEventListener('change', () => this.redraw());
    bar.append(this.choice, this.saving(), buttonOf('×', () => plots.remove(this), 'Remove this plot'));
    this.svg = svgElement('svg', { tabindex: 0, role: 'img' });
    this.reading = document.createElement('output');
    this.element.append(bar, this.svg, this.reading);
    this.pointed = null;  // index of the time that the pointer is at
    this.listen();
  }

  /* Offer what contains a text, and what is chosen. */
  fill(chosen, text = '') {
    const isOffered = ({ label, title }) => label === chosen || contains(label, text) || contains(title, text);
    const groups = columns.groups().map(({ title, items }) => ({ title, items: items.filter(isOffered) }));
    this.choice.replaceChildren(...groups.filter(({ items }) => items.length).map(optionGroup));
    this.choice.value = chosen;
  }

  saving() {
    const menu = document.createElement('details'), title = document.createElement('summary');
    title.textContent = 'Save';
    menu.className = 'menu';
    const kinds = { CSV: () => this.csv(), SVG: () => this.svgText(), PNG: null };
    const holder = document.createElement('div');
    for (const [kind, text] of Object.entries(kinds)) {
      holder.append(buttonOf(kind, () => {
        menu.open = false;
        if (text) save(`${this.fileName()}.${kind.toLowerCase()}`, new Blob([text()], { type: 'text/plain' }));
        else saveImage(`${this.fileName()}.png`, this.svgText(), this.size);
      }));
    }
    menu.append(title, holder);
    return menu;
  }

  fileName() {
    return `${player.data.name} ${this.choice.value}`.replace(/[^\w.-]+/g, '_');
  }

  /* ---- what is plotted ---- */

  /* Numbers of both axes, in the units that are shown. */
  read() {
    const item = columns.find(this.choice.value), { path } = item;
    const over = path ? columns.find(path[0]) : plots.over();
    const y = path ? columns.find(path[1]) : item;
    this.isPath = Boolean(path);
    this.isLog = Boolean(y.isLog);
    this.y = columns.values(y).map(value => value && value * units.factor(y.unit));
    this.x = (over ? columns.values(over) : Array.from(player.t)).map(value => value && value * units.factor(over?.unit ?? 's'));
    this.isOverTime = !over;
    this.names = [over?.label ?? 't', y.label];
    this.units = [over?.unit ?? 's', y.unit];
    this.labels = this.names.map((name, k) => units.titled(name, this.units[k]));
    const factors = [units.factor(over?.unit ?? 's'), units.factor(y.unit)];
    this.others = settings.curves.map(setting => ({ setting, ...Object.fromEntries([['x', over], ['y', y]].map(([axis, column], k) =>
      [axis, (column ? columns.values(column, setting) : Array.from(player.t)).map(value => value && value * factors[k])])) }));
    this.titles = [over?.title ?? 't', y.title];
    this.shown = this.titles.map((title, k) => units.titled(title, this.units[k]));
  }

  redraw() {
    this.read();
    const { width, height } = this.size = this.sizes();
    const type = Math.max(12, Math.round(0.8 * stage.type));
    this.box = { left: 4 * type, right: width - 1.3 * type, top: 1.9 * type, low: height - 3 * type };
    setAttributes(this.svg, { viewBox: `0 0 ${width} ${height}`, width, height, 'font-size': type,
      'font-family': 'system-ui, sans-serif', 'aria-label': `${this.shown[1]} over ${this.shown[0]}` });
    this.ranges();
    this.draw(type);
    this.move(player.state);
  }

  sizes() {
    const { width } = plots;
    const height = this.isPath ? Math.min(0.8 * width, isProjected() ? plots.height() : 1.3 * plots.height()) : plots.height();
    return { width, height };
  }

  /* What of both axes is seen; in a path lengths are true. */
  ranges() {
    const { to } = this.scale = this.isLog ? scalesOf.log : scalesOf.linear;
    // Time is shown whole, also where nothing was found.
    const all = [this, ...this.others];
    const x = extentOf(all.flatMap(own => own.x.filter((value, k) => value !== null && (this.isOverTime || own.y[k] !== null))));
    const isZoomed = !this.isPath && plots.range !== null;
    const [from, until] = isZoomed ? plots.range : x;
    const y = extentOf(all.flatMap(own => own.y.filter((value, k) => value !== null && own.x[k] >= from && own.x[k] <= until)).map(to));
    const noise = this.isLog ? 0 : ROUNDING_PART * units.scale(this.units[1]) * units.factor(this.units[1]);
    this.xRange = isZoomed ? [from, until] : this.isPath ? opened(x, noise) : x;
    this.yRange = opened(y, noise);
    if (!this.isPath) return;
    const { left, right, top, low } = this.box;
    const [wide, tall] = [this.xRange, this.yRange].map(([a, b]) => b - a);
    const scale = Math.min((right - left) / wide, (low - top) / tall);
    this.xRange = centred(this.xRange, (right - left) / scale);
    this.yRange = centred(this.yRange, (low - top) / scale);
  }

  px(x) {
    const { left, right } = this.box, [a, b] = this.xRange;
    return left + (right - left) * (x - a) / (b - a || 1);
  }

  py(y) {
    const { top, low } = this.box, [a, b] = this.yRange;
    return low - (low - top) * (this.scale.to(y) - a) / (b - a || 1);
  }

  /* ---- drawing ---- */

  draw(type) {
    const { palette } = stage, { left, right, top, low } = this.box;
    const text = (x, y, anchor, content, more = {}) =>
      svgElement('text', { x, y, 'text-anchor': anchor, fill: palette.quiet, ...more }, content);
    const line = (x1, y1, x2, y2, stroke = palette.line) => svgElement('line', { x1, y1, x2, y2, stroke });
    const parts = [...this.failureAreas(palette)];
    const step_x = niceStep((this.xRange[1] - this.xRange[0]) / Math.max(2, (right - left) / (6 * type)));
    for (const x of multiples(step_x, ...this.xRange)) {
      parts.push(line(this.px(x), top, this.px(x), low), text(this.px(x), low + 1.25 * type, 'middle', stepText(x, step_x)));
    }
    const isEmpty = !this.y.some((y, k) => y !== null && this.x[k] !== null);
    for (const [y, label] of isEmpty ? [] : this.levels(type, step_x)) {
      parts.push(line(left, y, right, y), text(left - 5, y + 0.35 * type, 'end', label));
    }
    parts.push(text((left + right) / 2, low + 2.6 * type, 'middle', this.shown[0], { fill: palette.ink }));
    parts.push(text(0, 1.1 * type, 'start', this.shown[1], { fill: palette.ink }));
    parts.push(...this.eventLines(palette), this.curves(palette), ...this.legend(type));
    if (isEmpty) {
      const said = hasMotion() ? 'No numbers were found.' : 'No position was found.';
      parts.push(text((left + right) / 2, (top + low) / 2, 'middle', said, { fill: palette.bad }));
    }
    this.now = svgElement('line', { y1: top, y2: low, class: 'now', stroke: palette.drive, 'stroke-width': 2 });
    this.dot = svgElement('circle', { r: 4.5, class: 'dot', fill: palette.paper, stroke: palette.drive, 'stroke-width': 2 });
    parts.push(this.now, this.dot);
    this.svg.replaceChildren(...parts);
  }

  /* Heights of the rules across the plot, with their labels. */
  levels(type, step_x) {
    const [a, b] = this.yRange, count = Math.max(2, (this.box.low - this.box.top) / (2.2 * type));
    if (this.isLog) {
      const step = Math.max(1, Math.ceil((b - a) / count));
      return multiples(step, a, b).map(y => [this.py(10 ** y), `1e${y}`]);
    }
    let step = this.isPath ? step_x : niceStep((b - a) / count);
    if (multiples(step, a, b).length < 2) step = niceStep(step / 2.5);
    return multiples(step, a, b).map(y => [this.py(y), stepText(y, step)]);
  }

  /* The way of a curve in the plot. */
  way({ x, y }) {
    const pieces = [];
    let isDown = false;
    y.forEach((value, k) => {
      const isThere = value !== null && x[k] !== null;
      if (isThere) pieces.push(`${isDown ? 'L' : 'M'}${Math.round(10 * this.px(x[k])) / 10} ${Math.round(10 * this.py(value)) / 10}`);
      isDown = isThere;
    });
    return pieces.join('');
  }

  /* Names of the settings in their colours, where there are others than the one shown. */
  legend(type) {
    const { palette } = stage, { right, top } = this.box;
    if (!this.others.length) return [];
    const lines = [['now', palette.plot], ...this.others.map(({ setting }) => [setting.name, settings.colourOf(setting)])];
    return lines.map(([name, fill], k) => svgElement('text', { x: right - 4, y: top + (1.1 + 1.15 * k) * type, 'text-anchor': 'end', class: 'name',
      fill, stroke: palette.paper, 'stroke-width': 3, 'paint-order': 'stroke' }, name));
  }

  /* The setting that is shown is in front. */
  curves(palette) {
    const { left, right, top, low } = this.box, edge = 3;
    const style = { fill: 'none', stroke: palette.plot, 'stroke-width': player.count < 2 ? 6 : 2,
      'stroke-linejoin': 'round', 'stroke-linecap': 'round', transform: `translate(${-left} ${edge - top})` };
    // An svg in an svg cuts off what is outside.
    const frame = svgElement('svg', { x: left, y: top - edge, width: right - left, height: low - top + 2 * edge });
    frame.append(...this.others.map(other => svgElement('path', { d: this.way(other), ...style, class: 'other',
      stroke: settings.colourOf(other.setting), 'stroke-width': 1.5 })), svgElement('path', { d: this.way(this), ...style }));
    return frame;
  }

  failureAreas(palette) {
    if (!this.isOverTime) return [];
    const { left, right, top, low } = this.box;
    return failures().map(([from, to]) => {
      const [x0, x1] = [from, to].map(time => Math.max(left, Math.min(right, this.px(time)))).sort((a, b) => a - b);
      return svgElement('rect', { x: x0, y: top, width: Math.max(1, x1 - x0), height: low - top, fill: palette.badTint });
    });
  }

  eventLines(palette) {
    if (!this.isOverTime) return [];
    const { top, low } = this.box;
    const [from, to] = this.xRange, seen = player.data.events.filter(({ t }) => t >= from && t <= to);
    return seen.map(({ t }) => svgElement('line', { x1: this.px(t), x2: this.px(t), y1: top, y2: low,
      stroke: palette.bad, 'stroke-dasharray': '5 4' }));
  }

  /* ---- time ---- */

  move(state) {
    if (!this.x) return;
    const { index } = state, { left, right } = this.box;
    const at = this.isOverTime ? state.time : this.x[index];
    const x = at === null ? -1 : this.px(at), y = this.y[index];
    const isSeen = x >= left - 1 && x <= right + 1;
    this.now.style.display = isSeen && !this.isPath ? '' : 'none';
    this.dot.style.display = isSeen && y !== null ? '' : 'none';
    setAttributes(this.now, { x1: x, x2: x });
    if (y !== null) setAttributes(this.dot, { cx: this.px(this.x[index]), cy: this.py(y) });
    this.tell(this.pointed ?? index);
  }

  /* The numbers at a solved time, below the plot. */
  tell(index) {
    const written = (name, value, unit) => `${name} = ${units.full(value ?? NaN, unit)}`;
    const shown = (values, k) => {
      const value = values[index] === null ? NaN : values[index] / units.factor(this.units[k]);
      return this.isLog && k ? `${this.titles[k]} = ${value.toExponential(3)}` : written(this.titles[k], value, this.units[k]);
    };
    const time = this.isOverTime ? [] : [written('t', player.t[index], 's')];
    this.reading.textContent = [...time, shown(this.x, 0), shown(this.y, 1)].join(',  ');
  }

  /* ---- pointers and keys ---- */

  listen() {
    const at = event => event.clientX - this.svg.getBoundingClientRect().left;
    let from = null;
    this.svg.addEventListener('pointerdown', event => { from = at(event); });
    this.svg.addEventListener('pointermove', event => {
      if (event.pointerType === 'touch') return;
      this.pointed = this.indexAt(event);
      this.tell(this.pointed);
      this.showPart(from, at(event));
    });
    this.svg.addEventListener('pointerup', event => {
      const to = at(event), begin = from;
      from = null;
      this.showPart(null);
      if (begin === null) return;
      if (Math.abs(to - begin) < 4 || this.isPath) this.choose(event);
      else plots.zoom([begin, to].map(x => this.valueAt(x)).sort((a, b) => a - b));
    });
    this.svg.addEventListener('pointerleave', () => {
      from = null;
      this.showPart(null);
      this.pointed = null;
      this.tell(player.state.index);
    });
    this.svg.addEventListener('dblclick', () => plots.zoom(null));
    this.svg.addEventListener('keydown', event => this.key(event));
  }

  /* A click, and not the end of a drag, sets the time. */
  choose(event) {
    player.pause();
    player.setIndex(this.indexAt(event));
  }

  valueAt(x) {
    const { left, right } = this.box, [a, b] = this.xRange;
    return a + (b - a) * Math.max(0, Math.min(1, (x - left) / (right - left)));
  }

  /* The solved time whose point is next to the pointer: of a curve over time, beside it. */
  indexAt(event) {
    const box = this.svg.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
    if (this.isOverTime) return player.indexNear(this.valueAt(x));
    let best = 0, least = Infinity;
    this.x.forEach((value, k) => {
      if (value === null || this.y[k] === null) return;
      const distance = Math.hypot(this.px(value) - x, this.py(this.y[k]) - y);
      if (distance < least) [best, least] = [k, distance];
    });
    return best;
  }

  /* The part of the axis that a drag will show. */
  showPart(from, to) {
    this.part?.remove();
    if (from === null || this.isPath) return;
    const { top, low } = this.box;
    this.part = svgElement('rect', { x: Math.min(from, to), width: Math.abs(to - from), y: top, height: low - top,
      fill: stage.palette.drive, opacity: 0.15 });
    this.svg.append(this.part);
  }

  key(event) {
    const [a, b] = this.xRange ?? [0, 1], now = this.isOverTime ? player.state.time : (a + b) / 2;
    const half = (b - a) / 2, middle = now >= a && now <= b ? now : (a + b) / 2;
    const range = { '+': [middle - ZOOM * half, middle + ZOOM * half], '=': [middle - ZOOM * half, middle + ZOOM * half],
      '-': [middle - half / ZOOM, middle + half / ZOOM], 0: null }[event.key];
    if (range === undefined || this.isPath) return;
    plots.zoom(range);
    event.preventDefault();
    event.stopPropagation();
  }

  /* ---- saving ---- */

  /* The numbers that are seen, in the units that are shown. */
  csv() {
    const quoted = text => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const more = this.others.flatMap(({ setting }) => (this.isOverTime ? this.labels.slice(1) : this.labels).map(label => `${label} (${setting.name})`));
    const heads = [...(this.isOverTime ? this.labels : ['t [s]', ...this.labels]), ...more];
    const beside = k => this.others.flatMap(({ x, y }) => (this.isOverTime ? [y[k]] : [x[k], y[k]]));
    const rows = this.x.map((x, k) => [...(this.isOverTime ? [x, this.y[k]] : [player.t[k], x, this.y[k]]), ...beside(k)]);
    const [from, to] = this.xRange;
    const seen = rows.filter((_, k) => this.isPath || (this.x[k] >= from && this.x[k] <= to));
    return `${[heads.map(quoted), ...seen.map(row => row.map(value => value ?? ''))].map(row => row.join(',')).join('\n')}\n`;
  }

  svgText() {
    const copy = this.svg.cloneNode(true), { width, height } = this.size;
    copy.setAttribute('xmlns', 'http://www.w3.org/2000/svg');
    copy.prepend(svgElement('rect', { width, height, fill: stage.palette.paper }));
    return new XMLSerializer().serializeToString(copy);
  }
}

function extentOf(values) {
  if (!values.length) return [0, 1];
  return values.reduce(([low, high], value) => [Math.min(low, value), Math.max(high, value)], [Infinity, -Infinity]);
}

/* A range with room at both ends; a constant in the middle of one, not rounding errors blown up: zero
   beside the largest number of its unit. */
function opened([low, high], noise) {
  const middle = (low + high) / 2, half = (high - low) / 2;
  const least = Math.max(noise, 1e-9 * Math.abs(middle));
  const size = Math.abs(middle) > noise ? Math.abs(middle) / 10 : noise / ROUNDING_PART;
  const wide = half <= least ? size || 1 : 1.08 * half;
  return [middle - wide, middle + wide];
}

function centred([a, b], length) {
  return [(a + b - length) / 2, (a + b + length) / 2];
}

function optionGroup(group) {
  const element = document.createElement('optgroup');
  element.label = group.title;
  element.append(...group.items.map(({ label, title }) => new Option(title, label)));
  return element;
}

/* An SVG as pixels, twice as many as are seen. */
async function saveImage(name, text, { width, height }) {
  const image = new Image();
  image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(text)}`;
  await image.decode();
  const canvas = document.createElement('canvas');
  Object.assign(canvas, { width: 2 * width, height: 2 * height });
  canvas.getContext('2d').drawImage(image, 0, 0, canvas.width, canvas.height);
  canvas.toBlob(blob => save(name, blob));
}

export const plots = {
  list: [],
  width: 240,
  range: null,  // of the x axis that all plots but paths show; null for all
  isNew: true,  // whether the first plots wait for a motion to choose by

  build(panel) {
    this.holder = document.createElement('div');
    const bar = document.createElement('div'), label = document.createElement('label');
    bar.className = 'bar';
    this.choice = document.createElement('select');
    this.choice.id = 'over';
    this.choice.append(...[TIME, ...this.overs()].map(name => new Option(symbolText(name), name)));
    this.choice.addEventListener('change', () => this.zoom(null));
    label.append('Over ', this.choice);
    const count = columns.groups().flatMap(({ items }) => items).length;
    const find = findBox('Find what to plot', () => count, text => this.list.forEach(plot => plot.fill(plot.choice.value, text)));
    bar.append(label, ...('reason' in emitted || !player.data.parameters.length ? [] : [settings.familyBox()]), find, buttonOf('All', () => this.zoom(null), 'All of the axis'));
    const more = buttonOf('Another plot', () => this.add(columns.groups()[0].items[0].label));
    more.id = 'another';
    this.parts = [bar, this.holder, more];
    this.nothing = document.createElement('p');
    this.nothing.textContent = 'There is no motion to plot.';
    panel.append(this.nothing, ...this.parts);
  },

  /* What plots can have along: the angles of bodies, the driven ones first, and outputs. */
  overs() {
    const { outputs, coordinates, drawing } = player.data;
    const driven = new Set(drawing.marks.filter(mark => mark.kind === 'drive').map(mark => mark.place.frame.index));
    const angles = drawing.frames.toSorted((a, b) => Number(driven.has(b.index)) - Number(driven.has(a.index)))
      .flatMap(frame => liveliestOf([frame])[0].map(k => coordinates[k].name));
    return [...angles, ...outputs.map(({ name }) => name)];
  },

  /* The column along the x axis; null for time. */
  over() {
    return this.choice.value === TIME ? null : columns.find(this.choice.value);
  },

  /* Two plots fill the panel of a full screen. */
  height() {
    return isProjected() ? Math.max(9 * stage.type, byId('right').clientHeight / 2 - 6.5 * stage.type) : 12.5 * stage.type;
  },

  /* Plots that are seen again may have another width. */
  show() {
    this.measure();
    this.redraw();
  },

  /* Take the room there is: asked once, since a browser lays out the page to answer. */
  measure() {
    const { width } = this.holder?.getBoundingClientRect() ?? { width: 0 };
    if (width) this.width = Math.max(240, Math.floor(width));
  },

  resize() {
    this.measure();
    this.redraw();
  },

  add(label) {
    const plot = new Plot(label);
    this.list.push(plot);
    this.holder.append(plot.element);
    plot.redraw();
  },

  remove(plot) {
    this.list.splice(this.list.indexOf(plot), 1);
    plot.element.remove();
  },

  zoom(range) {
    this.range = range;
    this.redraw();
  },

  move(state) {
    for (const plot of this.list) plot.move(state);
  },

  redraw() {
    const isFirst = this.isNew && hasMotion();
    this.isNew &&= !isFirst;
    this.nothing.hidden = !this.isNew;
    for (const part of this.parts) part.hidden = this.isNew;
    if (isFirst) {
      this.measure();
      plottedFirst().forEach(label => this.add(label));
    } else for (const plot of this.list) plot.redraw();
  },
};
