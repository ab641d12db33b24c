/* What is taken along from the page: pictures of the drawing, numbers, the changed model, an address of all that is shown. */

import { player, SPEEDS } from './player.js';
import { units } from './units.js';
import { isGround } from './draw.js';
import { AXES, isSpatial, orbit } from '#world';
import { hasBodies, stage } from './stage.js';
import { buttonOf, byId, svgElement } from './elements.js';
import { save } from './save.js';
import { columns } from './columns.js';
import { plots } from './plots.js';
import { live } from './live.js';
import { MOST_KEPT, MOST_OF_FAMILY, settings } from './settings.js';
import { shownPanel, showPanel } from './tabs.js';

const LONGEST_FILM = 30;  // seconds of a film at the most
const FILM_RATE = 30;  // pictures a second

/* A context of a canvas that writes what is drawn as SVG. */
class SvgContext {
  constructor() {
    this.parts = [];
    this.way = '';
    this.dash = [];
    this.saved = [];
    this.globalAlpha = this.lineWidth = 1;
    this.lineJoin = 'miter';
    this.lineCap = 'butt';
    this.font = this.textAlign = this.textBaseline = '';
    this.strokeStyle = this.fillStyle = '#000';
  }

  save() {
    const { globalAlpha, lineJoin, lineCap } = this;
    this.saved.push({ globalAlpha, lineJoin, lineCap });
  }

  restore() {
    Object.assign(this, this.saved.pop());
  }

  beginPath() { this.way = ''; }
  moveTo(x, y) { this.way += `M${place(x, y)}`; }
  lineTo(x, y) { this.way += `L${place(x, y)}`; }
  closePath() { this.way += 'Z'; }
  setLineDash(dash) { this.dash = dash; }
  clearRect() { this.parts = []; }

  arc(x, y, r) {
    this.way += `M${place(x - r, y)}a${place(r, r)} 0 1 0 ${place(2 * r, 0)}a${place(r, r)} 0 1 0 ${place(-2 * r, 0)}Z`;
  }

  put(name, attributes, text) {
    const opacity = this.globalAlpha < 1 ? { opacity: this.globalAlpha } : {};
    this.parts.push(svgElement(name, { ...attributes, ...opacity }, text));
  }

  fill() {
    this.put('path', { d: this.way, fill: this.fillStyle });
  }

  stroke() {
    const dash = this.dash.length ? { 'stroke-dasharray': this.dash.join(' ') } : {};
    this.put('path', { d: this.way, fill: 'none', stroke: this.strokeStyle, 'stroke-width': this.lineWidth,
      'stroke-linejoin': this.lineJoin, 'stroke-linecap': this.lineCap, ...dash });
  }

  fillRect(x, y, width, height) {
    this.put('rect', { x, y, width, height, fill: this.fillStyle });
  }

  write(text, x, y, more) {
    const anchor = { center: 'middle', right: 'end', end: 'end' }[this.textAlign] ?? 'start';
    const base = { top: 'text-before-edge', bottom: 'text-after-edge', middle: 'central' }[this.textBaseline] ?? 'auto';
    this.put('text', { x, y, 'text-anchor': anchor, 'dominant-baseline': base, style: `font: ${this.font}`, ...more }, String(text));
  }

  fillText(text, x, y) {
    this.write(text, x, y, { fill: this.fillStyle });
  }

  strokeText(text, x, y) {
    this.write(text, x, y, { fill: 'none', stroke: this.strokeStyle, 'stroke-width': this.lineWidth, 'stroke-linejoin': 'round' });
  }
}

function place(x, y) {
  return `${+x.toFixed(2)} ${+y.toFixed(2)}`;
}

function fileOf(kind) {
  return `${player.data.name.replace(/[^\w.-]+/g, '_')}.${kind}`;
}

