// Texts of the page in its language, number format, and translation of the server's messages.

/** @type {Record<string, string>} */
let texts = {};
/** Translations of English messages. {1}, {2} stand for the values. @type {{pattern: RegExp, translation: string}[]} */
let errors = [];
/** Key of sessionStorage under which a tab keeps its language. */
const LANGUAGE = "language";

/** Load the texts in the language of the tab, the server or the browser, and fill the page's elements. */
export async function loadTexts() {
  const { language, languages, pages } = await fetchJson("/languages");
  const browser = navigator.languages.map((name) => name.slice(0, 2));
  const wanted = [sessionStorage.getItem(LANGUAGE), language, ...browser];
  const chosen = wanted.find((name) => languages.includes(name)) ?? "en";
  document.documentElement.lang = chosen;
  texts = await fetchJson(`/static/texts/${chosen}.json`);
  if (chosen !== "en") {
    const table = await fetchJson(`/static/errors/${chosen}.json`);
    errors = Object.entries(table).map(([message, translation]) => ({ pattern: messagePattern(message), translation }));
  }
  /** @type {NodeListOf<HTMLElement>} */
  const elements = document.querySelectorAll("[data-text]");
  for (const element of elements) element.textContent = text(element.dataset.text ?? "");
  /** @type {NodeListOf<HTMLAnchorElement>} */
  const links = document.querySelectorAll("nav a");
  for (const link of links) link.hidden = !pages.includes(link.getAttribute("href"));
  addLanguageButtons(languages, chosen);
}

/** @param {string} path */
const fetchJson = async (path) => (await fetch(path)).json();

/** @param {string[]} languages @param {string} chosen */
function addLanguageButtons(languages, chosen) {
  const parent = /** @type {HTMLElement} */ (document.getElementById("languages"));
  parent.setAttribute("aria-label", text("language"));
  parent.replaceChildren(...languages.map((name) => {
    const button = Object.assign(document.createElement("button"), { type: "button", lang: name, textContent: name.toUpperCase() });
    button.setAttribute("aria-pressed", String(name === chosen));
    button.addEventListener("click", () => {
      sessionStorage.setItem(LANGUAGE, name);
      location.reload();
    });
    return button;
  }));
}

/** Return the text of a key, with values in place of {names}. @param {string} key @param {Record<string, any>} [values] */
export function text(key, values = {}) { return fill(texts[key], values); }

/** @param {string} template @param {Record<string, any>} values */
const fill = (template, values) => template.replace(/\{(\w+)\}/g, (_, name) => values[name]);

/**
 * Return a message of the server in the page's language, or in English if it is not in the table.
 * The values in a message may be messages too.
 * @param {string} message @returns {string}
 */
export function errorText(message) {
  for (const { pattern, translation } of errors) {
    const match = pattern.exec(message);
    if (match) return fill(translation, match.map((value, i) => (i ? errorText(withDecimalSign(value)) : "")));
  }
  return message;
}

/** Return a number and its unit with the decimal sign of the page's language, and any other text unchanged. @param {string} value */
const withDecimalSign = (value) => (/^-?\d+\.\d+(e-?\d+)?\D*$/.test(value) ? value.replace(".", decimalSign()) : value);

const decimalSign = () => formatted(0.5, {})[1];

/** Return the pattern of messages with any values. @param {string} message */
function messagePattern(message) {
  const parts = message.split(/\{\d\}/).map((part) => part.replace(/[\\^$.*+?()[\]{}|]/g, "\\$&"));
  return new RegExp(`^${parts.join("(.*?)")}$`, "s");
}

/** Formats by their options, because they are slow to make. @type {Map<string, Intl.NumberFormat>} */
const formats = new Map();

/** @param {number} value @param {Intl.NumberFormatOptions} options */
function formatted(value, options) {
  const key = JSON.stringify(options);
  const format = formats.get(key) ?? new Intl.NumberFormat(document.documentElement.lang, { ...options, useGrouping: false });
  formats.set(key, format);
  return format.format(value);
}

/**
 * Return a number with significant digits, with an exponent only if it is very large or small.
 * The decimal sign is that of the page's language.
 * @param {number} value
 */
export function formatNumber(value, digits = 4) {
  const size = Math.abs(value);
  const needsExponent = size >= 1e6 || (size > 0 && size < 1e-4);
  if (needsExponent) return value.toExponential(digits - 1).replace(".", decimalSign());
  return formatted(value + 0, { maximumSignificantDigits: digits });
}

/** Return a number with a fixed number of decimals. @param {number} value @param {number} decimals */
export function formatFixed(value, decimals) {
  const rounded = Number(value.toFixed(decimals)) + 0; // no -0
  return formatted(rounded, { minimumFractionDigits: decimals, maximumFractionDigits: decimals });
}
