// Charts in SVG: axes that change with their range, and curves that change with every frame.
import { formatNumber } from "./texts.js";

/**
 * Append a new SVG element.
 * @template {keyof SVGElementTagNameMap} Tag
 * @param {Tag} tag @param {Record<string, string | number>} attributes @param {ParentNode} [parent]
 */
export function svgElement(tag, attributes, parent) {
  const element = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, String(value));
  parent?.append(element);
  return element;
}

/** Return about `count` round values within a range. @param {number} low @param {number} high @param {number} count */
export function axisTicks(low, high, count) {
  const wanted = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(wanted));
  const step = ([1, 2, 5, 10].find((factor) => factor * power >= wanted * 0.8) ?? NaN) * power;
  const ticks = [];
  for (let i = Math.ceil(low / step - 1e-9); i * step <= high + step * 1e-9; i += 1) ticks.push(i * step);
  return ticks;
}

/** Ticks of a cam angle, deg. */
export const ANGLE_TICKS = [0, 60, 120, 180, 240, 300, 360];

/** Return the text colour for black, because text is white on a dark page. @param {string} colour */
export function lineColour(colour) { return /^#(000000|111|333)$/.test(colour) ? "currentColor" : colour; }

/** Margins around the curves, px. */
const LEFT = 56, RIGHT = 16, TOP = 18, BOTTOM = 20;
/** Height of the title of the x axis, px. */
const X_TITLE = 14;

export class Chart {
  /**
   * @param {HTMLElement} parent
   * @param {{title: string, x: Pair, xTicks: number[], xTitle?: string, isLogarithmic?: boolean, role?: string}} options
   *   `x` is the range of x. The y values of a logarithmic chart are decimal logarithms.
   */
  constructor(parent, { title, x, xTicks, xTitle = "", isLogarithmic = false, role = "img" }) {
    this.parent = parent;
    this.title = title;
    this.x = x;
    this.xTicks = xTicks;
    this.xTitle = xTitle;
    this.isLogarithmic = isLogarithmic;
    this.svg = svgElement("svg", { role, "aria-label": title });
    parent.append(this.svg);
    this.axes = svgElement("g", {}, this.svg);
    const id = `clip_${parent.id}`;
    this.clip = svgElement("rect", {}, svgElement("clipPath", { id }, svgElement("defs", {}, this.svg)));
    this.curves = svgElement("g", { "clip-path": `url(#${id})` }, this.svg);
    /** @type {Map<string, SVGPathElement>} */
    this.paths = new Map();
    /** @type {SVGGElement | null} */
    this.markerGroup = null;
    /** Values that each path displays. @type {WeakMap<SVGPathElement, Numbers>} */
    this.displayed = new WeakMap();
    /** Range of y, null before the first fit. @type {Pair | null} */
    this.y = null;
    this.onResize = () => {};
    new ResizeObserver(() => { this.#drawAxes(); this.onResize(); }).observe(parent);
    this.width = 0;
    this.height = 0;
    this.#measure();
  }

  #measure() {
    this.width = Math.max(80, this.parent.clientWidth);
    this.height = Math.max(60, this.parent.clientHeight);
  }

  /** Height of the curves, px. */
  get #plotHeight() { return this.height - TOP - BOTTOM - (this.xTitle ? X_TITLE : 0); }

  /** Return the horizontal position (px) of a value. @param {number} x */
  xPixel(x) { return LEFT + ((x - this.x[0]) / (this.x[1] - this.x[0])) * (this.width - LEFT - RIGHT); }

  /** Range of y of a chart that has been fitted. */
  get range() { return /** @type {Pair} */ (this.y); }

  /** Return the vertical position (px) of a value. @param {number} y */
  yPixel(y) {
    const [low, high] = this.range;
    return TOP + ((high - y) / (high - low)) * this.#plotHeight;
  }

  /** Return the value of y at a vertical position (px). @param {number} pixel */
  yValue(pixel) {
    const [low, high] = this.range;
    return high - ((pixel - TOP) / this.#plotHeight) * (high - low);
  }

  /** Return the fraction of the x range at which a pointer is. @param {PointerEvent} event */
  xFraction({ clientX }) {
    const left = this.xPixel(this.x[0]);
    return (clientX - this.svg.getBoundingClientRect().left - left) / (this.xPixel(this.x[1]) - left);
  }

  /** Extend the y axis to a range. It shrinks only if `mayShrink`. @param {number} low @param {number} high */
  fit(low, high, mayShrink = false) {
    if (!(Number.isFinite(low) && Number.isFinite(high))) return;
    if (!(high > low)) [low, high] = [low - 1, high + 1];
    const before = mayShrink ? null : this.y;
    if (before && low >= before[0] && high <= before[1]) return;
    const margin = this.isLogarithmic ? 0 : 0.08 * (high - low);
    this.y = union(before ?? [Infinity, -Infinity], [low - margin, high + margin]);
    this.#drawAxes();
  }

  /** @param {string} title */
  setTitle(title) {
    if (title === this.title) return;
    this.title = title;
    this.#drawAxes();
  }

  #drawAxes() {
    this.#measure();
    if (!this.y) return;
    const { width, height, y: [low, high] } = this;
    const [top, bottom] = [this.yPixel(high), this.yPixel(low)];
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    const clip = { x: LEFT, y: top, width: width - LEFT - RIGHT, height: bottom - top };
    for (const [name, value] of Object.entries(clip)) this.clip.setAttribute(name, String(value));
    const parts = document.createDocumentFragment();
    const label = (/** @type {number} */ x, /** @type {number} */ y, /** @type {string} */ content, more = {}) => {
      svgElement("text", { x, y, ...more }, parts).textContent = content;
    };
    const labelled = width < 300 ? 2 : 1;
    this.xTicks.forEach((x, i) => {
      svgElement("path", { class: "grid", d: `M${this.xPixel(x)} ${top}V${bottom}` }, parts);
      if (i % labelled === 0) label(this.xPixel(x), bottom + 14, formatNumber(x), { "text-anchor": "middle" });
    });
    const count = Math.max(4, Math.round((bottom - top) / 45));
    for (const y of this.isLogarithmic ? axisTicks(low, high, high - low) : axisTicks(low, high, count)) {
      const kind = y === 0 && !this.isLogarithmic ? "zero" : "grid";
      svgElement("path", { class: kind, d: `M${LEFT} ${this.yPixel(y)}H${width - RIGHT}` }, parts);
      label(LEFT - 5, this.yPixel(y) + 4, formatNumber(this.isLogarithmic ? 10 ** y : y), { "text-anchor": "end" });
    }
    svgElement("path", { class: "frame", d: `M${LEFT} ${top}V${bottom}H${width - RIGHT}` }, parts);
    label(LEFT, 12, this.title, { class: "title" });
    if (this.xTitle) label(width - RIGHT, height - 4, this.xTitle, { "text-anchor": "end" });
    this.axes.replaceChildren(parts);
    this.displayed = new WeakMap();
  }

  /** @param {string} key @param {string} kind */
  #pathOf(key, kind) {
    const path = this.paths.get(key) ?? svgElement("path", { class: kind }, this.curves);
    this.paths.set(key, path);
    return path;
  }

  /**
   * Return the path of a curve, or null if it is empty or already displays these values on these axes.
   * @param {string} key @param {Numbers | null | undefined} values @param {string | undefined} colour @param {string} kind
   */
  #changedPath(key, values, colour, kind) {
    const path = this.#pathOf(key, `curve ${kind}`);
    if (!values) {
      if (path.getAttribute("d")) path.setAttribute("d", "");
      this.displayed.delete(path);
      return null;
    }
    if (this.displayed.get(path) === values) return null;
    this.displayed.set(path, values);
    if (colour) path.setAttribute("stroke", lineColour(colour));
    return path;
  }

  /** Draw a vertical line at an x. @param {number} x */
  drawCursor(x) {
    if (!this.y) return;
    const d = `M${this.xPixel(x).toFixed(1)} ${this.yPixel(this.y[1])}V${this.yPixel(this.y[0])}`;
    this.#pathOf("cursor", "cursor").setAttribute("d", d);
  }

  /**
   * Draw vertical lines up to the values at x = 1, 2, ... `offset` (px) separates several sets of lines.
   * @param {string} key @param {Numbers | null | undefined} values
   * @param {{colour?: string, kind?: string, offset?: number}} style
   */
  drawStems(key, values, { colour, kind = "", offset = 0 }) {
    const path = this.#changedPath(key, values, colour, kind);
    if (!path || !values) return;
    const lowest = this.range[0], bottom = this.yPixel(lowest).toFixed(1);
    const stems = Array.from(values, (y, i) => {
      const top = this.yPixel(Math.max(y, lowest)).toFixed(1);
      return `M${(this.xPixel(i + 1) + offset).toFixed(1)} ${bottom}V${top}`;
    });
    path.setAttribute("d", stems.join(""));
  }

  /** Draw markers at points. @param {(MarkerStyle & {x: number, y: number, is_filled: boolean})[]} points */
  drawMarkers(points) {
    this.markerGroup ??= svgElement("g", {}, this.curves);
    this.markerGroup.replaceChildren(...points.map(({ x, y, colour, marker, is_filled: isFilled }) => svgElement("path", {
      class: isFilled ? "point full" : "point",
      d: MARKERS[marker],
      transform: `translate(${this.xPixel(x).toFixed(1)} ${this.yPixel(y).toFixed(1)})`,
      stroke: lineColour(colour),
      fill: lineColour(colour),
    })));
  }

  /**
   * Draw a curve of values at equal steps of x, with gaps at NaN, or remove it if there are no values.
   * @param {string} key @param {Numbers | null | undefined} values
   * @param {{colour?: string, kind?: string, scale?: number, step: number}} style
   */
  drawCurve(key, values, { colour, kind = "", scale = 1, step }) {
    const path = this.#changedPath(key, values, colour, kind);
    if (!path || !values) return;
    const points = new Array(values.length);
    for (let i = 0, pen = "M"; i < values.length; i += 1) {
      const y = this.yPixel(values[i] * scale);
      points[i] = Number.isNaN(y) ? "" : `${pen}${this.xPixel(this.x[0] + i * step).toFixed(1)} ${y.toFixed(1)}`;
      pen = Number.isNaN(y) ? "M" : "L";
    }
    path.setAttribute("d", points.join(""));
  }
}

