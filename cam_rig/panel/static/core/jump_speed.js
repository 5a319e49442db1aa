// Lowest cam speed at which the contact force of one rigid mass is zero, as cam_rig/dynamics/jump.
// Branch and bound over parts of the law: a part is discarded if its ordinates prove that the force is
// not negative in it, up to the lowest speed so far ((37) of docs/proofs.md).
/** @import { Law } from "./law.js" */
import { TIE_RTOL } from "./figures.js";
import { halve, largest } from "./polynomials.js";
import { RefusedError, general } from "./refusal.js";
import { DEGREE } from "./units.js";

/** Largest number of halvings of a piece, and of all pieces. */
const MAX_HALVINGS = 40, MAX_PARTS = 1 << 16;
/** Negative force that counts as rounding, relative to the sum of the magnitudes of its terms. */
const FORCE_RTOL = 1e-14;

/** Return the jump speed (rad/s): infinite if contact is always kept, 0 if it is always lost. @param {Law} law @param {Mass} rig */
export function jumpSpeed(law, rig) {
  requireSmooth(law);
  const { spring_stiffness: stiffness, preload, mass, damping } = rig;
  const rounding = TIE_RTOL * stiffness * Math.max(...law.orders[0].map(largest));
  if (preload + stiffness * law.low.value < -rounding) return 0;
  const follower = { mass, damping, stiffness, preload: Math.max(preload, rounding) };
  return findZero(law, follower);
}

/** Throw a RefusedError if s' jumps, which needs an infinite force. @param {Law} law */
function requireSmooth(law) {
  const [jump] = law.velocityJumps().sort((a, b) => Math.abs(b.step) - Math.abs(a.step));
  if (!jump) return;
  const step = general(jump.step, 3), angle = general(jump.angle * DEGREE, 3);
  throw new RefusedError(`law '${law.name}': velocity jumps by ${step} m/rad at ${angle}°, an infinite force in this model; `
    + "allowed: segments that join with one slope");
}

/** @typedef {{mass: number, damping: number, stiffness: number, preload: number}} Follower */

/** @param {Law} law @param {Follower} follower */
function findZero(law, follower) {
  let speed = Infinity, halved = 0;
  const visit = (/** @type {Float64Array[]} */ [s, slope, curvature], /** @type {number} */ i) => {
    speed = Math.min(speed, zeroAt(follower, s[i], slope[i], curvature[i]));
  };
  const pieces = law.spans.length, motion = (/** @type {number} */ i) => law.orders.slice(0, 3).map((order) => order[i]);
  for (let i = 0; i < pieces; i += 1) for (const end of [0, law.size - 1]) visit(motion(i), end);
  for (let i = 0; i < pieces; i += 1) {
    const parts = [{ part: motion(i), depth: 0 }];
    while (parts.length && halved < MAX_PARTS) {
      const { part, depth } = /** @type {typeof parts[0]} */ (parts.pop());
      if (depth >= MAX_HALVINGS || !mayPull(follower, part, speed)) continue;
      halved += 1;
      const halves = part.map(halve);
      const [left, right] = [0, 1].map((side) => halves.map((pair) => pair[side]));
      visit(right, 0);
      parts.push({ part: right, depth: depth + 1 }, { part: left, depth: depth + 1 });
    }
  }
  return speed;
}

/** Return the lowest speed with a force of zero at one angle. @param {Follower} follower @param {number} s @param {number} slope @param {number} curvature */
function zeroAt({ mass, damping, stiffness, preload }, s, slope, curvature) {
  const a = mass * curvature, b = damping * slope, c = stiffness * s + preload;
  const discriminant = b * b - 4 * a * c;
  if (discriminant < 0 || c <= 0) return Infinity;
  const divisor = Math.sqrt(discriminant) - b;
  return divisor > 0 ? (2 * c) / divisor : Infinity;
}

/** Return true if the force may be negative in a part of the law, at a speed from 0 on. @param {Follower} follower @param {Float64Array[]} part @param {number} speed */
function mayPull({ mass, damping, stiffness, preload }, [s, slope, curvature], speed) {
  return s.some((value, j) => {
    const a = mass * curvature[j], b = damping * slope[j], c = stiffness * value + preload;
    if (speed === Infinity) return a < 0 || b < 0 || c < 0;
    let change = Math.min((a * speed + b) * speed, 0);
    if (a > 0) {
      const vertex = Math.min(Math.max((-0.5 * b) / a, 0), speed);
      change = Math.min(change, (a * vertex + b) * vertex);
    }
    return change + c < -FORCE_RTOL * ((Math.abs(a) * speed + Math.abs(b)) * speed + Math.abs(c));
  });
}
