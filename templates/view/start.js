/* Everything is connected here: controls, keys, tabs, messages, themes. */

import { player, SPEEDS } from './player.js';
import { units } from './units.js';
import { distanceBetween, isGround } from './draw.js';
import { isSpatial, orbit } from '#world';
import { hasBodies, hasMotion, openPage, ORIGIN, pathOf, stage } from './stage.js';
import { byId } from './elements.js';
import { poles } from './poles.js';
import { reactions } from './forces.js';
import { tools } from './tools.js';
import { showTip } from './tip.js';
import { columns, failures } from './columns.js';
import { plots } from './plots.js';
import { numbers, points } from './tables.js';
import { showing } from './showing.js';
import { newtonPanel } from './newton_panel.js';
import { live, splitSentence } from './live.js';
import { settings } from './settings.js';
import { taken } from './taken.js';
import { measures } from './measures.js';
import { Grab } from './grab.js';
import { hands } from './hands.js';
import { transmission } from './transmission_panel.js';
import { connectTabs, shownPanel, showPanel } from './tabs.js';

/* ---- what the solver says ---- */

function showSizes() {
  const { data } = player;
  const counted = (count, one, several) => `${count} ${count === 1 ? one : several}`;
  const sizes = [
    counted(data.drawing.bodies.length, 'body', 'bodies'),
    counted(data.coordinates.length, 'coordinate', 'coordinates'),
    counted(data.equations.length, 'equation', 'equations'),
    counted(player.count, 'time', 'times'),
  ];
  byId('summary').textContent = (hasBodies() ? sizes : sizes.slice(1)).join(', ');
}

function inShort({ kind, t, bodies }) {
  return `${kind} at t = ${+t.toPrecision(6)}: ${bodies.join(', ')}`;
}

function showVerdict() {
  const { data } = player;
  // While sliders are pulled, the verdict is below them: nothing above them must move.
  byId('message').hidden = (data.success && !data.doubt) || live.isChanged;
  byId('message').textContent = data.success ? data.doubt : data.message;
  byId('events').replaceChildren();
  for (const event of data.events) {
    const item = document.createElement('li'), button = document.createElement('button');
    Object.assign(button, { type: 'button', textContent: inShort(event) });
    button.addEventListener('click', () => {
      player.pause();
      player.setTime(event.t);
    });
    item.append(button);
    // A motion that ends at an event has its message above.
    if (data.success) item.append(` ${event.message}`);
    byId('events').append(item);
  }
}

const UNASSEMBLED = 'No position was found: with these values the mechanism cannot be assembled, or the guess is too far away. ';

function showNote(state) {
  const note = byId('note'), { status, sentences } = player.data;
  const isGood = state.pose ? state.isFound : status[state.index] === 0;
  note.hidden = isGood;
  if (isGood) return;
  const shown = state.isFound ? '' : ' Shown is the last position that was found.';
  if (state.pose) {
    note.textContent = transmission.sentence();
    return;
  }
  // The event that ended the motion, rather than the status alone.
  const [ended] = player.data.events.slice(-1), sentence = sentences[status[state.index]];
  const said = status[state.index] === 4 && ended ? `${splitSentence(sentence)[0]}, after ${inShort(ended)}.` : sentence;
  note.textContent = hasMotion()
    ? `t = ${+state.time.toPrecision(6)}: ${said}${shown}`
    : state.isFound ? 'Shown is the position at the start.'
      : `${[1, 6].includes(status[0]) ? UNASSEMBLED : ''}Shown is the start guess. Constraints that it violates are red.`;
}

/* ---- time ---- */

/* Events, and times at which something was not found, on the time axis. */
function markTimeline() {
  byId('marks').replaceChildren();
  if (!(player.duration > 0)) return;
  const part = time => 100 * Math.abs(time - player.t[0]) / player.duration;
  const mark = (className, from, to, title) => {
    const element = document.createElement('span');
    Object.assign(element, { className, title });
    element.style.left = `${part(from)}%`;
    if (to !== null) element.style.width = `${part(to) - part(from)}%`;
    byId('marks').append(element);
  };
  for (const [from, to] of failures()) mark('failed', from, to, 'not found');
  for (const event of player.data.events) mark('event', event.t, null, event.message);
}

function connectTransport() {
  const time = byId('time');
  time.max = player.count - 1;
  time.addEventListener('input', () => {
    player.pause();
    player.setIndex(Number(time.value));
  });
  byId('play').addEventListener('click', () => player.toggle());
  byId('play').disabled = player.count < 2;
  byId('speed').append(...SPEEDS.map(speed => new Option(`${speed} ×`, String(speed))));
  byId('speed').addEventListener('change', () => player.setSpeed(Number(byId('speed').value)));
}

function showTransport(state) {
  byId('time').value = state.index;
  byId('clock').textContent = state.pose ? 'at the inputs' : `t = ${units.full(state.time, 's')}`;
  byId('speed').value = player.speed;
  const isPlaying = player.isPlaying;
  byId('play').textContent = isPlaying ? '❚❚' : '▶';
  byId('play').setAttribute('aria-label', isPlaying ? 'Pause' : 'Play');
}

