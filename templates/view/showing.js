/* How the page is shown: light or dark, degrees or radians, full screen, on paper. */

import { player } from './player.js';
import { units } from './units.js';
import { paletteNow } from './draw.js';
import { hasBodies, stage } from './stage.js';
import { byId } from './elements.js';
import { tools } from './tools.js';
import { plots } from './plots.js';
import { live } from './live.js';
import { measures } from './measures.js';
import { shownPanel } from './tabs.js';

export const showing = {
  connect() {
    byId('theme').addEventListener('click', () => {
      document.documentElement.dataset.theme = stage.palette.isDark ? 'light' : 'dark';
      this.theme();
    });
    matchMedia('(prefers-color-scheme: dark)').addEventListener('change', () => this.theme());
    byId('angles').addEventListener('click', () => this.angles());
    byId('project').addEventListener('click', () => this.project());
    document.addEventListener('fullscreenchange', () => this.enlarge(Boolean(document.fullscreenElement)));
    addEventListener('beforeprint', () => this.print(true));
    addEventListener('afterprint', () => this.print(false));
  },

  theme() {
    stage.palette = paletteNow();
    byId('theme').ariaPressed = String(stage.palette.isDark);
    if (hasBodies()) tools.colour();
    plots.redraw();
    player.refresh();
  },

  angles() {
    units.angle = units.angle === 'rad' ? 'deg' : 'rad';
    byId('angles').ariaPressed = String(units.angle === 'deg');
    live.showValues();
    if (shownPanel === 'measures') measures.show();
    plots.zoom(null);
    player.refresh();
  },

  /* Full screen with large type; where a browser allows no full screen, as in a notebook, large type. */
  async project() {
    const isOn = !document.documentElement.classList.contains('projected');
    this.enlarge(isOn);
    try {
      if (isOn) await document.documentElement.requestFullscreen();
      else if (document.fullscreenElement) await document.exitFullscreen();
    } catch { /* the type is large */ }
  },

  enlarge(isOn) {
    document.documentElement.classList.toggle('projected', isOn);
    byId('project').ariaPressed = String(isOn);
    this.layOut();
  },

  layOut() {
    stage.resize();
    plots.resize();
    document.documentElement.style.setProperty('--drawn', `${byId('drawn').offsetHeight}px`);
    player.refresh();
  },

  /* Paper is light. */
  print(isOn) {
    const { dataset } = document.documentElement;
    if (isOn) {
      this.before = dataset.theme;
      player.pause();
      if (!byId('tab-measures').hidden) measures.show();
      dataset.theme = 'light';
    } else if (this.before) dataset.theme = this.before;
    else delete dataset.theme;
    this.theme();
  },
};
