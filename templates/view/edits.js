/* What a hand does to a model file: each edit changes the file, which is the only model there is. */

import { numberOf } from './formula.js';
import { modelOf, parametersOf } from './sketched.js';

const LETTERS_OF_JOINTS = 'ABCDEFGHIJKLMNPQRSTUVWXYZ';
const DIGITS = 10;  // of a place that is drawn by hand
const STARTING_AT = /^(-?\d+\.?\d*(?:e[+-]?\d+)?)( [+-] .+)$/;  // a motion that begins with a number

export function newFile() {
  return {
    kincompile: 1, name: 'drawing', length_unit: 'm', analysis: { end: 1, points: 201 },
    sketch: { ground: {}, joints: {}, parts: [] },
  };
}

const short = x => Number(x.toPrecision(DIGITS));

/** The drawing of a file, with all its sections.
 * @param {any} file */
export function sketchOf(file) {
  const found = file.sketch ??= {};
  found.ground ??= {};
  found.joints ??= {};
  found.parts ??= [];
  return found;
}

/* A name that is free: A, B, ... for joints, a stem and a number for others. */
function freeName(file, stem = '') {
  const { ground, joints, parts } = sketchOf(file);
  const taken = new Set([...Object.keys(ground), ...Object.keys(joints), ...parts.map(nameOf), ...Array.from(file.bodies ?? [], body => body.name), ...parametersOf(file).keys()]);
  for (let k = 1; ; k++) {
    const letter = LETTERS_OF_JOINTS[(k - 1) % LETTERS_OF_JOINTS.length], round = Math.ceil(k / LETTERS_OF_JOINTS.length);
    const name = stem ? `${stem}${k}` : letter + (round > 1 ? round : '');
    if (!taken.has(name)) return name;
  }
}

/** What kind of part one is, and its name. @param {any} part */
export const kindOf = part => Object.keys(part)[0];
export const nameOf = part => part[kindOf(part)];

const jointsIn = text => String(text).replaceAll(',', ' ').split(' ').filter(Boolean);

/** A new joint. @param {any} file @param {number[]} place */
export function addJoint(file, place, isGround = false) {
  const name = freeName(file), sketch = sketchOf(file);
  sketch[isGround ? 'ground' : 'joints'][name] = place.map(short);
  return name;
}

/** Hold a joint on the ground, or let it go. @param {any} file @param {string} name */
export function toggleGround(file, name) {
  const { ground, joints } = sketchOf(file), [from, to] = name in ground ? [ground, joints] : [joints, ground];
  to[name] = from[name];
  delete from[name];
}

/** @param {any} file @param {string[]} joints */
export function addLink(file, joints) {
  const name = freeName(file, 'link');
  sketchOf(file).parts.push({ link: name, joints: joints.join(' ') });
  return name;
}

/** Give a link one joint more. @param {any} file @param {string} name @param {string} joint */
export function extendLink(file, name, joint) {
  const part = sketchOf(file).parts.find(item => item.link === name), own = jointsIn(part.joints);
  if (own.includes(joint)) return;
  if (part.length !== undefined) {
    part[own.join('_')] = part.length;
    delete part.length;
  }
  part.joints = [...own, joint].join(' ');
}

/** @param {any} file @param {string} joint @param {number[] | string} along */
export function addSlider(file, joint, along) {
  const name = freeName(file, 'slider');
  sketchOf(file).parts.push({ slider: name, joints: joint, along });
  return name;
}

/** @param {any} file @param {string} joint @param {number[] | string} along */
export function addSlot(file, joint, along) {
  sketchOf(file).parts.push({ slot: joint, along });
}

/** A wheel on a joint, where nothing else turns about it. */
function wheelAt(file, joint, other) {
  const { parts } = sketchOf(file), has = (part, name) => part.wheel && part.joint === name;
  const turning = parts.find(part => has(part, joint))
    ?? parts.find(part => part.link && jointsIn(part.joints).includes(joint) && !jointsIn(part.joints).includes(other));
  if (turning) return nameOf(turning);
  const name = freeName(file, 'wheel');
  parts.push({ wheel: name, joint });
  return name;
}