const KEYS = {
  ' ': () => player.toggle(),
  ArrowLeft: event => player.step(event.shiftKey ? -10 : -1),
  ArrowRight: event => player.step(event.shiftKey ? 10 : 1),
  Home: () => player.step(-player.count),
  End: () => player.step(player.count),
  '+': () => player.faster(1),
  '=': () => player.faster(1),
  '-': () => player.faster(-1),
  f: () => showing.project(),
  d: () => byId('angles').click(),
  n: () => hasBodies() && byId('names').click(),
  g: () => hasBodies() && byId('grid').click(),
  m: () => hasBodies() && byId('measure').click(),
  0: () => stage.fit(),
  PageUp: () => stage.zoom(1.25),
  PageDown: () => stage.zoom(0.8),
  ...(isSpatial ? orbit.keys : {}),
};
const MOVES = { ArrowLeft: [1, 0], ArrowRight: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
const MOVE = 40;  // pixels that a key moves the drawing

function connectKeys() {
  document.addEventListener('keydown', event => {
    const target = /** @type {Element} */ (event.target);
    // Keys belong to a field that is filled in, a list that is open, a button that is pressed.
    const isField = target.matches('select, textarea, input:not(#time, [type=checkbox])');
    const isPressed = event.key === ' ' && target.matches('button, [type=checkbox]');
    const isTab = target.matches('[role=tab]');
    const isTaken = isField || isPressed || isTab || event.ctrlKey || event.metaKey;
    const onDrawing = target === stage.canvas;
    const move = event.altKey && onDrawing && MOVES[event.key];
    const isPage = event.key.startsWith('Page') && !onDrawing;
    const mover = isSpatial && !event.shiftKey ? orbit : stage;
    const action = move ? () => mover.pan(MOVE * move[0], MOVE * move[1]) : !event.altKey && !isPage && KEYS[event.key];
    if (isTaken || !action) return;
    event.preventDefault();
    action(event);
  });
}

/* ---- paths ---- */

/* Where the model names no point, the longest path is traced from the start: not of a body that is hung on the ground, nor of a pin
   of one, where there are others, since these go in circles. */
function traceLongest() {
  if (stage.traced.size) return;
  const pins = player.data.drawing.marks.filter(mark => mark.kind === 'pin' || mark.style === 'gap');
  const hung = new Set(pins.filter(pin => isGround(pin.first.frame)).map(pin => pin.second.frame.index));
  const circling = new Set(pins.filter(({ first, second }) => hung.has(first.frame.index) || hung.has(second.frame.index)).map(({ joint }) => joint));
  const free = stage.points.filter(({ frame, name }) => !hung.has(frame.index) && !circling.has(name));
  const joints = free.filter(({ kind }) => kind !== ORIGIN);
  const candidates = [joints, free, stage.points].find(list => list.length) ?? [];
  const length = point => {
    const path = pathOf(point).line.filter(place => place !== null);
    return path.reduce((sum, place, k) => (k ? sum + distanceBetween(path[k - 1], place) : 0), 0);
  };
  const lengths = candidates.map(length), longest = Math.max(...lengths);
  if (longest > player.data.drawing.size) stage.traced.add(candidates[lengths.indexOf(longest)]);
}

/* ---- start ---- */

function showState(state) {
  if (hasBodies()) {
    stage.draw(state);
    showTip(state);
    tools.show(state);
  }
  showNote(state);
  showTransport(state);
  plots.move(state);
  if (shownPanel === 'numbers') numbers.update(state);
  if (shownPanel === 'points') points.update(state);
}

function start() {
  byId('stage').hidden = !hasBodies();
  byId('plain').hidden = hasBodies();
  byId('pointing').hidden = !hasBodies();
  byId('tab-points').hidden = !hasBodies();
  byId('tools').hidden = !hasBodies();
  byId('legend').hidden = !hasBodies();
  showSizes();
  showVerdict();
  markTimeline();
  connectTransport();
  connectKeys();
  showing.connect();
  plots.build(byId('panel-plots'));
  numbers.build(byId('panel-numbers'));
  byId('tab-measures').hidden = !(player.data.outputs.length || player.data.drawing.four_bars.length) || 'reason' in emitted;
  measures.build(byId('panel-measures'));
  live.build(byId('live'));
  if (hasBodies()) {
    points.build(byId('panel-points'));
    hands.build();
    stage.pointer = firstOf(hands, new Grab());
    stage.listen();
    tools.build();
    if (isSpatial) orbit.build();
    traceLongest();
  }
  taken.build();
  newtonPanel(byId('panel-newton'));
  stage.underlays.push((ctx, view, palette) => settings.draw(ctx, view, palette));
  player.onChange(showState);
  let sizes = '';
  const observer = new ResizeObserver(() => {
    // What is said beside the drawing is no reason to change it.
    const { clientWidth, clientHeight } = byId('stage'), found = [clientWidth, clientHeight, byId('right').clientWidth].join();
    if (found === sizes) return;
    sizes = found;
    showing.layOut();
  });
  for (const id of ['stage', 'right']) observer.observe(byId(id));
  player.onMotion(forget);
  transmission.build(byId('panel-transmission'));
  connectTabs();
  showPanel(transmission.branch ? 'transmission' : 'plots');
  showing.theme();
  if (player.data.angleUnit !== units.angle) showing.angles();
}

/* What a pointer means, as the first one that takes it says. */
function firstOf(...pointers) {
  const asked = kind => (...given) => pointers.some(pointer => pointer[kind](...given));
  return { down: asked('down'), move: asked('move'), up: asked('up') };
}

/* The motion is another one: what was computed from the last one is dropped. */
function forget() {
  live.fit();
  for (const keeper of [units, columns, poles, reactions, stage, ...(isSpatial ? [orbit] : [])]) keeper.forget();
  plots.redraw();
  showVerdict();
  markTimeline();
  if (shownPanel === 'measures') measures.show();
}

openPage(JSON.parse(byId('data').textContent), byId('canvas'));
start();
