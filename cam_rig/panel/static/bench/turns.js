// Charts of s, v, a and F over a turn: predicted turn, present turn, last turn, and earlier turns fading.
/** @import { ContactEvent } from "../common/rig.js" */
/** @import { CurveName, Sample, TurnCurves } from "./playback.js" */
import { clearCanvas, contextOf, onColourChange, readColours, resizeCanvas } from "../common/canvas.js";
import { ANGLE_TICKS, Chart, extent, union } from "../common/charts.js";
import { degrees } from "../common/rig.js";
import { text } from "../common/texts.js";
import { CURVES } from "./playback.js";

const UNITS = /** @type {const} */ ({ lift: "mm", velocity: "m/s", acceleration: "m/s²", force: "N" });
/** @typedef {keyof typeof UNITS} ChartName */
/** Chart with the canvas of the last two turns, the canvas of the faded turns, and the ranges of the newest turns.
 * @typedef {{name: ChartName, chart: Chart, canvas: HTMLCanvasElement, faded: HTMLCanvasElement, ranges: Pair[]}} TurnChart */
const TURN = 2 * Math.PI;
const COLOURS = /** @type {const} */ (["shade", "ghost", "of-lift", "of-velocity", "of-acceleration", "of-force"]);
/** Fraction by which an earlier turn fades per turn, and opacity of a new one. */
const FADE = 0.25, OPACITY = 0.5;
/** Number of turns for which an axis keeps a peak. The turn of the peak is then hardly visible (5 % opacity). */
const RANGE_TURNS = 8;
/** Fraction of an axis below which it shrinks, so that irregular turns do not change it all the time. */
const MIN_FILLED = 0.6;

export class TurnCharts {
  /** @param {HTMLElement} parent @param {(angle: number) => void} onHover receives the cam angle (rad) of the pointer */
  constructor(parent, onHover) {
    /** @type {TurnCurves | null} */
    this.predicted = null;
    /** @type {Sample[]} */
    this.present = [];
    /** @type {Sample[]} */
    this.last = [];
    /** Called with each completed turn and its lift-offs and landings. @type {(turn: Sample[], events: ContactEvent[]) => void} */
    this.onTurn = () => {};
    this.hasChanged = true;
    /** Displayed cam angle, rad. */
    this.angle = NaN;
    this.colours = readColours(COLOURS);
    onColourChange(() => {
      this.colours = readColours(COLOURS);
      this.hasChanged = true;
      this.draw(this.angle); // a print does not wait for a frame
    });
    /** @type {TurnChart[]} */
    this.charts = [];
    for (const name of /** @type {ChartName[]} */ (Object.keys(UNITS))) {
      const box = Object.assign(document.createElement("div"), { className: "chart", id: `turn_${name}` });
      parent.append(box);
      const title = `${text(`turn_${name}`)}, ${UNITS[name]}`;
      const chart = new Chart(box, { title, x: [0, 360], xTicks: ANGLE_TICKS, xTitle: name === "force" ? text("angle") : "" });
      const canvas = Object.assign(document.createElement("canvas"), { ariaHidden: "true" });
      box.append(canvas);
      box.addEventListener("pointermove", (event) => {
        const fraction = chart.xFraction(event);
        if (fraction >= 0 && fraction <= 1) onHover(fraction * TURN);
      });
      this.charts.push({ name, chart, canvas, faded: document.createElement("canvas"), ranges: [] });
      chart.onResize = () => this.#resize();
    }
    this.#resize();
  }