export const taken = {
  kinds: {
    PNG: () => stage.canvas.toBlob(blob => save(fileOf('png'), blob)),
    SVG: () => save(fileOf('svg'), new Blob([taken.svg()], { type: 'image/svg+xml' })),
    WebM: button => taken.film(button),
    CSV: () => save(fileOf('csv'), new Blob([taken.csv()], { type: 'text/csv' })),
    TOML: () => save(fileOf('toml'), new Blob([taken.toml()], { type: 'text/plain' })),
  },

  build() {
    const menu = byId('taken'), holder = menu.querySelector('div');
    const isOffered = { PNG: hasBodies(), SVG: hasBodies(), WebM: hasBodies() && 'MediaRecorder' in window, TOML: Boolean(player.data.toml), CSV: true };
    for (const [kind, act] of Object.entries(this.kinds)) {
      if (!isOffered[kind]) continue;
      const button = buttonOf(kind, () => {
        menu.open = kind === 'WebM';
        act(button);
      });
      holder.append(button);
    }
  },

  /* The drawing as it is seen. */
  svg() {
    const { ctx, width, height } = stage, drawn = new SvgContext();
    stage.ctx = drawn;
    try {
      stage.draw(player.state);
    } finally {
      stage.ctx = ctx;
      stage.draw(player.state);
    }
    const svg = svgElement('svg', { xmlns: 'http://www.w3.org/2000/svg', viewBox: `0 0 ${width} ${height}`, width, height });
    svg.append(svgElement('title', {}, player.data.name), ...drawn.parts);
    return new XMLSerializer().serializeToString(svg);
  },

  /* One round of the motion, at the speed that is chosen. */
  async film(button) {
    const recorder = new MediaRecorder(stage.canvas.captureStream(FILM_RATE), { mimeType: 'video/webm' }), pieces = [];
    recorder.addEventListener('dataavailable', ({ data }) => pieces.push(data));
    const ended = new Promise(done => recorder.addEventListener('stop', done));
    button.disabled = true;
    player.pause();
    player.setIndex(0);
    const begun = new Promise(done => recorder.addEventListener('start', done));
    recorder.start();
    await begun;
    player.play();
    await new Promise(done => setTimeout(done, 1000 * Math.min(LONGEST_FILM, player.duration / player.speed)));
    player.pause();
    recorder.stop();
    await ended;
    button.disabled = false;
    save(fileOf('webm'), new Blob(pieces, { type: 'video/webm' }));
  },

  /* All columns over time, in the units that are shown. */
  csv() {
    const items = columns.groups().flatMap(group => group.items).filter(({ path }) => !path);
    const quoted = text => (/[",\n]/.test(text) ? `"${text.replaceAll('"', '""')}"` : text);
    const heads = ['t [s]', ...items.map(({ label, unit }) => quoted(units.titled(label, unit)))];
    const own = items.map(item => columns.values(item).map(value => (value === null ? '' : value * units.factor(item.unit))));
    const rows = Array.from(player.t, (t, k) => [t, ...own.map(values => values[k])].join(','));
    return `${[heads.join(','), ...rows].join('\n')}\n`;
  },

  /* The parameters that are others than those of the model, as text to be pasted. */
  setting(kind) {
    if (kind === 'TOML') return this.toml();
    const changed = player.data.parameters.filter(({ value, default: own }) => value !== own);
    if (kind === '--set') return changed.map(({ name, value }) => `--set ${name}=${value}`).join(' ');
    const values = `p = {${changed.map(({ name, value }) => `"${name}": ${value}`).join(', ')}}`;
    return `${[...this.drawn(changed), `${values}  # for kc.solve(module, t, p)`].join('\n')}\n`;
  },

  /* Joints whose coordinates have changed, as calls of `Sketch`. */
  drawn(changed) {
    const { drawing: { hands }, parameters } = player.data;
    const moved = hands.filter(hand => hand.is_drawn && hand.own.length === AXES.length && hand.own.some(k => changed.includes(parameters[k])));
    const said = (call, some) => (some.length ? [`s.${call}(${some.map(({ name, own }) => (
      `${name}=(${own.map(k => parameters[k].value).join(', ')})`)).join(', ')})`] : []);
    const [ground, others] = [true, false].map(isFixed => moved.filter(({ place }) => isGround(place.frame) === isFixed));
    return [...said('ground', ground), ...said('joints', others)];
  },

  /* The model with the parameters as they are shown. */
  toml() {
    return player.data.parameters.reduce((text, { name, value, default: own }) => (value === own ? text : text.replace(
      new RegExp(`(name = "${name}", default = )[^,}]+?(?=[,}]| })`), (_, before) => `${before}${Number.isInteger(value) ? value.toFixed(1) : value}`)), player.data.toml);
  },

  /* ---- an address of all that is shown: names that begin with @ belong to no parameter ---- */

  toggles: ['names', 'grid', 'velocities', 'accelerations', 'forces', 'angles', 'theme'],

  view() {
    const { camera } = stage, on = this.toggles.filter(id => byId(id).ariaPressed === 'true' && !byId(id).hidden);
    const found = {
      t: player.state.pose ? '' : player.state.time, speed: player.speed, tab: shownPanel, over: plots.choice?.value,
      plots: plots.list.map(plot => plot.choice.value).join('~'), part: plots.range?.join('~'),
      camera: camera && [camera.zoom, ...camera.centre].join('~'), turn: isSpatial ? [orbit.azimuth, orbit.height].join('~') : '',
      traced: [...stage.traced].map(({ name }) => name).join('~'), on: on.join('~'),
      kept: settings.kept.map(({ values }) => values.join(' ')).join('~'), family: settings.over && [settings.over.k, settings.over.count].join('~'),
    };
    return Object.entries(found).filter(([key, value]) => (value ?? '') !== '' || key === 'traced')
      .map(([key, value]) => `@${key}=${encodeURIComponent(value)}`).join('&');
  },

  address() {
    const values = live.sliders ? live.fragment().slice(1) : '';
    return `${location.href.split('#')[0]}#${[values, this.view()].filter(Boolean).join('&')}`;
  },

  /* Show what an address says, when its values are solved; what is unknown is left out. */
  show(given) {
    const list = key => (given.get(`@${key}`) ?? '').split('~').filter(Boolean), numbersOf = key => list(key).map(Number);
    if (![...given.keys()].some(key => key.startsWith('@'))) return;
    const isIn = (values, count) => values.length === count && values.every(Number.isFinite);
    for (const id of this.toggles) if (list('on').includes(id) !== (byId(id).ariaPressed === 'true')) byId(id).click();
    for (const text of live.sliders ? list('kept').slice(0, MOST_KEPT) : []) {
      const values = text.split(' ').map(Number);
      if (isIn(values, live.names.length)) settings.keepOf(values);
    }
    const [k, count] = numbersOf('family');
    if (live.sliders && k < live.names.length && count <= MOST_OF_FAMILY) settings.choose(k, count);
    const wanted = list('plots').filter(label => columns.find(label));
    if (wanted.length) {
      for (const plot of plots.list.slice()) plots.remove(plot);
      for (const label of wanted) plots.add(label);
    }
    if (plots.choice && [...plots.choice.options].some(({ value }) => value === given.get('@over'))) plots.choice.value = given.get('@over');
    const speed = Number(given.get('@speed')), part = numbersOf('part'), camera = numbersOf('camera'), turn = numbersOf('turn');
    if (SPEEDS.includes(speed)) player.setSpeed(speed);
    if (given.has('@traced')) stage.traced = new Set(stage.points.filter(({ name }) => list('traced').includes(name)));
    if (isSpatial && isIn(turn, 2)) Object.assign(orbit, { azimuth: turn[0], height: turn[1] });
    if (isIn(camera, AXES.length + 1) && camera[0] > 0) stage.look({ zoom: camera[0], centre: camera.slice(1) });
    plots.zoom(isIn(part, 2) ? part : null);
    const tab = byId(`tab-${given.get('@tab')}`);
    if (tab && !tab.hidden) showPanel(given.get('@tab'));
    if (Number.isFinite(Number(given.get('@t') || NaN))) player.setTime(Number(given.get('@t')));
  },
};
