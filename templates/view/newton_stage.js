/* Newton's iterates as ghosts on the stage, and a guess that can be dragged.

   Every body of the guess has a handle: drag the body to move it, its knob to turn it; with the
   keyboard the arrows move it and + and - turn it. */

import { player } from './player.js';
import { drawShapes, hullOf, towards } from './draw.js';
import { AXES, inWorld, isSpatial, knobOf, moveBody } from '#world';
import { stage } from './stage.js';
import { setAttributes, svgElement } from './elements.js';

const KNOB = 40;  // pixels from a body's origin to the knob that turns it
const STEP = 1 / 60;  // of the picture's width that an arrow key moves a body; a tenth with Shift
const TURN = Math.PI / 36;
const MARGIN = 5;  // sizes of a mark that are seen around the origin of a body
const FARTHEST = 1;  // widths of the motion's picture that a body may be off its edge and be shown

export class NewtonStage {
  /* isShown(): whether ghosts are to be seen now.  onGuess(q): the guess was changed. */
  constructor(isShown, onGuess) {
    this.isShown = isShown;
    this.onGuess = onGuess;
    this.scene = null;  // { guess, iterates }: those of newton.iterate that are shown
    this.drag = null;
    this.layer = svgElement('svg', { class: 'newton-handles', 'aria-label': 'Handles of the guess' });
    this.handles = player.data.drawing.bodies.map(
      (name, body) => this.handle(name, player.data.drawing.frames[body]));
    this.layer.append(...this.handles.map(handle => handle.group));
    stage.canvas.parentElement.append(this.layer);
    stage.extent = () => this.extent();
    stage.overlays.push((ctx, view, palette) => this.draw(ctx, view, palette));
  }

  show(scene) {
    this.scene = scene;
    stage.draw(player.state);
  }

  draw(ctx, view, palette) {
    const isShown = this.scene !== null && this.isShown();
    this.layer.style.display = isShown ? '' : 'none';
    if (!isShown) return;
    // The motion below becomes a shade.
    Object.assign(ctx, { fillStyle: palette.paper, globalAlpha: 0.7 });
    ctx.fillRect(0, 0, stage.width, stage.height);
    ctx.globalAlpha = 1;
    this.drawGhosts(ctx, view, palette);
    this.handles.forEach(handle => this.placeHandle(handle, view));
  }

  /* The picture of the motion, widened by the bodies of guess and iterates. */
  extent() {
    const bounds = player.data.extent.slice();
    if (this.scene === null || !this.isShown()) return bounds;
    if (this.drag) return this.drag.extent;  // what is dragged must not move by itself
    const ends = AXES.map((_, k) => [bounds[2 * k], bounds[2 * k + 1]]);
    const reach = FARTHEST * Math.max(...ends.map(([low, high]) => high - low));
    const around = MARGIN * player.data.drawing.size;
    for (const q of [this.scene.guess, ...this.scene.iterates.map(iterate => iterate.q)]) {
      for (const { frame } of this.handles) {
        const place = inWorld(q, frame, [0, 0]);
        ends.forEach(([low, high], k) => {
          bounds[2 * k] = Math.min(bounds[2 * k], Math.max(place[k] - around, low - reach));
          bounds[2 * k + 1] = Math.max(bounds[2 * k + 1], Math.min(place[k] + around, high + reach));
        });
      }
    }
    return bounds;
  }

  /* The guess in one colour, the iterates in another one, the later the stronger. */
  drawGhosts(ctx, view, palette) {
    const { guess, iterates } = this.scene;
    // The style sheet gives them to the layer, where they are resolved for the theme.
    const { color: guessColour, fill: iterateColour } = getComputedStyle(this.layer);
    const drawGhost = (q, ghost, alpha) =>
      drawShapes(ctx, q, { view, palette, alpha, ghost });
    const last = iterates.length - 1;
    drawGhost(guess, guessColour, last ? 0.5 : 1);
    for (let k = 1; k < last; k++) drawGhost(iterates[k].q, iterateColour, 0.15 + 0.35 * k / last);
    if (last) drawGhost(iterates[last].q, iterateColour, 1);
    this.drawNumbers(ctx, view, palette);
  }

  /* The number of each iterate at the body that moves farthest, where there is room for it. */
  drawNumbers(ctx, view, palette) {
    const { iterates } = this.scene;
    const origin = ({ q }, frame) => view.toScreen(inWorld(q, frame, [0, 0]));
    const way = ({ frame }) => iterates.reduce((sum, iterate, k) =>
      (k ? sum + towards(origin(iterates[k - 1], frame), origin(iterate, frame))[2] : 0), 0);
    const ways = this.handles.map(way);
    const { frame } = this.handles[ways.indexOf(Math.max(...ways))];
    Object.assign(ctx, { font: 'bold 12px system-ui, sans-serif', lineWidth: 3,
      textAlign: 'center', textBaseline: 'middle', strokeStyle: palette.paper, fillStyle: palette.ink });
    const taken = [];
    iterates.forEach((iterate, k) => {
      const at = origin(iterate, frame);
      if (k === 0 || taken.some(other => towards(at, other)[2] < 14)) return;
      taken.push(at);
      ctx.strokeText(k, ...at);
      ctx.fillText(k, ...at);
    });
    ctx.textAlign = 'start';
  }

