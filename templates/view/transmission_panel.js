/* The panel of a transmission: inputs as sliders, outputs, J and mechanical advantage, and a map of the inputs with the
   singular positions in it. The drawing shows the pose of the inputs while the panel is open and time rests. */

import { player } from './player.js';
import { multiples, niceStep, ROUNDING_PART, stepText, units } from './units.js';
import { isSpatial, orbit } from '#world';
import { byId, setAttributes, svgElement } from './elements.js';
import { cell, numberText, tableOf } from './tables.js';
import { Slider } from './sliders.js';
import { live } from './live.js';
import { shortNumber } from './measures.js';
import { Branch } from './transmission.js';
import { InputMap, isReached } from './transmission_map.js';

const CHART = { width: 340, height: 250, left: 46, right: 10, top: 10, low: 36 };
const MOST_MAPPED = 3;  // inputs that have a map: of three a slice, the last one held
const SCARCE = 40;  // units of it between ticks, about

// What changes its height is below the sliders and the map, so that neither moves while it is dragged.
const TRANSMISSION_MARKUP = `
  <h2>Inputs</h2>
  <div class="sliders"></div>
  <div class="bar"><button type="button" id="first-pose">First pose</button></div>
  <div class="where"><svg class="map" viewBox="0 0 ${CHART.width} ${CHART.height}" role="img"></svg>
    <div class="legend"><p class="input">Input singularity (type 1): det J = 0, the outputs stand still</p>
      <p class="output">Output singularity (type 2): the branch ends</p>
      <p>Drag the point, or press where it is to go.</p><ul class="singular"></ul></div></div>
  <output class="reached" role="status"></output>
  <div class="readouts">
    <div><h2>Outputs</h2><div class="wide"><table class="outputs"></table></div></div>
    <div><h2>J = dx/du</h2><div class="wide"><table class="jacobian"></table></div></div>
    <div><h2>Mechanical advantage</h2><div class="wide"><table class="advantage"></table></div></div></div>
  <p class="quiet advantage-note"></p>`;

/* A number among others of a size: what is rounding beside it is zero. */
function numberBeside(value, size) {
  return Math.abs(value) <= ROUNDING_PART * size ? '0' : numberText(value);
}

/* A quotient of two units with that of it; angles are in radians. */
function quotientText(text, above, below) {
  if (text === '–' || above === below) return text;
  return `${text} ${below ? `${above || 1}/${below}` : above}`;
}

