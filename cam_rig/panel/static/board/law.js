// The law in the page: s to s''' are fixed matrices times the ordinates, and the kinetostatic
// contact force is their sum. All in SI.
import { decode } from "../common/dom.js";

/** Little-endian float64 from base64. @param {string} text */
export const doubles = (text) => new Float64Array(decode(text));

/** The table of a board as it was sent, its arrays decoded. @param {Board} board */
export function readTable(board) {
  const table = doubles(board.table);
  const first = Uint32Array.from(doubles(board.first));
  const { points, orders } = board;
  return { table, first, constant: doubles(board.constant), points, orders, width: table.length / points / orders };
}

/** @typedef {ReturnType<typeof readTable>} MotionTable */
/**
 * s (m), s', s'', s''' (m/rad^order) at equal steps of a turn, one Float64Array each.
 * @param {MotionTable} table @param {Numbers} ordinates
 */
export function motion({ table, first, constant, points, orders, width }, ordinates) {
  const found = [];
  for (let order = 0; order < orders; order += 1) {
    const values = new Float64Array(points);
    for (let k = 0; k < points; k += 1) {
      const row = (order * points + k) * width;
      let total = constant[order * points + k];
      for (let i = 0; i < width; i += 1) total += table[row + i] * ordinates[first[k] + i];
      values[k] = total;
    }
    found.push(values);
  }
  return found;
}

/**
 * How far (m) the lift at angle index k moves for one ordinate more at `index`.
 * @param {MotionTable} table @param {number} k @param {number} index
 */
export function pull({ table, first, width }, k, index) {
  const column = index - first[k];
  return column >= 0 && column < width ? table[k * width + column] : 0;
}

/** Contact force (N): m s'' Ω² + c s' Ω + k s + preload. @param {Float64Array[]} law @param {Mass} rig @param {number} rpm */
export function contactForce([s, slope, bend], rig, rpm) {
  const speed = (rpm * 2 * Math.PI) / 60;
  const [inertia, drag] = [rig.mass * speed * speed, rig.damping * speed];
  return s.map((lift, i) => inertia * bend[i] + drag * slope[i] + rig.spring_stiffness * lift + rig.preload);
}

/** Amplitudes of orders 1 to `count` of one turn. @param {Numbers} values @param {number} count */
export function spectrum(values, count) {
  const n = values.length;
  if (turn.length !== n) turn = Float64Array.from({ length: n }, (_, i) => Math.cos((2 * Math.PI * i) / n));
  const found = new Float64Array(count);
  for (let order = 1; order <= count; order += 1) {
    let [real, imaginary] = [0, 0];
    for (let i = 0; i < n; i += 1) {
      const at = (order * i) % n;
      real += values[i] * turn[at];
      imaginary += values[i] * turn[(at + n - n / 4) % n];
    }
    found[order - 1] = (2 / n) * Math.hypot(real, imaginary);
  }
  return found;
}
let turn = new Float64Array(0);
