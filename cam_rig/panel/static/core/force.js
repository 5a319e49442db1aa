// Contact force m s'' Ω² + c s' Ω + k s + preload of one rigid mass that follows the cam.
/** @import { Law } from "./law.js" */
import { EPS } from "./polynomials.js";
import { negativeIntervals } from "./roots.js";
import { TURN } from "./units.js";

/** Rounding error of a force, as a multiple of the float epsilon of the sum of its largest terms. */
const ROUNDING_ERRORS = 16;
/** Cam angle (rad) below which two ranges without contact are one. */
const SAME_ANGLE = 1e-15 * TURN;

/** Return the weights of s, s' and s'' in the force. @param {Mass} rig @param {number} speed rad/s */
const weights = (rig, speed) => [rig.spring_stiffness, rig.damping * speed, rig.mass * speed ** 2];

/** Return the force (N) for s (m), s' (m/rad) and s'' (m/rad²). @param {number[]} motion @param {Mass} rig @param {number} speed rad/s */
export function forceAt([s, slope, curvature], rig, speed) {
  const [k, c, m] = weights(rig, speed);
  return m * curvature + c * slope + k * s + rig.preload;
}

/** Return a bound of the rounding error of the force, N. @param {Law} law @param {Mass} rig @param {number} speed rad/s */
export function forceRounding(law, rig, speed) {
  const size = weights(rig, speed).reduce((sum, weight, order) => sum + weight * law.bounds[order], rig.preload);
  return ROUNDING_ERRORS * EPS * size;
}

/** Return the ranges [start, end] of the cam angle (rad) with a negative force, where contact is lost. @param {Law} law @param {Mass} rig @param {number} speed rad/s */
export function lossIntervals(law, rig, speed) {
  /** @type {Pair[]} */
  const losses = [];
  for (let i = 0; i < law.spans.length; i += 1) {
    const [lift, slope, curvature] = law.orders.map((order) => order[i]);
    const force = lift.map((s, j) => forceAt([s, slope[j], curvature[j]], rig, speed));
    if (!force.some((value) => value < 0)) continue;
    for (const part of negativeIntervals(force)) {
      const [start, end] = part.map((u) => law.breaks[i] + u * law.spans[i]);
      const last = losses.at(-1);
      if (last && start <= last[1] + SAME_ANGLE) last[1] = end;
      else losses.push([start, end]);
    }
  }
  return losses;
}
