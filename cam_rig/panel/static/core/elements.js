// Rollers, points and faces of followers, and their contact with the cam, as cam_rig/profile/faces.py.
// Points are [x, y] in the frame of the follower's guide: the cam's axis is the origin, a guided
// follower moves along y, and an arm has its pivot on x. Lengths in m, angles in rad.
import { RefusedError, general } from "./refusal.js";
import { MM } from "./units.js";

/** Product of curvature and distance from the axis at which a pitch curve counts as straight. */
const STRAIGHT_CURVATURE = 1e-10;

/** Motion at one cam angle: s (m), s' (m/rad), s'' (m/rad²). @typedef {number[]} MotionAt */
/**
 * Contact at one cam angle. `rate` (m/rad) is the velocity along the contour, not positive in an
 * undercut. `centre` is that of the roller, or the point, null for a face.
 * @typedef {{contact: Pair, rate: number, pressure: number, centre: Pair | null}} Touch
 */
/**
 * Part of a follower that touches the cam. `origin` (m) and `turn` are those of its outline at s = 0: the
 * roller's centre or the point of the face in the guide, or the pivot and the direction of the arm.
 * @typedef {{origin: Pair, turn: number, touch: (motion: MotionAt) => Touch}} Element
 */

// Complex numbers as pairs.

/** @param {Pair} a @param {Pair} b @returns {Pair} */
export const times = ([a, b], [c, d]) => [a * c - b * d, a * d + b * c];
/** @param {number} angle @param {number} [size] @returns {Pair} */
export const polar = (angle, size = 1) => [size * Math.cos(angle), size * Math.sin(angle)];
/** @param {Pair} a @param {Pair} b complex number, whose conjugate is the factor @returns {Pair} */
const timesConjugate = (a, [c, d]) => times(a, [c, -d]);
/** Return a complex number times i. @param {Pair} a @returns {Pair} */
const turned = ([a, b]) => [-b, a];

/**
 * Return the contact of a roller from its pitch curve (profile thesis, eq. 2.22-2.25 and 2.43-2.46).
 * @param {Pair} centre @param {Pair} tangent @param {Pair} second first and second derivative of the pitch curve
 * @param {number} roller @param {number} pressure @returns {Touch}
 */
function offsetContact(centre, tangent, second, roller, pressure) {
  const speed = Math.hypot(...tangent), [nx, ny] = turned(tangent);
  const bend = -timesConjugate(second, tangent)[1] / speed ** 3;
  const curvature = Math.abs(bend) * Math.hypot(...centre) < STRAIGHT_CURVATURE ? 0 : bend;
  const contact = /** @type {Pair} */ ([centre[0] - (roller * nx) / speed, centre[1] - (roller * ny) / speed]);
  return { contact, rate: (1 - roller * curvature) * speed, pressure, centre };
}

/** Roller or point in a guide (eq. 2.19-2.25). @param {number} roller @param {number} eccentricity @param {number} start height at s = 0 @returns {Element} */
function guidedCentre(roller, eccentricity, start, side = 1) {
  return {
    origin: [side * eccentricity, side * start],
    turn: 0,
    touch([s, slope, curvature]) {
      const height = start + side * s, up = side * slope - eccentricity;
      return offsetContact(
        [side * eccentricity, side * height],
        [side * height, side * up],
        [side * (up + side * slope), side * (side * curvature - height)],
        roller,
        Math.atan2(up, height),
      );
    },
  };
}

/** Face in a guide (eq. 2.14-2.18). @param {number} inclination @param {number} eccentricity @param {number} base distance of the face from the axis at s = 0 @returns {Element} */
function guidedFace(inclination, eccentricity, base) {
  const cosine = Math.cos(inclination), along = polar(inclination);
  return {
    origin: [eccentricity, (base + eccentricity * Math.sin(inclination)) / cosine],
    turn: 0,
    touch([s, slope, curvature]) {
      const distance = base + cosine * s;
      return { contact: times(along, [cosine * slope, distance]), rate: distance + cosine * curvature, pressure: inclination, centre: null };
    },
  };
}