const MARKERS = {
  circle: "M-5 0a5 5 0 1 0 10 0a5 5 0 1 0 -10 0Z",
  square: "M-4.5 -4.5H4.5V4.5H-4.5Z",
  triangle: "M0 -5.5L5 4H-5Z",
  diamond: "M0 -6L5 0L0 6L-5 0Z",
};
const SHAPES = /** @type {(keyof typeof MARKERS)[]} */ (Object.keys(MARKERS));

/** @typedef {{colour: string, marker: keyof typeof MARKERS}} MarkerStyle */

/** Return colour and shape of the i-th kind of markers. @param {number} i @param {string[]} colours @returns {MarkerStyle} */
export function markerStyle(i, colours) {
  return { colour: colours[i % colours.length], marker: SHAPES[i % SHAPES.length] };
}

/** Return an entry of a chart's legend. @param {string} textContent @param {MarkerStyle} style */
export function legendItem(textContent, { colour, marker }) {
  const item = Object.assign(document.createElement("li"), { textContent });
  const icon = svgElement("svg", { viewBox: "-8 -8 16 16", "aria-hidden": "true" });
  svgElement("path", { class: "point", d: MARKERS[marker], stroke: lineColour(colour) }, icon);
  item.prepend(icon);
  return item;
}

/** @param {Pair} first @param {Pair} second @returns {Pair} */
export function union(first, second) { return [Math.min(first[0], second[0]), Math.max(first[1], second[1])]; }

/** Return the lowest and highest value of arrays. @param {(Numbers | null | undefined)[]} arrays @returns {Pair} */
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
