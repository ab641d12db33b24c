/* The tabs beside the drawing, and the panel that is shown. */

import { player } from './player.js';
import { byId } from './elements.js';
import { plots } from './plots.js';
import { numbers, points } from './tables.js';
import { measures } from './measures.js';
import { transmission } from './transmission_panel.js';

const panels = {
  plots: () => plots.show(),
  numbers: () => numbers.update(player.state),
  points: () => points.update(player.state),
  measures: () => measures.show(),
  transmission: () => transmission.isOpen && transmission.show(),
  newton: () => {},  // follows the player by itself
};
export let shownPanel = 'plots';

export function showPanel(name) {
  shownPanel = name;
  for (const other of Object.keys(panels)) {
    byId(`panel-${other}`).hidden = other !== name;
    byId(`tab-${other}`).setAttribute('aria-selected', String(other === name));
    byId(`tab-${other}`).tabIndex = other === name ? 0 : -1;
  }
  // A pose is shown beside its panel only, as are Newton's iterates.
  if (player.state.pose && name !== 'transmission') player.setIndex(player.state.index);
  panels[name]();
  player.refresh();
}

export function connectTabs() {
  const names = Object.keys(panels).filter(name => !byId(`tab-${name}`).hidden);
  names.forEach((name, k) => {
    byId(`tab-${name}`).addEventListener('click', () => showPanel(name));
    byId(`tab-${name}`).addEventListener('keydown', event => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (!step) return;
      const next = names[(k + step + names.length) % names.length];
      showPanel(next);
      byId(`tab-${next}`).focus();
    });
  });
}
