/* The marks of a model that is made on the page, as kincompile/view/joint_shapes.py makes them: what each
   type looks like.  `draw.js` and `plane.js` draw them. */

import { GROUND, hullOf } from './draw.js';
import { isDriver } from './sketched.js';

const ORDER = ['track', 'rack', 'face', 'ring', 'wheel', 'cam', 'curved slot', 'polygon', 'hull', 'slot', 'rod', 'cylinder',
  'slide', 'dimension', 'slider', 'stand', 'pin', 'turn', 'push', 'dot'];  // from back to front
const CURVE_POINTS = 180;
const PARTS_OF_DIAGONAL = 40;  // sizes of marks in the mechanism's diagonal
const RACK_POINTS = ['s_P', 's_Q'];
const shapeOfRail = { guide: 'track' };

/* Marks of one constraint; `on` gives its points, directions and numbers. */
const DRAWN = {
  Revolute: on => [on.pin(on.point('s_i'), on.point('s_j'))],
  Translational(on) {
    let [i, j, u, v] = [on.point('s_i'), on.point('s_j'), on.unit('v_i'), on.unit('v_j')];
    if (on.isGround(j) || (on.isBlock(i) && !on.isGround(i))) [i, j, u, v] = [j, i, v, u];
    if (on.isGround(i) || on.isBlock(j)) return [on.rail(i, u, j), on.slider(j, v, j.frame)];
    return [on.span(i, j, 'slide'), on.slider(i, u, i.frame)];
  },
  RevoluteTranslational(on) {
    const i = on.point('s_i'), j = on.point('s_j'), axis = on.unit('v_i');
    if (on.isDriver('C')) return [on.rail(i, axis, j), on.span(i, j, 'dimension'), on.pin(j, j)];
    return [on.rail(i, axis, j), on.slider(j, axis, i.frame), on.pin(j, j)];
  },
  TranslationalDistance: on => [on.span(on.point('s_i'), on.point('s_j'), on.isDriver('C') ? 'cylinder' : 'dimension')],
  Distance: on => lengthMarks(on, on.point('s_i'), on.point('s_j')),
  AbsoluteDistance: on => lengthMarks(on, on.point('c'), on.point('s_i')),
  RelativeX: on => [on.span(on.point('s_i'), on.point('s_j'), 'dimension'), ...on.isDriver('C') ? [on.drive(on.point('s_j'), [1, 0])] : []],
  RelativeY: on => [on.span(on.point('s_i'), on.point('s_j'), 'dimension'), ...on.isDriver('C') ? [on.drive(on.point('s_j'), [0, 1])] : []],
  AbsoluteX: on => atMarks(on, [1, 0], [0, 1]),
  AbsoluteY: on => atMarks(on, [0, 1], [1, 0]),
  AbsoluteAngle: on => (on.isDriver('C') ? [on.drive(on.bearing(), null)] : []),
  RelativeAngle: on => (on.isDriver('C') ? [on.drive(on.bearing(), null)] : []),
  Gear: on => [on.wheel('s_i', 'R_i', 'theta_i'), on.wheel('s_j', 'R_j', 'theta_j')],
  RackAndPinion(on) {
    const p = on.point('s_P'), q = on.point('s_Q'), [x, y] = [q.point[0] - p.point[0], q.point[1] - p.point[1]];
    const length = Math.hypot(x, y);
    return [on.rail(p, [x / length, y / length], on.point('s_j'), 'rack', [0, length]), on.wheel('s_j', 'R_j', 'theta_j')];
  },
  CamFollower: on => [on.curve('s_i', 'rho_i', 'cam'), on.curve('s_j', 'rho_j', 'cam')],
  CamFlatFollower(on) {
    const cam = on.curve('s_i', 'rho_i', 'cam'), centre = on.point('s_i');
    const reach = Math.max(...cam.points.map(([x, y]) => Math.hypot(x - centre.point[0], y - centre.point[1])));
    return [cam, on.rail(on.point('s_j'), on.unit('v_j'), centre, 'face', [-reach, reach])];
  },
  PointFollower: on => [on.curve('s_j', 'rho_j', 'slot', 'curved slot'), on.pin(on.point('s_i'), on.point('s_i'))],
};

function lengthMarks(on, from, to) {
  return [on.span(from, to, on.isDriver('C') ? 'cylinder' : 'rod'), on.pin(from, from), on.pin(to, to)];
}

function atMarks(on, axis, across) {
  const place = on.point('s_i');
  if (on.isDriver('C')) return [on.drive(place, axis)];
  const value = on.value('C'), base = { frame: GROUND, point: axis.map(x => x * value) };
  return [on.rail(base, across, place), on.slider(place, across, GROUND), on.pin(place, place)];
}

/* A constraint with its points in frames. */
class OnModel {
  constructor(constraint, all) {
    this.constraint = constraint;
    this.all = all;
    const given = kernels.types[constraint.type].arguments;
    this.owners = Object.fromEntries(given.filter(([, kind]) => kind === 'body').map(([, , symbol], k) => [symbol, constraint.frames[k]]));
    this.on = Object.fromEntries(given.map(([, , symbol, on]) => [symbol, on || symbol.slice(-1)]));
  }

