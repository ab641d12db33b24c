/* Forces of the joints, as arrows on the drawing and in words beside a joint that is pointed at.

   `forces` is the module whose outputs are the forces along a motion, as kc.forces compiles it; null
   where the model has no loads, or redundant joints share them. An arrow is the force on body j. */

import { player } from './player.js';
import { units } from './units.js';
import { arrow, Pen } from './draw.js';
import { AXES, inWorld, isSpatial } from '#world';
import { stage } from './stage.js';
import { byId } from './elements.js';
import { finite } from './columns.js';

const FORCE_ARROW = 0.22;  // part of the canvas that the largest force takes

export const reactions = {
  isShown: false,
  greatest: null,  // of all joints and times
  kept: null,  // all forces at all times

  forget() {
    this.greatest = this.kept = null;
  },

  /* All forces at the solved times, computed once a motion. */
  get values() {
    this.kept ??= player.states.map(state => this.at(state));
    return this.kept;
  },

  /* Columns for plots: each force, and the polar plot of what a bearing bears. */
  items() {
    if (forces === null) return [];
    const unit = name => forces.UNITS[name], shown = name => !/^(lambda|determinant|missed)_/.test(name);
    const single = forces.OUTPUTS.filter(shown).map(name => ({
      label: name, unit: unit(name), values: () => this.column(forces.OUTPUTS.indexOf(name)),
    }));
    const polar = this.joints.filter(({ columns }) => columns.every(column => column >= 0)).map(({ joint }) => ({
      label: `force of ${joint.name}`, unit: unit(`F_x_${joint.name}`), path: [`F_x_${joint.name}`, `F_y_${joint.name}`],
    }));
    return [...single, ...(isSpatial ? [] : polar)];
  },

  column(k) {
    return this.values.map(values => finite(values[k]));
  },

  /* The joints that have a place and a force: the joint, and where its components stand. */
  get joints() {
    const place = name => forces.OUTPUTS.indexOf(name);
    this.found ??= forces === null ? [] : player.data.drawing.joints.filter(joint => joint.place)
      .map(joint => ({ joint, columns: AXES.map(axis => place(`F_${axis}_${joint.name}`)) }))
      .filter(({ columns }) => columns.some(column => column >= 0));
    return this.found;
  },

  /* All forces in a state; NaN where there is no acceleration, or the multipliers miss their
     equations. */
  at({ q, q_dot, q_ddot, time, isFound }) {
    if (isFound) {
      const values = forces.outputs(q, q_dot, q_ddot, time, player.data.parameters.map(({ value }) => value));
      if (values[forces.OUTPUTS.indexOf('missed_by_solves')] <= forces.SOLVED) return values;
    }
    return forces.OUTPUTS.map(() => NaN);
  },

  components(values, columns) {
    return columns.map(column => (column < 0 ? 0 : values[column]));
  },

  largest() {
    if (this.greatest !== null) return this.greatest;
    this.greatest = 0;
    for (const values of this.values) {
      for (const { columns } of this.joints) {
        const size = Math.hypot(...this.components(values, columns));
        if (size > this.greatest) this.greatest = size;
      }
    }
    return this.greatest;
  },

  draw(ctx, view, palette, state) {
    if (!this.isShown || !this.joints.length || !state.isFound || state.pose) return;
    const most = this.largest(), values = this.at(state);
    if (!(most > 0)) return;
    const pen = new Pen(ctx, state.q, { view, palette }, player.data.drawing.size);
    const length = FORCE_ARROW * Math.min(stage.width, stage.height) / view.scale;
    for (const { joint, columns } of this.joints) {
      const force = this.components(values, columns), from = inWorld(state.q, joint.place.frame, joint.place.point);
      if (!force.every(Number.isFinite)) continue;
      const end = from.map((x, k) => x + force[k] * length / most);
      arrow(pen, view.toScreen(from), view.toScreen(end), palette.force, 3);
    }
  },

  /* What is said of a joint: every force and torque of it, with units. */
  lines(names, state) {
    if (forces === null || !state.isFound) return [];
    const values = this.at(state);
    return forces.OUTPUTS.flatMap((name, k) => {
      const joint = names.find(own => name.endsWith(`_${own}`) && /^(F_.|T(_i)?(_.)?|[FT]_along|F_across|drive|P|load)$/.test(name.slice(0, -own.length - 1)));
      return joint ? [`${name.slice(0, -joint.length - 1)} = ${units.full(values[k], forces.UNITS[name])}`] : [];
    });
  },

  build() {
    const button = byId('forces');
    button.hidden = !this.joints.length;
    button.addEventListener('click', () => {
      this.isShown = !this.isShown;
      button.ariaPressed = String(this.isShown);
      player.refresh();
    });
    stage.overlays.push((...given) => this.draw(...given));
  },
};
