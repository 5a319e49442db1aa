// The law in the page: s to s''' are fixed matrices times the ordinates, and the kinetostatic
// contact force is a combination of them. All values are in SI units.
import { decodeBase64 } from "../common/dom.js";

/** Return little-endian float64 values of base64. @param {string} base64 */
const doubles = (base64) => new Float64Array(decodeBase64(base64));

/** Return the motion table of a board with decoded arrays. @param {Board} board */
export function readTable(board) {
  const table = doubles(board.table);
  const first = Uint32Array.from(doubles(board.first));
  const { points, orders } = board;
  return { table, first, constant: doubles(board.constant), points, orders, width: table.length / points / orders };
}

/** @typedef {ReturnType<typeof readTable>} MotionTable */
/** Curves s (m), s', s'', s''' (m/rad^order) at equal steps of a turn. @typedef {Float64Array[]} Motion */

/** Return the motion in the base64 of a message. @param {string} base64 @param {number} points @returns {Motion} */
export function decodeMotion(base64, points) {
  const values = doubles(base64);
  return Array.from({ length: values.length / points }, (_, order) => values.subarray(order * points, (order + 1) * points));
}

/** Return the motion of ordinates. @param {MotionTable} table @param {Numbers} ordinates @returns {Motion} */
export function motion({ table, first, constant, points, orders, width }, ordinates) {
  const curves = [];
  for (let order = 0; order < orders; order += 1) {
    const values = new Float64Array(points);
    for (let k = 0; k < points; k += 1) {
      const row = (order * points + k) * width;
      let sum = constant[order * points + k];
      for (let i = 0; i < width; i += 1) sum += table[row + i] * ordinates[first[k] + i];
      values[k] = sum;
    }
    curves.push(values);
  }
  return curves;
}

/**
 * Return the derivative (m) of the lift at angle index k with respect to an ordinate.
 * @param {MotionTable} table @param {number} k @param {number} index
 */
export function sensitivity({ table, first, width }, k, index) {
  const column = index - first[k];
  return column >= 0 && column < width ? table[k * width + column] : 0;
}

/** Return the contact force (N): m s'' Ω² + c s' Ω + k s + preload. @param {Motion} law @param {Mass} rig @param {number} rpm */
export function contactForce([lift, slope, curvature], rig, rpm) {
  const speed = (rpm * 2 * Math.PI) / 60;
  const inertia = rig.mass * speed * speed, damping = rig.damping * speed;
  return lift.map((s, i) => inertia * curvature[i] + damping * slope[i] + rig.spring_stiffness * s + rig.preload);
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
