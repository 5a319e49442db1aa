// Handles on the curve: circles that are moved and never replaced, so that focus and pointer stay.
/** @import { Chart } from "../common/charts.js" */
import { element } from "../common/charts.js";

/** Of the lift: what an arrow key moves an ordinate by, and how Shift and Page change that. */
const STEP = 0.005, FINE = 0.1, COARSE = 10;
const RADIUS = 6;

/**
 * What a gesture does: move to a lift (m), step by so many lifts, go home; least and most in mm.
 * @typedef {{begin: () => void, move: (handle: Handle, lift: number) => void, step: (handle: Handle, lifts: number) => void,
 *   home: (handle: Handle) => void, end: () => void, least: number, most: number}} Act
 */

export class Handles {
  /**
   * @param {Chart} chart
   * @param {Handle[]} handles
   * @param {Act} act
   * @param {{label: (i: number) => string, value: (handle: Handle) => string}} words
   */
  constructor(chart, handles, act, words) {
    this.chart = chart;
    this.handles = handles;
    this.act = act;
    this.words = words;
    /** @type {string[]} */
    this.seen = [];
    this.circles = handles.map((handle, i) => {
      const circle = element("circle", { class: "handle", r: RADIUS, role: "slider", tabindex: 0, "aria-label": words.label(i), "aria-orientation": "vertical", "aria-valuemin": act.least, "aria-valuemax": act.most, "data-index": handle.index }, chart.svg);
      this.#listen(circle, handle);
      return circle;
    });
  }

  /** @param {SVGCircleElement} circle @param {Handle} handle */
  #listen(circle, handle) {
    /** @type {number | null} */
    let grabbed = null;
    circle.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      circle.focus();
      circle.setPointerCapture(event.pointerId);
      grabbed = event.clientY - Number(circle.getAttribute("cy"));
      this.act.begin();
    });
    circle.addEventListener("pointermove", (event) => {
      if (grabbed !== null) this.act.move(handle, this.chart.value(event.clientY - grabbed) / 1e3);
    });
    const release = () => {
      if (grabbed === null) return;
      grabbed = null;
      this.act.end();
    };
    circle.addEventListener("pointerup", release);
    circle.addEventListener("lostpointercapture", release);
    circle.addEventListener("keydown", (event) => this.#key(event, handle));
  }

  /** @param {KeyboardEvent} event @param {Handle} handle */
  #key(event, handle) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const fine = event.shiftKey ? FINE : 1;
    /** @type {Record<string, number>} */
    const ways = { ArrowUp: fine, ArrowRight: fine, ArrowDown: -fine, ArrowLeft: -fine, PageUp: COARSE, PageDown: -COARSE };
    const by = ways[event.key];
    if (by === undefined && event.key !== "Home") return;
    event.preventDefault();
    this.act.begin();
    if (by === undefined) this.act.home(handle);
    else this.act.step(handle, by * STEP);
    this.act.end();
  }

  /**
   * Put every handle where the lift (m) is; what is as it was is not touched.
   * @param {Numbers} lift @param {Numbers} ordinates @param {number} unit
   */
  place(lift, ordinates, unit) {
    this.handles.forEach((handle, i) => {
      const at = [this.chart.right((handle.angle * 180) / Math.PI), this.chart.down(lift[handle.k] * 1e3)];
      const [x, y] = at.map((value) => value.toFixed(1));
      const value = (ordinates[handle.index] * unit).toFixed(4);
      const seen = `${x} ${y} ${value} ${lift[handle.k]}`;
      if (this.seen[i] === seen) return;
      this.seen[i] = seen;
      const attributes = { cx: x, cy: y, "aria-valuenow": value, "aria-valuetext": this.words.value(handle) };
      for (const [key, shown] of Object.entries(attributes)) this.circles[i].setAttribute(key, shown);
    });
  }
}

/**
 * What a handle pulls: [handle, weight], itself by 1, those beside it by a raised cosine of the cam angle.
 *
 * The cosine reaches `width` (rad) to either side, and no farther than the ordinates that keep the
 * end of the segment as it is, so that the law stays smooth there.
 * @param {Handle[]} handles @param {Handle} own @param {number} width @returns {[Handle, number][]}
 */
export function weights(handles, own, width) {
  /** @type {[Handle, number][]} */
  const found = [[own, 1]];
  const [left, right] = [Math.min(width, own.left), Math.min(width, own.right)];
  for (const other of handles) {
    if (other.segment !== own.segment || other.index === own.index) continue;
    const away = other.left - own.left;
    const part = away < 0 ? -away / left : away / right;
    if (part < 1) found.push([other, (1 + Math.cos(Math.PI * part)) / 2]);
  }
  return found;
}
