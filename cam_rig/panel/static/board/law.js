// The law in the page: polynomial pieces whose ordinates are fixed matrices times those of the board,
// its curves over a turn, and their contact force. All values are in SI units.
import { forceAt } from "../core/force.js";
import { Law, pieceOrdinates, readPieces } from "../core/law.js";
import { valueAt } from "../core/polynomials.js";
import { RPM, TURN } from "../core/units.js";
import { decodeBase64 } from "../common/dom.js";

/** Number of equal steps of a turn at which the curves are drawn. */
export const MOTION_POINTS = 720;

/** Curves s (m), s', s'', s''' (m/rad^order) at equal steps of a turn. @typedef {Float64Array[]} Motion */

/** Law of a cam for any ordinates. */
export class DrawnLaw {
  /** @param {Pick<Board, "cam" | "law" | "start">} board */
  constructor({ cam, law, start }) {
    this.name = cam.name;
    this.breaks = law.breaks;
    this.degree = law.degree;
    this.pieces = readPieces(law, new Float64Array(decodeBase64(law.matrices)));
    this.start = this.of(start);
  }

  /** @param {Numbers} ordinates */
  of(ordinates) { return new Law(this.name, this.breaks, pieceOrdinates(this.pieces, this.degree, ordinates)); }

  /** Return the derivative (m) of the lift at point k of a turn with respect to an ordinate. @param {number} k @param {number} index */
  sensitivity(k, index) {
    const angle = (TURN * k) / MOTION_POINTS, i = this.start.pieceAt(angle), { first, count, matrix } = this.pieces[i];
    if (index < first || index >= first + count) return 0;
    const column = Float64Array.from({ length: this.degree + 1 }, (_, row) => matrix[row * count + index - first]);
    return valueAt(column, (angle - this.breaks[i]) / this.start.spans[i]);
  }
}

/** Return the curves of a law. @param {Law} law @returns {Motion} */
export const motionOf = (law) => law.sample(MOTION_POINTS);

/** Return the law of a message. @param {LawData} law */
export const readLaw = ({ name, breaks, ordinates }) => new Law(name, breaks, ordinates.map((piece) => Float64Array.from(piece)));

/** Return the contact force (N) of a mass that follows the cam. @param {Motion} law @param {Mass} rig @param {number} rpm */
export function contactForce([lift, slope, curvature], rig, rpm) {
  return lift.map((s, i) => forceAt([s, slope[i], curvature[i]], rig, rpm * RPM));
}

/** Return the torque (N·m) of the contact force on the cam: F s'. @param {Motion} law @param {Numbers} force */
export const camTorque = ([, slope], force) => slope.map((value, i) => value * force[i]);

/** Return the amplitudes of orders 1 to `count` of one turn. @param {Numbers} values @param {number} count */
export function spectrum(values, count) {
  const n = values.length;
  if (cosine.length !== n) cosine = Float64Array.from({ length: n }, (_, i) => Math.cos((2 * Math.PI * i) / n));
  const amplitudes = new Float64Array(count);
  for (let order = 1; order <= count; order += 1) {
    let [real, imaginary] = [0, 0];
    for (let i = 0; i < n; i += 1) {
      const phase = (order * i) % n;
      real += values[i] * cosine[phase];
      imaginary += values[i] * cosine[(phase + n - n / 4) % n];
    }
    amplitudes[order - 1] = (2 / n) * Math.hypot(real, imaginary);
  }
  return amplitudes;
}
let cosine = new Float64Array(0);
