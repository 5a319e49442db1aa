// All charts of the page: the law and its derivatives, the force over the turn, the spectrum.
import { seen, Chart, element, extent, shown } from "../common/charts.js";
/** @import { ContourChart } from "../common/contour.js" */
/** @import { MotionTable } from "./law.js" */
import { $, field } from "../common/dom.js";
import { contactForce, motion, spectrum } from "./law.js";
import { text } from "../common/texts.js";

/** Lengths are shown in mm; the spectrum has so many orders, over so many decades. */
const MM = 1e3, HIGHEST_ORDER = 40, DECADES = 5;
const NAMES = ["lift", "velocity", "acceleration", "jerk"];

/**
 * The force at a speed, of the start and of the second law, and the spectra of what was chosen.
 * @typedef {{rpm: number, second: Float64Array[] | null, forces: (Float64Array | null)[],
 *   lines: Record<string, (Float64Array | null)[]>}} Others
 */

export class Pictures {
  /** @param {Board} board @param {MotionTable} table @param {Float64Array[]} start @param {ContourChart} contour */
  constructor(board, table, start, contour) {
    this.board = board;
    this.table = table;
    this.start = start;
    this.contour = contour;
    this.motion = start;
    /** Another law beside it. @type {Float64Array[] | null} */
    this.second = null;
    this.faulty = false;
    /** @type {Others | null} */
    this.others = null;
    /** The last that can be made. @type {Float64Array | null} */
    this.good = board.start_made ? Float64Array.from(board.start) : null;
    this.step = 360 / board.points;
    const turn = { x: /** @type {Pair} */ ([0, 360]), xTicks: [0, 60, 120, 180, 240, 300, 360] };
    const last = NAMES.length - 1;
    this.charts = NAMES.map((_, i) => new Chart($(`chart${i}`), { ...turn, title: text(`s${i}`), role: i === 0 ? "group" : "img", xTitle: i === 0 || i === last ? text("angle") : "" }));
    this.force = new Chart($("force"), { ...turn, title: text("newton"), xTitle: text("angle") });
    this.spectrum = new Chart($("spectrum"), { x: [0, HIGHEST_ORDER + 1], xTicks: [1, 10, 20, 30, 40], title: text("of_force"), xTitle: text("order"), log: true });
    this.all = [...this.charts, this.force, this.spectrum];
    this.#key();
  }

  /** Draw ordinates at a speed; `anew` lets axes shrink. @param {Numbers} ordinates @param {number} rpm @param {boolean} anew */
  draw(ordinates, rpm, anew) {
    this.motion = motion(this.table, ordinates);
    this.charts.forEach((chart, i) => this.#law(chart, i, anew));
    const shownForce = this.faulty && this.good ? motion(this.table, this.good) : this.motion;
    const { rig, colours } = this.board;
    const own = contactForce(shownForce, rig, rpm);
    const others = this.#others(rpm);
    const [start, second] = others.forces;
    this.force.fit(...widened(extent([own, start, second]), 0), anew);
    const common = { step: this.step };
    this.force.curve("start", start, { ...common, colour: colours.ghost, kind: "ghost" });
    this.force.curve("second", second, { ...common, colour: "#111", kind: "second" });
    this.force.curve("own", own, { ...common, colour: colours.force });
    this.force.curve("lost", null, common);
    this.#contact(own);
    this.#spectrum(own, shownForce, others, anew);
  }

  /** The force of the start and of the second law, computed when speed or law change. @param {number} rpm */
  #others(rpm) {
    if (!this.others || this.others.rpm !== rpm || this.others.second !== this.second) {
      const forces = [this.start, this.second].map((law) => law && contactForce(law, this.board.rig, rpm));
      this.others = { rpm, second: this.second, forces, lines: {} };
    }
    return this.others;
  }