/** Roller or point at the end of an arm (eq. 2.26, 2.30-2.36). @param {number} roller @param {number} arm @param {number} pivot @param {number} start angle at s = 0 @returns {Element} */
function swungCentre(roller, arm, pivot, start, side = 1) {
  return {
    origin: [pivot, 0],
    turn: -start,
    touch([s, slope, curvature]) {
      const turn = 1 + slope / arm, bend = curvature / arm;
      const out = polar(-side * (start + (side * s) / arm), arm);
      const tangent = turned([turn * out[0] - pivot, turn * out[1]]), swing = turned(out);
      const second = /** @type {Pair} */ ([turn ** 2 * out[0] - pivot + bend * swing[0], turn ** 2 * out[1] + bend * swing[1]]);
      const [x, y] = timesConjugate(turned(tangent), [side * swing[0], side * swing[1]]);
      return offsetContact([pivot - out[0], -out[1]], tangent, second, roller, Math.atan2(y, x));
    },
  };
}

/** Face along an arm (eq. 2.26-2.29). @param {number} arm @param {number} offset @param {number} pivot @param {number} start angle at s = 0 @returns {Element} */
function swungFace(arm, offset, pivot, start) {
  return {
    origin: [pivot, 0],
    turn: -start,
    touch([s, slope, curvature]) {
      const angle = start + s / arm, turn = 1 + slope / arm, swing = turn - 1, bend = curvature / arm;
      const high = pivot * Math.sin(angle), wide = pivot * Math.cos(angle), distance = high + offset;
      const radius = distance + ((wide * bend) / turn - high * swing ** 2) / turn ** 2;
      return {
        contact: times(polar(-angle), [(wide * swing) / turn, distance]),
        rate: radius * turn,
        pressure: Math.atan2(offset * turn, wide),
        centre: null,
      };
    },
  };
}

/**
 * Return the elements of the follower that touch the discs of the cam, one or two.
 * @param {FollowerSizes} follower @param {number} stroke sum of the smallest and the largest s
 */
export function elements(follower, stroke) {
  const { type, base_radius: base, roller_radius: roller, eccentricity, inclination } = follower;
  const { arm, pivot_distance: pivot, face_offset: offset, roller_distance: distance, arms_angle: arms } = follower;
  switch (type) {
    case "point":
    case "roller":
    case "constant_diameter":
      return [guidedCentre(roller, eccentricity, heightOnBase(base + roller, eccentricity))];
    case "flat":
    case "inclined_flat":
    case "constant_breadth":
      return [guidedFace(inclination, eccentricity, base)];
    case "oscillating_point":
    case "oscillating_roller":
      return [swungCentre(roller, arm, pivot, armOnBase(base + roller, arm, pivot))];
    case "oscillating_flat":
      return [swungFace(arm, offset, pivot, faceOnBase(base - offset, pivot))];
    case "conjugate": {
      const start = heightOnBase(base + roller, eccentricity);
      return [guidedCentre(roller, eccentricity, start), guidedCentre(roller, -eccentricity, distance === null ? start + stroke : distance - start, -1)];
    }
    default: {
      const start = armOnBase(base + roller, arm, pivot);
      return [swungCentre(roller, arm, pivot, start), swungCentre(roller, arm, pivot, arms === null ? start + stroke / arm : arms - start, -1)];
    }
  }
}

/** @param {number} length in m */
const mm = (length) => general(length * MM, 6);

/** Return the height of a guided centre at s = 0 (eq. 2.19). @param {number} prime @param {number} eccentricity */
function heightOnBase(prime, eccentricity) {
  if (Math.abs(eccentricity) < prime) return Math.sqrt(prime ** 2 - eccentricity ** 2);
  throw new RefusedError(`eccentricity is ${mm(Math.abs(eccentricity))} mm; allowed: less than base and roller radius together, ${mm(prime)} mm`);
}

/** Return the angle of an arm with a roller at s = 0 (eq. 2.34). @param {number} prime @param {number} arm @param {number} pivot */
function armOnBase(prime, arm, pivot) {
  const shortest = Math.abs(pivot - arm), longest = pivot + arm;
  if (shortest < prime && prime < longest) return Math.acos((arm ** 2 + pivot ** 2 - prime ** 2) / (2 * arm * pivot));
  throw new RefusedError(`out of reach at the base circle: its centre is ${mm(prime)} mm from the cam's axis; allowed: between ${mm(shortest)} `
    + `and ${mm(longest)} mm with an arm of ${mm(arm)} mm on a pivot at ${mm(pivot)} mm`);
}

/** Return the angle of an arm with a face at s = 0 (eq. 2.27). @param {number} reach base radius less offset @param {number} pivot */
function faceOnBase(reach, pivot) {
  if (Math.abs(reach) < pivot) return Math.asin(reach / pivot);
  throw new RefusedError(`out of reach at the base circle: its radius less the face's offset is ${mm(reach)} mm; `
    + `allowed: less than the pivot's distance, ${mm(pivot)} mm`);
}
