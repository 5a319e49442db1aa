// s, v, a and F over one turn: what is expected, the turn that runs, the last one, those before fading.
import { brush, colours, size, wipe } from "../common/canvas.js";
import { Chart, extent } from "../common/charts.js";
/** @import { Crossing } from "../common/rig.js" */
/** @import { Rows } from "./playback.js" */
import { text } from "../common/texts.js";

const KINDS = /** @type {const} */ ([["lift", "mm"], ["velocity", "m/s"], ["acceleration", "m/s²"], ["force", "N"]]);
/** @typedef {typeof KINDS[number][0]} Kind */
/** @typedef {Record<Kind | "angle" | "gap", number>} Sample */
/** @typedef {{ name: Kind, chart: Chart, canvas: HTMLCanvasElement, past: HTMLCanvasElement }} One */
const TURN = 2 * Math.PI, TICKS = [0, 60, 120, 180, 240, 300, 360];
const COLOURS = /** @type {const} */ (["shade", "ghost", "of-lift", "of-velocity", "of-acceleration", "of-force"]);
/** What is left of a turn that is over, from one to the next. */
const FADE = 0.25;

export class TurnCharts {
  /**
   * `hovered(angle or null)` is told of the cam angle (rad) that the pointer is at.
   * @param {HTMLElement} place @param {(angle: number | null) => void} hovered
   */
  constructor(place, hovered) {
    /** What is expected. @type {Rows | null} */
    this.known = null;
    /** The turn that runs, and the one before. @type {Sample[]} */
    this.running = [];
    /** @type {Sample[]} */
    this.last = [];
    /** Told of a turn that is over, and where in it contact was lost and found. @type {(turn: Sample[], events: Crossing[]) => void} */
    this.told = () => {};
    this.dirty = true;
    /** The angle (rad) that is drawn. @type {number | null} */
    this.drawn = null;
    this.colours = colours(COLOURS);
    this.charts = KINDS.map(([name, unit], i) => {
      const box = Object.assign(document.createElement("div"), { className: "chart", id: `turn_${name}` });
      place.append(box);
      const last = i === KINDS.length - 1;
      const chart = new Chart(box, { title: `${text(`turn_${name}`)}, ${unit}`, x: [0, 360], xTicks: TICKS, xTitle: last ? text("angle") : "" });
      const canvas = Object.assign(document.createElement("canvas"), { ariaHidden: "true" });
      box.append(canvas);
      chart.resized = () => { this.#sized(); this.expected(this.known); };
      box.addEventListener("pointermove", ({ clientX }) => {
        const angle = ((clientX - box.getBoundingClientRect().left - chart.right(0)) / (chart.right(360) - chart.right(0))) * TURN;
        hovered(angle >= 0 && angle <= TURN ? angle : null);
      });
      box.addEventListener("pointerleave", () => hovered(null));
      return { name, chart, canvas, past: document.createElement("canvas") };
    });
    this.#sized();
  }

  #sized() {
    for (const { chart, canvas, past } of this.charts ?? []) for (const one of [canvas, past]) size(one, chart.width, chart.height);
    this.dirty = true;
  }

  /** The settled turn of a set-up and speed: rows as in a block; null is none. @param {Rows | null} rows */
  expected(rows) {
    const anew = rows !== this.known;
    this.known = rows;
    for (const one of this.charts) {
      if (rows) this.#fit(one, rows[one.name], anew);
      this.#expect(one);
    }
    this.dirty = true;
  }

