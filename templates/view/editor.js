/* The editor: a drawing that is a model.  What its tools do, and its buttons, keys and list. */

import { addCylinder, addDriver, addGear, addJoint, addLink, addSlider, addSlot, erase, erasePart, extendLink, kindOf, moveJoint, nameOf, newFile, sketchOf, toggleGround, togglePoint } from './edits.js';
import { Board, connectPointers } from './board.js';
import { Editing } from './editing.js';
import { save } from './save.js';
import { FormulaError } from './formula.js';
import { ModelProblem } from './sketched.js';
import { FileError, readToml, writeToml } from './toml.js';
import { writePython } from './python_text.js';

const TOOLS = [
  ['move', 'V', 'Move', 'Pull a joint, or the paper.'],
  ['link', 'L', 'Link', 'From joint to joint; empty paper makes a joint.'],
  ['joint', 'J', 'Joint', 'Press a link: it gets one joint more.'],
  ['ground', 'G', 'Ground', 'Press a joint: it stands still, or not any more.'],
  ['slider', 'S', 'Slider', 'From a joint in the direction in which it slides, or to the link that guides it.'],
  ['slot', 'T', 'Slot', 'From a pin to the link with the slot, or in the direction of the slot.'],
  ['gear', 'E', 'Gear', 'From centre to centre: two wheels that roll on each other.'],
  ['cylinder', 'C', 'Cylinder', 'From joint to joint: it drives their distance.'],
  ['driver', 'D', 'Driver', 'Press a link or a slider: it is driven, or not any more.'],
  ['point', 'P', 'Point', 'Press a joint: its path is kept as that of a named point.'],
  ['erase', 'X', 'Erase', 'Press a joint or a link.'],
];
const TWO_ENDED = new Set(['link', 'slider', 'slot', 'gear', 'cylinder']);
const PLEASANT_TIME = 4000;  // ms that a motion takes, played
const FAST = 5;  // steps of the grid that an arrow takes with Shift
const DECIMALS_SAID = 4;  // of places

const given = JSON.parse(document.getElementById('data').textContent);
/** @param {string} id @returns {any} */
const part = id => document.getElementById(id);
const editing = new Editing();
const board = new Board(part('canvas'), editing, given.tables);
editing.sentences = given.sentences;

