// Contour of the cam with axis and base circle, path of its roller, and follower, turned to a cam angle. Faults are red.
import { svgElement, union } from "./charts.js";
import { degrees, followerPose, polyline } from "./rig.js";
import { formatNumber, text } from "./texts.js";

/** Visible length of the stem, relative to the largest radius of the cam. */
const STEM = 0.35;
/** Wanted length of the scale bar, px. */
const BAR = 70;
/** Radius of the axis, and of the ring around an undercut, px. */
const AXIS_RADIUS = 4, MARK_RADIUS = 11;

export class ContourChart {
  /** @param {HTMLElement} parent @param {Record<string, string>} colours @param {string} label */
  constructor(parent, colours, label) {
    this.parent = parent;
    this.colours = colours;
    /** @type {FollowerPicture | null} */
    this.picture = null;
    this.pose = { angle: 0, lift: 0 };
    /** Position of the axis (px), and px/mm. */
    this.frame = { x: 0, y: 0, unit: 1 };
    /** Ranges of x and y, mm. @type {{x: Pair, y: Pair} | null} */
    this.box = null;
    /** @type {Disc[]} */
    this.discs = [];
    this.svg = svgElement("svg", { role: "img", "aria-label": label });
    parent.append(this.svg);
    this.scale = svgElement("g", {}, this.svg);
    this.curves = svgElement("g", {}, this.svg);
    this.follower = svgElement("g", { class: "held" }, this.svg);
    new ResizeObserver(() => this.#draw()).observe(parent);
  }

  /**
   * Draw discs and follower, unless they are already displayed. The visible area shrinks only if it may.
   * @param {Disc[]} discs @param {FollowerPicture} picture @param {boolean} mayShrink
   */
  draw(discs, picture, mayShrink) {
    if ((discs === this.discs && !mayShrink) || !discs.length) return;
    const box = bounds(discs, picture), previous = mayShrink ? null : this.box;
    this.box = previous ? { x: union(previous.x, box.x), y: union(previous.y, box.y) } : box;
    this.discs = discs;
    this.picture = picture;
    this.follower.replaceChildren(...[...picture.outline].reverse().map((outline) => (
      svgElement("path", { class: "follower", d: polyline(outline) }))));
    this.#draw();
  }

  #draw() {
    const { box, picture, parent: { clientWidth: width, clientHeight: height } } = this;
    if (!width || !box || !picture) return;
    const unit = Math.min((width - 12) / (box.x[1] - box.x[0]), (height - 28) / (box.y[1] - box.y[0]));
    const x0 = width / 2 - (unit * (box.x[0] + box.x[1])) / 2;
    const y0 = height / 2 - 8 + (unit * (box.y[0] + box.y[1])) / 2;
    this.frame = { x: x0, y: y0, unit };
    /** @param {Points} points @param {number[]} indices */
    const line = ([xs, ys], indices) => `M${indices.map((i) => (
      `${(x0 + unit * xs[i]).toFixed(1)} ${(y0 - unit * ys[i]).toFixed(1)}`)).join("L")}`;
    const parts = document.createDocumentFragment();
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    for (const { points, pitch, undercut, steep } of this.discs) {
      const all = points[0].map((_, i) => i);
      svgElement("path", { class: "body", d: `${line(points, all)}Z` }, parts);
      if (pitch) svgElement("path", { class: "curve pitch", stroke: this.colours.pitch, d: `${line(pitch, all)}Z` }, parts);
      svgElement("path", { class: "curve", stroke: this.colours.contour, d: `${line(points, all)}Z` }, parts);
      for (const run of runs(undercut)) svgElement("path", { class: "curve bad", d: line(points, run) }, parts);
      for (const run of runs(steep)) svgElement("path", { class: "curve steep", d: line(points, run) }, parts);
    }
    svgElement("circle", { class: "zero base", cx: x0, cy: y0, r: unit * picture.base }, parts);
    svgElement("circle", { class: "zero", cx: x0, cy: y0, r: AXIS_RADIUS }, parts);
    this.curves.replaceChildren(parts);
    this.#markFaults();
    this.#drawScale(height);
    this.setPose(this.pose.angle, this.pose.lift);
  }

