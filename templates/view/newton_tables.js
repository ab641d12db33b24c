/* What Newton's iterates say in numbers: convergence, residuals, coordinates and Phi_q. */

import { svgElement } from './elements.js';
import { cell, numberText, tableOf } from './tables.js';
import { newton } from './newton.js';

export const newtonTables = (() => {
  const PLOT = { width: 340, height: 200, left: 34, right: 10, top: 10, bottom: 26 };
  const LOWEST = -17;  // log10 of the smallest number that differs from zero
  const HIGHEST = 308;  // and of the largest one
  const MOST_DIGITS = 10;  // coordinates up to which a cell of Phi_q has room for its number
  const NEXT = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] };

  const brief = x => (x === 0 ? '0' : x.toExponential(0));
  const scientific = x => (Number.isFinite(x) ? x.toExponential(2) : '\u2013');
  const twoDigits = x => (Math.abs(x) < 0.01 ? brief(x) : +x.toPrecision(2));
  const logarithm = x => Math.max(LOWEST, Math.min(HIGHEST, Math.log10(Math.abs(x))));

  function row(cells) {
    const made = document.createElement('tr');
    made.append(...cells);
    return made;
  }

  /* Tables keep their element, and with it the place to which they are scrolled. */
  function fill(table, heads, rows) {
    const made = tableOf(heads);
    made.tBodies[0].append(...rows);
    table.replaceChildren(...made.children);
  }

  /* log10 of the correction and of the residual over the iterations: a straight line is linear
     convergence, one that falls twice as fast at every step is quadratic. */
  function convergence(svg, iterates, total) {
    const { width, height, left, right, top, bottom } = PLOT;
    const last = Math.max(total, 4);
    const residuals = iterates.map(({ Phi }) => logarithm(newton.norm(Phi)));
    const corrections = iterates.map(({ correction }) => logarithm(correction)).slice(1);
    const highest = Math.max(1, Math.ceil(Math.max(...residuals, ...corrections)));
    const x = k => left + (k / last) * (width - left - right);
    const y = value => top + ((highest - value) / (highest - LOWEST)) * (height - top - bottom);
    svg.replaceChildren();
    for (let value = 4 * Math.floor(highest / 4); value >= LOWEST; value -= 4) {
      const line = { class: 'rule', x1: left, x2: width - right, y1: y(value), y2: y(value) };
      const label = { x: left - 5, y: y(value) + 4, 'text-anchor': 'end' };
      svg.append(svgElement('line', line), svgElement('text', label, String(value)));
    }
    for (let k = 0; k <= last; k += Math.ceil(last / 10)) {
      svg.append(svgElement('text', { x: x(k), y: height - 8, 'text-anchor': 'middle' }, String(k)));
    }
    curve(svg, 'residual', residuals.map((value, k) => [x(k), y(value)]));
    curve(svg, 'correction', corrections.map((value, k) => [x(k + 1), y(value)]));
  }

  function curve(svg, kind, points) {
    svg.append(svgElement('polyline', { class: kind, points: points.join(' ') }));
    points.forEach(([cx, cy]) => svg.append(svgElement('circle', { class: kind, cx, cy, r: 3.5 })));
  }

  /* The order of convergence that three corrections show; none once rounding decides. */
  function order(iterates, k) {
    if (k < 3) return '';
    const [a, b, c] = [k - 2, k - 1, k].map(i => iterates[i].correction);
    const isRounding = c < 1e-14 * (1 + newton.norm(iterates[k].q));
    return isRounding || b > a / 4 || c > b / 4 ? '' : (Math.log(c / b) / Math.log(b / a)).toFixed(1);
  }

  function iterations(table, iterates) {
    const heads = ['k', '|\u0394q|', 'log\u2081\u2080|\u0394q|', 'order', '|\u03a6|', 'det \u03a6_q'];
    fill(table, heads, iterates.map(({ Phi, correction, factors }, k) => row([
      String(k),
      scientific(correction),
      k ? Math.log10(correction).toFixed(1).replace('-0.0', '0.0') : '',
      order(iterates, k),
      scientific(newton.norm(Phi)),
      scientific(factors.determinant),
    ].map(text => cell(text)))));
  }

  /* A row a constraint, a column an iterate: the norm of the constraint's rows of Phi. */
  function residuals(table, iterates, constraints) {
    const heads = ['constraint', ...iterates.keys()];
    fill(table, heads, constraints.map(({ name, rows: [first, count] }) => {
      const cells = iterates.map(({ Phi }) => {
        const value = newton.norm(Phi.slice(first, first + count));
        const made = Object.assign(cell(brief(value)), { title: `${name}: ${value}` });
        shade(made, 1 - Math.min(0, logarithm(value)) / LOWEST);
        return made;
      });
      return row([cell(name, 'th'), ...cells]);
    }));
  }

  /* Colour a cell by a part between 0 and 1. */
  function shade(element, part) {
    element.style.setProperty('--part', `${Math.round(45 * part)}%`);
  }

  /* The guess as fields, with place for the iterate and its correction; onGuess(k, value): the
     k-th coordinate was typed.  Rows are returned, and stay, so that a field keeps its focus. */
  function coordinates(table, model, onGuess) {
    const rows = model.COORDINATES.map((name, k) => {
      const unit = model.UNITS[name], holder = cell('');
      holder.append(guessField(name, value => onGuess(k, value)));
      return row([cell(unit ? `${name} [${unit}]` : name, 'th'), holder, cell(''), cell('')]);
    });
    fill(table, ['coordinate', 'guess', 'q', '\u0394q'], rows);
    return rows;
  }

  function guessField(name, onValue) {
    const field = document.createElement('input');
    Object.assign(field, { type: 'text', inputMode: 'decimal', ariaLabel: `Guess of ${name}` });
    field.addEventListener('change', () => {
      const value = Number(field.value.trim().replace('\u2212', '-') || NaN);
      field.ariaInvalid = String(!Number.isFinite(value));
      if (Number.isFinite(value)) onValue(value);
    });
    return field;
  }

  function guessValues(rows, guess) {
    rows.forEach(({ cells }, k) => {
      const field = cells[1].firstChild;
      field.value = +guess[k].toPrecision(9);
      field.ariaInvalid = 'false';
    });
  }

  function coordinateValues(rows, { q, step }) {
    rows.forEach(({ cells }, k) => {
      cells[2].textContent = numberText(q[k]);
      cells[3].textContent = step ? scientific(step[k]) : '';
    });
  }

  /* Phi_q as a grid, whose cells are returned by row and column; onEntry(i, j): one is looked at. */
  function jacobian(table, model, onEntry) {
    const cells = model.EQUATIONS.map(() => model.COORDINATES.map(() => cell('')));
    fill(table, ['', ...model.COORDINATES],
      model.EQUATIONS.map((name, i) => row([cell(name, 'th'), ...cells[i]])));
    cells.flat().forEach(element => { element.tabIndex = -1; });
    cells[0][0].tabIndex = 0;
    const placed = event => {
      const element = event.target.closest('tbody td');
      return element && [element.parentElement.rowIndex - 1, element.cellIndex - 1];
    };
    for (const kind of ['pointerover', 'focusin']) {
      table.addEventListener(kind, event => {
        const place = placed(event);
        if (place) onEntry(...place);
      });
    }
    table.addEventListener('keydown', event => {
      const place = placed(event);
      if (!place || !NEXT[event.key]) return;
      const [i, j] = place.map((at, axis) => at + NEXT[event.key][axis]);
      if (cells[i] && cells[i][j]) cells[i][j].focus();
      event.preventDefault();
      event.stopPropagation();
    });
    return cells;
  }

  /* Colour by sign and size: by the root, so that a one is seen beside lever arms of tens. */
  function jacobianValues(cells, model, Phi_q) {
    const most = Math.max(...Phi_q.map(newton.largest)) || 1;
    for (const [i, j] of model.PATTERN) {
      const value = Phi_q[i][j], element = cells[i][j];
      element.className = value < 0 ? 'negative' : 'positive';
      shade(element, 0.15 + 0.85 * Math.sqrt(Math.abs(value) / most));
      const isRounding = Math.abs(value) < 1e-14 * most;
      if (model.N_COORDINATES <= MOST_DIGITS) {
        element.textContent = isRounding ? 0 : twoDigits(value);
      }
    }
  }

  return {
    convergence, iterations, residuals, coordinates, guessValues, coordinateValues, jacobian,
    jacobianValues,
  };
})();
