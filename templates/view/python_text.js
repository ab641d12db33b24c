/* A model as Python: calls of `kc.Sketch`, or of `kc.Mechanism` where the file has bodies.  Formulas are
   read and written anew, so that no text of a file becomes code. */

import { parsedFormula } from './formula.js';
import { ModelProblem } from './sketched.js';

const OF_SYMPY = { ln: 'log', arcsin: 'asin', arccos: 'acos', arctan: 'atan', log: 'log' };

/** @param {any} file */
export function writePython(file) {
  const sketch = file.sketch ?? {}, names = new Set();
  const define = (name, call) => {
    names.add(name);
    lines.push(`${variable(name)} = ${call}`);
  };
  const value = given => pythonValue(given, names);
  const options = [['length_unit', file.length_unit], ['mass_unit', file.mass_unit]].filter(([, x]) => x !== undefined).map(([key, x]) => `${key}=${quoted(x)}`);
  const { end = 1, points = 101 } = file.analysis ?? {};
  const lines = ['import sympy', '', 'import kincompile as kc', ''], make = lines.length;
  for (const { name, default: given, unit = '' } of file.parameters ?? []) define(name, `s.parameter(${quoted(name)}, ${value(given)}, ${quoted(unit)})`);
  for (const [name, given] of Object.entries(sketch.lengths ?? {})) define(name, `s.length(${quoted(name)}, ${value(given)})`);
  lines.splice(make, 0, `s = kc.Sketch(${[quoted(file.name ?? 'model'), ...options, `end=${value(end)}`, `points=${Number(points)}`].join(', ')})`);
  for (const section of ['ground', 'joints']) {
    const own = Object.entries(sketch[section] ?? {}).map(([name, place]) => `${quoted(name)}: ${value(place)}`);
    if (own.length) lines.push(`s.${section}(**{${own.join(', ')}})`);
  }
  for (const part of sketch.parts ?? []) lines.push(partText(part, value));
  lines.push('m = s.mechanism()');
  for (const { name, guess = [0, 0, 0] } of file.bodies ?? []) lines.push(`m.body(${quoted(name)}, guess=${value(guess)})`);
  for (const { type, name, ...given } of file.constraints ?? []) {
    const kinds = kindsOf(type), more = Object.entries(given).map(([key, x]) => `${word(key)}=${kinds.get(key) === 'body' ? quoted(x) : value(x)}`);
    const unknown = Object.keys(given).find(key => !kinds.has(key) && !['guess', 'corners'].includes(key));
    if (unknown !== undefined) throw new ModelProblem(`${name}: ${JSON.stringify(unknown)} is not known. Take it out.`);
    lines.push(`m.add(kc.${type}(${[quoted(name), ...more].join(', ')}))`);
  }
  for (const { name, body, local } of file.points ?? []) lines.push(`m.point(${[quoted(name), quoted(body), value(local)].join(', ')})`);
  return `${lines.join('\n')}\n`;
}

function partText(part, value) {
  const [[kind, name], ...given] = Object.entries(part);
  const positional = { link: ['joints'], wheel: ['joint'], slider: ['joints', 'along'], slot: ['along'], drive: ['value'], gear: [], point: [] }[kind];
  if (!positional) throw new ModelProblem(`a part ${kind} is not known. Take it out.`);
  const first = positional.map(key => (key === 'value' || key === 'along' && typeof part[key] !== 'string' ? value(part[key]) : quoted(part[key])));
  const rest = given.filter(([key]) => !positional.includes(key));
  const texts = new Set(['on', 'against', 'i', 'j', 'centre_i', 'centre_j', 'joint', 'joints']);
  const named = rest.map(([key, x]) => `${quoted(key)}: ${texts.has(key) ? quoted(x) : value(x)}`);
  const more = kind === 'link' && part.length !== undefined ? [value(part.length)] : [];
  const kept = named.filter(text => !text.startsWith('"length":'));
  return `s.${kind}(${[quoted(name), ...first, ...more, ...kept.length ? [`**{${kept.join(', ')}}`] : []].join(', ')})`;
}

/* A word of Python: a name in a file that is no such word is refused. */
function word(text) {
  if (!/^[A-Za-z]\w*$/.test(text)) throw new ModelProblem(`${JSON.stringify(text)} is no name. Rename it.`);
  return text;
}

/* The arguments of a type, and what each is. */
function kindsOf(type) {
  if (!Object.hasOwn(kernels.types, type)) throw new ModelProblem(`the type ${JSON.stringify(type)} is not known. Change it.`);
  return new Map(kernels.types[type].arguments.map(([key, kind]) => [key, kind]));
}

const variable = name => `p_${word(name)}`;
const quoted = text => JSON.stringify(String(text)).replace(/\x7f/g, '\\u007f');

function pythonValue(given, names) {
  if (typeof given === 'number') return String(given);
  if (typeof given === 'boolean') return given ? 'True' : 'False';
  if (Array.isArray(given)) return `(${given.map(x => pythonValue(x, names)).join(', ')}${given.length === 1 ? ',' : ''})`;
  if (typeof given === 'object') {
    const { points, law, ramp } = given, own = [`${pythonValue(points, names)}`];
    if (law !== undefined) own.push(Array.isArray(law) ? `[${law.map(quoted).join(', ')}]` : quoted(law));
    if (ramp !== undefined) own.push(`ramp=${pythonValue(ramp, names)}`);
    return `kc.motion.sequence(${own.join(', ')})`;
  }
  // What is no formula is a name: of a body, of a joint.
  const tree = treeOf(given);
  return tree && isKnown(tree, names) ? formulaText(tree, names) : quoted(given);
}

function treeOf(text) {
  try {
    return parsedFormula(text);
  } catch {
    return null;
  }
}

const PLAIN = ['cot', 'sec', 'csc'];
const SYMBOLS = { t: 'kc.t', alpha: 'kc.alpha', pi: 'kc.pi', deg: 'kc.deg' };

function isKnown(tree, names) {
  if (tree.kind === 'name') return names.has(tree.name) || Object.hasOwn(SYMBOLS, tree.name);
  return [tree.a, tree.b, ...tree.given ?? []].every(inner => !inner || isKnown(inner, names));
}

function formulaText(tree, names) {
  const of = inner => formulaText(inner, names);
  switch (tree.kind) {
    case 'number': return String(tree.value);
    case 'name': return names.has(tree.name) ? variable(tree.name) : SYMBOLS[tree.name];
    case 'neg': return `(-${of(tree.a)})`;
    case 'call': {
      const { name } = tree, given = tree.given.map(of).join(', ');
      const title = Object.keys(kernels.titles).find(key => kernels.titles[key] === name);
      if (!title && !Object.hasOwn(kernels.functions, OF_SYMPY[name] ?? name) && !PLAIN.includes(name)) throw new ModelProblem(`the function ${JSON.stringify(name)} is not known. Write another.`);
      return title ? `kc.motion.law(${quoted(title)})(${given})` : `sympy.${OF_SYMPY[name] ?? name}(${given})`;
    }
    case '^': return `(${of(tree.a)})**(${of(tree.b)})`;
    default: return `(${of(tree.a)} ${tree.kind} ${of(tree.b)})`;
  }
}
