/* TOML, as far as model files have it: tables, arrays of tables, inline tables, texts, numbers, truths.

   A file is data.  What is read are plain objects without a prototype; sizes are bounded before work is
   spent, and what is beyond them, or is no TOML, is refused with its line. */

const MOST_CHARACTERS = 1_000_000;
const MOST_VALUES = 50_000;
const DEEPEST_TABLE = 32;
const NUMBER = /^[+-]?(?:0|[1-9](?:_?\d)*)(?:\.\d(?:_?\d)*)?(?:[eE][+-]?\d+)?$/;
const ESCAPES = { b: '\b', t: '\t', n: '\n', f: '\f', r: '\r', e: '\x1b', '"': '"', '\\': '\\' };

/** A file that is refused; its message names the line. */
export class FileError extends Error {}

class TomlReader {
  /** @param {string} text */
  constructor(text) {
    this.text = text;
    this.at = 0;
    this.values = 0;
  }

  fail(what) {
    const line = this.text.slice(0, this.at).split('\n').length;
    return new FileError(`Line ${line}: ${what}`);
  }

  /* Go over blanks and comments; over ends of lines too where they do not count. */
  skip(lines = false) {
    const blank = lines ? /(?:[ \t\r\n]|#[^\n]*)*/y : /[ \t\r]*(?:#[^\n]*)?/y;
    blank.lastIndex = this.at;
    blank.exec(this.text);
    this.at = blank.lastIndex;
  }

  take(sign) {
    if (!this.text.startsWith(sign, this.at)) return false;
    this.at += sign.length;
    return true;
  }

  expect(sign) {
    if (!this.take(sign)) throw this.fail(`"${sign}" is missing. Write it there.`);
  }

  /** @returns {any} */
  file() {
    const root = Object.create(null);
    let table = root;
    for (this.skip(true); this.at < this.text.length; this.skip(true)) {
      if (this.take('[[')) {
        table = this.listed(root, this.key());
        this.expect(']]');
      } else if (this.take('[')) {
        table = this.within(root, this.key());
        this.expect(']');
      } else this.pair(table, 0);
      this.skip();
      if (this.at < this.text.length && this.text[this.at] !== '\n') throw this.fail('there is more behind the value. Begin a new line.');
    }
    return root;
  }

  pair(table, depth) {
    const names = this.key(), last = names.pop(), owner = this.within(table, names);
    this.expect('=');
    this.skip();
    if (last in owner) throw this.fail(`"${last}" is given twice. Give it once.`);
    owner[last] = this.value(depth);
  }

  /* A key in its parts. */
  key() {
    const parts = [];
    do {
      this.skip();
      const bare = /[A-Za-z0-9_-]+/y;
      bare.lastIndex = this.at;
      const found = bare.exec(this.text);
      if (found) this.at = bare.lastIndex;
      parts.push(found ? found[0] : this.string('a name is missing. Write it before "=".'));
      this.skip();
    } while (this.take('.'));
    if (parts.length > 4) throw this.fail('a key has more than 4 parts. Use tables.');
    return parts;
  }

  /* The table at a key, made where it is not there. */
  within(table, names) {
    for (const name of names) {
      const found = table[name] ??= Object.create(null);
      table = Array.isArray(found) ? found[found.length - 1] : found;
      if (typeof table !== 'object' || table === null) throw this.fail(`"${name}" is no table. Rename it.`);
    }
    return table;
  }

  /* A new table in the list at a key. */
  listed(root, names) {
    const last = names.pop(), owner = this.within(root, names), list = owner[last] ??= [];
    if (!Array.isArray(list)) throw this.fail(`"${last}" is no list of tables. Rename it.`);
    list.push(Object.create(null));
    return list[list.length - 1];
  }

  value(depth) {
    if (++this.values > MOST_VALUES) throw this.fail(`there are more than ${MOST_VALUES} values. Open a smaller file.`);
    if (depth > DEEPEST_TABLE) throw this.fail(`there are more than ${DEEPEST_TABLE} levels. Write it flatter.`);
    const sign = this.text[this.at];
    if (sign === '"' || sign === "'") return this.string('');
    if (this.take('[')) return this.items(']', () => this.value(depth + 1));
    if (this.take('{')) {
      const table = Object.create(null);
      this.items('}', () => this.pair(table, depth + 1));
      return table;
    }
    const word = /[^\s,\]}#]+/y;
    word.lastIndex = this.at;
    const found = word.exec(this.text)?.[0] ?? '';
    if (found !== 'true' && found !== 'false' && !NUMBER.test(found)) throw this.fail(`${JSON.stringify(found.slice(0, 40))} is no value that models have. Write a number, or a text in quotes.`);
    this.at = word.lastIndex;
    return found === 'true' || (found !== 'false' && Number(found.replaceAll('_', '')));
  }