  /** @param {One} one */
  #expect({ name, chart }) {
    const { known } = this;
    const step = known ? (known.angle[1] * 180) / Math.PI : 1;
    chart.curve("expected", known && Array.from(known[name]), { kind: "expected", step });
  }

  /** Axes that hold these values; what was drawn on others is drawn anew, or is gone. @param {One} one @param {Numbers} values @param {boolean} anew */
  #fit(one, values, anew) {
    const { chart } = one;
    const [low, high] = extent([values]);
    const before = `${chart.range}`;
    chart.fit(Math.min(0, low), Math.max(0, high), anew);
    if (`${chart.range}` === before) return;
    wipe(one.past);
    this.#expect(one);
    this.dirty = true;
  }

  /** Samples that have passed, in their order. @param {Rows} rows */
  take(rows) {
    for (let i = 0; i < rows.angle.length; i += 1) {
      const turn = Math.floor(rows.angle[i] / TURN), angle = rows.angle[i] - turn * TURN;
      if (angle < (this.running.at(-1)?.angle ?? 0) - 1e-6) this.#over();
      this.running.push({ angle, lift: rows.lift[i], velocity: rows.velocity[i], acceleration: rows.acceleration[i], force: rows.force[i], gap: rows.gap[i] });
    }
    for (const one of this.charts) if (rows.angle.length) this.#fit(one, rows[one.name], false);
    this.dirty = true;
  }

  /** A turn is over: it is the last one, and those before fade. */
  #over() {
    for (const { name, chart, past } of this.charts) {
      const context = brush(past);
      context.globalCompositeOperation = "destination-out";
      context.fillStyle = `rgb(0 0 0 / ${FADE})`;
      context.fillRect(0, 0, chart.width, chart.height);
      context.globalCompositeOperation = "source-over";
      context.globalAlpha = 0.5;
      stroke(context, chart, this.last, name, this.colours[`of-${name}`]);
      context.globalAlpha = 1;
    }
    this.last = this.running;
    this.running = [];
    this.told(this.last, crossings(this.last));
  }

  /** The page has become light or dark. */
  recolour() {
    this.colours = colours(COLOURS);
    this.dirty = true;
  }

  /** Nothing of the turns before. */
  clear() {
    [this.running, this.last, this.dirty] = [[], [], true];
    for (const { past } of this.charts) wipe(past);
  }

  /** Draw what has changed; the cam stands at an angle (rad), null is nowhere. @param {number | null} angle */
  draw(angle) {
    if (!this.dirty && angle === this.drawn) return;
    this.dirty = false;
    this.drawn = angle;
    const at = this.running.at(-1)?.angle ?? -1;
    const rest = this.last.filter((one) => one.angle > at);
    for (const { name, chart, canvas, past } of this.charts) {
      if (!chart.range) continue;
      const context = brush(canvas);
      wipe(canvas);
      const [left, right] = [chart.right(0), chart.right(360)];
      const [bottom, top] = [chart.down(chart.ends[0]), chart.down(chart.ends[1])];
      context.save();
      context.beginPath();
      context.rect(left, top, right - left, bottom - top);
      context.clip(); // a turn of a faster speed may not fit these axes
      for (const part of [rest, this.running]) this.#shade(context, chart, part);
      context.drawImage(past, 0, 0, chart.width, chart.height);
      for (const part of [rest, this.running]) stroke(context, chart, part, name, this.colours[`of-${name}`]);
      if (angle !== null) {
        context.fillStyle = this.colours.ghost;
        context.fillRect(px(chart, angle % TURN) - 0.5, top, 1, bottom - top);
      }
      context.restore();
    }
  }

  /**
   * Behind the curves, where the follower is off the cam.
   * @param {CanvasRenderingContext2D} context @param {Chart} chart @param {Sample[]} part
   */
  #shade(context, chart, part) {
    context.fillStyle = this.colours.shade;
    const [top, bottom] = [chart.down(chart.ends[1]), chart.down(chart.ends[0])];
    for (const [from, to] of flights(part)) {
      context.fillRect(px(chart, part[from].angle), top, Math.max(1, px(chart, part[to].angle) - px(chart, part[from].angle)), bottom - top);
    }
  }
}

const px = (/** @type {Chart} */ chart, /** @type {number} */ angle) => chart.right((angle * 180) / Math.PI);

/** @param {CanvasRenderingContext2D} context @param {Chart} chart @param {Sample[]} part @param {Kind} name @param {string} colour */
function stroke(context, chart, part, name, colour) {
  if (part.length < 2) return;
  context.strokeStyle = colour;
  context.lineWidth = 1.8;
  context.beginPath();
  for (const one of part) context.lineTo(px(chart, one.angle), chart.down(one[name]));
  context.stroke();
}

/** First and last indices of samples in flight. @param {Sample[]} part */
function flights(part) {
  /** @type {Pair[]} */
  const found = [];
  let from = -1;
  part.forEach(({ force }, i) => {
    if (force === 0 && from < 0) from = i;
    if (from >= 0 && (force !== 0 || i === part.length - 1)) { found.push([from, i]); from = -1; }
  });
  return found;
}

/** Where a turn's contact was lost and found again. @param {Sample[]} part @returns {Crossing[]} */
function crossings(part) {
  return part.slice(1).flatMap((one, i) => (
    (one.force === 0) === (part[i].force === 0) ? [] : [{ angle: one.angle, landing: one.force !== 0 }]));
}
