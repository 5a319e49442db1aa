// Elements of the page by their ids.

/** @param {string} id */
export const $ = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** An input, or what has its value or is disabled as one: a select or a button. @param {string} id */
export const field = (id) => /** @type {HTMLInputElement} */ (document.getElementById(id));

/** Words are put only where they change: a reader of the page hears them once, and it is laid out once. @param {string} id @param {string} sentence */
export function say(id, sentence) {
  if ($(id).textContent !== sentence) $(id).textContent = sentence;
}