  /** @param {Chart} chart @param {number} order @param {boolean} anew */
  #law(chart, order, anew) {
    const { colours } = this.board;
    const [own, start, second] = [this.motion[order], this.start[order], this.second?.[order]];
    let [low, high] = extent([own, start, second], MM);
    if (order === 0) { // room to drag into
      const [least, most] = extent([start], MM);
      [low, high] = [Math.min(low, least - 0.12 * (most - least)), Math.max(high, most + 0.12 * (most - least))];
    }
    chart.fit(low, high, anew);
    const common = { step: this.step, scale: MM };
    chart.curve("start", start, { ...common, colour: colours.ghost, kind: "ghost" });
    chart.curve("second", second, { ...common, colour: "#111", kind: "second" });
    chart.curve("own", own, { ...common, colour: colours[NAMES[order]] });
  }

  /** Where the force is below zero, in words and in red. @param {Float64Array} force */
  #contact(force) {
    const place = $("contact");
    let [first, last, least] = [-1, -1, Infinity];
    force.forEach((value, i) => {
      if (value < least) least = value;
      if (value < 0) { if (first < 0) first = i; last = i; }
    });
    const lost = first >= 0;
    if (lost) {
      const below = force.map((value) => Math.min(value, 0));
      this.force.curve("lost", below, { step: this.step, kind: "bad" });
    }
    const words = lost
      ? text("contact_lost", { from: shown(first * this.step), to: shown(last * this.step) })
      : text("contact_kept", { least: shown(least) });
    const whole = this.faulty ? text(this.good ? "force_kept" : "force_not_made", { words }) : words;
    if (place.textContent !== whole) place.textContent = whole;
    place.classList.toggle("fault", lost || this.faulty);
  }

  /** @param {Float64Array} force @param {Float64Array[]} own @param {Others} others @param {boolean} anew */
  #spectrum(force, own, others, anew) {
    const of = field("spectrum_of").value;
    const ofForce = of === "force";
    const lines = (/** @type {Float64Array} */ values, /** @type {number} */ scale) => spectrum(values, HIGHEST_ORDER).map((x) => Math.log10(Math.max(x * scale, 1e-300)));
    /** @type {(one: Float64Array | null, other: Float64Array[] | null) => Float64Array | null} */
    const pick = (one, other) => one && other && (ofForce ? lines(one, 1) : lines(other[2], MM));
    others.lines[of] ??= [pick(others.forces[0], this.start), pick(others.forces[1], this.second)];
    const found = [pick(force, own), ...others.lines[of]];
    const top = Math.ceil(Math.max(...found.flatMap((values) => (values ? [Math.max(...values)] : []))));
    this.spectrum.title = text(ofForce ? "newton" : "s2");
    this.spectrum.fit(top - DECADES, top, anew);
    const { colours } = this.board;
    this.spectrum.stems("start", found[1], { aside: -2.5, colour: colours.ghost, kind: "ghost" });
    this.spectrum.stems("second", found[2], { aside: 2.5, colour: "#111", kind: "second" });
    this.spectrum.stems("own", found[0], { colour: ofForce ? colours.force : colours.acceleration });
  }

  /**
   * What the server found of some ordinates: a law that cannot be made keeps the last good force.
   * Gives whether that is to be drawn otherwise than before.
   * @param {Float64Array | undefined} ordinates @param {Exact | Moved} found
   */
  judged(ordinates, { faults, discs }) {
    const before = this.faulty;
    this.faulty = faults.length > 0;
    if (!this.faulty && ordinates) this.good = ordinates;
    if (discs.length) this.contour.draw(discs, !this.contour.discs.length);
    this.charts[0].paths.get("own")?.classList.toggle("bad", this.faulty);
    return before !== this.faulty;
  }

  #key() {
    const { colours } = this.board;
    for (const [words, colour, kind] of [["key_law", colours.lift, ""], ["key_start", colours.ghost, "ghost"], ["key_second", "#111", "second"]]) {
      const item = document.createElement("li");
      const svg = element("svg", { viewBox: "0 0 34 10", "aria-hidden": "true" });
      element("path", { class: `curve ${kind}`, stroke: seen(colour), d: "M0 5H34" }, svg);
      item.append(svg, text(words));
      $("key").append(item);
    }
  }
}

/** @param {Pair} range @param {number} value @returns {Pair} */
function widened([low, high], value) { return [Math.min(low, value), Math.max(high, value)]; }
