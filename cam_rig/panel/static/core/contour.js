// Contours of a cam with their faults, as cam_rig/profile and cam_rig/panel/board/drawable.py.
/** @import { Law } from "./law.js" */
/** @import { Element } from "./elements.js" */
import { elements, polar } from "./elements.js";
import { RefusedError, TURN } from "./law.js";
import { jumpSpeed } from "./jump_speed.js";

/** Number of points of a contour. */
export const CONTOUR_POINTS = 360;
/** Degrees per radian, mm per m, and rad/s per rpm. */
const DEGREE = 180 / Math.PI, MM = 1e3, RPM = TURN / 60;

/** Contour of a disc at equal steps of the cam angle, in the cam frame, m and rad. @typedef {{points: Points, pitch: Points | null, rate: number[], pressure: number[]}} Contour */

/** Return the contours of a cam, one per disc. Throws a RefusedError if the follower does not reach the base circle. @param {FollowerSizes} follower @param {Law} law @returns {Contour[]} */
export function contours(follower, law, count = CONTOUR_POINTS) {
  const curves = law.sample(count, 2);
  return elements(follower, law.low.value + law.high.value).map((element) => contour(element, curves, count));
}

/** @param {Element} element @param {Float64Array[]} curves @param {number} count @returns {Contour} */
function contour(element, curves, count) {
  const touches = Array.from({ length: count }, (_, i) => element.touch(curves.map((curve) => curve[i])));
  const inCam = (/** @type {Pair[]} */ points) => /** @type {Points} */ (points.map(([x, y], i) => {
    const [cosine, sine] = polar((TURN * i) / count);
    return [x * cosine + y * sine, y * cosine - x * sine];
  }).reduce((out, [x, y]) => { out[0].push(x); out[1].push(y); return out; }, /** @type {Points} */ ([[], []])));
  return {
    points: inCam(touches.map((touch) => touch.contact)),
    pitch: touches[0].centre ? inCam(touches.map((touch) => /** @type {Pair} */ (touch.centre))) : null,
    rate: touches.map((touch) => touch.rate),
    pressure: touches.map((touch) => Math.abs(touch.pressure)),
  };
}

/** @param {Points} points in m @returns {Points} in mm */
const millimetres = ([xs, ys]) => [xs.map((x) => MM * x), ys.map((y) => MM * y)];

/** Return the fast results of a law: contours, their faults, and the jump speed of one rigid mass. @param {FollowerSizes} follower @param {Law} law @param {Mass} rig */
export function evaluateFast(follower, law, rig) {
  const jump_rigid = pageValue(() => jumpSpeed(law, rig) / RPM);
  /** @type {{discs: Disc[], faults: Fault[], warnings: Fault[], jump_rigid: PageValue, pressure: FastResults["pressure"]}} */
  const results = { discs: [], faults: [], warnings: [], jump_rigid, pressure: null };
  /** @type {Contour[]} */
  let all;
  try {
    all = contours(follower, law);
  } catch (error) {
    return { ...results, faults: [{ key: /** @type {const} */ ("error"), message: refusal(error) }] };
  }
  const allowed = follower.allowed_pressure, angle = (/** @type {number} */ i) => (360 * i) / CONTOUR_POINTS;
  for (const { points, pitch, rate, pressure } of all) {
    const undercut = indices(rate, (value) => value <= 0), steep = indices(pressure, (value) => value > allowed);
    results.discs.push({ points: millimetres(points), pitch: pitch && millimetres(pitch), undercut, steep });
    if (undercut.length) results.faults.push({ key: "undercut", angle_deg: angle(rate.indexOf(Math.min(...rate))) });
    const max = Math.max(...pressure), worst = { value_deg: max * DEGREE, allowed_deg: allowed * DEGREE };
    if (steep.length) results.warnings.push({ key: "pressure", angle_deg: angle(pressure.indexOf(max)), ...worst });
    if (!results.pressure || worst.value_deg > results.pressure.value_deg) results.pressure = worst;
  }
  return results;
}

/** @param {number[]} values @param {(value: number) => boolean} condition */
const indices = (values, condition) => values.flatMap((value, i) => (condition(value) ? [i] : []));

/** Return a value for the page, or the reason why there is none. It is empty for infinity. @param {() => number} compute @returns {PageValue} */
function pageValue(compute) {
  try {
    const value = compute();
    return Number.isFinite(value) ? { value } : {};
  } catch (error) {
    return { message: refusal(error) };
  }
}

/** Return the message of a RefusedError. @param {unknown} error */
function refusal(error) {
  if (error instanceof RefusedError) return error.message;
  throw error;
}
