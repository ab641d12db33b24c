/* Joints that are pulled: parameters follow, those of the joint itself where they move it.

   What a joint's place depends on is in the data (kincompile/view/hands.py). Its parameters are found
   by least squares of its place at the time that is shown, with the least change of them; what the
   drawing says is a place of its own is one step away. */

import { player } from './player.js';
import { snapping } from './sliders.js';
import { niceStep } from './units.js';
import { isGround, Pen } from './draw.js';
import { inWorld } from '#world';
import { CLICK, NEAR, stage } from './stage.js';
import { byId } from './elements.js';
import { live } from './live.js';

const ROUNDS = 8;  // of Gauss and Newton
const NUDGE = 1e-6;  // of a parameter's range, for differences
const DAMPED = 1e-4;  // of the trace: a direction in which nothing moves takes no large step
const WAYS = [1, 0.5, 0.25];  // of a way whose end cannot be assembled
const UNMOVED = 1e-9;  // of the drawing's size: what moves less does not move
const ROUNDING = 0.2;  // pixels to which parameters are rounded
const KEYED = 12;  // pixels that a key moves, about
const RADIUS = 6;  // pixels of a handle

export const hands = {
  list: [],
  isShown: true,
  held: null,  // { hand, from, offset, values, isMoved }: what the pointer holds
  wanted: null,  // where it is to be, until the next frame

  build() {
    const isPossible = live.sliders && player.data.status.some(status => status === 0);
    this.list = isPossible ? this.movable() : [];
    for (const id of ['pulling', 'snap']) byId(id).hidden = !live.sliders;
    byId('pulling').hidden = !this.list.length;
    const group = byId('hands');
    group.hidden = !this.list.length;
    group.append(...this.list.map(hand => this.button(hand)));
    const toggle = (id, act) => byId(id).addEventListener('click', () => {
      byId(id).ariaPressed = String(byId(id).ariaPressed !== 'true');
      act(byId(id).ariaPressed === 'true');
      player.refresh();
    });
    toggle('snap', isOn => { snapping.isOn = isOn; });
    toggle('pulling', isOn => {
      this.isShown = isOn;
      group.hidden = !isOn;
    });
    stage.overlays.push((...given) => this.draw(...given));
    // Nor does the page scroll.
    stage.canvas.addEventListener('touchstart', event => { if (this.held) event.preventDefault(); }, { passive: false });
  },

  /* ---- which joints, and how places depend on parameters ---- */

  /* The joints that some lengths move, each with these: its own, or else all. */
  movable() {
    const { parameters, drawing, lengthUnit } = player.data, p = live.given, index = player.data.status.indexOf(0);
    const lengths = parameters.flatMap(({ unit }, k) => (unit === lengthUnit ? [k] : [])), seen = [];
    const q = player.row('q', index), t = player.t[index], least = UNMOVED * drawing.size;
    return drawing.hands.flatMap((hand, k) => {
      const made = { ...hand, slots: slotsOf(k) }, here = placeOf(made, p, t, q);
      if (!here || seen.some(other => gap(other, here.place) < least)) return [];
      const moves = j => {
        const way = changeOf(made, p, j, t, here);
        return way && Math.hypot(...way) * widthOf(j) > least;
      };
      const own = hand.own.filter(moves), all = own.length ? own : lengths.filter(moves);
      if (!all.length) return [];
      seen.push(here.place);
      return [{ ...made, parameters: all }];
    });
  },

  where(hand) {
    return inWorld(player.state.q, hand.place.frame, hand.place.point);
  },

  /* The values with which a joint is at a place at the time shown, or as near as it gets. */
  solve(hand, target, step) {
    const t = player.t[player.state.index];
    let p = live.values.slice(), here = placeOf(hand, p, t, player.state.q);
    for (let round = 0; here && round < ROUNDS; round++) {
      const left = target.map((x, i) => x - here.place[i]);
      if (Math.hypot(...left) < step / 100) break;
      const change = this.step(hand, p, t, here, left);
      if (!change) break;
      const next = p.map((x, j) => (change[j] ? inRange(j, x + change[j]) : x)), there = placeOf(hand, next, t, here.q);
      if (there && gap(there.place, target) >= gap(here.place, target)) break;
      [p, here] = [next, there];  // what cannot be assembled is tried, so that it is said why
    }
    return p.map((x, j) => (x === live.values[j] ? x : inRange(j, toStep(x, step))));
  },

  /* The least change of parameters, in parts of their ranges, that goes a way; none beyond an end. */
  step(hand, p, t, here, left) {
    let free = hand.parameters.map(j => ({ j, way: changeOf(hand, p, j, t, here) }));
    if (free.some(({ way }) => !way)) return null;
    for (;;) {
      const found = leastChange(free, left);
      if (!found) return null;
      const isFree = ({ j }) => inRange(j, p[j] + found[j]) !== p[j] || found[j] === 0;
      if (free.every(isFree)) return found;
      free = free.filter(isFree);
      if (!free.length) return null;
    }
  },

  /* Take a joint to a place, or towards it as far as it can be assembled; the drawing stays else. */
  pull(hand, target) {
    const step = snapping.isOn !== this.isTurnedOver ? stepOfGrid() : fineStep(), begin = this.where(hand);
    let refused = '';
    for (const part of WAYS) {
      const to = begin.map((x, i) => x + part * (target[i] - x)), why = live.attempt(this.solve(hand, to, step), refused);
      if (!why) return;
      refused ||= `${hand.name} cannot be pulled there. ${why}`;
    }
    live.refuse(refused);
  },

  /* ---- pointers, as stage.pointer ---- */

  down(place, event) {
    if (!this.isShown || stage.fingers.size > 1 || event.button > 0 || player.state.pose || !player.state.isFound) return false;
    const at = [event.offsetX, event.offsetY], hand = this.near(at, event.pointerType === 'touch' ? 2 * NEAR : 0.8 * NEAR);
    if (!hand) return false;
    const on = stage.view.toScreen(this.where(hand));
    this.held = { hand, from: at, offset: at.map((x, k) => x - on[k]), isMoved: false };
    stage.canvas.setPointerCapture(event.pointerId);
    return true;
  },

  move(place, event) {
    if (!this.held) return false;
    const at = [event.offsetX, event.offsetY], { from, offset, hand } = this.held;
    if (!this.held.isMoved && Math.hypot(at[0] - from[0], at[1] - from[1]) <= CLICK) return true;
    if (!this.held.isMoved) this.begin();
    this.held.isMoved = true;
    this.isTurnedOver = event.shiftKey;
    const [, , depth] = stage.view.toScreen(this.where(hand));
    const wanted = stage.view.toWorld(at.map((x, k) => x - offset[k]), depth), isWaiting = this.wanted;
    this.wanted = () => this.pull(hand, wanted);
    // Of several places in a frame the last one counts.
    if (!isWaiting) requestAnimationFrame(() => this.follow());
    return true;
  },

  up(place, event) {
    if (!this.held) return false;
    const { isMoved } = this.held;
    this.follow();
    this.held = null;
    if (isMoved) this.end();
    else if (event.type === 'pointerup') stage.click(stage.targetAt(event));
    return true;
  },

  follow() {
    const pull = this.wanted;
    this.wanted = null;
    pull?.();
  },

  /* What is seen stays as it is while a joint is pulled. */
  begin() {
    player.pause();
    player.setIndex(player.state.index);
    stage.held = stage.view;
    stage.canvas.style.cursor = 'grabbing';
  },

  end() {
    this.isTurnedOver = false;
    stage.held = null;
    stage.canvas.style.cursor = '';
    live.commit();
    player.refresh();
  },

  near(at, reach) {
    const away = hand => {
      const [x, y] = stage.view.toScreen(this.where(hand));
      return Math.hypot(x - at[0], y - at[1]);
    };
    return this.list.filter(hand => away(hand) < reach).sort((a, b) => away(a) - away(b))[0] ?? null;
  },

  /* ---- keys: a button for each joint, over the drawing, which pointers pass through ---- */

  button(hand) {
    const button = document.createElement('button');
    Object.assign(button, { type: 'button', className: 'hand', ariaLabel: `Pull ${hand.name} with the arrows` });
    button.addEventListener('keydown', event => this.key(hand, event));
    hand.button = button;
    return button;
  },

  key(hand, event) {
    const way = { ArrowRight: [1, 0], ArrowLeft: [-1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (!way || event.ctrlKey || event.metaKey || event.altKey || player.state.pose || !player.state.isFound) return;
    event.preventDefault();
    event.stopPropagation();
    this.begin();
    const length = (event.shiftKey ? 10 : 1) * keyStep(), go = stage.view.way(way[0] * length, way[1] * length);
    const was = live.values.slice();
    this.pull(hand, this.where(hand).map((x, k) => x + go[k]));
    this.end();
    if (was.some((x, k) => x !== live.values[k])) hand.button.ariaLabel = `${hand.name} at ${this.text(hand)}, pull it with the arrows`;
  },

  text(hand) {
    return `${this.where(hand).map(x => +x.toPrecision(5)).join(', ')} ${player.data.lengthUnit}`;
  },

  /* ---- what is seen of it ---- */

  draw(ctx, view, palette, state) {
    if (!this.isShown || state.pose || !state.isFound) return;
    const pen = new Pen(ctx, state.q, { view, palette }, player.data.drawing.size);
    for (const hand of this.list) {
      const [x, y] = view.toScreen(inWorld(state.q, hand.place.frame, hand.place.point)), isHeld = this.held?.hand === hand;
      pen.circle([x, y], RADIUS + 2);
      pen.stroke(palette.paper, 4);
      pen.stroke(palette.drive, isHeld ? 3.5 : 2);
      hand.button.style.transform = `translate(${x}px, ${y}px)`;
    }
  },
};

/* Which numbers of the drawing are components of a joint's place: [component, number]. */
function slotsOf(k) {
  return geometry.places.flatMap((place, number) => (place[0] === 'hands' && place[1] === k ? [[place[4], number]] : []));
}

/* Where a joint is at a time with other parameters, and the position of all; null where there is none. */
function placeOf(hand, p, t, q) {
  const numbers = geometry.numbers(0, p), { frame } = hand.place, point = Array.from(hand.place.point);
  for (const [component, number] of hand.slots) point[component] = numbers[number];
  if (isGround(frame)) return { place: inWorld(q, frame, point), q };
  const found = emitted.solver.solve(emitted, [t], Float64Array.from(p), q).q;
  return found.every(Number.isFinite) ? { place: inWorld(found, frame, point), q: found } : null;
}

/* How a joint's place changes with a parameter. */
function changeOf(hand, p, j, t, { place, q }) {
  const isAtEnd = p[j] >= player.data.parameters[j].high, nudge = (isAtEnd ? -1 : 1) * NUDGE * widthOf(j);
  const there = placeOf(hand, p.map((x, k) => (k === j ? x + nudge : x)), t, q);
  return there && there.place.map((x, i) => (x - place[i]) / nudge);
}

/* The least change in parts of ranges: W J^T (J W J^T)^-1 of what is left. */
function leastChange(free, left) {
  const { factor, solve } = emitted.solver.linear, weight = j => widthOf(j) ** 2;
  const matrix = left.map((_, a) => left.map((_, b) => free.reduce((sum, { j, way }) => sum + weight(j) * way[a] * way[b], 0)));
  const trace = matrix.reduce((sum, row, a) => sum + row[a], 0);
  if (!(trace > 0)) return null;
  matrix.forEach((row, a) => { row[a] += DAMPED * trace; });
  const pull = solve(factor(matrix), left);
  return Object.fromEntries(free.map(({ j, way }) => [j, weight(j) * way.reduce((sum, x, a) => sum + x * pull[a], 0)]));
}

function widthOf(j) {
  const { low, high } = player.data.parameters[j];
  return high - low;
}

function inRange(j, value) {
  const { low, high } = player.data.parameters[j];
  return Math.max(low, Math.min(high, value));
}

function gap(one, other) {
  return Math.hypot(...one.map((x, k) => x - other[k]));
}

function toStep(value, step) {
  return +(Math.round(value / step) * step).toPrecision(12);
}

const fineStep = () => 10 ** Math.floor(Math.log10(ROUNDING / stage.view.scale));
const stepOfGrid = () => niceStep(70 / stage.view.scale) / 5;
const keyStep = () => (snapping.isOn ? stepOfGrid() : niceStep(KEYED / stage.view.scale));
