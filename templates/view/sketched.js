/* A model file as bodies and constraints with numbers: what kincompile makes of it, from its drawing
   (`sketch`) and from its bodies and constraints alike.

   Names, frames, guesses and the order of coordinates are those of `kc.Sketch` and `kc.read`. */

import { FormulaError, jetOf, driverOf, numberOf } from './formula.js';

const FLAT_TRIANGLE = 1e-9;  // height of a triangle, relative to its longest side, up to which it is a line
const MOST_DRAWN = 300;  // joints, parts, bodies, constraints
export const GROUND_NAME = 'ground';

/** What the model cannot be; its message names the part. */
export class ModelProblem extends Error {}

const known = (table, name) => Object.hasOwn(table, name);
/** @type {(one: any, other: any) => number[]} */
const minus = ([a, b], [x, y]) => [a - x, b - y];
/** @type {(vector: any) => number} */
const lengthOf = ([x, y]) => Math.hypot(x, y);

class Sketched {
  constructor(file) {
    this.values = parametersOf(file);
    this.joints = new Map();
    this.links = new Map([[GROUND_NAME, { name: GROUND_NAME, places: new Map(), origin: [0, 0], angle: 0 }]]);
    this.bodies = [];
    this.constraints = [];
    this.points = [];
  }

  number(given) {
    if (typeof given !== 'number' && typeof given !== 'string') throw new ModelProblem(`${JSON.stringify(given) ?? 'nothing'} is no number. Give a number or a formula.`);
    return numberOf(given, this.values);
  }

  pair(given) {
    if (!Array.isArray(given) || given.length !== 2) throw new ModelProblem(`${JSON.stringify(given) ?? 'nothing'} is no pair. Give [x, y].`);
    return given.map(x => this.number(x));
  }

  named(given, least, most = Infinity) {
    const names = String(given ?? '').replaceAll(',', ' ').split(' ').filter(Boolean);
    const unknown = names.find(name => !this.joints.has(name));
    if (unknown) throw new ModelProblem(`there is no joint ${unknown}. Draw it first.`);
    if (names.length < least || names.length > most || new Set(names).size < names.length) throw new ModelProblem(`it has the joints "${given}". Give ${least} or more, each once.`);
    return names;
  }

  link(name) {
    if (!this.links.has(name)) throw new ModelProblem(`there is no link ${name}. Draw it first.`);
    return this.links.get(name);
  }

  /* The first link that has a joint. */
  holder(joint) {
    for (const link of this.links.values()) if (link.places.has(joint)) return link;
    throw new ModelProblem(`no link has the joint ${joint}. Draw a link to it first.`);
  }

  /** A body, with a pin for each of its joints that another link has already. */
  body(name, places, origin, angle, further = {}) {
    if (this.links.has(name)) throw new ModelProblem(`there is a link ${name} already. Rename one.`);
    const others = [...places].map(([joint, place]) => [joint, place, [...this.links.values()].find(link => link.places.has(joint))]);
    this.bodies.push({ name, guess: [...origin, angle] });
    const taken = new Set(this.constraints.map(item => item.name));
    for (const [joint, place, other] of others) {
      if (!other) continue;
      this.add('Revolute', taken.has(joint) ? `${joint}_${name}` : joint, { i: other.name, point_i: other.places.get(joint), j: name, point_j: place });
    }
    this.links.set(name, { name, places, origin, angle, ...further });
  }

  /** A constraint with the arguments of its type, as the file has them. */
  add(type, name, given, guess = []) {
    if (!known(kernels.types, type)) throw new ModelProblem(`${name} is of the type ${type}, which the editor does not have. Open the model in Python.`);
    if (this.constraints.some(item => item.name === name)) throw new ModelProblem(`there are two constraints ${name}. Rename one.`);
    const numbers = {}, functions = {}, frames = [];
    const bodies = Object.fromEntries(kernels.types[type].arguments.filter(([, kind]) => kind === 'body').map(([key, , symbol]) => [symbol, given[key]]));
    for (const [key, kind, symbol, on] of kernels.types[type].arguments) {
      const value = given[key];
      if (kind === 'body') frames.push(this.bodyIndex(value));
      else if (kind === 'point' && typeof value === 'string') numbers[symbol] = this.placeOn(bodies[on] ?? GROUND_NAME, value);
      else if (kind === 'point' || kind === 'axis') numbers[symbol] = this.pair(value);
      else if (kind === 'value' || kind === 'distance') functions[symbol] = driverOf(value, this.values);
      else if (kind === 'profile') functions[symbol] = this.profile(value);
      else numbers[symbol] = [this.number(value)];
    }
    this.constraints.push({ type, name, frames, numbers, functions, given, guess: [guess].flat().map(x => this.number(x)), corners: given.corners === true });
  }