/** Two wheels that roll on each other. @param {any} file @param {string} one @param {string} other */
export function addGear(file, one, other) {
  const places = modelOf(file).joints, [a, b] = [places.get(one), places.get(other)];
  const i = wheelAt(file, one, other), j = wheelAt(file, other, one), name = freeName(file, 'gear');
  const radius = short(Math.hypot(b[0] - a[0], b[1] - a[1]) / 2);
  sketchOf(file).parts.push({ gear: name, i, centre_i: one, radius_i: radius, j, centre_j: other, radius_j: radius });
}

/** A cylinder between two joints, which changes its length. */
export function addCylinder(file, one, other) {
  const places = modelOf(file).joints, [a, b] = [places.get(one), places.get(other)];
  const length = short(Math.hypot(b[0] - a[0], b[1] - a[1]));
  sketchOf(file).parts.push({ drive: `${one} ${other}`, value: `${length} + ${short(0.1 * length)}*sin(2*pi*t)` });
}

/** Drive a link, once around, or a slider, to and fro, from where it is drawn. */
export function addDriver(file, name) {
  const model = modelOf(file), link = model.links.get(name), size = short(0.2 * (sizeOfModel(model) || 1));
  const start = link.guide ? wayOf(model, link) : link.angle;
  const moving = link.guide ? `${size}*sin(2*pi*t)` : '2*pi*t';
  const { parts } = sketchOf(file), found = parts.findIndex(part => part.drive === name);
  if (found >= 0) parts.splice(found, 1);
  else parts.push({ drive: name, value: `${short(start)} + ${moving}` });
}

/* How far along its guide a slider is drawn. */
function wayOf(model, { guide: { link, point, axis }, origin }) {
  const c = Math.cos(link.angle), s = Math.sin(link.angle), [x, y] = axis;
  const from = [link.origin[0] + c * point[0] - s * point[1], link.origin[1] + s * point[0] + c * point[1]];
  const along = [c * x - s * y, s * x + c * y], length = Math.hypot(x, y);
  return ((origin[0] - from[0]) * along[0] + (origin[1] - from[1]) * along[1]) / length;
}

function sizeOfModel({ joints }) {
  const places = [...joints.values()], far = k => Math.max(...places.map(x => x[k])) - Math.min(...places.map(x => x[k]));
  return places.length ? Math.hypot(far(0), far(1)) : 0;
}

/** Name a joint as a point, whose path is drawn, or not any more. */
export function togglePoint(file, joint) {
  const { parts } = sketchOf(file), found = parts.findIndex(part => part.point === joint);
  if (found >= 0) parts.splice(found, 1);
  else parts.push({ point: joint });
}

/* Whether a part is about a name: of a joint, or of a link. */
function mentions(part, name) {
  const words = ['joints', 'joint', 'along', 'on', 'i', 'j', 'centre_i', 'centre_j', 'slot', 'drive', 'point', 'against'];
  return words.some(word => jointsIn(typeof part[word] === 'string' ? part[word].replaceAll('.', ' ') : '').includes(name));
}

/** Take out a joint or a part, and all that cannot be without it. @param {any} file @param {string} name */
export function erase(file, name) {
  const sketch = sketchOf(file), gone = [name];
  delete sketch.ground[name];
  delete sketch.joints[name];
  for (let k = 0; k < gone.length; k++) {
    for (const part of sketch.parts.slice()) {
      const isOwn = nameOf(part) === gone[k] && !['drive', 'slot', 'point'].includes(kindOf(part));
      if (part.link && !isOwn && mentions(part, gone[k]) && jointsIn(part.joints).length > 2) {
        part.joints = jointsIn(part.joints).filter(joint => joint !== gone[k]).join(' ');
      } else if (isOwn || mentions(part, gone[k])) {
        sketch.parts.splice(sketch.parts.indexOf(part), 1);
        if (['link', 'wheel', 'slider'].includes(kindOf(part))) gone.push(nameOf(part));
      }
    }
  }
  const held = new Set(sketch.parts.flatMap(part => jointsIn([part.joints, part.joint].filter(Boolean).join(' '))));
  const loose = Object.keys({ ...sketch.joints, ...sketch.ground }).filter(joint => !held.has(joint));
  loose.forEach(joint => delete sketch.joints[joint]);
  dropLimits(file, [...gone, ...loose]);
}

