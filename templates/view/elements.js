/* Elements of a page: found by name, and made. */

/** The element of a name in page.html, of whatever kind.
 * @param {string} id @returns {any} */
export const byId = id => document.getElementById(id);

export function buttonOf(text, act, title = '') {
  const button = document.createElement('button');
  Object.assign(button, { type: 'button', textContent: text, title });
  if (title) button.setAttribute('aria-label', title);
  button.addEventListener('click', act);
  return button;
}

export function svgElement(tag, attributes, text = '') {
  const made = document.createElementNS('http://www.w3.org/2000/svg', tag);
  setAttributes(made, attributes);
  made.textContent = text;
  return made;
}

export function setAttributes(element, attributes) {
  Object.entries(attributes).forEach(([name, value]) => element.setAttribute(name, value));
}