const editor = {
  tool: 'move',
  isPlaying: false,

  /* ---- pointing ---- */

  press(place, reach) {
    board.cursor = place;
    const joint = board.jointAt(place, reach), two = TWO_ENDED.has(this.tool);
    if (two && board.first) return;
    if (two) board.first = { joint, place: board.snapped(place) };
    else if (this.tool === 'move' && joint) this.hold(joint);
    else if (this.tool !== 'move') this.once(place, joint);
    this.draw();
  },

  pull(place, [right, down]) {
    board.cursor = place;
    if (board.held) this.bring(board.held, board.snapped(place));
    else if (this.tool === 'move' && !board.first) board.pan(right, down);
    this.draw();
  },

  release(place, isPull) {
    const { first } = board, wasOpen = this.isOpen;
    this.letGo();
    if (!place) board.first = null;
    // A press that does not pull leaves one end, and the next one is the other.
    else if (first && !isPull && !wasOpen) this.isOpen = true;
    else if (first) {
      this.isOpen = false;
      board.first = null;
      this.twoEnded(first, place);
    }
    this.draw();
  },

  hover(place) {
    board.cursor = place;
    const hovered = board.jointAt(place);
    if (hovered === board.hovered && !board.first) return;
    board.hovered = hovered;
    this.draw();
  },

  /* What a tool does with one press. */
  once(place, joint) {
    const link = board.linkAt(place), { tool } = this;
    this.change(file => {
      if (tool === 'ground') return joint ? toggleGround(file, joint) : addJoint(file, board.snapped(place), true);
      if (tool === 'joint') return link ? extendLink(file, link, addJoint(file, this.drawn(place))) : say('Press a link: it gets a joint.');
      if (tool === 'driver') return addDriver(file, this.driven(place, joint, link));
      if (tool === 'point') return joint ? togglePoint(file, joint) : say('Press a joint.');
      if (tool === 'erase' && (joint || link)) return erase(file, joint ?? link);
      return undefined;
    });
  },

  /* A place on a link as it is drawn: the motion is at its start. */
  drawn(place) {
    this.rewind();
    return board.snapped(place);
  },

  driven(place, joint, link) {
    const own = sketchOf(editing.file).parts, slides = own.find(item => item.slider && joint && item.joints.split(' ').includes(joint));
    const held = own.find(item => item.link && joint && item.joints.split(' ').includes(joint)) ?? own.find(item => item.wheel && item.joint === joint);
    const found = slides?.slider ?? link ?? (held && nameOf(held));
    if (!found) throw new ModelProblem('Press a link or a slider: it is driven.');
    return found;
  },

  /* What a tool does from one end to the other. */
  twoEnded(first, place) {
    const joint = board.jointAt(place), link = board.linkAt(place), { tool } = this;
    this.change(file => {
      this.settle(file);
      if (tool === 'link') {
        const one = first.joint ?? addJoint(file, first.place), other = joint ?? addJoint(file, board.snapped(place));
        if (one !== other) return addLink(file, [one, other]);
        return erase(file, first.joint ? '' : one);
      }
      if (!first.joint) throw new ModelProblem('Begin at a joint.');
      const from = board.jointPlaces().get(first.joint), along = () => (link ? this.lineOf(link) : board.direction(from, place));
      if (tool === 'slider') return addSlider(file, first.joint, along());
      if (tool === 'slot') return addSlot(file, first.joint, along());
      if (!joint || joint === first.joint) throw new ModelProblem('End at another joint.');
      return tool === 'gear' ? addGear(file, first.joint, joint) : addCylinder(file, first.joint, joint);
    });
  },

  lineOf(link) {
    const own = [...editing.model.links.get(link).places.keys()];
    return own.length > 1 ? own.slice(0, 2).join(' ') : [1, 0];
  },

  /* ---- pulling a joint ---- */

  hold(joint) {
    if (!editing.model.joints.has(joint)) return;
    this.rewind();
    board.held = joint;
    editing.history.take();
    this.bring(joint, null);
  },

  bring(joint, place) {
    this.change(file => {
      this.settle(file);
      return place && moveJoint(file, joint, place);
    }, { goesOn: true, isPull: true });
    if (place) announce(`${joint} at ${placeText(place)}`);
  },

  letGo() {
    if (!board.held) return;
    board.held = null;
    editing.history.take();
    this.show();
  },

  /* The drawing as it is assembled, where it was a rough one. */
  settle(file) {
    if (editing.problem || !editing.bound?.isAssembled || board.index) return;
    const sketch = sketchOf(file), size = board.drawing?.size ?? 1;
    for (const [name, place] of board.jointPlaces()) {
      const before = sketch.joints[name];
      if (!before || !before.every(Number.isFinite) || Math.hypot(before[0] - place[0], before[1] - place[1]) < 1e-6 * size) continue;
      sketch.joints[name] = place.map(x => Number(x.toPrecision(10)));
    }
  },

  /* ---- changing and showing ---- */

  /** Change the file and show it; a mistake is said, and nothing changes. */
  change(edit, how = {}) {
    const isFirst = !editing.bound && !Object.keys(sketchOf(editing.file).joints).length;
    try {
      const said = editing.edit(edit, how);
      say(typeof said === 'string' && how.isPull ? said : '');
    } catch (error) {
      if (!isExpected(error)) throw error;
      say(error.message);
    }
    board.renew();
    if (isFirst && editing.bound) board.camera ??= null;
    this.show(how.isPull);
  },

  show(isPull = false) {
    const { isGood, lines } = editing.findings(), { motion } = editing;
    part('findings').replaceChildren(...lines.map(text => made('li', text)));
    part('findings').classList.toggle('bad', !isGood && Boolean(editing.problem || editing.event));
    part('undo').disabled = !editing.history.canUndo;
    part('redo').disabled = !editing.history.canRedo;
    part('time').max = String((motion?.t.length ?? 1) - 1);
    part('play').disabled = !motion || motion.failed?.index === 0;
    if (!isPull) this.list();
    this.draw();
  },

  draw() {
    board.draw();
    part('time').value = String(board.index);
    part('clock').textContent = `t = ${((editing.motion?.t[board.index]) ?? 0).toPrecision(4)} s`;
  },

  rewind() {
    this.play(false);
    board.index = 0;
  },

  play(isPlaying) {
    this.isPlaying = isPlaying && Boolean(editing.motion);
    part('play').ariaPressed = String(this.isPlaying);
    part('play').textContent = this.isPlaying ? '⏸ Pause' : '▶ Play';
    if (!this.isPlaying) return;
    const begin = performance.now() - board.index / Math.max(1, editing.motion.t.length - 1) * PLEASANT_TIME;
    const step = now => {
      if (!this.isPlaying || !editing.motion) return;
      const { failed, t } = editing.motion, last = failed ? Math.max(failed.index - 1, 0) : t.length - 1;
      const way = (now - begin) / PLEASANT_TIME * (t.length - 1);
      board.index = Math.round(((way % (last + 1)) + last + 1) % (last + 1)) % (last + 1);
      this.draw();
      requestAnimationFrame(step);
    };
    requestAnimationFrame(step);
  },

  take(tool) {
    this.tool = tool;
    board.first = board.held = null;
    this.isOpen = false;
    for (const button of part('tools').children) button.ariaPressed = String(button.dataset.tool === tool);
    part('about').textContent = TOOLS.find(([name]) => name === tool)[3];
    this.draw();
  },

  changed() {
    this.draw();
  },

  /* ---- the list: what a hand cannot say exactly ---- */

  list() {
    const { file } = editing, sketch = sketchOf(file), rows = [];
    for (const section of ['ground', 'joints']) {
      for (const name of Object.keys(sketch[section])) rows.push(rowOf(section === 'ground' ? 'ground' : 'joint', name, sketch[section], [name], () => this.change(own => erase(own, name))));
    }
    for (const [name] of Object.entries(sketch.lengths ?? {})) rows.push(rowOf('length', name, sketch.lengths, [name]));
    for (const item of file.parameters ?? []) rows.push(rowOf('parameter', item.name, item, ['default']));
    sketch.parts.forEach((item, k) => {
      const keys = Object.keys(item).slice(1);
      if (item.link && item.joints.split(' ').length === 2 && !keys.includes('length')) keys.push('length');
      rows.push(rowOf(kindOf(item), nameOf(item), item, keys, () => this.change(own => erasePart(own, k))));
    });
    (file.bodies ?? []).forEach(item => rows.push(rowOf('body', item.name, item, ['guess'])));
    (file.constraints ?? []).forEach(item => rows.push(rowOf(item.type, item.name, item, Object.keys(item).slice(2))));
    part('list').replaceChildren(...rows);
    for (const [id, owner, key] of [['name', file, 'name'], ['end', file.analysis ??= { end: 1, points: 101 }, 'end'], ['count', file.analysis, 'points'], ['unit', file, 'length_unit']]) {
      part(id).value = String(owner[key] ?? '');
    }
  },
};

