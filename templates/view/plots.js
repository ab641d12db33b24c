'use strict';
/* Plots over time, drawn by uPlot; the line of the current time is our own. */

const PLOT_HEIGHT = 165;

/* Everything that can be plotted: groups of { label, unit, values, isLog }. */
function plottable(data) {
  const { count } = player;
  const column = (name, k, width) => Array.from({ length: count },
    (_, row) => finite(data.arrays[name][row * width + k]));
  const rates = [['', '', ''], ['_dot', '_dot', '/s'], ['_ddot', '_ddot', '/s²']];
  const titled = (titles, owners, array) => rates.map(([order, ending, per], k) => ({
    title: titles[k],
    items: owners.map(({ name, unit }, place) => ({
      label: name + ending, unit: unit ? unit + per : '',
      values: () => column(array + order, place, owners.length),
    })),
  }));
  const groups = [
    ...titled(['Output', 'Rate of an output', 'Second rate of an output'], data.outputs, 'y'),
    ...titled(['Position', 'Velocity', 'Acceleration'], data.coordinates, 'q'),
  ];
  const joints = data.drawing.joints;
  groups.push({
    title: 'Residual',
    items: !data.arrays.residual ? [] : joints.map(({ name }, k) => ({
      label: `|Phi| of ${name}`, unit: '', isLog: true,
      values: () => column('residual', k, joints.length).map(aboveZero),
    })),
  });
  const jacobian = [];
  if (data.arrays.condition) {
    jacobian.push({ label: 'condition number of Phi_q', unit: '', isLog: true,
      values: () => column('condition', 0, 1) });
  }
  if (data.arrays.determinant) {
    jacobian.push({ label: 'determinant of Phi_q', unit: '', values: () => column('determinant', 0, 1) });
  }
  groups.push({ title: 'Jacobian', items: jacobian });
  return groups.filter(group => group.items.length);
}

function timesFall() {
  return player.t[0] > player.t[player.count - 1];
}

function finite(value) {
  return Number.isFinite(value) ? value : null;
}

/* A residual of exactly zero has no logarithm. */
function aboveZero(value) {
  return value === null ? null : Math.max(value, 1e-18);
}

class Plot {
  constructor(groups, label) {
    this.items = groups.flatMap(group => group.items);
    this.element = document.createElement('div');
    this.element.className = 'plot';
    const bar = document.createElement('div');
    bar.className = 'bar';
    this.choice = document.createElement('select');
    this.choice.setAttribute('aria-label', 'What is plotted');
    for (const group of groups) this.choice.append(optionGroup(group));
    this.choice.value = label;
    this.choice.addEventListener('change', () => this.redraw());
    const close = document.createElement('button');
    Object.assign(close, { type: 'button', textContent: '×', title: 'Remove this plot' });
    close.addEventListener('click', () => plots.remove(this));
    bar.append(this.choice, close);
    this.holder = document.createElement('div');
    this.element.append(bar, this.holder);
    this.cursor = document.createElement('div');
    this.cursor.className = 'now';
  }

  redraw() {
    if (this.chart) this.chart.destroy();
    this.chart = new uPlot(this.options(this.item), this.series(), this.holder);
    this.chart.over.append(this.cursor);
  }

  get item() {
    return this.items.find(({ label }) => label === this.choice.value);
  }

  series() {
    const order = timesFall() ? x => x.reverse() : x => x;  // uPlot wants rising times
    return [order(Array.from(player.t)), order(this.item.values())];
  }

  options(item) {
    const { ink, quiet, line } = stage.palette;
    const axis = { stroke: quiet, grid: { stroke: line, width: 1 }, ticks: { stroke: line, width: 1 },
      font: '11px system-ui, sans-serif' };
    const written = value => (value === null || value === undefined ? '–' : numberText(value));
    return {
      width: this.width(), height: PLOT_HEIGHT,
      scales: { x: { time: false }, y: item.isLog ? { distr: 3 } : { range: openRange } },
      axes: [
        { ...axis, size: 26, values: (_, ticks) => ticks.map(tick => `${+tick.toPrecision(6)}`) },
        { ...axis, size: 62, values: (_, ticks) => ticks.map(tick => (tick === null ? '' : brief(tick))) },
      ],
      series: [
        { label: 't', value: (_, value) => written(value) },
        { label: item.unit ? `${item.label} [${item.unit}]` : item.label, stroke: stage.palette.plot || ink,
          width: 1.75, pxAlign: 0,  // on whole pixels a curve is a staircase
          points: { show: player.count < 2 }, value: (_, value) => written(value) },
      ],
      cursor: { drag: { x: true, y: false }, points: { size: 6 } },
      hooks: {
        drawClear: [chart => this.shadeFailures(chart)],
        draw: [chart => this.drawEvents(chart)],
        setCursor: [() => this.showNumbers(player.state)],
        ready: [chart => {
          this.listen(chart);
          this.move(player.state);
        }],
      },
    };
  }

  width() {
    return Math.max(200, this.element.clientWidth);
  }

  /* A click, and not the end of a drag, sets the time. */
  listen(chart) {
    let from = 0;
    chart.over.addEventListener('pointerdown', event => { from = event.clientX; });
    chart.over.addEventListener('click', event => {
      if (Math.abs(event.clientX - from) > 3) return;
      player.pause();
      player.setTime(chart.posToVal(event.offsetX, 'x'));
    });
  }

  shadeFailures(chart) {
    const { ctx, bbox } = chart;
    ctx.fillStyle = stage.palette.badTint;
    for (const [from, to] of failures()) {
      const [x0, x1] = [from, to].map(time => chart.valToPos(time, 'x', true)).sort((a, b) => a - b);
      ctx.fillRect(x0, bbox.top, Math.max(1, x1 - x0), bbox.height);
    }
  }

