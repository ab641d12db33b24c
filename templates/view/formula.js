/* Formulas as files have them: read by a small grammar, never run; with derivatives by one variable.

   A value with its derivatives is a jet, [f, f', f'', f'''].  Those of the elementary functions and of
   the motion laws are emitted (`kernels`); here are sums, products and the chain rule. */

const LONGEST_FORMULA = 2000;  // characters
const DEEPEST_FORMULA = 60;  // parentheses within each other
const HIGHEST_POWER = 64;  // whole exponents up to this are products
const TOKEN = /\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([A-Za-z_]\w*)|(\*\*|[-+*/^(),]))/y;
const RENAMED = { ln: 'log', arcsin: 'asin', arccos: 'acos', arctan: 'atan' };
const INVERTED = { cot: 'tan', sec: 'cos', csc: 'sin' };

/** A formula that cannot be read or has no value; its message is for people. */
export class FormulaError extends Error {}

/** The tree of a formula.
 * @param {string} text
 * @returns {any} { kind: 'number' | 'name' | 'call' | 'neg' | '+' | '-' | '*' | '/' | '^', ... } */
export function parsedFormula(text) {
  if (text.length > LONGEST_FORMULA) throw new FormulaError(`A formula has ${text.length} characters. Write at most ${LONGEST_FORMULA}.`);
  const tokens = tokensOf(text);
  let next = 0, depth = 0;
  const take = sign => tokens[next]?.sign === sign && Boolean(++next);
  const expect = sign => {
    if (!take(sign)) throw new FormulaError(`"${text}" lacks "${sign}". Write it there.`);
  };
  const deeper = read => {
    if (++depth > DEEPEST_FORMULA) throw new FormulaError(`A formula has more than ${DEEPEST_FORMULA} levels. Write it in parts.`);
    const found = read();
    depth -= 1;
    return found;
  };
  const chain = (signs, part) => {
    let found = part();
    for (let sign; (sign = signs.find(take));) found = { kind: sign, a: found, b: part() };
    return found;
  };
  const sum = () => chain(['+', '-'], product);
  const product = () => chain(['*', '/'], signed);
  const signed = () => (take('-') ? { kind: 'neg', a: deeper(signed) } : take('+') ? deeper(signed) : power());
  const power = () => {
    const base = atom();
    return take('**') || take('^') ? { kind: '^', a: base, b: deeper(signed) } : base;
  };
  const atom = () => {
    const token = tokens[next];
    if (take('(')) {
      const inner = deeper(sum);
      expect(')');
      return inner;
    }
    next += 1;
    if (token?.number !== undefined) return { kind: 'number', value: token.number };
    if (token?.name === undefined) throw new FormulaError(`"${text}" ends or breaks off. Complete the formula.`);
    if (!take('(')) return { kind: 'name', name: token.name };
    const given = [deeper(sum)];
    while (take(',')) given.push(deeper(sum));
    expect(')');
    return { kind: 'call', name: token.name, given };
  };
  const found = sum();
  if (next < tokens.length) throw new FormulaError(`"${text}" goes on after its end. Write an operator between its parts.`);
  return found;
}

/** @param {string} text */
function tokensOf(text) {
  const tokens = [];
  TOKEN.lastIndex = 0;
  for (let at = 0; text.slice(at).trim(); at = TOKEN.lastIndex) {
    TOKEN.lastIndex = at;
    const found = TOKEN.exec(text);
    if (!found) throw new FormulaError(`"${text}" has "${text.slice(at).trim()[0]}". Write numbers, names and + - * / ^ ( ).`);
    const [, number, name, sign] = found;
    tokens.push(number !== undefined ? { number: Number(number) } : name !== undefined ? { name } : { sign });
  }
  return tokens;
}

/** The function of a variable that a formula is: it gives a jet.
 * @param {number | string} given @param {Map<string, number>} values of names
 * @param {string} [variable]
 * @returns {(x: number) => number[]} */
export function jetOf(given, values, variable = '') {
  if (typeof given === 'number') return constantJet(given);
  const found = jetFunction(parsedFormula(given), values, variable);
  return found;
}

/** A number, or the value of a formula without a variable.
 * @param {number | string} given @param {Map<string, number>} values */
export function numberOf(given, values) {
  const value = jetOf(given, values)(0)[0];
  if (!Number.isFinite(value)) throw new FormulaError(`${JSON.stringify(given)} has no finite value. Change it or its parameters.`);
  return value;
}

/** Whether a name is in a formula.
 * @param {any} given @param {string} name */
export function dependsOn(given, name) {
  if (typeof given !== 'string') return false;
  const has = tree => (tree.kind === 'name' ? tree.name === name : [tree.a, tree.b, ...tree.given ?? []].some(x => x && has(x)));
  return has(parsedFormula(given));
}

const constantJet = value => {
  const jet = [value, 0, 0, 0];
  return () => jet;
};