  /* What a body is dragged by: its link, its origin and the knob. */
  handle(name, frame) {
    const group = svgElement('g', {
      tabindex: 0, role: 'group', 'aria-label': `${name}: arrow keys move it, plus and minus turn it`,
    });
    const link = svgElement('polygon', { class: 'link' });
    const arm = svgElement('line', { class: 'arm' });
    // A dot is seen, the larger grip around it is what a finger finds.
    const circles = (...kinds) =>
      kinds.map(([kind, r]) => svgElement('circle', { class: kind, r }));
    const atOrigin = circles(['dot', 5], ['grip', 16]), atKnob = circles(['dot', 6], ['grip turn', 16]);
    group.append(svgElement('title', {}, name), link, arm, ...atOrigin, ...atKnob);
    group.addEventListener('pointerdown', event => this.startDrag(event, group, frame));
    group.addEventListener('pointermove', event => this.moveDrag(event));
    for (const kind of ['pointerup', 'pointercancel']) {
      group.addEventListener(kind, () => this.endDrag());
    }
    group.addEventListener('keydown', event => this.key(event, frame));
    return { frame, group, link, arm, atOrigin, atKnob };
  }

  placeHandle({ frame, link, arm, atOrigin, atKnob }, view) {
    const q = this.scene.guess, [right, down] = knobOf(q, frame, view);
    const [x, y] = view.toScreen(inWorld(q, frame, [0, 0]));
    const [knobX, knobY] = [x + KNOB * right, y + KNOB * down];
    const hull = player.data.drawing.marks.find(
      mark => mark.kind === 'hull' && mark.frame.index === frame.index);
    const corners = hull ? hull.points.map(point => view.toScreen(inWorld(q, frame, point))) : [];
    link.setAttribute('points', (isSpatial ? hullOf(corners) : corners).map(([a, b]) => `${a},${b}`).join(' '));
    for (const circle of atOrigin) setAttributes(circle, { cx: x, cy: y });
    for (const circle of atKnob) setAttributes(circle, { cx: knobX, cy: knobY });
    setAttributes(arm, { x1: x, y1: y, x2: knobX, y2: knobY });
  }

  pointer(event) {
    const box = this.layer.getBoundingClientRect();
    return [event.clientX - box.left, event.clientY - box.top];
  }

  startDrag(event, group, frame) {
    group.setPointerCapture(event.pointerId);
    group.focus({ preventScroll: true });
    const isTurn = event.target.classList.contains('turn');
    this.drag = { frame, isTurn, from: this.pointer(event), extent: this.extent() };
    event.preventDefault();
  }

  moveDrag(event) {
    if (!this.drag) return;
    const { frame, isTurn, from } = this.drag;
    const to = this.pointer(event);
    this.drag.from = to;
    if (isTurn) {
      const [x, y] = stage.view.toScreen(inWorld(this.scene.guess, frame, [0, 0]));
      const turn = Math.atan2(y - to[1], to[0] - x) - Math.atan2(y - from[1], from[0] - x);
      // The short way, so that whole turns add up.
      this.change(frame, [0, 0], Math.atan2(Math.sin(turn), Math.cos(turn)));
    } else {
      const { scale } = stage.view;
      this.change(frame, [(to[0] - from[0]) / scale, (from[1] - to[1]) / scale], 0);
    }
  }

  endDrag() {
    this.drag = null;
    stage.draw(player.state);
  }

  key(event, frame) {
    const part = event.shiftKey ? 0.1 : 1;
    const step = part * STEP * stage.width / stage.view.scale, turn = part * TURN;
    const change = {
      ArrowLeft: [[-step, 0], 0], ArrowRight: [[step, 0], 0], ArrowUp: [[0, step], 0],
      ArrowDown: [[0, -step], 0], '+': [[0, 0], turn], '=': [[0, 0], turn], '-': [[0, 0], -turn],
    }[event.key];
    if (!change) return;
    this.change(frame, ...change);
    event.preventDefault();
    event.stopPropagation();
  }

  /* Move a body on the screen, to the right and up in lengths of the model, and turn it. */
  change(frame, way, turn) {
    const guess = this.scene.guess.slice();
    moveBody(guess, frame, way, turn, stage.view);
    this.onGuess(guess);
  }
}
