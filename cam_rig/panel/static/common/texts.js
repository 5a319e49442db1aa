// The words of the page, from one file a language.
/** @type {Record<string, string>} */
let words = {};
/** What was chosen on the page is kept for its tab, over reloads. */
const CHOSEN = "language";

export async function loadTexts() {
  const { language, languages, pages } = await (await fetch("/languages")).json();
  const wanted = [sessionStorage.getItem(CHOSEN), language, ...navigator.languages.map((name) => name.slice(0, 2))];
  const own = wanted.find((name) => languages.includes(name)) ?? document.documentElement.lang;
  document.documentElement.lang = own;
  words = await (await fetch(`/static/texts/${own}.json`)).json();
  for (const place of /** @type {NodeListOf<HTMLElement>} */ (document.querySelectorAll("[data-text]"))) place.textContent = text(place.dataset.text ?? "");
  for (const link of /** @type {NodeListOf<HTMLAnchorElement>} */ (document.querySelectorAll("nav a"))) link.hidden = !pages.includes(link.getAttribute("href"));
  offer(languages, own);
}

/** A button for each language, where the page has a place for them. @param {string[]} languages @param {string} own */
function offer(languages, own) {
  const place = document.getElementById("languages");
  if (!place) return;
  place.setAttribute("aria-label", text("language"));
  place.replaceChildren(...languages.map((name) => {
    const button = Object.assign(document.createElement("button"), { type: "button", lang: name, textContent: name.toUpperCase() });
    button.setAttribute("aria-pressed", String(name === own));
    button.addEventListener("click", () => {
      sessionStorage.setItem(CHOSEN, name);
      location.reload();
    });
    return button;
  }));
}

/** The words of a key, with values in place of {names}. @param {string} key @param {Record<string, any>} [values] */
export function text(key, values = {}) {
  return words[key].replace(/\{(\w+)\}/g, (_, name) => values[name]);
}
