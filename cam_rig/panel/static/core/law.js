// Motion law of a cam: s (m) over one turn, as polynomial pieces in Bernstein form, and its derivatives
// by the cam angle. Each piece is a fixed matrix times the ordinates of the drawing board.
import { extremes, jumps } from "./figures.js";
import { derivative, elevate, largest, valueAt } from "./polynomials.js";
import { TURN } from "./units.js";

/** Smallest jump of s' that is not rounding: relative to the lift, and to the slopes on both sides. */
const VELOCITY_JUMP = 1e-9, SLOPE_ROUNDING = 1e-12;
/** Distance of a sample from a joint at which it counts as on the joint, relative to the step of the samples. */
const AT_SAMPLE = 1e-6;

/** Polynomial piece: `matrix` (rows of `count`) times the ordinates from `first` on, or constant. @typedef {{first: number, count: number, matrix: Float64Array, dwell: number}} Piece */

/** Return the pieces of a board's law. @param {BoardLaw} law @param {Float64Array} matrices @returns {Piece[]} */
export function readPieces({ degree, first, count, dwell }, matrices) {
  let offset = 0;
  return first.map((start, i) => {
    const size = (degree + 1) * count[i];
    offset += size;
    return { first: start, count: count[i], matrix: matrices.subarray(offset - size, offset), dwell: dwell[i] };
  });
}

/** Return the ordinates (m) of each piece. @param {Piece[]} pieces @param {number} degree @param {Numbers} ordinates */
export function pieceOrdinates(pieces, degree, ordinates) {
  return pieces.map(({ first, count, matrix, dwell }) => Float64Array.from({ length: degree + 1 }, (_, row) => {
    if (!count) return dwell;
    let sum = 0;
    for (let i = 0; i < count; i += 1) sum += matrix[row * count + i] * ordinates[first + i];
    return sum;
  }));
}

/** Motion law over one turn. */
export class Law {
  /** @param {string} name @param {Numbers} breaks cam angles (rad) from 0 to 2π @param {Float64Array[]} ordinates of each piece (m) */
  constructor(name, breaks, ordinates) {
    this.name = name;
    this.breaks = Float64Array.from(breaks);
    this.spans = Float64Array.from(ordinates, (_, i) => breaks[i + 1] - breaks[i]);
    this.size = ordinates[0].length;
    /** Ordinates of s and its first four derivatives in each piece, of the degree of s. @type {Float64Array[][]} */
    this.orders = [];
    for (let order = 0, of = ordinates; order <= 4; order += 1) {
      this.orders.push(of.map((values) => elevate(values, this.size)));
      of = of.map((values, i) => derivative(values).map((value) => value / this.spans[i]));
    }
    /** Bounds of |s| (m), |s'| (m/rad) and |s''| (m/rad²). */
    this.bounds = this.orders.slice(0, 3).map((pieces) => Math.max(...pieces.map(largest)));
    const [low, high] = extremes(this, 0);
    /** Smallest and largest s with their angles. */
    this.low = low;
    this.high = high;
    /** Largest less smallest displacement, m. */
    this.lift = high.value - low.value;
  }

  /** Return the index of the piece at an angle of the first turn. @param {number} angle */
  pieceAt(angle) {
    let low = 0, high = this.spans.length;
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (this.breaks[middle] <= angle) low = middle;
      else high = middle;
    }
    return low;
  }

  /**
   * Return s and its derivatives up to an order at a cam angle (rad). At a joint they are right limits.
   * An angle that is less than `tolerance` before a joint counts as on it.
   * @param {number} angle
   */
  at(angle, maxOrder = 2, tolerance = 0) {
    const inside = angle - Math.floor(angle / TURN) * TURN, piece = this.pieceAt(inside + tolerance);
    const u = Math.max(0, (inside - this.breaks[piece]) / this.spans[piece]);
    return this.orders.slice(0, maxOrder + 1).map((pieces) => valueAt(pieces[piece], u));
  }

  /** Return s and its derivatives up to an order at equal steps of a turn. @param {number} points */
  sample(points, maxOrder = 3) {
    const curves = Array.from({ length: maxOrder + 1 }, () => new Float64Array(points)), step = TURN / points;
    for (let k = 0; k < points; k += 1) {
      this.at(k * step, maxOrder, AT_SAMPLE * step).forEach((value, order) => { curves[order][k] = value; });
    }
    return curves;
  }

  /** Return the joints at which s' jumps: cam angle (rad) and step (m/rad). */
  velocityJumps() {
    const slopes = this.orders[1], last = slopes.length - 1;
    return jumps(this, 1).flatMap((step, i) => {
      const rounding = SLOPE_ROUNDING * Math.max(largest(slopes[i]), largest(slopes[i ? i - 1 : last]));
      return Math.abs(step) - rounding > VELOCITY_JUMP * this.lift ? [{ angle: this.breaks[i], step }] : [];
    });
  }
}