  /** Turn the cam to an angle (rad), and lift the follower (mm). @param {number} angle @param {number} lift */
  setPose(angle, lift) {
    this.pose = { angle, lift };
    if (!this.picture) return;
    const { x, y, unit } = this.frame;
    const follower = followerPose(this.picture, lift);
    this.curves.setAttribute("transform", `rotate(${-degrees(angle)} ${x} ${y})`);
    this.follower.setAttribute("transform", `translate(${x} ${y}) scale(${unit} ${-unit}) translate(${follower.x} ${follower.y}) rotate(${degrees(follower.turn)})`);
  }

  /** Name the undercut at the places where it is on the contour. */
  #markFaults() {
    const { x, y, unit } = this.frame;
    for (const { points: [xs, ys], undercut } of this.discs) {
      for (const run of runs(undercut)) {
        const i = run[Math.floor(run.length / 2)];
        const [px, py] = [x + unit * xs[i], y - unit * ys[i]];
        const mark = svgElement("circle", { class: "bad mark", cx: px, cy: py, r: MARK_RADIUS }, this.curves);
        svgElement("title", {}, mark).textContent = text("undercut_here");
      }
    }
  }

  /** Draw the axis, and a scale bar of a round length. @param {number} height */
  #drawScale(height) {
    const { x, y, unit } = this.frame;
    const wanted = BAR / unit;
    const power = 10 ** Math.floor(Math.log10(wanted));
    const length = ([5, 2, 1].find((factor) => factor * power <= wanted) ?? NaN) * power;
    const parts = document.createDocumentFragment();
    svgElement("path", { class: "zero", d: `M${x - 6} ${y}H${x + 6}M${x} ${y - 6}V${y + 6}` }, parts);
    svgElement("path", { class: "frame", d: `M8 ${height - 8}v-4v4h${length * unit}v-4` }, parts);
    svgElement("text", { x: 12, y: height - 14 }, parts).textContent = `${formatNumber(length)} mm`;
    this.scale.replaceChildren(parts);
  }
}

/**
 * Return the ranges of x and y (mm) of discs at any angle, and of the follower.
 * @param {Disc[]} discs @param {FollowerPicture} picture
 */
function bounds(discs, picture) {
  const curves = discs.flatMap(({ points, pitch }) => [points, pitch ?? points]);
  const radius = Math.max(...curves.flatMap(([xs, ys]) => xs.map((x, i) => Math.hypot(x, ys[i]))));
  /** @type {{x: Pair, y: Pair}} */
  const box = { x: [-radius, radius], y: [-radius, radius] };
  for (const lift of [0, picture.max_lift]) {
    const { x: x0, y: y0, turn } = followerPose(picture, lift);
    for (const [xs, ys] of picture.outline) {
      xs.forEach((across, i) => {
        const along = picture.is_oscillating ? ys[i] : Math.min(ys[i], STEM * radius);
        const x = x0 + across * Math.cos(turn) - along * Math.sin(turn);
        const y = y0 + across * Math.sin(turn) + along * Math.cos(turn);
        [box.x, box.y] = [union(box.x, [x, x]), union(box.y, [y, y])];
      });
    }
  }
  return box;
}

/** Return runs of consecutive indices. A single index is joined to the previous point. @param {number[]} indices */
function runs(indices) {
  /** @type {number[][]} */
  const all = [];
  for (const i of indices) {
    const last = all.at(-1);
    if (last && last.at(-1) === i - 1) last.push(i);
    else all.push([i]);
  }
  return all.map((run) => (run.length > 1 ? run : [Math.max(0, run[0] - 1), run[0]]));
}
