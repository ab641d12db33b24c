/* Every card's mechanism in motion, while it can be seen; at rest for those who ask for it. */

import { Player, withArrays } from './player.js';

const MARGIN = 10;
const REST = 0.3;  // part of the motion that is shown at rest, where the data name no other

class Card {
  constructor(element) {
    this.motion = new Player(withArrays(JSON.parse(element.querySelector('script').textContent)));
    this.canvas = element.querySelector('canvas');
    this.isSeen = true;
    new IntersectionObserver(([entry]) => { this.isSeen = entry.isIntersecting; }).observe(this.canvas);
  }

  draw(seconds, palette) {
    const { canvas, motion } = this, { drawing, extent } = motion.data;
    const dense = devicePixelRatio || 1, { clientWidth, clientHeight } = canvas;
    canvas.width = Math.round(clientWidth * dense);
    canvas.height = Math.round(clientHeight * dense);
    const ctx = canvas.getContext('2d');
    ctx.scale(dense, dense);
    if (!drawing.bodies.length) {
      Object.assign(ctx, { font: 'italic 1.6rem serif', fillStyle: palette.quiet, textAlign: 'center' });
      ctx.fillText('Φ(q, t) = 0', clientWidth / 2, clientHeight / 2);
      return;
    }
    const elapsed = motion.duration ? (motion.speed * seconds) % motion.duration : 0;
    const { View, drawShapes } = worldOf(motion.data);
    const view = new View(extent, clientWidth, clientHeight, MARGIN);
    drawShapes(ctx, motion.between(elapsed).q, { view, palette, drawing });
  }
}

/* What draws a mechanism: in the plane, or in space. */
function worldOf({ extent }) {
  return worlds[extent.length / 2];
}

function startGallery() {
  const cards = [...document.querySelectorAll('.card')].map(element => new Card(element));
  if (!cards.length) return;
  const isStill = matchMedia('(prefers-reduced-motion: reduce)').matches;
  const atRest = card => (card.motion.data.rest ?? REST) * card.motion.duration / card.motion.speed;
  const { drawing } = cards[0].motion.data, { paletteNow } = worldOf(cards[0].motion.data);
  let palette = paletteNow(drawing);
  const drawAll = () => cards.forEach(card => card.draw(atRest(card), palette));
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => {
    palette = paletteNow(drawing);
    drawAll();
  });
  addEventListener('resize', drawAll);
  drawAll();
  if (isStill) return;
  const frame = now => {
    for (const card of cards) if (card.isSeen) card.draw(atRest(card) + now / 1000, palette);
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}

startGallery();