function jetFunction(tree, values, variable) {
  const part = inner => jetFunction(inner, values, variable);
  switch (tree.kind) {
    case 'number': return constantJet(tree.value);
    case 'name': return namedJet(tree.name, values, variable);
    case 'neg': {
      const a = part(tree.a);
      return x => a(x).map(y => -y);
    }
    case 'call': return calledJet(tree, part);
    case '^': return powerJet(part(tree.a), part(tree.b), constantOf(tree.b, values, variable));
  }
  const a = part(tree.a), b = part(tree.b);
  switch (tree.kind) {
    case '+': return x => a(x).map((y, k) => y + b(x)[k]);
    case '-': return x => a(x).map((y, k) => y - b(x)[k]);
    case '*': return x => product(a(x), b(x));
    default: return x => quotient(a(x), b(x));
  }
}

function namedJet(name, values, variable) {
  if (name === variable) return x => [x, 1, 0, 0];
  if (values.has(name)) return constantJet(values.get(name));
  if (name === 'pi') return constantJet(Math.PI);
  if (name === 'deg') return constantJet(Math.PI / 180);
  throw new FormulaError(`"${name}" is not known here. Use a parameter${variable ? `, "${variable}"` : ''} or "pi".`);
}

/* The number that an exponent is; NaN where it changes. */
function constantOf(tree, values, variable) {
  const changes = inner => (inner.kind === 'name' ? inner.name === variable : [inner.a, inner.b, ...inner.given ?? []].some(x => x && changes(x)));
  return changes(tree) ? NaN : jetFunction(tree, values, variable)(0)[0];
}

function calledJet({ name, given }, part) {
  const known = RENAMED[name] ?? INVERTED[name] ?? name, [first, second] = given.map(part);
  const law = Object.hasOwn(kernels.laws, known) ? kernels.laws[known] : null;
  if (law) return x => composed(law(first(x)[0], second?.(x)[0]), first(x));
  if (known === 'pow' || !Object.hasOwn(kernels.functions, known) || given.length > 1) {
    throw new FormulaError(`The editor has no function "${name}" of ${given.length}. Use another, or open the model in Python.`);
  }
  const inner = x => composed(kernels.functions[known](first(x)[0]), first(x));
  return INVERTED[name] ? x => quotient([1, 0, 0, 0], inner(x)) : inner;
}

function powerJet(base, exponent, constant) {
  if (Number.isInteger(constant) && Math.abs(constant) <= HIGHEST_POWER) {
    return x => {
      let jet = [1, 0, 0, 0];
      for (let k = 0; k < Math.abs(constant); k++) jet = product(jet, base(x));
      return constant < 0 ? quotient([1, 0, 0, 0], jet) : jet;
    };
  }
  if (!Number.isNaN(constant)) return x => composed(kernels.functions.pow(base(x)[0], constant), base(x));
  return x => {
    const inner = product(exponent(x), composed(kernels.functions.log(base(x)[0]), base(x)));
    return composed(kernels.functions.exp(inner[0]), inner);
  };
}

/** @param {any} one @param {any} other */
function product([a, a1, a2, a3], [b, b1, b2, b3]) {
  return [a * b, a1 * b + a * b1, a2 * b + 2 * a1 * b1 + a * b2, a3 * b + 3 * (a2 * b1 + a1 * b2) + a * b3];
}

function quotient(a, b) {
  const inverse = composed(kernels.functions.pow(b[0], -1), b), found = product(a, inverse);
  return [a[0] / b[0], ...found.slice(1)];
}

/* The chain rule: derivatives of f(u), of f by u and of u. */
/** @param {any} outer @param {any} inner */
function composed([f, f1, f2, f3], [, u1, u2, u3]) {
  return [f, f1 * u1, f2 * u1 * u1 + f1 * u2, f3 * u1 * u1 * u1 + 3 * f2 * u1 * u2 + f1 * u3];
}

/** A motion: a formula of the time, or a sequence of rests as files have it.
 * @param {any} given @param {Map<string, number>} values
 * @returns {(t: number) => number[]} */
export function driverOf(given, values) {
  if (typeof given !== 'object') return jetOf(given, values, 't');
  if (!Array.isArray(given?.points) || given.points.length < 2) {
    throw new FormulaError('A motion through a table is not shown in the editor. Give a formula of t, or points and a law.');
  }
  const points = given.points.map(([time, value]) => [numberOf(time, values), numberOf(value, values)]);
  const ramp = numberOf(given.ramp ?? 0.25, values);
  const steps = points.slice(1).map(([end, stop], k) => {
    const [begin, start] = points[k], title = Array.isArray(given.law) ? given.law[k] : given.law ?? 'modified sine';
    const name = Object.hasOwn(kernels.titles, title) ? kernels.titles[title] : '';
    if (!name) throw new FormulaError(`There is no law ${JSON.stringify(title)}. Laws: ${Object.keys(kernels.titles).join(', ')}.`);
    if (!(end > begin)) throw new FormulaError('The times of a motion do not rise. Put its points in order.');
    return { begin, slope: 1 / (end - begin), rise: stop - start, law: kernels.laws[name] };
  });
  return t => steps.reduce((sum, { begin, slope, rise, law }) => {
    const jet = composed(law((t - begin) * slope, ramp), [0, slope, 0, 0]);
    return sum.map((x, k) => (rise ? x + rise * jet[k] : x));
  }, [points[0][1], 0, 0, 0]);
}
