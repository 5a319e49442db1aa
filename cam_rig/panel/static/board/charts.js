// Charts of the board: the law and its derivatives, the contact force over the turn, the spectrum.
/** @import { Law } from "../core/law.js" */
/** @import { DrawnLaw, Motion } from "./law.js" */
/** @import { BoardState, SecondLaw } from "./main.js" */
import { ANGLE_TICKS, Chart, extent, lineColour, union } from "../common/charts.js";
import { $, setText } from "../common/dom.js";
import { cached } from "../common/store.js";
import { formatNumber, text } from "../common/texts.js";
import { Flight } from "./flight.js";
import { MOTION_POINTS, camTorque, contactForce, motionOf, spectrum } from "./law.js";
import { curveSample } from "./tables.js";

/** Displayed lengths are in mm. */
const MM = 1e3;
/** Orders and decades of the spectrum. */
const MAX_ORDER = 40, DECADES = 5;
/** Distance of the stems of different laws in the spectrum, px. */
const STEM_OFFSET = 2.5;
/** Space above and below the curve of s, relative to its range, into which handles can be dragged. */
const DRAG_MARGIN = 0.12;
/** Colours of the curves, and texts of the axes, of s to s'''. */
const CURVES = [["lift", "s0"], ["velocity", "s1"], ["acceleration", "s2"], ["jerk", "s3"]];
export const SECOND_COLOUR = "#111";

export class BoardCharts {
  /** @param {Board} board @param {DrawnLaw} drawn */
  constructor(board, drawn) {
    this.board = board;
    this.step = 360 / MOTION_POINTS;
    const lawOf = () => cached((/** @type {Numbers} */ ordinates) => drawn.of(ordinates));
    /** Law of ordinates, and of the last law that can be made. */
    this.law = lawOf();
    this.makeableLaw = lawOf();
    /** Motion of both laws. */
    this.motion = cached(motionOf);
    this.makeableMotion = cached(motionOf);
    /** Flight of the law of the displayed force. */
    this.flight = cached((/** @type {Law} */ law, /** @type {number} */ rpm) => (board.cam.sprung ? new Flight(law, board.rig, rpm) : null));
    this.start = motionOf(drawn.start);
    const angle = { x: /** @type {Pair} */ ([0, 360]), xTicks: ANGLE_TICKS };
    this.laws = CURVES.map(([, title], i) => new Chart($(`chart${i}`), {
      ...angle, title: text(title), role: i === 0 ? "group" : "img", xTitle: [0, CURVES.length - 1].includes(i) ? text("angle") : "",
    }));
    this.force = new Chart($("force"), { ...angle, title: text("newton") });
    this.torque = new Chart($("torque"), { ...angle, title: text("newton_metre"), xTitle: text("angle") });
    this.spectrum = new Chart($("spectrum"), {
      x: [0, MAX_ORDER + 1], xTicks: [1, 10, 20, 30, 40], title: text("of_force"), xTitle: text("order"), isLogarithmic: true,
    });
    /** Charts over the cam angle. */
    this.overAngle = [...this.laws, this.force, this.torque];
    const forces = () => cached((/** @type {Motion | null} */ law, /** @type {number} */ rpm) => law && contactForce(law, board.rig, rpm));
    this.forces = [forces(), forces(), forces()];
    const torques = () => cached((/** @type {Motion | null} */ law, /** @type {Numbers | null} */ force) => law && force && camTorque(law, force));
    this.torques = [torques(), torques(), torques()];
    const logSpectrum = (/** @type {Numbers | null} */ values, /** @type {number} */ scale) => (
      values && spectrum(values, MAX_ORDER).map((amplitude) => Math.log10(Math.max(amplitude * scale, 1e-300))));
    this.spectra = [cached(logSpectrum), cached(logSpectrum), cached(logSpectrum)];
    /** Second law in the legend, undefined before the first drawing. @type {SecondLaw | null | undefined} */
    this.secondInLegend = undefined;
  }

