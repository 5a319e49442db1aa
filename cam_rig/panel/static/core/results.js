// Results of a law that are computed for each change, as cam_rig/panel/board/evaluation.py.
/** @import { Contour } from "./contour.js" */
/** @import { Law } from "./law.js" */
import { CONTOUR_POINTS, contours } from "./contour.js";
import { lawFigures } from "./figures.js";
import { jumpSpeed } from "./jump_speed.js";
import { RefusedError } from "./refusal.js";
import { DEGREE, MM, RPM } from "./units.js";

/** @param {Points} points in m @returns {Points} in mm */
const millimetres = ([xs, ys]) => [xs.map((x) => MM * x), ys.map((y) => MM * y)];

/**
 * Return the fast results of a law: its figures, contours, their faults, and the jump speed of one rigid mass.
 * @param {StaticCam} cam with the present base radius @param {Law} law @param {Mass} rig @returns {Omit<FastResults, "version">}
 */
export function evaluateFast({ follower, picture, rise }, law, rig) {
  const jump_rigid = pageValue(() => jumpSpeed(law, rig) / RPM), figures = lawFigures(law, rise);
  /** @type {Contour[]} */
  let all;
  try {
    all = contours(follower, law);
  } catch (error) {
    const faults = [{ key: /** @type {const} */ ("error"), message: refusal(error) }];
    return { figures, discs: [], follower: null, faults, warnings: [], jump_rigid, pressure: null };
  }
  const [{ element: { origin, turn } }] = all, base = MM * follower.base_radius;
  const moved = { base, origin: /** @type {Pair} */ (origin.map((x) => MM * x)), turn, max_lift: MM * law.high.value };
  const checked = all.map((contour) => checkDisc(contour, follower.allowed_pressure));
  return {
    figures,
    discs: checked.map(({ disc }) => disc),
    follower: { ...picture, ...moved },
    faults: checked.flatMap(({ fault }) => fault),
    warnings: checked.flatMap(({ warning }) => warning),
    jump_rigid,
    pressure: checked.map(({ pressure }) => pressure).reduce((worst, next) => (next.value_deg > worst.value_deg ? next : worst)),
  };
}

/** Return the disc of a contour for the page, with its undercut and its pressure angle. @param {Contour} contour @param {number} allowed */
function checkDisc({ points, pitch, rate, pressure }, allowed) {
  const angle = (/** @type {number} */ i) => (360 * i) / CONTOUR_POINTS, max = Math.max(...pressure);
  const undercut = indices(rate, (value) => value <= 0), steep = indices(pressure, (value) => value > allowed);
  const worst = { value_deg: max * DEGREE, allowed_deg: allowed * DEGREE };
  return {
    disc: { points: millimetres(points), pitch: pitch && millimetres(pitch), undercut, steep },
    fault: undercut.length ? [{ key: /** @type {const} */ ("undercut"), angle_deg: angle(rate.indexOf(Math.min(...rate))) }] : [],
    warning: steep.length ? [{ key: /** @type {const} */ ("pressure"), angle_deg: angle(pressure.indexOf(max)), ...worst }] : [],
    pressure: worst,
  };
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
