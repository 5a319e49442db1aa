// Elements of the page by their ids, what they are told, and what the server is asked.
import { text } from "./texts.js";

/** @param {string} id */
export const $ = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** An input, or what has its value or is disabled as one: a select or a button. @param {string} id */
export const field = (id) => /** @type {HTMLInputElement} */ (document.getElementById(id));

/** What came of it, in the page's line for that; `wrong`: as a fault. @param {string} words */
export function status(words, wrong = Boolean(words)) {
  $("status").textContent = words;
  $("status").classList.toggle("fault", wrong);
}

/** @param {string} path @param {object} value */
export const post = (path, value, more = {}) => fetch(path, { method: "POST", body: JSON.stringify(value), ...more });

/** The bytes that base64 stands for. @param {string} text */
export const decode = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

/** Copy words, and say so by the first key; by the other where the browser does not let a page. @param {string} words @param {string} done @param {string} not */
export async function copy(words, done, not) {
  try {
    await navigator.clipboard.writeText(words);
    status(text(done), false);
  } catch (refused) {
    if (!(refused instanceof DOMException)) throw refused;
    status(text(not), false);
  }
}

/** Words are put only where they change: a reader of the page hears them once, and it is laid out once. @param {string} id @param {string} sentence */
export function say(id, sentence) {
  if ($(id).textContent !== sentence) $(id).textContent = sentence;
}