  /** Draw the state. Axes shrink only if `state.mayShrink`. @param {BoardState} state */
  draw(state) {
    const { mayShrink, rpm } = state;
    const second = state.second && state.second.motion;
    this.#drawLegend(state.second);
    const law = this.motion(this.law(state.ordinates)), { forceLaw, isFaulty } = this.#forceLaw(state);
    this.laws.forEach((chart, order) => this.#drawLaw(chart, order, law, second, mayShrink));
    this.laws[0].paths.get("own")?.classList.toggle("bad", isFaulty);
    const laws = [forceLaw === this.law(state.ordinates) ? law : this.makeableMotion(forceLaw), this.start, second];
    const forces = laws.map((each, i) => this.forces[i](each, rpm)), flight = this.flight(forceLaw, rpm);
    const [low, high] = extent([...forces, flight?.force]);
    this.force.fit(Math.min(low, 0), Math.max(high, 0), mayShrink);
    const shown = [flight?.force ?? forces[0], forces[1], forces[2]];
    this.#drawCurves(this.force, shown, { colour: this.board.colours.force });
    const torques = laws.map((each, i) => this.torques[i](each, shown[i]));
    this.torque.fit(...extent(torques), mayShrink);
    this.#drawCurves(this.torque, torques, { colour: this.board.colours.torque });
    this.#nameTorques(/** @type {Float64Array} */ (torques[0]));
    this.#drawContact(/** @type {Float64Array} */ (forces[0]), flight, isFaulty, Boolean(state.makeable));
    const isOfForce = state.spectrum === "force";
    const spectra = laws.map((each, i) => this.spectra[i](isOfForce ? forces[i] : each && each[2], isOfForce ? 1 : MM));
    this.#drawSpectrum(spectra, isOfForce, mayShrink);
  }

  /** Return the law of the displayed force. That of a law that cannot be made is the last law that can. @param {BoardState} state */
  #forceLaw({ ordinates, fast, makeable }) {
    const isFaulty = Boolean(fast?.faults.length);
    return { isFaulty, forceLaw: isFaulty && makeable ? this.makeableLaw(makeable) : this.law(ordinates) };
  }

  /** Return the motion of the follower at a cam angle (rad) if the cam can be made and contact is lost, otherwise null. @param {BoardState} state @param {number} angle */
  flightAt(state, angle) {
    const { forceLaw, isFaulty } = this.#forceLaw(state), flight = isFaulty ? null : this.flight(forceLaw, state.rpm);
    return flight?.isLost ? flight.at(angle) : null;
  }

