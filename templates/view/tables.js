/* The numbers of the current time, and the points that can be traced. */

import { player } from './player.js';
import { symbolNodes, symbolText, units } from './units.js';
import { AXES, ratesInWorld } from '#world';
import { hasMotion, stage } from './stage.js';
import { columns, finite } from './columns.js';

export function numberText(value) {
  if (!Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e7)) return value.toExponential(5);
  return value.toPrecision(7);
}

export function cell(text, tag = 'td') {
  const element = document.createElement(tag);
  element.textContent = text;
  return element;
}

export function tableOf(header) {
  const table = document.createElement('table');
  table.createTHead().insertRow().append(...header.map(text => cell(text, 'th')));
  table.createTBody();
  return table;
}

export function wide(table) {
  const holder = document.createElement('div');
  Object.assign(holder, { className: 'wide', tabIndex: 0 });
  holder.append(table);
  return holder;
}

/* The name of a coordinate, an output or a parameter at the head of a row. */
function nameCell(name) {
  const element = document.createElement('th');
  Object.assign(element, { title: name, ariaLabel: name, scope: 'row' });
  element.append(...symbolNodes(name));
  return element;
}

const MANY = 12;  // entries of a list, above which it can be searched

export function contains(text, part) {
  return text.toLowerCase().includes(part.trim().toLowerCase());
}

/* A box to search a long list with; `count` says how long it is, `act` takes the text. */
export function findBox(name, count, act) {
  const box = document.createElement('input');
  Object.assign(box, { type: 'search', placeholder: 'Find …', ariaLabel: name, hidden: count() <= MANY });
  box.addEventListener('input', () => act(box.value));
  return box;
}

/* A box that hides the rows of a list, [text, element], that do not have its text. */
export function rowFinder(name, rows) {
  return findBox(name, () => rows().length, part => {
    for (const [text, element] of rows()) element.hidden = !contains(text, part);
  });
}

export const numbers = {
  build(panel) {
    const bar = document.createElement('div');
    bar.className = 'bar';
    this.at = document.createElement('span');
    this.copy = document.createElement('button');
    Object.assign(this.copy, { type: 'button', textContent: 'Copy', id: 'copy' });
    this.copy.addEventListener('click', () => copied(this.text()).then(isDone => {
      this.copy.textContent = isDone ? 'Copied' : 'Not allowed';
      setTimeout(() => { this.copy.textContent = 'Copy'; }, 1500);
    }));
    this.motion = tableOf(['coordinate', 'unit', 'position', 'velocity', 'acceleration']);
    this.rows = player.data.coordinates.map(({ name, unit }) => {
      const row = this.motion.tBodies[0].insertRow();
      row.append(nameCell(name), cell(unit), cell(''), cell(''), cell(''));
      return row;
    });
    this.outputs = tableOf(['output', 'unit', 'value', 'rate', 'second rate']);
    this.observed = player.data.outputs.map(({ name, unit }) => {
      const row = this.outputs.tBodies[0].insertRow();
      row.append(nameCell(name), cell(unit), cell(''), cell(''), cell(''));
      return row;
    });
    this.ready = columns.all().find(({ title }) => title === 'Four-bars')?.items ?? [];
    const found = tableOf(['four-bar', 'unit', 'value']);
    this.transmitted = this.ready.map(({ label, unit }) => {
      const row = found.tBodies[0].insertRow();
      row.append(cell(label, 'th'), cell(unit), cell(''));
      return row;
    });
    this.equations = tableOf(['constraint', 'type', '|Phi|']);
    this.joints = player.data.drawing.joints.map(({ name, kind, is_driver }) => {
      const row = this.equations.tBodies[0].insertRow();
      row.append(cell(name, 'th'), cell(is_driver ? `${kind}, driver` : kind), cell(''));
      return row;
    });
    const named = [[this.rows, player.data.coordinates], [this.observed, player.data.outputs], [this.joints, player.data.drawing.joints],
      [this.transmitted, this.ready.map(({ label }) => ({ name: label }))]];
    const find = rowFinder('Find in the tables', () => named.flatMap(([rows, items]) => rows.map((row, k) => [`${items[k].name} ${symbolText(items[k].name)}`, row])));
    bar.append(this.at, find, this.copy);
    panel.append(bar, ...(this.observed.length ? [wide(this.outputs)] : []), ...(this.ready.length ? [wide(found)] : []), wide(this.motion), wide(this.equations));
  },

  update(state) {
    const { data } = player;
    const time = `t = ${units.full(state.time, 's')}`;
    this.at.textContent = state.isFound ? time
      : `${time}: not found; positions are the last found, or the guess`;
    const fill = (row, unit, values) => {
      row.cells[1].textContent = units.name(unit);
      values.forEach((value, k) => {
        const own = unit ? unit + ['', '/s', '/s²'][k] : '';
        row.cells[2 + k].textContent = units.text(k && !state.isFound ? NaN : value, own);
      });
    };
    this.rows.forEach((row, k) => fill(row, data.coordinates[k].unit, [state.q[k], state.q_dot[k], state.q_ddot[k]]));
    const at = state.index * data.outputs.length;
    const order = (name, k) => (state.isFound ? data.arrays[name][at + k] : NaN);
    this.observed.forEach((row, k) => fill(row, data.outputs[k].unit, ['y', 'y_dot', 'y_ddot'].map(name => order(name, k))));
    this.ready.forEach(({ unit, at }, k) => {
      const value = state.isFound ? at(state) : NaN;
      this.transmitted[k].cells[1].textContent = units.name(unit);
      this.transmitted[k].cells[2].textContent = units.text(value, unit, Math.max(1, Math.abs(value)));
    });
    this.joints.forEach((row, k) => {
      const value = residualAt(state, k);
      row.cells[2].textContent = value === null ? '–' : value.toExponential(2);
      row.classList.toggle('bad', value > data.violated);
    });
  },

  /* The tables as text with tabs, for a spreadsheet: full precision. */
  text() {
    const { state, data } = player;
    const lines = [`t\t${state.time}`, 'coordinate\tunit\tposition\tvelocity\tacceleration'];
    data.coordinates.forEach(({ name, unit }, k) => lines.push(
      [name, units.name(unit), ...[state.q[k], ...(state.isFound ? [state.q_dot[k], state.q_ddot[k]] : ['', ''])]
        .map(value => (value === '' ? value : value * units.factor(unit)))].join('\t')));
    return `${lines.join('\n')}\n`;
  },
};

