// Free motion of one mass, m ÿ + c ẏ + k y + preload = 0, as cam_rig/dynamics/events/free_flight.py.
// All results are changes since the start of the flight, because a weak spring puts the position of
// rest far away.
import { binomials, restrict } from "./polynomials.js";

/** Product of time and fastest rate up to which the power series of the impulse response is used, and its length. */
const MAX_SERIES_TIME = 0.5, SERIES_TERMS = 18;
/** Size below which two terms in a row end the series, relative to its first term. */
const MIN_SERIES_TERM = 2 ** -62;
/** Smallest ratio of slow to fast decay at which the integral of a response follows from the response. */
const MIN_RATE_RATIO = 0.1;
/** Product of fastest rate and window: within a window the acceleration is a power series, exact to rounding. */
const WINDOW_REACH = 2, SERIES_DEGREE = 24;

/** Free motion of a mass from an initial state (y in m, ẏ in m/s) on. */
export class FreeFlight {
  /** @param {Mass} rig @param {number} y @param {number} velocity */
  constructor({ mass, damping, spring_stiffness: stiffness, preload }, y, velocity) {
    /** c/m (1/s) and k/m (1/s²). */
    this.damping = damping / mass;
    this.stiffness = stiffness / mass;
    this.y = y;
    this.velocity = velocity;
    /** Force of spring and preload at the start, relative to the mass, m/s². */
    this.pull = this.stiffness * y + preload / mass;
    this.acceleration = -this.pull - this.damping * velocity;
    /** Duration (s) in which the series of the acceleration is exact to rounding. */
    this.window = (2 * WINDOW_REACH) / (this.damping + Math.sqrt(this.damping ** 2 + 4 * this.stiffness));
  }

  /** Return displacement (m), velocity (m/s) and acceleration (m/s²) at a time (s). @param {number} time */
  at(time) {
    const { velocity, pull, acceleration, stiffness } = this;
    const [impulse, slope, step] = impulseResponse(this.damping, stiffness, time);
    return {
      y: this.y + (velocity * impulse - pull * step),
      velocity: velocity * slope - pull * impulse,
      acceleration: acceleration * slope - stiffness * velocity * impulse,
    };
  }

  /** Return the ordinates of the acceleration from a time (s) on, for a duration within a window. @param {number} time @param {number} duration */
  accelerationOrdinates(time, duration) {
    const { window, damping, stiffness } = this, state = this.at(time);
    const terms = new Float64Array(SERIES_DEGREE + 1), ordinates = new Float64Array(SERIES_DEGREE + 1);
    const weights = binomials(SERIES_DEGREE);
    for (let j = 0, { velocity, acceleration } = state; j <= SERIES_DEGREE; j += 1) {
      terms[j] = acceleration / weights[j];
      const factor = window / (j + 1);
      [velocity, acceleration] = [acceleration * factor, -(stiffness * velocity + damping * acceleration) * factor];
    }
    for (let i = 0; i <= SERIES_DEGREE; i += 1) {
      const row = binomials(i);
      for (let j = 0; j <= i; j += 1) ordinates[i] += row[j] * terms[j];
    }
    return duration < window ? restrict(ordinates, 0, duration / window) : ordinates;
  }
}

/** Return the impulse response S (s) of ẍ + 2δ ẋ + κ x = 0, its derivative and its integral (s²). @param {number} damping 2δ @param {number} stiffness κ @param {number} time */
function impulseResponse(damping, stiffness, time) {
  const reach = stiffness * time * time;
  if (damping * time <= MAX_SERIES_TIME && reach <= MAX_SERIES_TIME ** 2) return expandResponse(damping * time, reach, time);
  const decay = 0.5 * damping, square = stiffness - decay * decay;
  if (square <= 0) return overdampedResponse(decay, Math.sqrt(-square), stiffness, time);
  const frequency = Math.sqrt(square), envelope = Math.exp(-decay * time);
  const value = (envelope * Math.sin(frequency * time)) / frequency, rate = envelope * Math.cos(frequency * time) - decay * value;
  return [value, rate, (1 - rate - 2 * decay * value) / stiffness];
}

/** @param {number} damping 2δ t @param {number} stiffness κ t² @param {number} time */
function expandResponse(damping, stiffness, time) {
  let term = 1, previous = 0, value = 0, integral = 0;
  for (let i = 2; i <= SERIES_TERMS; i += 1) {
    const part = term / i;
    value += term;
    integral += part;
    [previous, term] = [part, -(damping * part + (stiffness * previous) / i)];
    if (Math.abs(previous) + Math.abs(term) < MIN_SERIES_TERM) break;
  }
  return [value * time, 1 - damping * value - stiffness * integral, integral * time * time];
}

/** Return the response for δ² ≥ κ without a growing exponential. @param {number} decay δ @param {number} root √(δ² − κ) @param {number} stiffness @param {number} time */
function overdampedResponse(decay, root, stiffness, time) {
  const fast = decay + root, difference = 2 * root, slow = stiffness / fast;
  const growth = difference > 0 ? -Math.expm1(-difference * time) / difference : time;
  const value = Math.exp(-slow * time) * growth, rate = Math.exp(-fast * time) - slow * value;
  if (slow > MIN_RATE_RATIO * fast) return [value, rate, (1 - rate - 2 * decay * value) / stiffness];
  const slowIntegral = slow > 0 ? -Math.expm1(-slow * time) / slow : time;
  return [value, rate, (slowIntegral + Math.expm1(-fast * time) / fast) / difference];
}
