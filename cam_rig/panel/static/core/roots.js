// Zeros of polynomials in Bernstein form on u ∈ [0, 1], as cam_rig/laws/polynomials.py. No sign
// change is missed: a part is discarded only if its ordinates do not change sign.
import { EPS, derivative, halve, valueAt } from "./polynomials.js";

/** Smallest width of a part of [0, 1] that is halved. Below it doubles do not separate two zeros. */
const MIN_PART_WIDTH = 2 ** -46;
/** Relative width of a bracket at which a zero is found. */
const BRACKET_RTOL = 4 * EPS;
/** Largest relative size of a Newton step that cannot change a zero, and of steps that are rounding if they stop shrinking. */
const NEGLIGIBLE_STEP = 2 ** -55, ROUNDING_STEP = 2 ** -40;
/** Largest number of Newton steps, for a zero next to 0. */
const MAX_STEPS = 2000;

/** Return the zero of a polynomial that changes sign once. It stays in a bracket. @param {Float64Array} ordinates */
function singleRoot(ordinates) {
  const slopes = derivative(ordinates), first = ordinates[0];
  let low = 0, high = 1, step = 1, converges = false, u = first / (first - ordinates[ordinates.length - 1]);
  for (let i = 0; i < MAX_STEPS; i += 1) {
    const value = valueAt(ordinates, u);
    if (value === 0) return u;
    if ((value < 0) === (first < 0)) low = u;
    else high = u;
    let next = u - value / valueAt(slopes, u);
    const newtonStep = Math.abs(next - u), isInside = low < next && next < high, shrinks = newtonStep <= 0.5 * step;
    if (converges && isInside && newtonStep * (newtonStep / step) ** 2 <= NEGLIGIBLE_STEP * u) return next;
    if (converges && !shrinks && step <= ROUNDING_STEP * u) return u;
    converges = isInside && shrinks;
    if (!converges) next = 0.5 * (low + high);
    step = Math.abs(next - u);
    u = next;
    if (high - low <= BRACKET_RTOL * u) return u;
  }
  return u;
}

/** Return the number of sign changes of ordinates, at least that of the zeros in (0, 1). @param {Float64Array} ordinates */
function signChanges(ordinates) {
  let changes = 0, last = 0;
  for (const value of ordinates) {
    if (value === 0) continue;
    if (last !== 0 && value < 0 !== last < 0) changes += 1;
    last = value;
  }
  return changes;
}

/** @param {number} a @param {number} b */
const areOpposite = (a, b) => (a < 0 && b > 0) || (b < 0 && a > 0);

/**
 * Return all u in (low, high) at which a polynomial on [low, high] changes sign, in order.
 * @param {Float64Array} ordinates @returns {number[]}
 */
export function crossings(ordinates, low = 0, high = 1) {
  const changes = signChanges(ordinates), crosses = areOpposite(ordinates[0], ordinates[ordinates.length - 1]);
  if (changes === 0) return [];
  if (changes === 1 && crosses) return [low + (high - low) * singleRoot(ordinates)];
  const middle = 0.5 * (low + high);
  if (high - low <= MIN_PART_WIDTH) return crosses ? [middle] : [];
  const [left, right] = halve(ordinates);
  const before = left.findLast((value) => value !== 0), after = right.find((value) => value !== 0);
  const atMiddle = right[0] === 0 && areOpposite(before ?? 0, after ?? 0) ? [middle] : [];
  return [...crossings(left, low, middle), ...atMiddle, ...crossings(right, middle, high)];
}

/** Return the parts of [0, 1] in which a polynomial is negative. @param {Float64Array} ordinates @returns {[number, number][]} */
export function negativeIntervals(ordinates) {
  const edges = [0, ...crossings(ordinates), 1];
  const parts = edges.slice(1).map((edge, i) => /** @type {[number, number]} */ ([edges[i], edge]));
  return parts.filter(([start, end]) => valueAt(ordinates, 0.5 * (start + end)) < 0);
}

/**
 * Return the zero u ∈ [0, 1] after which a polynomial is below −`rounding`, or -1 without such a zero.
 *
 * It is 0 if the polynomial starts below −`rounding`, or below zero by less and continues to fall.
 * @param {Float64Array} ordinates @param {number} rounding
 */
export function findFall(ordinates, rounding) {
  if (ordinates.every((value) => value >= -rounding)) return -1;
  if (ordinates[0] < -rounding) return 0;
  const [below] = crossings(ordinates.map((value) => value + rounding));
  if (below === undefined) return -1;
  return crossings(ordinates).findLast((u) => u <= below) ?? 0;
}