  profile(given) {
    if (typeof given === 'object') throw new ModelProblem('a cam given by a table is not shown in the editor. Give a formula of alpha, or open the model in Python.');
    return jetOf(given, this.values, 'alpha');
  }

  bodyIndex(name) {
    const index = this.bodies.findIndex(body => body.name === name);
    if (index < 0 && name !== GROUND_NAME) throw new ModelProblem(`there is no body ${name}. Name one that is there, or "ground".`);
    return index;
  }

  placeOn(body, joint) {
    const place = this.links.get(body)?.places.get(joint);
    if (!place) throw new ModelProblem(`${body} has no joint ${joint}. Give a place [xi, eta].`);
    return place;
  }

  /* A line through two joints of a link, or in a direction through a drawn joint. */
  line(joint, along, on = GROUND_NAME) {
    if (typeof along === 'string') {
      const [one, other] = this.named(along, 2, 2);
      for (const link of this.links.values()) {
        if (link.places.has(one) && link.places.has(other)) return { link, point: link.places.get(one), axis: minus(link.places.get(other), link.places.get(one)) };
      }
      throw new ModelProblem(`no link has both ${one} and ${other}. Give a direction, or two joints of one link.`);
    }
    const link = this.link(on), start = this.joints.get(joint), axis = this.pair(along);
    if (!lengthOf(axis)) throw new ModelProblem('a direction has no length. Give another.');
    if (on === GROUND_NAME) return { link, point: start, axis };
    const from = this.joints.get(link.places.keys().next().value) ?? start;
    return { link, point: turnedBack(minus(start, from), link.angle), axis: turnedBack(axis, link.angle) };
  }
}

/* A vector of the drawing in a frame that is turned. */
/** @param {any} vector */
function turnedBack([x, y], angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return angle ? [x * c + y * s, y * c - x * s] : [x, y];
}

/** The parameters of a file by name.
 * @param {any} file @returns {Map<string, number>} */
export function parametersOf(file) {
  const values = new Map();
  for (const { name, default: given } of listOf(file.parameters)) values.set(String(name), numberOf(given ?? 0, values));
  for (const [name, given] of Object.entries(file.sketch?.lengths ?? {})) values.set(name, numberOf(given, values));
  return values;
}

/* ---- the parts of a drawing: each adds what it is to the model ---- */

const PARTS = {
  link(sketch, { link: name, joints, length, ...more }) {
    const names = sketch.named(joints, 2), angle = directionOf(sketch, names[0], names[1]);
    const heavy = ['mass', 'inertia', 'centre', 'density', 'width', 'thickness'];
    const given = Object.entries(more).filter(([key]) => !heavy.includes(key));
    if (length !== undefined) given.unshift([names.join('_'), length]);
    sketch.body(name, shapeOf(sketch, names, given), sketch.joints.get(names[0]), angle);
  },
  wheel(sketch, { wheel: name, joint }) {
    const [centre] = sketch.named(joint, 1, 1);
    sketch.body(name, new Map([[centre, [0, 0]]]), sketch.joints.get(centre), 0);
  },
  slider(sketch, { slider: name, joints, along, on }) {
    const names = sketch.named(joints, 1), guide = sketch.line(names[0], along, on), { link, point, axis } = guide;
    const origin = sketch.joints.get(names[0]);
    const places = new Map(names.map(joint => [joint, turnedBack(minus(sketch.joints.get(joint), origin), link.angle)]));
    sketch.body(name, places, origin, link.angle, { guide });
    sketch.add('Translational', `${name}_guide`, { i: link.name, point_i: point, axis_i: axis, j: name, point_j: [0, 0], axis_j: axis });
  },
  slot(sketch, { slot: joint, along, on }) {
    sketch.named(joint, 1, 1);
    const { link, point, axis } = sketch.line(joint, along, on), pin = sketch.holder(joint);
    sketch.add('RevoluteTranslational', `${joint}_slot`, { i: link.name, point_i: point, axis_i: axis, j: pin.name, point_j: pin.places.get(joint), distance: 0 });
  },
  gear(sketch, { gear: name, i, centre_i, radius_i, j, centre_j, radius_j }) {
    const [one, other] = [sketch.link(i), sketch.link(j)];
    sketch.named(`${centre_i} ${centre_j}`, 2, 2);
    const towards = directionOf(sketch, centre_i, centre_j);
    sketch.add('Gear', name, {
      i, centre_i: sketch.placeOn(i, centre_i), radius_i, theta_i: towards - one.angle,
      j, centre_j: sketch.placeOn(j, centre_j), radius_j, theta_j: towards + Math.PI - other.angle,
    });
  },
  drive(sketch, { drive: what, value, against }) {
    const name = `drive_${what.replaceAll('.', ' ').split(' ').filter(Boolean).join('_')}`, link = sketch.links.get(what);
    const at = joint => [sketch.holder(joint).name, sketch.holder(joint).places.get(joint)];
    if (link?.guide) {
      const { link: base, point, axis } = link.guide;
      return sketch.add('TranslationalDistance', name, { i: base.name, point_i: point, axis_i: axis, j: what, point_j: [0, 0], distance: value });
    }
    if (link && against === undefined) return sketch.add('AbsoluteAngle', name, { body: what, angle: value });
    if (link) return sketch.add('RelativeAngle', name, { i: sketch.link(against).name, j: what, angle: value });
    const [joint, letter] = what.split('.');
    if (letter === 'x' || letter === 'y') {
      sketch.named(joint, 1, 1);
      const [body, point] = at(joint);
      return sketch.add(letter === 'x' ? 'AbsoluteX' : 'AbsoluteY', name, { body, point, value });
    }
    const [from, to] = sketch.named(what, 2, 2).map(at);
    return sketch.add('Distance', name, { i: from[0], point_i: from[1], j: to[0], point_j: to[1], distance: value });
  },
  point(sketch, { point: joint }) {
    sketch.named(joint, 1, 1);
    const link = sketch.holder(joint);
    sketch.points.push({ name: joint, body: sketch.bodyIndex(link.name), place: link.places.get(joint) });
  },
};