/* Take out the limits of constraints that the parts of these names bring. */
function dropLimits(file, names) {
  const own = names.flatMap(name => [name, `${name}_guide`, `${name}_slot`, `drive_${name.replace(/\W+/g, '_')}`]);
  if (file.limits) file.limits = file.limits.filter(item => !own.includes(item.joint));
}

/** Take out a part by its place in the list. @param {any} file @param {number} k */
export function erasePart(file, k) {
  const { parts } = sketchOf(file), part = parts[k];
  if (['link', 'wheel', 'slider', 'gear'].includes(kindOf(part))) erase(file, nameOf(part));
  else {
    parts.splice(k, 1);
    dropLimits(file, [part.drive ?? `${part.slot}_slot`]);
  }
}

/** Bring a joint to a place.  Lengths that are given, and drivers that begin with a number, follow.
 * @param {any} file @param {string} name @param {number[]} place
 * @returns {string} what could not follow, in words */
export function moveJoint(file, name, place) {
  const sketch = sketchOf(file), section = name in sketch.ground ? sketch.ground : sketch.joints, kept = [];
  const before = modelOf(file);
  section[name] = section[name].map((given, k) => {
    if (setValue(file, given, short(place[k]), x => { given = x; })) return given;
    kept.push(`${name} is at "${given}"`);
    return given;
  });
  const at = joint => (sketch.ground[joint] ?? sketch.joints[joint]).map(x => numberOf(x, parametersOf(file)));
  for (const part of sketch.parts.filter(item => item.link && mentions(item, name))) {
    const own = jointsIn(part.joints);
    for (const [key, pair] of lengthsOf(part, own)) {
      if (!pair.includes(name)) continue;
      const [[x, y], [u, v]] = pair.map(at), length = short(Math.hypot(u - x, v - y));
      if (length > 0 && !setValue(file, part[key], length, value => { part[key] = value; })) kept.push(`${part.link} has the length "${part[key]}"`);
    }
    if (Array.isArray(part[name])) delete part[name];
  }
  shiftDrivers(file, before);
  return kept.length ? `${kept.join(', ')}: a formula stays. Change it in the list.` : '';
}

/* Set a number, the number that a parameter has, or the opposite of it; a formula stays. */
function setValue(file, given, value, set) {
  if (typeof given === 'number') {
    set(value);
    return true;
  }
  const [, sign, name] = /^(-?)([A-Za-z_]\w*)$/.exec(given) ?? [], wanted = sign ? -value : value;
  const lengths = file.sketch.lengths ?? {}, parameter = (file.parameters ?? []).find(item => item.name === name);
  if (name in lengths) lengths[name] = wanted;
  else if (parameter) parameter.default = wanted;
  else return false;
  return true;
}

/* The lengths of a link, each with its two joints. */
function lengthsOf(part, own) {
  const found = part.length === undefined ? [] : [['length', own]];
  for (const one of own) {
    for (const other of own) {
      for (const key of [one + other, `${one}_${other}`, `${one} ${other}`]) if (one !== other && key in part) found.push([key, [one, other]]);
    }
  }
  return found;
}

/* Let drivers that begin with a number begin where their link is drawn now. */
function shiftDrivers(file, before) {
  const after = modelOf(file);
  for (const part of sketchOf(file).parts.filter(item => item.drive && typeof item.value === 'string')) {
    const [, start, rest] = STARTING_AT.exec(part.value) ?? [], link = after.links.get(part.drive);
    if (start === undefined) continue;
    let now;
    if (link) now = link.guide ? wayOf(after, link) : Number(start) + turnBetween(before.links.get(part.drive).angle, link.angle);
    else {
      const [a, b] = jointsIn(part.drive).map(joint => after.joints.get(joint));
      if (!a || !b) continue;
      now = Math.hypot(b[0] - a[0], b[1] - a[1]);
    }
    part.value = `${short(now)}${rest}`;
  }
}

/* The turn from one angle to another, at most half of one. */
function turnBetween(from, to) {
  const turn = to - from;
  return turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI));
}
