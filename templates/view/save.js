/* Give a file to the browser, which asks the user or keeps it among the downloads. */
export function save(name, blob) {
  const link = document.createElement('a');
  Object.assign(link, { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