  frame(symbol) {
    return this.all.frames[this.owners[this.on[symbol]] ?? -1] ?? GROUND;
  }

  point(symbol) {
    return { frame: this.frame(symbol), point: [...this.constraint.numbers[symbol]] };
  }

  points() {
    const given = kernels.types[this.constraint.type].arguments;
    return given.filter(([, kind, symbol]) => kind === 'point' && !RACK_POINTS.includes(symbol)).map(([, , symbol]) => this.point(symbol));
  }

  unit(symbol) {
    const [x, y] = this.constraint.numbers[symbol], length = Math.hypot(x, y) || 1;
    return [x / length, y / length];
  }

  value(symbol) {
    return this.constraint.functions[symbol](0)[0];
  }

  isDriver(symbol) {
    return isDriver(this.constraint, symbol);
  }

  isGround({ frame }) {
    return frame.index < 0;
  }

  isBlock({ frame }) {
    return this.all.blocks.has(frame.index);
  }

  bearing() {
    const frame = this.all.frames[this.constraint.frames.filter(k => k >= 0).pop()];
    return this.all.bearings.get(frame.index) ?? { frame, point: [0, 0] };
  }

  pin(first, second) {
    if (this.isGround(second)) [first, second] = [second, first];
    return { kind: 'pin', shape: this.isGround(first) ? 'stand' : 'pin', first, second };
  }

  rail(base, axis, follower, style = '', at_least = []) {
    const own = style || (this.isGround(base) ? 'guide' : 'slot');
    return { kind: 'rail', shape: shapeOfRail[own] ?? own, frame: base.frame, base: base.point, axis, style: own, follower, at_least, reach: [0, 0] };
  }

  slider(place, axis, guide) {
    return { kind: 'slider', shape: 'slider', place, axis, guide };
  }

  span(first, second, style) {
    return { kind: 'span', shape: style, first, second, style, barrel: 0 };
  }

  drive(place, axis) {
    return { kind: 'drive', shape: axis ? 'push' : 'turn', place, axis };
  }

  wheel(centre, radius, theta) {
    const [size] = this.constraint.numbers[radius];
    return { kind: 'wheel', shape: size < 0 ? 'ring' : 'wheel', place: this.point(centre), radius: Math.abs(size), theta: this.constraint.numbers[theta][0] };
  }

  curve(centre, rho, style, shape = style) {
    const { frame, point: [x, y] } = this.point(centre), radius = this.constraint.functions[rho];
    const points = Array.from({ length: CURVE_POINTS }, (_, k) => {
      const angle = 2 * Math.PI * k / CURVE_POINTS, [length] = radius(angle);
      return [x + length * Math.cos(angle), y + length * Math.sin(angle)];
    });
    return { kind: 'contour', shape, frame, points };
  }
}

/** The drawing of a model, as data.drawing of a page has it; `fitMarks` makes rails fit a motion.
 * @param {any} model @param {any} tables shapes, looks and hues
 * @param {number} diagonal of the mechanism */
export function drawingOf(model, tables, diagonal) {
  const frames = model.bodies.map((_, k) => ({ index: k, columns: [3 * k, 3 * k + 1, 3 * k + 2] }));
  const all = { frames, blocks: new Set(), bearings: new Map() };
  const joints = model.constraints.map(constraint => new OnModel(constraint, all));
  const points = frames.map(() => []), pins = new Set();
  for (const joint of joints) {
    const isPin = joint.constraint.type === 'Revolute';
    for (const { frame, point } of joint.points()) {
      if (frame.index < 0) continue;
      points[frame.index].push(point);
      if (isPin && joint.points().every(item => item.frame.index >= 0)) pins.add(frame.index);
      if (isPin && (!all.bearings.has(frame.index) || joint.points().some(item => item.frame.index < 0))) all.bearings.set(frame.index, { frame, point });
    }
  }
  for (const index of pins) if (points[index].every(([x, y]) => x === points[index][0][0] && y === points[index][0][1])) all.blocks.add(index);
  model.bodies.forEach(({ name }, k) => points[k].push(...model.links.get(name)?.places.values() ?? []));
  for (const { body, place } of model.points) if (body >= 0) points[body].push(place);
  const hulls = model.bodies.map(({ outline }, k) => {
    const own = outline ?? hullOf(points[k].map(point => [...point]));
    return own.length ? { kind: outline ? 'polygon' : 'hull', shape: outline ? 'polygon' : 'hull', frame: frames[k], points: own } : null;
  }).filter((mark, k) => mark && !(all.blocks.has(k) && mark.points.length < 2));
  const dots = model.points.map(({ name, body, place }) => ({ kind: 'dot', shape: 'dot', name, place: { frame: frames[body] ?? GROUND, point: place } }));
  const marks = [...hulls, ...joints.flatMap(joint => DRAWN[joint.constraint.type](joint)), ...dots];
  marks.sort((one, other) => ORDER.indexOf(one.shape) - ORDER.indexOf(other.shape));
  const size = diagonal / PARTS_OF_DIAGONAL;
  return { ...tables, name: model.name, bodies: model.bodies.map(body => body.name), frames, marks, size, overhang: 2.4 * size };
}