  /**
   * Draw the curves of the present, start and second law.
   * @param {Chart} chart @param {(Numbers | null | undefined)[]} curves @param {{colour: string, scale?: number}} style
   */
  #drawCurves(chart, [own, start, second], { colour, scale = 1 }) {
    const common = { step: this.step, scale };
    chart.drawCurve("start", start, { ...common, colour: this.board.colours.ghost, kind: "ghost" });
    chart.drawCurve("second", second, { ...common, colour: SECOND_COLOUR, kind: "second" });
    chart.drawCurve("own", own, { ...common, colour });
  }

  /** @param {Chart} chart @param {number} order @param {Motion} law @param {Motion | null} second @param {boolean} mayShrink */
  #drawLaw(chart, order, law, second, mayShrink) {
    const curves = [law[order], this.start[order], second?.[order]];
    let range = extent(curves, MM);
    if (order === 0) {
      const [low, high] = extent([this.start[0]], MM);
      range = union(range, [low - DRAG_MARGIN * (high - low), high + DRAG_MARGIN * (high - low)]);
    }
    chart.fit(...range, mayShrink);
    this.#drawCurves(chart, curves, { colour: this.board.colours[CURVES[order][0]], scale: MM });
  }

  /**
   * Show the angles at which the force is below zero, and the lift-offs and landings.
   * @param {Float64Array} force @param {Flight | null} flight @param {boolean} isFaulty @param {boolean} hasMakeable
   */
  #drawContact(force, flight, isFaulty, hasMakeable) {
    const ranges = this.board.cam.sprung ? negativeRanges(force).map(([from, to]) => (
      text("angle_range", { from: formatNumber(from * this.step), to: formatNumber(to * this.step) }))) : [];
    const isLost = ranges.length > 0, hasFlights = Boolean(flight?.isLost);
    this.force.drawCurve("lost", isLost ? force.map((value) => (value < 0 ? value : NaN)) : null, { step: this.step, kind: "bad" });
    const sentences = [];
    if (!this.board.cam.sprung) sentences.push(text("contact_guided"));
    else if (isLost) sentences.push(text("contact_lost", { ranges: ranges.join(", ") }));
    else if (!hasFlights) sentences.push(text("contact_kept", { min: formatNumber(extent([force])[0]) }));
    if (hasFlights || (isLost && flight?.message)) sentences.push(/** @type {Flight} */ (flight).describe());
    const contact = sentences.join(" ");
    setText("contact", isFaulty ? text(hasMakeable ? "force_kept" : "force_not_made", { contact }) : contact);
    $("contact").classList.toggle("fault", isLost || hasFlights || isFaulty);
  }

  /** Show the largest, the least and the mean torque. @param {Float64Array} torque */
  #nameTorques(torque) {
    const [least, largest] = extent([torque]);
    const mean = torque.reduce((sum, value) => sum + value, 0) / torque.length;
    setText("torques", text("torques", {
      largest: formatNumber(largest, 3),
      least: formatNumber(least, 3),
      mean: formatNumber(mean, 3),
      largest_at: formatNumber(torque.indexOf(largest) * this.step),
      least_at: formatNumber(torque.indexOf(least) * this.step),
    }));
  }

  /** @param {(Numbers | null)[]} spectra @param {boolean} isOfForce @param {boolean} mayShrink */
  #drawSpectrum(spectra, isOfForce, mayShrink) {
    const { colours } = this.board;
    const top = Math.ceil(extent(spectra)[1]);
    this.spectrum.setTitle(text(isOfForce ? "newton" : "s2"));
    this.spectrum.fit(top - DECADES, top, mayShrink);
    this.spectrum.drawStems("start", spectra[1], { offset: -STEM_OFFSET, colour: colours.ghost, kind: "ghost" });
    this.spectrum.drawStems("second", spectra[2], { offset: STEM_OFFSET, colour: SECOND_COLOUR, kind: "second" });
    const colour = isOfForce ? colours.force : colours.acceleration;
    this.spectrum.drawStems("own", spectra[0], { colour });
    $("key").querySelector("path")?.setAttribute("stroke", lineColour(colour));
  }

  /** Name the laws of the curves. @param {SecondLaw | null} second */
  #drawLegend(second) {
    if (second === this.secondInLegend) return;
    this.secondInLegend = second;
    const { colours, cam } = this.board;
    const entries = [[cam.title, colours.force, ""], [text("key_start", cam), colours.ghost, "ghost"]];
    if (second) entries.push([second.title, SECOND_COLOUR, "second"]);
    $("key").replaceChildren(...entries.map(([title, colour, kind]) => {
      const item = document.createElement("li");
      item.append(curveSample(kind, lineColour(colour)), title);
      return item;
    }));
  }
}

/** Return first and last index of each range of negative values. @param {Numbers} values */
function negativeRanges(values) {
  /** @type {Pair[]} */
  const ranges = [];
  values.forEach((value, i) => {
    const last = ranges.at(-1);
    if (value >= 0) return;
    if (last && last[1] === i - 1) last[1] = i;
    else ranges.push([i, i]);
  });
  return ranges;
}