  items(end, read) {
    const found = [];
    for (this.skip(true); !this.take(end); this.skip(true)) {
      if (found.length) {
        this.expect(',');
        this.skip(true);
        if (this.take(end)) break;
      }
      found.push(read());
    }
    return found;
  }

  string(otherwise) {
    if (this.take("'")) {
      const end = this.text.indexOf("'", this.at), found = this.text.slice(this.at, end);
      if (end < 0 || found.includes('\n')) throw this.fail('a text does not end. Write its last quote.');
      this.at = end + 1;
      return found;
    }
    if (!this.take('"')) throw this.fail(otherwise);
    if (this.text.startsWith('""', this.at)) throw this.fail('a text of several lines is not read here. Write it on one line.');
    let found = '';
    for (;;) {
      const letter = this.text[this.at++];
      if (letter === '"') return found;
      if (letter === undefined || letter === '\n') throw this.fail('a text does not end. Write its last quote.');
      found += letter === '\\' ? this.escaped() : letter;
    }
  }

  escaped() {
    const letter = this.text[this.at++], size = { u: 4, U: 8 }[letter];
    if (ESCAPES[letter] !== undefined) return ESCAPES[letter];
    const code = parseInt(this.text.slice(this.at, this.at + size), 16);
    if (!size || !(code <= 0x10ffff)) throw this.fail('a text has an unknown escape. Write "\\\\" for a backslash.');
    this.at += size;
    return String.fromCodePoint(code);
  }
}

/** What a file holds.
 * @param {string} text */
export function readToml(text) {
  if (text.length > MOST_CHARACTERS) throw new FileError(`The file has ${text.length} characters. Open one of at most ${MOST_CHARACTERS}.`);
  return new TomlReader(text).file();
}

/** The same as text: a line for each value, lists of tables one table a line.
 * @param {any} file */
export function writeToml(file) {
  const lines = [], later = [];
  const isTable = value => typeof value === 'object' && !Array.isArray(value);
  for (const [key, value] of Object.entries(file)) {
    if (isTable(value) && key !== 'analysis') later.push([key, value]);
    else if (isTables(value)) lines.push(`${keyText(key)} = [`, ...value.map(row => `    ${inlineText(row)},`), ']');
    else lines.push(`${keyText(key)} = ${inlineText(value)}`);
  }
  for (const [key, table] of later) {
    lines.push('', `[${keyText(key)}]`);
    for (const [name, value] of Object.entries(table)) {
      if (isTables(value)) lines.push(`${keyText(name)} = [`, ...value.map(row => `    ${inlineText(row)},`), ']');
      else lines.push(`${keyText(name)} = ${inlineText(value)}`);
    }
  }
  return `${lines.join('\n')}\n`;
}

const isTables = value => Array.isArray(value) && value.length > 0 && value.every(row => typeof row === 'object' && !Array.isArray(row));

const keyText = key => (/^[A-Za-z0-9_-]+$/.test(key) ? key : quotedText(key));

function inlineText(value) {
  if (typeof value === 'string') return quotedText(value);
  if (Array.isArray(value)) return `[${value.map(inlineText).join(', ')}]`;
  if (typeof value === 'object') {
    const pairs = Object.entries(value).map(([key, inner]) => `${keyText(key)} = ${inlineText(inner)}`);
    return pairs.length ? `{ ${pairs.join(', ')} }` : '{}';
  }
  return String(value).replace(/^(-?\d+)e/, '$1.0e');
}

/* A text in quotes; control characters and lone halves of characters as escapes. */
function quotedText(text) {
  return JSON.stringify(text).replace(/\x7f/g, '\\u007f');
}