  drawEvents(chart) {
    const { ctx, bbox } = chart;
    ctx.save();
    ctx.strokeStyle = stage.palette.bad;
    ctx.setLineDash([5, 4]);
    for (const event of player.data.events) {
      const x = chart.valToPos(event.t, 'x', true);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
    ctx.restore();
  }

  /* The numbers under the plot are those of the pointer; where there is none, of the time shown. */
  showNumbers(state) {
    if (this.chart.cursor.left >= 0) return;
    const idx = timesFall() ? player.count - 1 - state.index : state.index;
    this.chart.setLegend({ idx }, false);
  }

  move(state) {
    if (this.chart.status !== 1) return;  // uPlot lays out a little later, and then calls `ready`
    const x = this.chart.valToPos(state.time, 'x');
    this.cursor.style.transform = `translateX(${x}px)`;
    this.cursor.hidden = !(x >= 0 && x <= this.chart.over.clientWidth);
    this.showNumbers(state);
  }
}

/* A constant is shown as a line in the middle, not as rounding errors blown up. */
function openRange(_, low, high) {
  if (low === null || high === null) return [-1, 1];
  const middle = (low + high) / 2, least = 1e-9 * Math.max(1e-12, Math.abs(low), Math.abs(high));
  const half = Math.max((high - low) / 2, least);
  const isConstant = half === least;
  const wide = isConstant ? Math.max(Math.abs(middle) / 10, 1e-9) : 1.08 * half;
  return [middle - wide, middle + wide];
}

function optionGroup(group) {
  const element = document.createElement('optgroup');
  element.label = group.title;
  element.append(...group.items.map(({ label }) => new Option(label, label)));
  return element;
}

/* Pieces of time [from, to] in which something was not found. */
function failures() {
  const { status } = player.data, pieces = [];
  for (let k = 0; k < player.count; k++) {
    if (status[k] === 0) continue;
    const begin = player.t[Math.max(0, k - 1)];
    while (k + 1 < player.count && status[k + 1] !== 0) k++;
    pieces.push([begin, player.t[k]]);
  }
  return pieces;
}

function brief(value) {
  const size = Math.abs(value);
  return size !== 0 && (size < 1e-3 || size >= 1e5) ? value.toExponential(0) : `${+value.toPrecision(5)}`;
}

const plots = {
  list: [],
  first: null,  // what is plotted when the page opens

  build(panel) {
    if (!hasMotion()) {
      panel.append('There is no motion to plot.');
      return;
    }
    this.groups = plottable(player.data);
    this.holder = document.createElement('div');
    const more = document.createElement('button');
    Object.assign(more, { type: 'button', textContent: 'Another plot', id: 'another' });
    more.addEventListener('click', () => this.add(this.groups[0].items[0].label));
    panel.append(this.holder, more);
    const name = movingOutput() ?? liveliest();
    this.first = [name, `${name}_dot`, `${name}_ddot`];
  },

  /* The first plots are made when they can be seen: before, they have no width. */
  show() {
    if (this.first) {
      const labels = this.first;
      this.first = null;
      labels.forEach(label => this.add(label));
    } else {
      this.resize();
    }
  },

  add(label) {
    const plot = new Plot(this.groups, label);
    this.list.push(plot);
    this.holder.append(plot.element);
    plot.redraw();
  },

  remove(plot) {
    this.list.splice(this.list.indexOf(plot), 1);
    plot.chart.destroy();
    plot.element.remove();
  },

  move(state) {
    for (const plot of this.list) plot.move(state);
  },

  resize() {
    for (const plot of this.list) {
      plot.chart.setSize({ width: plot.width(), height: PLOT_HEIGHT });
      plot.move(player.state);
    }
  },

  redraw() {
    for (const plot of this.list) plot.redraw();
  },

  /* Show another motion at the same times. */
  refill() {
    for (const plot of this.list) plot.chart.setData(plot.series());
  },
};

/* The first output that moves; none where there is no such. */
function movingOutput() {
  const { outputs, arrays } = player.data, width = outputs.length;
  const moves = k => {
    const values = arrays.y?.filter((value, place) => place % width === k && Number.isFinite(value)) ?? [];
    const size = values.reduce((most, value) => Math.max(most, Math.abs(value)), 0);
    return values.some(value => Math.abs(value - values[0]) > 1e-9 * Math.max(size, 1e-12));
  };
  return outputs.find((_, k) => moves(k))?.name;
}

/* The coordinate that is plotted first: of bodies an angle, that of the largest acceleration, so that
   it is not one that a motor turns steadily; where all angles are steady, as of a cam and its follower,
   any coordinate of the largest acceleration; where nothing accelerates, the one that goes farthest. */
function liveliest() {
  const { data, n } = player, { frames } = data.drawing;
  const all = data.coordinates.map((_, k) => k);
  const sizes = (name, candidates) => candidates.map(k => {
    const values = data.arrays[name].filter((value, place) => place % n === k && Number.isFinite(value));
    return values.reduce((most, value) => Math.max(most, Math.abs(value - values[0])), 0);
  });
  const ofBodies = frames.length ? frames.flatMap(({ columns }) => columns) : all;
  const angles = frames.map(({ columns: [, , phi] }) => phi);
  for (const [name, candidates] of [['q_ddot', angles], ['q_ddot', ofBodies], ['q', all]]) {
    const found = sizes(name, candidates), largest = Math.max(0, ...found);
    if (largest > 1e-9) return data.coordinates[candidates[found.indexOf(largest)]].name;
  }
  return data.coordinates[0].name;
}