/* A row of the list: what it is, its name, a box for each value. */
function rowOf(kind, name, owner, keys, remove = null) {
  const row = made('tr'), head = made('th', `${kind} ${name}`), cell = made('td');
  head.scope = 'row';
  for (const key of keys) cell.append(...boxOfValue(kind, name, owner, key));
  row.append(head, cell, made('td'));
  if (remove) {
    const button = made('button', '✕');
    Object.assign(button, { type: 'button', title: `Erase ${name}`, ariaLabel: `Erase ${name}`, onclick: remove });
    row.lastChild.append(button);
  }
  return row;
}

function boxOfValue(kind, name, owner, key) {
  const box = made('input'), label = made('label', key !== name ? `${key} ` : kind === 'length' ? 'value ' : 'at ');
  box.value = owner[key] === undefined ? '' : textOf(owner[key]);
  box.ariaLabel = `${key} of ${kind} ${name}`;
  box.onchange = () => editor.change(() => {
    const value = valueOf(box.value);
    if (value === undefined) delete owner[key];
    else owner[key] = value;
  });
  label.append(box);
  if (kind !== 'drive' || key !== 'value') return [label];
  return [label, lawsOf(name, owner)];
}

/* The ways in which a driver may move. */
function lawsOf(name, owner) {
  const choice = made('select'), now = typeof owner.value === 'object' ? owner.value.law : 'formula';
  choice.ariaLabel = `motion law of drive ${name}`;
  for (const title of ['formula', 'constant speed', 'to and fro', ...Object.keys(kernels.titles)]) choice.append(made('option', title));
  choice.value = Array.isArray(now) ? now[0] : now;
  choice.onchange = () => editor.change(({ analysis: { end } }) => {
    const constraint = editing.model.constraints.find(item => item.name === `drive_${name.replaceAll('.', ' ').split(' ').join('_')}`);
    const start = Number(constraint.functions.C(0)[0].toPrecision(10)), isAngle = /Angle$/.test(constraint.type);
    const size = isAngle ? 1 : Number((0.2 * (Math.abs(start) || 1)).toPrecision(3)), last = Number(end) || 1;
    if (choice.value === 'constant speed') owner.value = `${start} + ${isAngle ? '2*pi' : size}*t`;
    else if (choice.value === 'to and fro') owner.value = `${start} + ${size}*sin(2*pi*t)`;
    else if (choice.value === 'formula') owner.value = `${start}`;
    else owner.value = { points: [[0, start], [0.4 * last, start + size], [0.6 * last, start + size], [last, start]], law: choice.value };
  });
  return choice;
}