/* The residual of a constraint at a state, null where it is not known. */
function residualAt(state, k) {
  const { arrays, drawing, guessResidual } = player.data;
  if (!state.isFound) return hasMotion() ? null : guessResidual[k];
  return arrays.residual ? finite(arrays.residual[state.index * drawing.joints.length + k]) : null;
}

/* Copy text; pages opened from a file may have to do it the old way. */
export async function copied(text) {
  try {
    await navigator.clipboard.writeText(text);
    return true;
  } catch {
    const area = document.createElement('textarea');
    area.value = text;
    document.body.append(area);
    area.select();
    const isDone = document.execCommand('copy');
    area.remove();
    return isDone;
  }
}

export const points = {
  build(panel) {
    const unit = player.data.lengthUnit;
    const titles = [...AXES.map(axis => `${axis} [${unit}]`), `|v| [${unit}/s]`, `|a| [${unit}/s²]`];
    const table = tableOf(['point', 'path', ...titles, 'what']);
    this.table = table;
    this.rows = [];
    for (const point of stage.points) this.addRow(point);
    const find = rowFinder('Find a point', () => this.rows.map(({ row, point }) => [`${point.name} ${point.kind}`, row]));
    panel.append(find, wide(table), this.form());
  },

  addRow(point) {
    const row = this.table.tBodies[0].insertRow();
    const box = document.createElement('input');
    Object.assign(box, { type: 'checkbox', ariaLabel: `Path of ${point.name}` });
    box.addEventListener('change', () => stage.toggleTrace(point));
    const holder = cell('');
    holder.append(box);
    row.append(cell(point.name, 'th'), holder, ...AXES.map(() => cell('')), cell(''), cell(''), cell(point.kind));
    row.addEventListener('pointerenter', () => stage.hover(point));
    row.addEventListener('pointerleave', () => stage.hover(null));
    box.addEventListener('focus', () => stage.hover(point));
    box.addEventListener('blur', () => stage.hover(null));
    this.rows.push({ row, box, point });
  },

  /* A point of one's own: a body and its coordinates there. */
  form() {
    const form = document.createElement('form');
    const body = document.createElement('select');
    body.setAttribute('aria-label', 'Body');
    body.append(...player.data.drawing.bodies.map((name, index) => new Option(name, index)));
    const local = AXES.map((_, k) => {
      const name = ['xi', 'eta', 'zeta'][k];
      const input = document.createElement('input');
      Object.assign(input, { type: 'number', step: 'any', value: '0', ariaLabel: name });
      return input;
    });
    const add = document.createElement('button');
    add.textContent = 'Trace this point';
    form.append('Point of ', body, ' at ', ...local, add);
    form.addEventListener('submit', event => {
      event.preventDefault();
      const at = local.map(input => Number(input.value));
      const { bodies, frames } = player.data.drawing;
      const name = `${bodies[body.value]} (${at.join(', ')})`;
      const point = { name, kind: 'chosen', frame: frames[body.value], point: at };
      stage.points.push(point);
      this.addRow(point);
      stage.toggleTrace(point);
    });
    return form;
  },

  update(state) {
    const unit = player.data.lengthUnit;
    for (const { row, box, point } of this.rows) {
      box.checked = stage.traced.has(point);
      const place = stage.where(point, state);
      const { velocity, acceleration } = ratesInWorld(state, point.frame, point.point);
      const values = [...place, Math.hypot(...velocity), Math.hypot(...acceleration)];
      row.cells[1].style.background = stage.traced.has(point) ? stage.colourOf(point) : '';
      values.forEach((value, k) => {
        const per = ['/s', '/s²'][k - AXES.length] ?? '';
        row.cells[2 + k].textContent = units.text(per && !state.isFound ? NaN : value, unit + per);
      });
    }
  },
};