  #resize() {
    for (const { chart, canvas, faded } of this.charts) {
      for (const each of [canvas, faded]) resizeCanvas(each, chart.width, chart.height);
    }
    this.setPredicted(this.predicted);
  }

  /** Display the predicted turn, or none. @param {TurnCurves | null} curves */
  setPredicted(curves) {
    const isNew = curves !== this.predicted;
    this.predicted = curves;
    for (const each of this.charts) {
      if (curves) this.#fit(each, curves[each.name], isNew);
      this.#drawPredicted(each);
    }
    this.hasChanged = true;
  }

  /** @param {TurnChart} chart */
  #drawPredicted({ name, chart }) {
    const { predicted } = this;
    chart.drawCurve("expected", predicted?.[name], { kind: "expected", step: predicted ? degrees(predicted.angle[1]) : 1 });
  }

  /** Extend an axis. Curves on the previous axis are removed. @param {TurnChart} each @param {Numbers} values @param {boolean} mayShrink */
  #fit(each, values, mayShrink) {
    const { chart } = each;
    const [low, high] = extent([values]);
    const before = `${chart.y}`;
    chart.fit(Math.min(0, low), Math.max(0, high), mayShrink);
    if (`${chart.y}` === before) return;
    clearCanvas(each.faded);
    this.#drawPredicted(each);
    this.hasChanged = true;
  }

  /** Shrink an axis that is too large for the predicted turn and the newest turns. @param {TurnChart} each */
  #shrink(each) {
    const { name, chart, ranges } = each;
    ranges.push(extent([this.last.map((sample) => sample[name])]));
    ranges.splice(0, ranges.length - RANGE_TURNS);
    const [low, high] = ranges.reduce(union, union([0, 0], extent([this.predicted?.[name]])));
    const [bottom, top] = chart.range;
    if (high - low < MIN_FILLED * (top - bottom)) this.#fit(each, Float64Array.of(low, high), true);
  }

  /** Add passed samples. @param {TurnCurves} curves */
  add(curves) {
    for (let i = 0; i < curves.angle.length; i += 1) {
      const sample = /** @type {Sample} */ (Object.fromEntries(CURVES.map((name) => [name, curves[name][i]])));
      sample.angle -= TURN * Math.floor(sample.angle / TURN);
      if (sample.angle < (this.present.at(-1)?.angle ?? 0) - 1e-6) this.#completeTurn();
      this.present.push(sample);
    }
    for (const each of this.charts) if (curves.angle.length) this.#fit(each, curves[each.name], false);
    this.hasChanged = true;
  }

  #completeTurn() {
    for (const { name, chart, faded } of this.charts) {
      const context = contextOf(faded);
      context.globalCompositeOperation = "destination-out";
      context.fillStyle = `rgb(0 0 0 / ${FADE})`;
      context.fillRect(0, 0, chart.width, chart.height);
      context.globalCompositeOperation = "source-over";
      context.globalAlpha = OPACITY;
      drawSamples(context, chart, this.last, name, this.colours[`of-${name}`]);
      context.globalAlpha = 1;
    }
    this.last = this.present;
    this.present = [];
    for (const each of this.charts) this.#shrink(each);
    this.onTurn(this.last, contactEvents(this.last));
  }

  /** Remove all turns. */
  clear() {
    [this.present, this.last, this.hasChanged] = [[], [], true];
    for (const each of this.charts) {
      each.ranges = [];
      clearCanvas(each.faded);
    }
  }

  /** Draw the turns and the cam angle (rad), if they have changed. @param {number} angle */
  draw(angle) {
    if (!this.hasChanged && angle === this.angle) return;
    [this.hasChanged, this.angle] = [false, angle];
    const position = this.present.at(-1)?.angle ?? -1;
    const parts = [this.last.filter((sample) => sample.angle > position), this.present];
    for (const { name, chart, canvas, faded } of this.charts) {
      if (!chart.y) continue;
      const context = contextOf(canvas);
      clearCanvas(canvas);
      const [left, right] = [chart.xPixel(0), chart.xPixel(360)];
      const [bottom, top] = [chart.yPixel(chart.range[0]), chart.yPixel(chart.range[1])];
      context.save();
      context.beginPath();
      context.rect(left, top, right - left, bottom - top);
      context.clip(); // turns of a higher speed may exceed the axes
      for (const part of parts) this.#shadeFlights(context, chart, part);
      context.drawImage(faded, 0, 0, chart.width, chart.height);
      for (const part of parts) drawSamples(context, chart, part, name, this.colours[`of-${name}`]);
      context.fillStyle = this.colours.ghost;
      context.fillRect(xOf(chart, angle % TURN) - 0.5, top, 1, bottom - top);
      context.restore();
    }
  }

  /** Shade the angles without contact. @param {CanvasRenderingContext2D} context @param {Chart} chart @param {Sample[]} samples */
  #shadeFlights(context, chart, samples) {
    context.fillStyle = this.colours.shade;
    const [top, bottom] = [chart.yPixel(chart.range[1]), chart.yPixel(chart.range[0])];
    for (const [first, last] of flights(samples)) {
      const [left, right] = [xOf(chart, samples[first].angle), xOf(chart, samples[last].angle)];
      context.fillRect(left, top, Math.max(1, right - left), bottom - top);
    }
  }
}

const xOf = (/** @type {Chart} */ chart, /** @type {number} */ angle) => chart.xPixel(degrees(angle));

/** @param {CanvasRenderingContext2D} context @param {Chart} chart @param {Sample[]} samples @param {CurveName} name @param {string} colour */
function drawSamples(context, chart, samples, name, colour) {
  if (samples.length < 2) return;
  context.strokeStyle = colour;
  context.lineWidth = 1.8;
  context.beginPath();
  for (const sample of samples) context.lineTo(xOf(chart, sample.angle), chart.yPixel(sample[name]));
  context.stroke();
}

/** Return first and last index of each flight. @param {Sample[]} samples */
function flights(samples) {
  /** @type {Pair[]} */
  const intervals = [];
  let first = -1;
  samples.forEach(({ force }, i) => {
    if (force === 0 && first < 0) first = i;
    if (first >= 0 && (force !== 0 || i === samples.length - 1)) {
      intervals.push([first, i]);
      first = -1;
    }
  });
  return intervals;
}

/** Return the lift-offs and landings of a turn. @param {Sample[]} samples @returns {ContactEvent[]} */
function contactEvents(samples) {
  const changes = samples.slice(1).filter(({ force }, i) => (force === 0) !== (samples[i].force === 0));
  return changes.map(({ angle, force }) => ({ angle, isLanding: force !== 0 }));
}