const textOf = value => (typeof value === 'string' ? value : writeToml({ x: value }).slice(4).trim());

/* What is typed in a box: a number, a list or a table, or a text. */
function valueOf(text) {
  const trimmed = text.trim();
  if (!trimmed) return undefined;
  if (/^[[{]/.test(trimmed)) return readToml(`x = ${trimmed}`).x;
  return trimmed !== '' && Number.isFinite(Number(trimmed)) ? Number(trimmed) : trimmed;
}

function made(tag, text = '') {
  /** @type {any} */
  const element = document.createElement(tag);
  element.textContent = text;
  return element;
}

const isExpected = error => [ModelProblem, FormulaError, FileError, SyntaxError].some(kind => error instanceof kind);
const placeText = place => place.map(x => Number(x.toFixed(DECIMALS_SAID))).join(', ');

function say(text) {
  part('message').textContent = text;
  part('message').hidden = !text;
}

function announce(text) {
  part('said').textContent = text;
}

/* ---- files ---- */

function saveText(text, ending) {
  save(`${String(editing.file.name ?? 'drawing').replace(/\W+/g, '_')}.${ending}`, new Blob([text], { type: 'text/plain' }));
}

function openText(text) {
  try {
    editing.openText(text);
    say('');
  } catch (error) {
    if (!isExpected(error)) throw error;
    say(`The file was not opened. ${error.message}`);
    return;
  }
  editor.rewind();
  board.renew();
  board.fit();
  editor.show();
}

/* ---- keys: a cross that arrows move stands for the pointer ---- */

function onBoard(event) {
  const arrows = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }, { key } = event;
  const arrow = arrows[key];
  if (arrow) {
    board.isShowingCursor = true;
    const from = board.cursor ? board.snapped(board.cursor) : board.snapped(board.view.toWorld([board.width / 2, board.height / 2]));
    board.cursor = arrow.map((x, k) => from[k] + x * board.step * (event.shiftKey ? FAST : 1));
    if (board.held) editor.bring(board.held, board.snapped(board.cursor));
    else announce(`${placeText(board.cursor)}${board.jointAt(board.cursor) ? `, joint ${board.jointAt(board.cursor)}` : ''}`);
    editor.draw();
  } else if (key === 'Enter' && board.cursor) {
    if (board.held) editor.letGo();
    else if (editor.tool === 'move') editor.press(board.cursor, 2 * board.step * board.view.scale);
    else {
      editor.press(board.cursor, board.step * board.view.scale);
      editor.release(board.cursor, false);
    }
    editor.draw();
  } else if (key === 'Escape') {
    const { held } = board;
    if (held) {
      if (editing.history.isChanged) undo('undo');
      board.cursor = board.jointPlaces().get(held);
    }
    board.first = board.held = null;
    editor.isOpen = false;
    editor.draw();
  } else if ((key === 'Delete' || key === 'Backspace') && board.cursor) {
    const found = board.jointAt(board.cursor) ?? board.linkAt(board.cursor);
    if (found) editor.change(file => erase(file, found));
  } else if (key === '+' || key === '-') {
    board.zoom(key === '+' ? 1.25 : 0.8);
    editor.draw();
  } else if (key === ' ') editor.play(!editor.isPlaying);
  else return onPage(event);
  event.preventDefault();
  return undefined;
}

function onPage(event) {
  const isTyped = /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName) && event.target.type !== 'range', key = event.key.toUpperCase();
  if ((event.ctrlKey || event.metaKey) && !isTyped && (key === 'Z' || key === 'Y')) {
    undo(key === 'Y' || event.shiftKey ? 'redo' : 'undo');
    event.preventDefault();
  } else if (!isTyped && !event.ctrlKey && !event.metaKey && !event.altKey) {
    const tool = TOOLS.find(([, letter]) => letter === key);
    if (tool) editor.take(tool[0]);
    else if (key === 'F') fit();
  }
}

