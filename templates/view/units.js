/* Numbers as they are read: angles in radians or degrees, as many digits as are significant.

   units.text(value, unit)   a number of a unit of the model; rounding errors of the largest number
                             of that unit in the motion are 0
   units.name(unit)          the unit it is shown in
   units.factor(unit)        and the factor from one to the other */

import { player } from './player.js';

const DIGITS = 6;  // of the largest number of a unit; the others have as many decimals
export const ROUNDING_PART = 1e-11;  // of the largest number, below which a difference is rounding
export const LARGEST = 1e300;  // number whose differences are finite too

export const units = {
  angle: 'rad',
  scales: null,  // of each unit: the largest number of the motion

  name(unit) {
    return this.angle === 'deg' ? unit.replace(/^rad\b/, 'deg') : unit;
  },

  factor(unit) {
    return this.angle === 'deg' && /^rad\b/.test(unit) ? 180 / Math.PI : 1;
  },

  /* A name with the unit it is shown in. */
  titled(name, unit) {
    return unit ? `${name} [${this.name(unit)}]` : name;
  },

  text(value, unit = '', scale = this.scale(unit)) {
    if (!Number.isFinite(value)) return '–';
    const factor = this.factor(unit);
    return Math.abs(value) <= ROUNDING_PART * scale ? '0' : digitsOf(value * factor, scale * factor);
  },

  /* A number with its unit. */
  full(value, unit, scale = this.scale(unit)) {
    return `${this.text(value, unit, scale)} ${this.name(unit)}`.trim();
  },

  scale(unit) {
    if (!this.scales) this.scales = largestOfUnits(player.data);
    return this.scales.get(unit) ?? 0;
  },

  forget() {
    this.scales = null;
  },
};

/* A number with the decimals that numbers of a scale have. */
function digitsOf(value, scale) {
  const size = Math.abs(value);
  if (size < 1e-6 * scale || size >= 1e7 || size < 1e-5) return value.toExponential(3);
  const largest = Math.max(size, scale), small = size < 1e-3 * scale ? 3 : 0;
  const decimals = DIGITS - 1 - Math.floor(Math.log10(largest)) + small;
  return value.toFixed(Math.max(0, Math.min(12, decimals)));
}

/* The largest number of each unit among coordinates, outputs and their rates. */
function largestOfUnits({ coordinates, outputs, arrays, lengthUnit, drawing }) {
  const scales = new Map([['s', Math.max(...player.t.map(Math.abs))]]);
  const grow = (unit, value) => { if (value > (scales.get(unit) ?? 0) && value < LARGEST) scales.set(unit, value); };
  for (const [owners, name] of [[coordinates, 'q'], [outputs, 'y']]) {
    ['', '_dot', '_ddot'].forEach((order, k) => {
      const values = arrays[name + order] ?? [], most = new Float64Array(owners.length);
      for (let place = 0, at = 0; place < values.length; place++, at = at + 1 < most.length ? at + 1 : 0) {
        const size = Math.abs(values[place]);
        if (size > most[at] && size < LARGEST) most[at] = size;
      }
      owners.forEach(({ unit }, at) => grow(unit && unit + ['', '/s', '/s²'][k], most[at]));
    });
  }
  grow(lengthUnit, drawing.size);
  return scales;
}

/* ---- steps of a scale ---- */

const STEPS = [1, 2, 5, 10];

/* The step 1, 2 or 5 times a power of ten that is next to a length. */
export function niceStep(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return power * STEPS.find(step => step * power >= 0.999 * length);
}

/* Multiples of a step between two numbers. */
export function multiples(step, low, high) {
  const first = Math.ceil(low / step - 1e-9), count = Math.floor(high / step + 1e-9) - first + 1;
  return Array.from({ length: Math.max(0, count) }, (_, k) => (first + k) * step);
}

/* A multiple of a step, without the digits that its rounding adds. */
export function stepText(value, step) {
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const size = Math.abs(value);
  if (size !== 0 && (size < 1e-4 || size >= 1e6)) return value.toExponential(1);
  return (size < step / 2 ? 0 : value).toFixed(Math.min(12, decimals));
}

/* ---- names as derivations print them ---- */

const LETTERS = 'alpha α beta β gamma γ delta δ epsilon ε zeta ζ eta η theta θ iota ι kappa κ lambda λ mu μ nu ν xi ξ rho ρ sigma σ tau τ phi φ chi χ psi ψ omega ω'.split(' ');

/* Letter, dots and index of a name: phi_boom is φ with the index boom; a word has its rate before it. */
function symbolOf(name, order = 0) {
  const [head, ...rest] = name.split('_'), place = LETTERS.indexOf(head), index = rest.join('_');
  const letter = place >= 0 && place % 2 === 0 ? LETTERS[place + 1] : head, isLetter = letter.length === 1;
  if (!head) return { letter: name, index: '' };
  return { letter: isLetter ? letter + ['', '\u0307', '\u0308'][order] : ['', 'd/dt ', 'd²/dt² '][order] + letter, index };
}

export function symbolText(name, order = 0) {
  const { letter, index } = symbolOf(name, order);
  return index ? `${letter}_${index}` : letter;
}

export function symbolNodes(name) {
  const { letter, index } = symbolOf(name), [base, low] = ['span', 'sub'].map(tag => document.createElement(tag));
  [base.textContent, low.textContent] = [letter, index];
  if ([...letter].length === 1) base.style.fontStyle = 'italic';
  return index ? [base, document.createElement('wbr'), low] : [base];
}
