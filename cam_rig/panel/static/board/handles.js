// Handles on the curve of s. Their circles are moved and never replaced, so that focus and pointer stay.
/** @import { Chart } from "../common/charts.js" */
import { svgElement } from "../common/charts.js";
import { degrees } from "../common/rig.js";
import { formatNumber, text } from "../common/texts.js";

/** Step of an ordinate by an arrow key, in lifts. Shift and the Page keys multiply it. */
const STEP = 0.005, FINE = 0.1, COARSE = 10;
/** Radius of a handle, px. */
const RADIUS = 6;

/**
 * Actions of the handles. `move` sets a lift in m, `step` changes an ordinate by a number of lifts.
 * `limit` is the largest magnitude of an ordinate, mm.
 * @typedef {{begin: () => void, move: (handle: Handle, lift: number) => void, step: (handle: Handle, lifts: number) => void,
 *   reset: (handle: Handle) => void, end: () => void, focus: (handle: Handle) => void, limit: number}} Actions
 */

export class Handles {
  /** @param {Chart} chart @param {Handle[]} handles @param {Actions} actions */
  constructor(chart, handles, actions) {
    this.chart = chart;
    this.handles = handles;
    this.actions = actions;
    /** Displayed position and value of each handle. @type {string[]} */
    this.displayed = [];
    this.circles = handles.map((handle, i) => {
      const attributes = {
        class: "handle", r: RADIUS, role: "slider", tabindex: 0, "data-index": handle.index, "aria-orientation": "vertical",
        "aria-label": text("handle", { number: i + 1, count: handles.length }),
        "aria-valuemin": -actions.limit, "aria-valuemax": actions.limit,
      };
      const circle = svgElement("circle", attributes, chart.svg);
      this.#listen(circle, handle);
      return circle;
    });
  }

  /** @param {SVGCircleElement} circle @param {Handle} handle */
  #listen(circle, handle) {
    /** Distance (px) of the pointer from the handle's centre, null if it is not held. @type {number | null} */
    let distance = null;
    circle.addEventListener("focus", () => this.actions.focus(handle));
    circle.addEventListener("pointerdown", (event) => {
      if (event.button !== 0) return;
      event.preventDefault();
      circle.focus();
      circle.setPointerCapture(event.pointerId);
      distance = event.clientY - Number(circle.getAttribute("cy"));
      this.actions.begin();
    });
    circle.addEventListener("pointermove", (event) => {
      if (distance !== null) this.actions.move(handle, this.chart.yValue(event.clientY - distance) / 1e3);
    });
    const release = () => {
      if (distance === null) return;
      distance = null;
      this.actions.end();
    };
    circle.addEventListener("pointerup", release);
    circle.addEventListener("lostpointercapture", release);
    circle.addEventListener("keydown", (event) => this.#pressKey(event, handle));
  }

  /** @param {KeyboardEvent} event @param {Handle} handle */
  #pressKey(event, handle) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const unit = event.shiftKey ? FINE : 1;
    /** @type {Record<string, number>} */
    const steps = { ArrowUp: unit, ArrowRight: unit, ArrowDown: -unit, ArrowLeft: -unit, PageUp: COARSE, PageDown: -COARSE };
    const count = steps[event.key];
    if (count === undefined && event.key !== "Home") return;
    event.preventDefault();
    this.actions.begin();
    if (count === undefined) this.actions.reset(handle);
    else this.actions.step(handle, count * STEP);
    this.actions.end();
  }

  /**
   * Draw every handle that has changed, at the lift (m) of its angle.
   * @param {Numbers} lift @param {Numbers} ordinates @param {number} unit mm per ordinate
   */
  draw(lift, ordinates, unit) {
    this.handles.forEach((handle, i) => {
      const x = this.chart.xPixel(degrees(handle.angle)).toFixed(1);
      const y = this.chart.yPixel(lift[handle.k] * 1e3).toFixed(1);
      const value = (ordinates[handle.index] * unit).toFixed(4);
      const displayed = `${x} ${y} ${value} ${lift[handle.k]}`;
      if (this.displayed[i] === displayed) return;
      this.displayed[i] = displayed;
      const words = text("handle_value", { lift: formatNumber(lift[handle.k] * 1e3, 5), angle: formatNumber(degrees(handle.angle)) });
      const attributes = { cx: x, cy: y, "aria-valuenow": value, "aria-valuetext": words };
      for (const [name, attribute] of Object.entries(attributes)) this.circles[i].setAttribute(name, attribute);
    });
  }
}

/**
 * Return the handles that a handle pulls, with weights: 1 for itself, a raised cosine of the cam angle for its neighbours.
 *
 * The cosine reaches `width` (rad) to either side, but not beyond the fixed ordinates at the ends of
 * the segment, so that the law stays smooth there.
 * @param {Handle[]} handles @param {Handle} pulled @param {number} width @returns {[Handle, number][]}
 */
export function pullWeights(handles, pulled, width) {
  /** @type {[Handle, number][]} */
  const weights = [[pulled, 1]];
  const left = Math.min(width, pulled.left), right = Math.min(width, pulled.right);
  for (const other of handles) {
    if (other.segment !== pulled.segment || other.index === pulled.index) continue;
    const distance = other.left - pulled.left;
    const fraction = distance < 0 ? -distance / left : distance / right;
    if (fraction < 1) weights.push([other, (1 + Math.cos(Math.PI * fraction)) / 2]);
  }
  return weights;
}