export const transmission = {
  panel: null,
  map: null,  // of the parameters as they are, when it is found
  pose: null,  // the last that was reached

  get isOpen() {
    return this.branch && !this.panel.hidden;
  },

  build(panel) {
    const { transmission: ends } = player.data;
    byId('tab-transmission').hidden = !ends;
    if (!ends) return;
    this.panel = panel;
    if (transmitted.reason) {
      panel.append(`This mechanism is no function of its inputs here: ${transmitted.reason}`);
      return;
    }
    panel.classList.add('transmission');
    panel.innerHTML = TRANSMISSION_MARKUP;
    this.part('.where').hidden = ends.inputs.length > MOST_MAPPED;
    this.begin();
    byId('first-pose').addEventListener('click', () => this.first());
    this.listen();
  },

  part(selector) {
    return this.panel.querySelector(selector);
  },

  /* The values of the parameters, as the function takes them. */
  values() {
    const { parameters } = player.data;
    return transmitted.PARAMETERS.map(name => parameters.find(item => item.name === name).value);
  },

  /* Take the parameters as they are; inputs stay. */
  begin() {
    const { inputs } = player.data.transmission;
    this.search?.stop();
    this.branch = new Branch(this.values());
    this.map = null;
    const { home } = this.branch;
    this.u = this.u ?? home.u;
    this.pose = isReached(home) ? home : null;
    const ends = this.pose ? this.branch.limits(home) : inputs.map(() => [null, null]);
    this.sliders ??= inputs.map((input, k) => new Slider(
      this.part('.sliders'), `input-${k}`, { ...input, low: -1, high: 1 },
      value => this.set(this.u.map((x, j) => (j === k ? value : x))), () => {}));
    this.span(ends.map(([low, high], k) => {
      const far = inputs[k].unit === 'rad' ? Math.PI : this.branch.size;
      return [low ?? home.u[k] - far, high ?? home.u[k] + far];
    }));
    this.find();
    this.look();
  },

  /* Search the axis or the plane of the first inputs; a third one is held as it is. */
  look() {
    this.search?.stop();
    const { branch, u } = this, { home } = branch;
    if (u.length > MOST_MAPPED || !isReached(home)) return;
    const here = u.length < 3 ? home : branch.go(home, [...home.u.slice(0, 2), u[2]]);
    this.held = u[2];
    if (!isReached(here) && this.pose?.u[2] !== u[2]) return;
    const search = new InputMap(branch, isReached(here) ? here : this.pose);
    this.search = search;
    search.search(() => this.take(search));
  },

  /* Sliders go a little beyond what can be reached, so that they show what happens there. */
  span(ends) {
    ends.forEach(([low, high], k) => {
      const isTurn = high - low > 2 * Math.PI - 1e-6 && player.data.transmission.inputs[k].unit === 'rad', over = isTurn ? 0 : 0.08 * (high - low);
      this.sliders[k].reach(low - over, high + over);
    });
  },

  /* Show a map that was searched for; the drawing has room for all its poses. */
  take(map) {
    const isFirst = !this.map;
    this.map = map;
    this.span(map.box);
    const areas = map.areas.flat();
    if (map.box.length === 1) map.box = [[areas[0].u[0], areas[areas.length - 1].u[0]]];
    if (isFirst) {
      player.more = map.poses.map(({ all }) => ({ q: all, isFound: true }));
      live.fit();
      if (isSpatial) orbit.forget();
    }
    this.find();
    player.refresh();
  },

  /* Take inputs, and find their pose before the next frame. */
  set(u) {
    this.u = u;
    if (this.frame) return;
    this.frame = requestAnimationFrame(() => {
      this.frame = null;
      player.pause();
      this.find();
      if (u[2] !== this.held) this.look();
      this.show();
    });
  },

  /* Go back to the first pose: to that itself, not on a way that may end a rounding beside it. */
  first() {
    const { home } = this.branch;
    this.pose = isReached(home) ? home : null;
    this.set(home.u);
  },

  /* Go to the inputs from the last pose; where no straight way leads there, from the first one, as f(u) in Python, or from the
     nearest of the map. */
  find() {
    const { branch } = this, { home } = branch;
    this.found = home;
    if (!isReached(home)) return;
    const starts = [this.pose, home, this.map?.near(this.u)].filter(Boolean);
    this.isAround = false;
    for (const start of starts) {
      this.found = start.u.every((x, k) => x === this.u[k]) ? start : branch.go(start, this.u);
      if (isReached(this.found)) break;
      this.isAround = true;
    }
    if (isReached(this.found)) this.pose = this.found;
  },

  /* Show the pose in the drawing. */
  show() {
    const { index, time } = player.state, still = new Float64Array(player.n), { pose } = this;
    const q = Float64Array.from(pose?.all ?? player.data.guess);
    player.show({ index, time, q, q_dot: still, q_ddot: still, isFound: isReached(this.found), pose: this.found });
  },

  /* A state is shown: what the panel says follows. */
  follow(state) {
    if (!this.isOpen) return;
    if (this.values().some((x, k) => x !== this.branch.p[k])) {
      this.begin();
      this.show();
    } else if (state.pose) this.tell();
  },

  /* ---- what is said ---- */

  tell() {
    const isFound = isReached(this.found);
    this.sliders.forEach((slider, k) => slider.show(this.u[k]));
    const said = this.part('.reached');
    said.textContent = this.sentence();
    said.classList.toggle('failed', !isFound);
    this.tellOutputs();
    this.tellJacobian();
    this.tellAdvantage();
    this.draw();
  },

  /* Inputs with their units: left = 0.25 m, right = 0.22 m. */
  inputsText(u) {
    return player.data.transmission.inputs.map(({ name, unit }, k) =>
      `${name} = ${shortNumber(u[k] * units.factor(unit))} ${units.name(unit)}`.trim()).join(', ');
  },

  sentence() {
    const { branch, found, pose } = this;
    if (!pose) return 'With these parameters no pose was found at the first inputs.';
    if (isReached(found)) return `${this.isAround ? 'Reached on a way around an output singularity. ' : ''}${this.reachText(branch.limits(found))}`;
    const end = branch.end(pose, this.u) ?? pose, which = [...end.u.keys()].filter(k => Math.abs(this.u[k] - pose.u[k]) > 0);
    const limits = player.data.transmission.inputs.map(({ name }) => name).filter((_, k) => which.includes(k)).join(' and ');
    const why = this.found.status === 3 ? 'an equation has no value beyond'
      : 'an output singularity (type 2), where two assemblies meet';
    return `${this.inputsText(this.u)} cannot be reached: the limit of ${limits} is at ${this.inputsText(end.u)}, ${why}. `
      + 'Shown is the last pose that was reached.';
  },

  /* How far each input goes from here. */
  reachText(limits) {
    const parts = limits.map(([low, high], k) => {
      const { name, unit } = player.data.transmission.inputs[k];
      const text = end => shortNumber(end * units.factor(unit));
      const own = units.name(unit);
      if (low === null && high === null) return unit === 'rad' ? `${name} turns fully` : `${name} has no limit near`;
      if (low === null) return `${name} goes up to ${text(high)} ${own}`;
      return `${name} goes from ${text(low)}${high === null ? ` ${own} on` : ` to ${text(high)} ${own}`}`;
    });
    const others = limits.length > 1 ? `, with the other${limits.length > 2 ? 's' : ''} held` : '';
    return `${parts.join('; ')}${others}.`;
  },

  tellOutputs() {
    const { outputs } = player.data.transmission, isFound = isReached(this.found);
    fillTable(this.part('.outputs'), ['output', 'value'], outputs.map(({ name, unit }, k) =>
      [units.titled(name, unit), isFound ? numberBeside(this.found.x[k] * units.factor(unit), this.branch.scales[1][k]) : '–']));
  },

  tellJacobian() {
    const { inputs, outputs } = player.data.transmission, { J } = this.found;
    fillTable(this.part('.jacobian'), ['', ...inputs.map(({ name }) => `by ${name}`)], outputs.map(({ name, unit }, i) =>
      [name, ...inputs.map((input, j) => quotientText(numberBeside(J[i][j], Math.hypot(...J[i])), unit, input.unit))]));
  },

  /* One input: 1/J. Several: what each supplies for a unit of an output, and how unlike directions are. */
  tellAdvantage() {
    const { inputs, outputs } = player.data.transmission, { J } = this.found, table = this.part('.advantage');
    const note = this.part('.advantage-note');
    if (inputs.length === 1) {
      fillTable(table, ['', '1/J'], outputs.map(({ name, unit }, i) =>
        [name, quotientText(numberText(1 / J[i][0]), inputs[0].unit, unit)]));
      note.textContent = `What the output delivers for an effort of 1 of ${inputs[0].name}; at an input singularity it is infinite.`;
      return;
    }
    const rows = outputs.map(({ name }, i) => {
      const tau = transmitted.effort(J, outputs.map((_, k) => (k === i ? 1 : 0)));
      return [`1 of ${name}`, ...Array.from(tau, x => numberBeside(x, Math.hypot(...tau)))];
    });
    fillTable(table, ['effort for', ...inputs.map(({ name }) => name)], rows);
    note.textContent = this.stretchText();
  },

  stretchText() {
    if (!isReached(this.found)) return '';
    const { inputs, outputs } = player.data.transmission, { branch, found } = this;
    const isAlike = [inputs, outputs].every(own => own.every(({ unit }) => unit === own[0].unit));
    const sizes = branch.stretches(found, !isAlike), [least, most] = [sizes[0], sizes[sizes.length - 1]];
    const [above, below] = isAlike ? [outputs[0].unit, inputs[0].unit] : ['', ''];
    const all = sizes.toReversed().map(x => quotientText(numberText(x), above, below)).join(', ');
    const scaled = isAlike ? '' : ', with lengths in sizes of the mechanism';
    const determinant = branch.isSquare ? ` det J = ${numberText(branch.determinant(found))}.` : '';
    return `tau_u = Jᵀ tau_x. Singular values of J${scaled}: ${all}; condition number ${numberText(most / least)}.${determinant}`;
  },

  /* ---- the map ---- */

  /* What goes up in the map: the second input, or the first output; of an angular velocity, which has no value, the derivative. */
  upright() {
    const { inputs, outputs: [first] } = player.data.transmission;
    if (inputs[1]) return { ...inputs[1], of: pose => pose.u[1] };
    if (Number.isFinite(this.branch.home.x[0])) return { ...first, of: pose => pose.x[0] };
    return { name: `d ${first.name}/d ${inputs[0].name}`, unit: '', of: pose => pose.J[0][0] };
  },

  /* From inputs, or an input and the first output, to the chart. */
  chart() {
    const { map } = this, [x] = map.box, { width, height, left, right, top, low } = CHART;
    const second = this.upright(), values = map.poses.map(second.of);
    const spread = [values.reduce((a, b) => Math.min(a, b)), values.reduce((a, b) => Math.max(a, b))];
    const padded = range => range.map((end, side) => end + (side ? 0.05 : -0.05) * (range[1] - range[0] || 20));
    const [across, up] = [padded(x), padded(map.box[1] ?? spread)];
    const place = (value, range, from, to) => from + (value - range[0]) / (range[1] - range[0]) * (to - from);
    return {
      across, up, second,
      at: pose => [place(pose.u[0], across, left, width - right), place(second.of(pose), up, height - low, top)],
      inputs: ([a, b]) => [across[0] + (a - left) / (width - right - left) * (across[1] - across[0]),
        up[0] + (height - low - b) / (height - low - top) * (up[1] - up[0])].slice(0, map.box.length),
    };
  },

  draw() {
    const svg = this.part('.map'), { map } = this;
    if (!map) return;
    if (this.drawn !== map || this.drawnAngle !== units.angle) {
      Object.assign(this, { drawn: map, drawnAngle: units.angle, axes: this.chart() });
      svg.replaceChildren(...this.background(this.axes));
      this.dot = svgElement('circle', { class: 'dot', r: 7 });
      svg.append(this.dot);
      this.listSingular();
    }
    const [x, y] = this.axes.at(this.pose);
    setAttributes(this.dot, { cx: x, cy: y, class: isReached(this.found) ? 'dot' : 'dot lost' });
    svg.setAttribute('aria-label', `${this.isPlane ? 'Plane' : 'Axis'} of the inputs: ${this.inputsText(this.pose.u)}. ${
      this.count('output')} and ${this.count('input')}.`);
  },

  get isPlane() {
    return player.data.transmission.inputs.length > 1;
  },

  count(type) {
    const count = this.map.curves.filter(curve => curve.type === type).length;
    const what = `${type} singularities`;
    return this.isPlane ? `${count ? '' : 'no '}${what}${count ? ' as curves' : ''}` : `${count} ${what}`;
  },

  background({ across, up, second, at }) {
    const { width, height, left, right, top, low } = CHART, { map } = this;
    const { inputs } = player.data.transmission;
    /** @param {any} more */
    const write = (text, x, y, anchor, more = {}) => svgElement('text', { x, y, 'text-anchor': anchor, ...more }, text);
    const path = (className, pieces, end = '') => svgElement('path', {
      class: className, d: pieces.map(poses => `M${poses.map(pose => at(pose).map(x => x.toFixed(2))).join('L')}${end}`).join(''),
    });
    const ticks = (range, unit, length) => {
      const factor = units.factor(unit), [a, b] = range.map(x => x * factor), step = niceStep((b - a) * SCARCE / length);
      return multiples(step, a, b).map(x => [(x / factor - range[0]) / (range[1] - range[0]), stepText(x, step)]);
    };
    const frame = svgElement('rect', { class: 'frame', x: left, y: top, width: width - left - right, height: height - top - low });
    const scaleX = ticks(across, inputs[0].unit, width - left - right).map(([part, text]) =>
      write(text, left + part * (width - left - right), height - low + 13, 'middle'));
    const scaleY = ticks(up, second.unit, height - top - low).map(([part, text]) =>
      write(text, left - 4, height - low - part * (height - top - low) + 4, 'end'));
    const titles = [
      write(units.titled(inputs[0].name, inputs[0].unit), (left + width - right) / 2, height - 5, 'middle', { class: 'title' }),
      write(units.titled(second.name, second.unit), -(top + height - low) / 2, 11, 'middle', { class: 'title', transform: 'rotate(-90)' }),
    ];
    const held = inputs.slice(2, MOST_MAPPED).map(({ name, unit }) => write(
      `${name} = ${shortNumber(map.home.u[2] * units.factor(unit))} ${units.name(unit)}`, width - right - 4, top + 12, 'end', { class: 'title' }));
    const curves = type => map.curves.filter(curve => curve.type === type).map(({ ends }) => ends);
    const drawn = this.isPlane
      ? [path('area', map.areas, 'Z'), path('output', curves('output')), path('input', curves('input'))]
      : [path('line', map.areas), ...['output', 'input'].flatMap(type => curves(type).map(([pose]) => this.mark(type, at(pose))))];
    return [frame, ...drawn, ...scaleX, ...scaleY, ...titles, ...held];
  },

  /* A singular position of a single input: a line across the axis, and what tells the types apart without colours. */
  mark(type, [x, y]) {
    const group = svgElement('g', { class: type });
    group.append(svgElement('line', { x1: x, x2: x, y1: CHART.top, y2: CHART.height - CHART.low }));
    group.append(type === 'input' ? svgElement('circle', { cx: x, cy: y, r: 4 })
      : svgElement('rect', { x: x - 4, y: y - 4, width: 8, height: 8 }));
    return group;
  },

  /* The singular positions of a single input in words. */
  listSingular() {
    const places = this.isPlane ? [] : this.map.curves;
    this.part('.singular').replaceChildren(...places.map(({ type, ends: [pose] }) => {
      const item = document.createElement('li'), button = document.createElement('button');
      Object.assign(button, { type: 'button', className: type, textContent: `${type} singularity: ${this.inputsText(pose.u)}` });
      button.addEventListener('click', () => this.set(pose.u));
      item.append(button);
      return item;
    }));
  },

  listen() {
    const svg = this.part('.map');
    const drag = event => {
      if (!this.map || !(event.buttons & 1)) return;
      const box = svg.getBoundingClientRect(), scale = CHART.width / box.width;
      const u = this.axes.inputs([(event.clientX - box.left) * scale, (event.clientY - box.top) * scale]);
      this.set([...u.map(x => +x.toPrecision(6)), ...this.u.slice(u.length)]);
      event.preventDefault();
    };
    svg.addEventListener('pointerdown', event => {
      svg.setPointerCapture(event.pointerId);
      drag(event);
    });
    svg.addEventListener('pointermove', drag);
    player.onChange(state => this.follow(state));
  },
};

/* Fill a table with titles and rows of text, the first of each its title. */
function fillTable(table, titles, rows) {
  const made = tableOf(titles);
  for (const [title, ...texts] of rows) made.tBodies[0].insertRow().append(cell(title, 'th'), ...texts.map(text => cell(text)));
  table.replaceChildren(...made.children);
}