function directionOf(sketch, one, other) {
  const [x, y] = minus(sketch.joints.get(other), sketch.joints.get(one));
  return Math.atan2(y, x);
}

/* ---- the shape of a link: its joints in its frame, from the first along the second ---- */

function shapeOf(sketch, names, given) {
  const at = name => sketch.joints.get(name), [first, second] = names, lengths = new Map();
  const places = new Map([[first, [0, 0]]]);
  const along = minus(at(second), at(first)), drawn = lengthOf(along);
  if (!drawn) throw new ModelProblem(`${first} and ${second} are drawn at one place. Draw them apart.`);
  for (const [key, value] of given) {
    if (names.indexOf(key) > 1) places.set(key, sketch.pair(value));
    else lengths.set(pairNamed(names, key), positive(sketch.number(value), key));
  }
  const between = (one, other) => lengths.get(pairKey(names, one, other));
  places.set(second, [between(first, second) ?? drawn, 0]);
  const others = names.slice(2), used = new Set([pairKey(names, first, second)]);
  for (const joint of others) {
    if (places.has(joint) || names.some(other => between(joint, other) !== undefined)) continue;
    const [x, y] = minus(at(joint), at(first));
    const xi = (x * along[0] + y * along[1]) / drawn, eta = (y * along[0] - x * along[1]) / drawn;
    places.set(joint, [xi, Math.abs(eta) <= FLAT_TRIANGLE * drawn ? 0 : eta]);
  }
  for (let missing; (missing = others.filter(joint => !places.has(joint))).length;) {
    const reaches = joint => [...places.keys()].filter(other => between(joint, other) !== undefined);
    const joint = missing.find(name => reaches(name).length > 1);
    if (!joint) throw new ModelProblem(`${missing[0]} has one length alone. Give its lengths to two joints, or none.`);
    const [one, other] = reaches(joint);
    places.set(joint, apexOf([places.get(one), places.get(other)], [between(joint, one), between(joint, other)], [at(one), at(other), at(joint)], joint));
    [one, other].forEach(end => used.add(pairKey(names, joint, end)));
  }
  const surplus = [...lengths.keys()].find(key => !used.has(key));
  if (surplus !== undefined) throw new ModelProblem(`the length ${surplus} is one too many. Remove it.`);
  return new Map(names.map(name => [name, places.get(name)]));
}

const pairKey = (names, one, other) => [one, other].sort((a, b) => names.indexOf(a) - names.indexOf(b)).join(' ');

function pairNamed(names, key) {
  const found = new Set();
  for (const one of names) {
    for (const other of names) {
      if (one !== other && [one + other, `${one}_${other}`, `${one} ${other}`].includes(key)) found.add(pairKey(names, one, other));
    }
  }
  if (found.size !== 1) throw new ModelProblem(`${key} is no pair of its joints. Write the two joints with _ between them.`);
  return [...found][0];
}

