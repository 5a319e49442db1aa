// The contour of the cam with the path of its roller, under its follower as it has turned; what
// cannot be is red, and said in words.
import { element, shown } from "./charts.js";
import { degrees, path, stand } from "./rig.js";

/** What is seen of the stem above the follower's place, over the cam's greatest radius. */
const STEM = 0.35;

export class ContourChart {
  /** @param {HTMLElement} place @param {Record<string, string>} colours @param {string} label @param {CamPicture} picture of the follower */
  constructor(place, colours, label, picture) {
    this.picture = picture;
    /** Cam angle (rad) and lift (mm). @type {Pair} */
    this.at = [0, 0];
    /** Where the axis is (px), and px/mm. */
    this.frame = [0, 0, 1];
    this.place = place;
    this.colours = colours;
    /** Of x and of y. @type {[Pair, Pair] | null} */
    this.box = null;
    /** @type {Disc[]} */
    this.discs = [];
    this.svg = element("svg", { role: "img", "aria-label": label });
    place.append(this.svg);
    this.scale = element("g", {}, this.svg);
    this.curves = element("g", {}, this.svg);
    this.held = element("g", { class: "held" }, this.svg);
    for (const strip of [...picture.outline].reverse()) element("path", { class: "follower", d: path(...strip) }, this.held);
    new ResizeObserver(() => this.draw(this.discs)).observe(place);
  }

  /** Discs in mm; `anew` lets the scale shrink. @param {Disc[]} discs */
  draw(discs, anew = false) {
    this.discs = discs;
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !discs.length) return;
    const box = bounds(discs, this.picture);
    this.box = anew || !this.box ? box : union(this.box, box);
    const [[left, right], [bottom, top]] = this.box;
    const unit = Math.min((width - 12) / (right - left), (height - 28) / (top - bottom));
    const [x0, y0] = [width / 2 - (unit * (left + right)) / 2, height / 2 - 8 + (unit * (bottom + top)) / 2];
    const at = (/** @type {Points} */ [xs, ys], /** @type {number} */ i) => `${(x0 + unit * xs[i]).toFixed(1)} ${(y0 - unit * ys[i]).toFixed(1)}`;
    const line = (/** @type {Points} */ points, /** @type {number[]} */ indices) => `M${indices.map((i) => at(points, i)).join("L")}`;
    const parts = document.createDocumentFragment();
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    for (const { points, pitch, undercut, steep } of discs) {
      const all = points[0].map((_, i) => i);
      element("path", { class: "body", d: `${line(points, all)}Z` }, parts);
      if (pitch) element("path", { class: "curve pitch", stroke: this.colours.pitch, d: `${line(pitch, all)}Z` }, parts);
      element("path", { class: "curve", stroke: this.colours.contour, d: `${line(points, all)}Z` }, parts);
      for (const { indices, kind } of [{ indices: undercut, kind: "bad" }, { indices: steep, kind: "steep" }]) {
        for (const run of runs(indices)) element("path", { class: `curve ${kind}`, d: line(points, run) }, parts);
      }
    }
    this.curves.replaceChildren(parts);
    this.#ruler([x0, y0], height, unit);
    this.frame = [x0, y0, unit];
    this.pose(...this.at);
  }

  /** Turn the cam to an angle (rad), and lift the follower (mm). @param {number} angle @param {number} lift */
  pose(angle, lift) {
    this.at = [angle, lift];
    const [x0, y0, unit] = this.frame;
    const [[x, y], turn] = stand(this.picture, lift);
    this.curves.setAttribute("transform", `rotate(${-degrees(angle)} ${x0} ${y0})`);
    this.held.setAttribute("transform", `translate(${x0} ${y0}) scale(${unit} ${-unit}) translate(${x} ${y}) rotate(${degrees(turn)})`);
  }

  /** The axis, and a length to measure by. @param {Pair} axis @param {number} height @param {number} unit */
  #ruler([x, y], height, unit) {
    const raw = 70 / unit;
    const power = 10 ** Math.floor(Math.log10(raw));
    const length = ([5, 2, 1].find((part) => part * power <= raw) ?? NaN) * power;
    const parts = document.createDocumentFragment();
    element("path", { class: "zero", d: `M${x - 6} ${y}H${x + 6}M${x} ${y - 6}V${y + 6}` }, parts);
    element("path", { class: "frame", d: `M8 ${height - 8}v-4v4h${length * unit}v-4` }, parts);
    element("text", { x: 12, y: height - 14 }, parts).textContent = `${shown(length)} mm`;
    this.scale.replaceChildren(parts);
  }
}

/**
 * Least and greatest x and y (mm) of discs and their pitch curves however they turn, and of the follower.
 * @param {Disc[]} discs @param {CamPicture} picture @returns {[Pair, Pair]}
 */
function bounds(discs, picture) {
  const radius = Math.max(...discs.flatMap(({ points, pitch }) => [points, pitch ?? points].flatMap(([xs, ys]) => xs.map((x, i) => Math.hypot(x, ys[i])))));
  /** @type {[Pair, Pair]} */
  let box = [[-radius, radius], [-radius, radius]];
  for (const lift of [0, picture.max_lift]) {
    const [[x0, y0], turn] = stand(picture, lift);
    for (const [xs, ys] of picture.outline) {
      xs.forEach((along, i) => {
        const up = picture.swings ? ys[i] : Math.min(ys[i], STEM * radius);
        const [x, y] = [x0 + along * Math.cos(turn) - up * Math.sin(turn), y0 + along * Math.sin(turn) + up * Math.cos(turn)];
        box = union(box, [[x, x], [y, y]]);
      });
    }
  }
  return box;
}

/** @param {[Pair, Pair]} one @param {[Pair, Pair]} other @returns {[Pair, Pair]} */
function union([[left, right], [bottom, top]], [x, y]) {
  return [[Math.min(left, x[0]), Math.max(right, x[1])], [Math.min(bottom, y[0]), Math.max(top, y[1])]];
}

/** Neighbours together; a single one has length by its next. @param {number[]} indices */
function runs(indices) {
  /** @type {number[][]} */
  const found = [];
  for (const i of indices) {
    const last = found.at(-1);
    if (last && last.at(-1) === i - 1) last.push(i);
    else found.push([i]);
  }
  return found.map((run) => (run.length > 1 ? run : [Math.max(0, run[0] - 1), run[0]]));
}
