// Contours of a cam by kinematic inversion, as cam_rig/profile/disc.py.
/** @import { Law } from "./law.js" */
/** @import { Element } from "./elements.js" */
import { elements, polar, times } from "./elements.js";
import { TURN } from "./units.js";

/** Number of points of a contour. */
export const CONTOUR_POINTS = 360;

/** Contour of a disc at equal steps of the cam angle, in the cam frame, m and rad. @typedef {{element: Element, points: Points, pitch: Points | null, rate: number[], pressure: number[]}} Contour */

/** Return the contours of a cam, one per disc. Throws a RefusedError if the follower does not reach the base circle. @param {FollowerSizes} follower @param {Law} law @returns {Contour[]} */
export function contours(follower, law, count = CONTOUR_POINTS) {
  const curves = law.sample(count, 2);
  return elements(follower, law.low.value + law.high.value).map((element) => contour(element, curves, count));
}

/** @param {Element} element @param {Float64Array[]} curves @param {number} count @returns {Contour} */
function contour(element, curves, count) {
  const touches = Array.from({ length: count }, (_, i) => element.touch(curves.map((curve) => curve[i])));
  const inCam = (/** @type {Pair[]} */ points) => {
    const turned = points.map((point, i) => times(point, polar(-i * (TURN / count))));
    return /** @type {Points} */ ([turned.map(([x]) => x), turned.map(([, y]) => y)]);
  };
  return {
    element,
    points: inCam(touches.map((touch) => touch.contact)),
    pitch: touches[0].centre ? inCam(touches.map((touch) => /** @type {Pair} */ (touch.centre))) : null,
    rate: touches.map((touch) => touch.rate),
    pressure: touches.map((touch) => Math.abs(touch.pressure)),
  };
}