function positive(value, key) {
  if (!(value > 0)) throw new ModelProblem(`the length ${key} is ${value}. Give one that is positive.`);
  return value;
}

/* The corner of a triangle over two places, from its distances to them, on the side that is drawn. */
function apexOf([from, to], [near, far], [drawnFrom, drawnTo, drawn], joint) {
  const [x, y] = minus(to, from), base = lengthOf([x, y]), [short, middle, longest] = [base, near, far].sort((a, b) => a - b);
  if (longest - short - middle > FLAT_TRIANGLE * longest) throw new ModelProblem(`${joint} makes no triangle: a side is longer than the others together. Change a length.`);
  const along = (near * near - far * far + base * base) / (2 * base);
  const square = short + middle - longest <= FLAT_TRIANGLE * longest ? 0 : near * near - along * along;
  const [a, b] = minus(drawnTo, drawnFrom), [c, d] = minus(drawn, drawnFrom);
  const height = Math.sqrt(square) * Math.sign(a * d - b * c);
  return [from[0] + (along * x - height * y) / base, from[1] + (along * y + height * x) / base];
}

/** Whether the value of a constraint changes with time.
 * @param {any} constraint */
export function isDriver({ functions }, symbol = 'C') {
  const jet = functions[symbol];
  return jet !== undefined && [0, 0.1237, 0.371].some(t => jet(t)[1] !== 0 || jet(t)[2] !== 0);
}

/* ---- a whole file ---- */

const listOf = given => {
  if (given === undefined) return [];
  if (!Array.isArray(given) || given.length > MOST_DRAWN || !given.every(row => row && typeof row === 'object')) throw new ModelProblem(`a list of tables is expected, of at most ${MOST_DRAWN}. Write it so.`);
  return given;
};

/* Do something for a part; a mistake is said with its name. */
function within(what, work) {
  try {
    work();
  } catch (error) {
    if (error instanceof ModelProblem || error instanceof FormulaError) throw new ModelProblem(`${what}: ${error.message}`);
    throw error;
  }
}

/** What a file means, or why it means nothing here.
 * @param {any} file
 * @returns {any} bodies, constraints and points, with numbers; the joints and links of its drawing; the time grid */
export function modelOf(file) {
  const space = file.space ?? 2;
  if (space !== 2) throw new ModelProblem('the file is of a mechanism in space. The editor draws in the plane.');
  if (listOf(file.coordinates).length) throw new ModelProblem('the file has coordinates of free equations. Open it in Python.');
  const sketch = new Sketched(file), drawing = file.sketch ?? {};
  for (const section of ['ground', 'joints']) {
    for (const [name, place] of Object.entries(drawing[section] ?? {})) {
      within(`joint ${name}`, () => sketch.joints.set(name, sketch.pair(place)));
      if (section === 'ground') sketch.links.get(GROUND_NAME).places.set(name, sketch.joints.get(name));
    }
  }
  for (const part of listOf(drawing.parts)) {
    const kind = Object.keys(PARTS).find(key => known(part, key));
    if (!kind) throw new ModelProblem(`a part of the drawing has no kind. Write one of ${Object.keys(PARTS).join(', ')}.`);
    within(`${kind} ${part[kind]}`, () => PARTS[kind](sketch, part));
  }
  for (const { name, guess = [0, 0, 0], outline } of listOf(file.bodies)) {
    within(`body ${name}`, () => {
      const start = guess.map(x => sketch.number(x));
      if (start.length !== 3) throw new ModelProblem('its guess is not [x, y, phi]. Give three numbers.');
      sketch.bodies.push({ name, guess: start, outline: outline?.map(corner => sketch.pair(corner)) });
    });
  }
  for (const { type, name, guess, ...given } of listOf(file.constraints)) within(String(name), () => sketch.add(String(type), String(name), given, guess));
  for (const { name, body, local } of listOf(file.points)) {
    within(`point ${name}`, () => sketch.points.push({ name, body: sketch.bodyIndex(body), place: sketch.pair(local) }));
  }
  const { end = 1, points = 101 } = file.analysis ?? {};
  if (!Number.isInteger(points) || points < 1 || points > 100_000) throw new ModelProblem('analysis: points is no number of times. Give one from 1 to 100,000.');
  const { bodies, constraints, joints, links, values } = sketch;
  return { name: String(file.name ?? 'model'), unit: String(file.length_unit ?? 'm'), end: sketch.number(end), count: points, bodies, constraints, joints, links, values, points: sketch.points };
}
