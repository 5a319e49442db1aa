// The words of the page, from one file a language.
let words = {};

export async function loadTexts() {
  words = await (await fetch(`/static/texts/${document.documentElement.lang}.json`)).json();
  for (const place of document.querySelectorAll("[data-text]")) place.textContent = text(place.dataset.text);
}

/** The words of a key, with values in place of {names}. */
export function text(key, values = {}) {
  return words[key].replace(/\{(\w+)\}/g, (_, name) => values[name]);
}
