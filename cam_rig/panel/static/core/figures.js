// Figures of a law: extreme values of its derivatives from their zeros, and the class of its roughest
// joint, as cam_rig/laws/law.py and cam_rig/panel/board/figures.py.
/** @import { Law } from "./law.js" */
import { EPS, largest, valueAt } from "./polynomials.js";
import { crossings } from "./roots.js";
import { DEGREE, TURN } from "./units.js";

/** Difference of extreme values that counts as rounding, relative to the largest ordinate. */
export const TIE_RTOL = 1e-12;
/** Jump that is no jump, relative to the peak of the derivative on both sides. */
const JUMP_RTOL = 1e-6;
/** Rounding of a derivative, in units of the rounding of s in a piece of this span. */
const LEVEL_ROUNDINGS = 16;
/** Highest class of a joint. */
const MAX_CONTINUITY = 4;

/** Value (m/rad^order) and cam angle (rad). @typedef {{value: number, angle: number}} ExtremeAt */

/** Return the smallest and the largest value of a derivative in pieces of a law (default: all), the first of equal values. @param {Law} law @param {number} order @param {number[]} [pieces] @returns {[ExtremeAt, ExtremeAt]} */
export function extremes({ orders, breaks, spans }, order, pieces = [...spans.keys()]) {
  const values = orders[order], slopes = orders[order + 1], tie = TIE_RTOL * Math.max(...values.map(largest));
  let low = { value: values[pieces[0]][0], angle: breaks[pieces[0]] }, high = low;
  for (const i of pieces) {
    const ends = [0, ...crossings(slopes[i]), 1].map((u) => ({ value: valueAt(values[i], u), angle: breaks[i] + spans[i] * u }));
    const lowest = ends.reduce((least, end) => (end.value < least.value ? end : least));
    const highest = ends.reduce((most, end) => (end.value > most.value ? end : most));
    if (lowest.value < low.value - tie) low = lowest;
    if (highest.value > high.value + tie) high = highest;
  }
  return [low, high];
}

/** Return the jump of a derivative at the start of each piece. @param {Law} law @param {number} order */
export function jumps({ orders, size }, order) {
  return orders[order].map((piece, i, pieces) => piece[0] - pieces[i ? i - 1 : pieces.length - 1][size - 1]);
}

/** Return the highest derivative that is continuous at all joints, -1 for a step of s. @param {Law} law */
function continuity(law) {
  const level = Math.max(...law.orders[0].map(largest));
  for (let order = 0; order <= MAX_CONTINUITY; order += 1) {
    const limits = law.orders[order].map((piece, i) => {
      const rounding = LEVEL_ROUNDINGS * EPS * level * ((2 * (law.size - 1)) / law.spans[i]) ** order;
      return order ? Math.max(JUMP_RTOL * largest(piece), rounding) : JUMP_RTOL * level;
    });
    const isBroken = jumps(law, order).some((jump, i) => Math.abs(jump) > Math.max(limits[i], limits[i ? i - 1 : limits.length - 1]));
    if (isBroken) return order - 1;
  }
  return MAX_CONTINUITY;
}

/** Return the peaks of s' to s''' over the turn, and the class of the roughest joint. @param {Law} law @param {Rise | null} rise @returns {Figures} */
export function lawFigures(law, rise) {
  const inRise = rise && [...law.spans.keys()].filter((i) => {
    const ahead = law.breaks[i] + 0.5 * law.spans[i] - rise.start;
    return ahead - Math.floor(ahead / TURN) * TURN < rise.span;
  });
  const at = (/** @type {ExtremeAt} */ { value, angle }) => ({ value, angle_deg: (angle * DEGREE) % 360 });
  return {
    continuity: continuity(law),
    peaks: [1, 2, 3].map((order) => {
      const [least, most] = extremes(law, order);
      const size = rise && Math.max(...extremes(law, order, inRise ?? []).map(({ value }) => Math.abs(value)));
      return { largest: at(most), least: at(least), coefficient: rise && ((size ?? 0) * rise.span ** order) / rise.height };
    }),
  };
}
