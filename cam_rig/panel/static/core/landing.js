// Landing of a flying mass, as cam_rig/dynamics/events/approach.py. In a window the acceleration of the
// gap is a polynomial, which is integrated twice from the gap and its rate at the start of the window.
// At a lift-off both are known exactly, and the zero there is divided out. So no landing is missed.
/** @import { Law } from "./law.js" */
/** @import { FreeFlight } from "./free_flight.js" */
import { EPS, elevate, integrate, largest, restrict, valueAt } from "./polynomials.js";
import { findFall } from "./roots.js";
import { TURN } from "./units.js";

/** Rounding errors of an acceleration or a gap, and of a cam angle, as multiples of the float epsilon. */
const ACCELERATION_ROUNDING_ERRORS = 64, ANGLE_ROUNDING_ERRORS = 4;
/** Largest relative position in a piece of the law, because its end belongs to the next piece. */
const MAX_PIECE_POSITION = 1 - 2 ** -53;
/** Difference of cam angles (rad) that counts as none, and the longest time (s) that it may take. */
export const SAME_ANGLE = 1e-12;
const MAX_JUMP_ROUNDING_S = 1e-7;
/** Shortest step of the search, s. */
const MIN_WINDOW_S = 1e-300;

/** Cam of a law from an angle (rad) on, at a speed (rad/s). @typedef {{law: Law, speed: number, angle: number}} Cam */
/** Gap to the cam at a time of a flight. @typedef {{time: number, gap: number, rate: number, rounding: number, hasLanded: boolean}} Gap */

/**
 * Return the gap (m) at the landing, or at `limit` (s) without a landing.
 *
 * A velocity jump of the cam may be at `limit`. Within rounding of it the cam is that before the jump.
 * @param {FreeFlight} flight @param {Cam} cam @param {number} gap @param {number} rate at the start, m and m/s
 * @param {number} startRounding uncertainty of the gap's acceleration at a lift-off, m/s² @param {number} limit @returns {Gap}
 */
export function findLanding(flight, cam, gap, rate, startRounding, limit) {
  const atJump = Math.min(Math.max(SAME_ANGLE / cam.speed, 4 * angleRoundingTime(cam)), MAX_JUMP_ROUNDING_S);
  let point = { time: 0, gap, rate, rounding: 0, hasLanded: false };
  while (point.time < limit && !point.hasLanded) {
    const lag = point.time > limit - atJump ? atJump : 0;
    point = searchWindow(flight, cam, point, startRounding, limit, lag);
  }
  return point;
}

/** Return the time (s) in which the cam turns by the rounding error of its angle. @param {Cam} cam */
const angleRoundingTime = ({ angle, speed }) => (ANGLE_ROUNDING_ERRORS * EPS * (Math.abs(angle) + TURN)) / speed;

/** Return the piece of the law just after a time, and its ends as cam angles. @param {Cam} cam @param {number} time @returns {[number, number, number]} */
function pieceFrom(cam, time) {
  const { law: { breaks, spans }, law } = cam, angle = cam.angle + cam.speed * time;
  const turn = Math.floor(angle / TURN) * TURN, piece = law.pieceAt(angle - turn);
  const low = breaks[piece] + turn, high = breaks[piece + 1] + turn;
  if ((high - cam.angle) / cam.speed > time + angleRoundingTime(cam)) return [piece, low, high];
  const next = (piece + 1) % spans.length;
  return [next, high, high + spans[next]];
}

/**
 * Search in the piece of the law that follows the time of the point, less a lag (s).
 * @param {FreeFlight} flight @param {Cam} cam @param {Gap} point @param {number} startRounding @param {number} limit @param {number} lag @returns {Gap}
 */
function searchWindow(flight, cam, point, startRounding, limit, lag) {
  const { law, speed } = cam, { time } = point;
  const [piece, low, high] = pieceFrom(cam, time - lag);
  const end = Math.min(time + flight.window, limit, lag ? Infinity : (high - cam.angle) / speed);
  if (!(end > time)) return { ...point, time: time + Math.max(EPS * time, MIN_WINDOW_S) };
  const duration = end === time + flight.window ? flight.window : end - time, span = high - low;
  const position = (/** @type {number} */ at, /** @type {number} */ max) => Math.min(Math.max((cam.angle + speed * at - low) / span, 0), max);
  const first = position(time, MAX_PIECE_POSITION), last = Math.max(first, position(end, 1));
  const curvature = restrict(law.orders[2][piece], first, last), own = flight.accelerationOrdinates(time, duration);
  // Rounding error of s'' itself, and that of s before it is differentiated twice.
  const differences = (law.size - 1) / law.spans[piece];
  const curvatureSize = ACCELERATION_ROUNDING_ERRORS * largest(law.orders[2][piece]) + differences ** 2 * law.bounds[0];
  const rounding = EPS * (ACCELERATION_ROUNDING_ERRORS * largest(own) + speed ** 2 * curvatureSize);
  const size = Math.max(own.length, curvature.length), bend = elevate(curvature, size);
  const acceleration = elevate(own, size).map((value, i) => value - speed ** 2 * bend[i]);
  const rates = integrate(acceleration, duration, point.rate), gaps = integrate(rates, duration, point.gap);
  const steepest = Math.max(...[0, 1].map((i) => Math.abs(acceleration[i + 1] - acceleration[i])));
  const timeRounding = ((size - 1) / duration) * steepest * angleRoundingTime(cam);
  const u = firstFall(gaps, point, duration, rounding + startRounding + timeRounding);
  if (u >= 0) return { time: time + u * duration, gap: 0, rate: valueAt(rates, u), rounding: 0, hasLanded: true };
  return { time: end, gap: gaps[size + 1], rate: rates[size], rounding: point.rounding + duration ** 2 * rounding, hasLanded: false };
}

/**
 * Return the relative time u at which the gap falls below its rounding error, or -1.
 * @param {Float64Array} gaps @param {Gap} point @param {number} duration @param {number} accelerationRounding
 */
function firstFall(gaps, point, duration, accelerationRounding) {
  const rounding = point.rounding + ACCELERATION_ROUNDING_ERRORS * EPS * largest(gaps);
  if (point.gap !== 0 || point.rounding !== 0 || point.rate < 0) return findFall(gaps, rounding);
  const once = divideByU(gaps), onceRounding = duration ** 2 * accelerationRounding;
  if (point.rate === 0) return findFall(divideByU(once), onceRounding);
  return findFall(once, Math.min(onceRounding, 0.5 * duration * point.rate));
}

/** Return a polynomial with p(0) = 0 divided by u. @param {Float64Array} ordinates */
function divideByU(ordinates) {
  const degree = ordinates.length - 1;
  return Float64Array.from({ length: degree }, (_, i) => ordinates[i + 1] * (degree / (i + 1)));
}
