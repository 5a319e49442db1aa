// Elements of the page by their ids, and requests to the server.
import { errorText, text } from "./texts.js";

/** @param {string} id */
export const $ = (id) => /** @type {HTMLElement} */ (document.getElementById(id));

/** Return an input, or a select or button, which have some of its properties. @param {string} id */
export const field = (id) => /** @type {HTMLInputElement} */ (document.getElementById(id));

/**
 * Return a new element with properties.
 * @template {keyof HTMLElementTagNameMap} Tag
 * @param {Tag} tag @param {Record<string, unknown>} [properties] @returns {HTMLElementTagNameMap[Tag]}
 */
export const create = (tag, properties = {}) => Object.assign(document.createElement(tag), properties);

// The setters write only changed values. A write would cause a new layout and be read to a blind user again.

/** @param {string} id @param {string} value */
export function setText(id, value) {
  if ($(id).textContent !== value) $(id).textContent = value;
}

/** @param {string} id @param {boolean} isHidden */
export function setHidden(id, isHidden) {
  if ($(id).hidden !== isHidden) $(id).hidden = isHidden;
}

/** @param {string} id @param {boolean} isDisabled */
export function setDisabled(id, isDisabled) {
  if (field(id).disabled !== isDisabled) field(id).disabled = isDisabled;
}

/** @param {string} id @param {string | number} value */
export function setValue(id, value) {
  if (field(id).value !== String(value)) field(id).value = String(value);
}

/**
 * Return the number in a field, with a decimal point or comma, or NaN.
 *
 * "1,000" is NaN, because it may be a thousand or one.
 * @param {HTMLInputElement} input
 */
export function readNumber({ value }) {
  const number = value.trim();
  return number === "" || /^[-+]?\d{1,3},\d{3}$/.test(number) ? NaN : Number(number.replace(",", "."));
}

/** Show the result of an action in the status line of the page. @param {string} message */
export function showStatus(message, isFault = Boolean(message)) {
  setText("status", message);
  $("status").classList.toggle("fault", isFault);
}

/** Show the reason for which the server has refused a request. @param {string} key @param {{message: string}} reply */
export function showRefusal(key, { message }, values = {}) {
  showStatus(text(key, { ...values, message: errorText(message) }));
}

/** @param {string} path @param {object} value */
export const post = (path, value, more = {}) => fetch(path, { method: "POST", body: JSON.stringify(value), ...more });

/** Return the bytes of base64. @param {string} base64 */
export const decodeBase64 = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0)).buffer;

/**
 * Copy a text, and show the first key. Show the other key if the browser does not allow it.
 * @param {string} value @param {string} copiedKey @param {string} failedKey
 */
export async function copyText(value, copiedKey, failedKey) {
  try {
    await navigator.clipboard.writeText(value);
    showStatus(text(copiedKey), false);
  } catch (error) {
    if (!(error instanceof DOMException)) throw error;
    showStatus(text(failedKey), false);
  }
}