function undo(which) {
  board.held = board.first = null;
  editing.history[which]();
  board.renew();
  editor.show();
}

function fit() {
  board.fit();
  editor.draw();
}

/* Draw another assembly: joints go where it has them. */
function nextAssembly() {
  const found = editing.assemblies();
  if (found.length < 2) {
    announce(found.length ? 'One assembly was found.' : 'There is no assembly.');
    part('assembled').textContent = found.length ? 'one assembly found' : 'no assembly';
    return;
  }
  editor.rewind();
  const q = found[1], { model } = editing;
  editor.change(file => {
    const { joints } = sketchOf(file);
    for (const [name] of Object.entries(joints)) {
      const link = [...model.links.values()].find(item => item.places.has(name)), k = model.bodies.findIndex(body => body.name === link?.name);
      if (k < 0 || !joints[name].every(Number.isFinite)) continue;
      const [x, y] = link.places.get(name), [a, b, phi] = q.subarray(3 * k, 3 * k + 3), c = Math.cos(phi), s = Math.sin(phi);
      joints[name] = [a + c * x - s * y, b + s * x + c * y].map(value => Number(value.toPrecision(10)));
    }
    (file.bodies ?? []).forEach(body => {
      const k = model.bodies.findIndex(item => item.name === body.name);
      body.guess = [...q.subarray(3 * k, 3 * k + 3)].map(value => Number(value.toPrecision(10)));
    });
  });
  part('assembled').textContent = `${found.length} assemblies found; another is drawn`;
}

function start() {
  for (const [name, letter, title, about] of TOOLS) {
    const button = made('button', title);
    Object.assign(button, { type: 'button', title: `${about} (${letter})`, onclick: () => editor.take(name) });
    button.dataset.tool = name;
    part('tools').append(button);
  }
  connectPointers(board, {
    press: (place, reach) => editor.press(place, reach), pull: (place, way) => editor.pull(place, way),
    release: (place, isPull) => editor.release(place, isPull), hover: place => editor.hover(place), changed: () => editor.draw(),
  });
  const acts = {
    new: () => {
      editing.replace(newFile());
      board.renew();
      fit();
      editor.show();
    },
    open: () => part('file').click(), toml: () => saveText(writeToml(editing.file), 'toml'),
    python: () => editor.change(() => saveText(writePython(editing.file), 'py')),
    undo: () => undo('undo'), redo: () => undo('redo'), play: () => editor.play(!editor.isPlaying), fit, assemblies: nextAssembly,
    theme: () => {
      document.documentElement.dataset.theme = board.palette.isDark ? 'light' : 'dark';
      board.resize();
      editor.draw();
    },
  };
  for (const [id, act] of Object.entries(acts)) part(id).onclick = act;
  part('file').onchange = async event => {
    const [file] = event.target.files;
    if (file) openText(file.size > given.largest ? ' '.repeat(given.largest + 1) : await file.text());
    event.target.value = '';
  };
  part('snap').onchange = event => { board.snaps = event.target.checked; };
  part('paths').onchange = event => {
    board.showsPaths = event.target.checked;
    editor.draw();
  };
  part('time').oninput = event => {
    editor.play(false);
    board.index = Number(event.target.value);
    editor.draw();
  };
  for (const [id, set] of Object.entries({
    name: (file, value) => { file.name = value; }, unit: (file, value) => { file.length_unit = value; },
    end: (file, value) => { file.analysis.end = valueOf(value) ?? 1; }, count: (file, value) => { file.analysis.points = Number(value); },
  })) part(id).onchange = event => editor.change(file => set(file, event.target.value));
  part('canvas').addEventListener('keydown', onBoard);
  document.addEventListener('keydown', event => { if (event.target !== part('canvas')) onPage(event); });
  new ResizeObserver(() => {
    board.resize();
    editor.draw();
  }).observe(part('canvas').parentElement);
  matchMedia('(prefers-color-scheme: dark)').addEventListener('change', acts.theme);
  if (given.file) openText(given.file);
  editing.history.forget();
  editor.take(given.file ? 'move' : 'link');
  editor.show();
}

start();
