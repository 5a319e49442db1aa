// Charts in SVG: axes that change with their range, and paths that change with every frame.

/**
 * @template {keyof SVGElementTagNameMap} T
 * @param {T} name
 * @param {Record<string, string | number>} attributes
 * @param {ParentNode} [parent]
 */
export function element(name, attributes, parent) {
  const made = document.createElementNS("http://www.w3.org/2000/svg", name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, String(value));
  parent?.append(made);
  return made;
}

/** Round steps, about `count` of them, that cover a range. @param {number} low @param {number} high @param {number} count */
export function ticks(low, high, count) {
  const raw = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = ([1, 2, 5, 10].find((part) => part * power >= raw * 0.8) ?? NaN) * power;
  const found = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i += 1) found.push(i * step);
  return found;
}

/**
 * A number with so many digits, a decimal point in every language, as in files and fields, and no exponent where it can be read without.
 * @param {number} value
 */
export function shown(value, digits = 4) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e6 || size < 1e-4) return value.toExponential(digits - 1);
  formats[digits] ??= new Intl.NumberFormat("en", { maximumSignificantDigits: digits, useGrouping: false });
  return formats[digits].format(value);
}
/** They are slow to make. @type {Intl.NumberFormat[]} */
const formats = [];

/** Black is the colour of the words, which is white on a dark page. @param {string} colour */
export function seen(colour) { return /^#(000000|111|333)$/.test(colour) ? "currentColor" : colour; }

const LEFT = 56, RIGHT = 16, TOP = 18, BOTTOM = 20;

export class Chart {
  /**
   * `options`: x range, its ticks, log for a logarithmic y axis, title and xTitle; the role of a picture, or of a group of handles.
   * @param {HTMLElement} place
   * @param {{title: string, x: Pair, xTicks: number[], xTitle?: string, log?: boolean, role?: string}} options
   */
  constructor(place, { title, x, xTicks, xTitle = "", log = false, role = "img" }) {
    this.place = place;
    this.title = title;
    this.x = x;
    this.xTicks = xTicks;
    this.xTitle = xTitle;
    this.log = log;
    this.svg = element("svg", { role, "aria-label": title });
    place.append(this.svg);
    this.axes = element("g", {}, this.svg);
    const id = `clip_${place.id}`;
    this.clip = element("rect", {}, element("clipPath", { id }, element("defs", {}, this.svg)));
    this.curves = element("g", { "clip-path": `url(#${id})` }, this.svg);
    /** @type {Map<string, SVGPathElement>} */
    this.paths = new Map();
    /** @type {Map<string, SVGGElement>} */
    this.groups = new Map();
    /** @type {WeakMap<SVGPathElement, Numbers>} */
    this.drawn = new WeakMap();
    /** Of y, once it has been fitted. @type {Pair | null} */
    this.range = null;
    this.resized = () => {};
    new ResizeObserver(() => { this.#axes(); this.resized(); }).observe(place);
    this.width = 0;
    this.height = 0;
    this.#measure();
  }

  #measure() {
    this.width = Math.max(80, this.place.clientWidth);
    this.height = Math.max(60, this.place.clientHeight);
  }

  /** @param {number} x */
  right(x) { return LEFT + ((x - this.x[0]) / (this.x[1] - this.x[0])) * (this.width - LEFT - RIGHT); }

  /** Lowest and highest y, of a chart that has been fitted. */
  get ends() { return /** @type {Pair} */ (this.range); }

  /** @param {number} y */
  down(y) {
    const [low, high] = this.ends;
    return TOP + ((high - y) / (high - low)) * (this.height - TOP - BOTTOM - (this.xTitle ? 14 : 0));
  }

  /** The value at a height in px of the chart. @param {number} pixels */
  value(pixels) {
    const [low, high] = this.ends;
    return high - ((pixels - TOP) / (this.height - TOP - BOTTOM - (this.xTitle ? 14 : 0))) * (high - low);
  }

  /**
   * Widen the range to hold these values; `anew` lets it shrink as well.
   * @param {number} low @param {number} high @param {boolean} [anew]
   */
  fit(low, high, anew) {
    if (!(Number.isFinite(low) && Number.isFinite(high))) return;
    if (!(high > low)) [low, high] = [low - 1, high + 1];
    const own = this.range;
    if (own && !anew && low >= own[0] && high <= own[1]) return;
    const spare = this.log ? 0 : 0.08 * (high - low);
    this.range = [low - spare, high + spare];
    if (own && !anew) this.range = [Math.min(own[0], this.range[0]), Math.max(own[1], this.range[1])];
    this.#axes();
  }

  #axes() {
    this.#measure();
    if (!this.range) return;
    const { width, height } = this;
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const [top, bottom] = [this.down(this.range[1]), this.down(this.range[0])];
    for (const [key, value] of Object.entries({ x: LEFT, y: top, width: width - LEFT - RIGHT, height: bottom - top })) {
      this.clip.setAttribute(key, String(value));
    }
    const parts = document.createDocumentFragment();
    const text = (/** @type {number} */ x, /** @type {number} */ y, /** @type {string} */ words, more = {}) => { element("text", { x, y, ...more }, parts).textContent = words; };
    const every = width < 300 ? 2 : 1;
    this.xTicks.forEach((x, i) => {
      element("path", { class: "grid", d: `M${this.right(x)} ${top}V${bottom}` }, parts);
      if (i % every === 0) text(this.right(x), bottom + 14, shown(x), { "text-anchor": "middle" });
    });
    const marks = this.log ? decades(this.range) : ticks(...this.range, Math.max(4, Math.round((bottom - top) / 45)));
    for (const y of marks) {
      element("path", { class: y === 0 && !this.log ? "zero" : "grid", d: `M${LEFT} ${this.down(y)}H${width - RIGHT}` }, parts);
      text(LEFT - 5, this.down(y) + 4, shown(this.log ? 10 ** y : y), { "text-anchor": "end" });
    }
    element("path", { class: "frame", d: `M${LEFT} ${top}V${bottom}H${width - RIGHT}` }, parts);
    text(LEFT, 12, this.title, { class: "title" });
    if (this.xTitle) text(width - RIGHT, height - 4, this.xTitle, { "text-anchor": "end" });
    this.axes.replaceChildren(parts);
    this.drawn = new WeakMap();
  }

  /**
   * A path to be drawn; null where it is empty, or is of the same values on the same axes.
   * @param {string} key @param {Numbers | null | undefined} values @param {string | undefined} colour @param {string} kind
   */
  #path(key, values, colour, kind) {
    const path = this.paths.get(key) ?? element("path", { class: `curve ${kind}` }, this.curves);
    this.paths.set(key, path);
    if (!values) {
      if (path.getAttribute("d")) path.setAttribute("d", "");
      this.drawn.delete(path);
      return null;
    }
    if (this.drawn.get(path) === values) return null;
    this.drawn.set(path, values);
    if (colour) path.setAttribute("stroke", seen(colour));
    return path;
  }

  /** A line across the curves at an x. @param {number} x */
  cursor(x) {
    if (!this.range) return;
    const path = this.paths.get("cursor") ?? element("path", { class: "cursor" }, this.curves);
    this.paths.set("cursor", path);
    path.setAttribute("d", `M${this.right(x).toFixed(1)} ${this.down(this.range[1])}V${this.down(this.range[0])}`);
  }

  /**
   * Lines up to values at 1, 2, ...; `aside` (px) lets several stand beside each other.
   * @param {string} key @param {Numbers | null | undefined} values @param {{colour?: string, kind?: string, aside?: number}} look
   */
  stems(key, values, { colour, kind = "", aside = 0 }) {
    const path = this.#path(key, values, colour, kind);
    if (!path || !values) return;
    const bottom = this.down(this.ends[0]).toFixed(1);
    const parts = Array.from(values, (y, i) => `M${(this.right(i + 1) + aside).toFixed(1)} ${bottom}V${this.down(Math.max(y, this.ends[0])).toFixed(1)}`);
    path.setAttribute("d", parts.join(""));
  }

  /**
   * Markers at points, each with its colour and shape; a full one stands out.
   * @param {string} key @param {(Look & {x: number, y: number, full: boolean})[]} all
   */
  points(key, all) {
    const group = this.groups.get(key) ?? element("g", {}, this.curves);
    this.groups.set(key, group);
    group.replaceChildren(...all.map(({ x, y, colour, marker, full }) => {
      const at = `translate(${this.right(x).toFixed(1)} ${this.down(y).toFixed(1)})`;
      return element("path", { class: full ? "point full" : "point", d: MARKERS[marker], transform: at, stroke: seen(colour), fill: seen(colour) });
    }));
  }

  /**
   * A curve of values at equal steps of x; null takes it away.
   * @param {string} key @param {Numbers | null | undefined} values @param {{colour?: string, kind?: string, scale?: number, step: number}} look
   */
  curve(key, values, { colour, kind = "", scale = 1, step }) {
    const path = this.#path(key, values, colour, kind);
    if (!path || !values) return;
    const from = this.x[0];
    const parts = new Array(values.length);
    for (let i = 0; i < values.length; i += 1) {
      parts[i] = `${this.right(from + i * step).toFixed(1)} ${this.down(values[i] * scale).toFixed(1)}`;
    }
    path.setAttribute("d", `M${parts.join("L")}`);
  }
}

export const MARKERS = {
  circle: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0 -10 0Z",
  square: "M-4.5 -4.5H4.5V4.5H-4.5Z",
  triangle: "M0 -5.5L5 4H-5Z",
  diamond: "M0 -6L5 0L0 6L-5 0Z",
};

/** @typedef {{colour: string, marker: keyof typeof MARKERS}} Look */

/** Colour and shape of the i-th kind of markers. @param {number} i @param {string[]} colours @returns {Look} */
export function look(i, colours) {
  const shapes = /** @type {Look["marker"][]} */ (Object.keys(MARKERS));
  return { colour: colours[i % colours.length], marker: shapes[i % shapes.length] };
}

/** What a kind of markers is, for the key beside a chart. @param {string} textContent @param {Look} look */
export function entry(textContent, { colour, marker }) {
  const item = Object.assign(document.createElement("li"), { textContent });
  const icon = element("svg", { viewBox: "-8 -8 16 16", "aria-hidden": "true" });
  element("path", { class: "point", d: MARKERS[marker], stroke: seen(colour) }, icon);
  item.prepend(icon);
  return item;
}

/** @param {Pair} range */
function decades([low, high]) {
  const found = [];
  for (let i = Math.ceil(low); i <= high; i += 1) found.push(i);
  return found;
}

/** Lowest and highest of several arrays, those that are there. @param {(Numbers | null | undefined)[]} arrays @returns {Pair} */
export function extent(arrays, scale = 1) {
  let [low, high] = [Infinity, -Infinity];
  for (const values of arrays) {
    for (const value of values ?? []) {
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  return [low * scale, high * scale];
}
