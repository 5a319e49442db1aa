// Playback buffer of the follower's motion: the picture follows slightly behind the newest block.
import { NAME_BYTES } from "./connection.js";

/** Curves of a block in their order: rad, mm, m/s, m/s², N, µm. */
export const CURVES = /** @type {const} */ (["angle", "lift", "velocity", "acceleration", "force", "gap"]);
/** @typedef {typeof CURVES[number]} CurveName */
/** @typedef {Record<CurveName, Float32Array>} TurnCurves */
/** @typedef {Record<CurveName, number>} Sample */

/** Delay of the picture, in s of wall time and in ticks. The larger one applies. */
const DELAY_S = 0.065, DELAY_TICKS = 1.5;
/** Time (s) within which a wrong delay is corrected, and difference (s) above which the picture jumps. */
const CORRECTION_S = 0.3, MAX_DIFFERENCE_S = 0.4;
/** Number of doubles in the header of a block: rig time (s), step (s) and number of samples. */
const HEADER = 3;

/** Return the curves in the 32-bit floats of a buffer. @param {ArrayBuffer} buffer @param {number} start byte */
export function readCurves(buffer, start, count = (buffer.byteLength - start) / 4 / CURVES.length) {
  return forEachCurve((_, i) => new Float32Array(buffer, start + 4 * i * count, count));
}

export class Playback {
  /** @type {{time: number, step: number, count: number, curves: TurnCurves}[]} */
  blocks = [];
  /** Rig time of the picture, s. @type {number | null} */
  time = null;
  /** Rig time of the newest sample, s. @type {number | null} */
  end = null;
  /** Rig time at which the newest block starts, s. @type {number | null} */
  start = null;
  /** Duration of a tick, s. */
  tick = 0;
  /** Number of played samples of the first block. */
  played = 0;
  /** Displayed sample. @type {Sample | null} */
  sample = null;

  reset() {
    [this.blocks, this.time, this.end] = [[], null, null];
    [this.tick, this.played, this.sample] = [0, 0, null];
  }

  /** Add the blocks of a message. @param {ArrayBuffer} buffer */
  push(buffer) {
    for (let position = NAME_BYTES; position < buffer.byteLength;) {
      const [time, step, count] = new Float64Array(buffer, position, HEADER);
      position += 8 * HEADER;
      if (count) this.#add(time, step, count, readCurves(buffer, position, count));
      position += 4 * CURVES.length * count;
    }
  }

  /** @param {number} time @param {number} step @param {number} count @param {TurnCurves} curves */
  #add(time, step, count, curves) {
    if (this.end !== null && time < this.end - 10 * step) this.reset(); // another run
    this.tick = time - (this.start ?? time) || this.tick;
    this.start = time;
    this.end = time + step * (count - 1);
    this.blocks.push({ time, step, count, curves });
  }

  /**
   * Advance by a wall time (s) at a real-time factor. Return the passed curves and the displayed sample.
   * @param {number} seconds @param {number} factor
   */
  advance(seconds, factor) {
    if (this.end === null) return { passed: [], sample: null };
    const target = this.end - Math.max(DELAY_S * factor, DELAY_TICKS * this.tick);
    const difference = target - (this.time ?? target) - seconds * factor;
    if (this.time === null || Math.abs(difference) > MAX_DIFFERENCE_S * factor + 2 * this.tick) this.time = target;
    else {
      const step = seconds * factor + difference * Math.min(1, seconds / CORRECTION_S);
      this.time = Math.min(this.end, this.time + Math.max(0, step));
    }
    return { passed: this.#playTo(this.time), sample: this.sample };
  }

  /** Advance to the newest sample, after the cam has stopped. */
  finish() {
    if (this.end !== null) this.time = this.end;
    return { passed: this.#playTo(this.time ?? 0), sample: this.sample };
  }

  /** @param {number} time */
  #playTo(time) {
    /** @type {TurnCurves[]} */
    const passed = [];
    while (this.blocks.length) {
      const { time: start, step, count, curves } = this.blocks[0];
      const position = (time - start) / (step || 1);
      const end = Math.min(count, Math.floor(position + 1e-6) + 1);
      if (end > this.played) {
        passed.push(forEachCurve((name) => curves[name].subarray(this.played, end)));
        this.sample = forEachCurve((name) => curves[name][end - 1]);
        this.played = end;
      }
      if (this.played < count) {
        const last = this.played - 1, fraction = Math.min(1, position - last);
        if (last >= 0 && fraction > 0) {
          this.sample = forEachCurve((name) => curves[name][last] + fraction * (curves[name][last + 1] - curves[name][last]));
        }
        break;
      }
      this.blocks.shift();
      this.played = 0;
    }
    return passed;
  }
}

/** Return a value for each curve. @template T @param {(name: CurveName, i: number) => T} valueOf @returns {Record<CurveName, T>} */
function forEachCurve(valueOf) {
  return /** @type {Record<CurveName, T>} */ (Object.fromEntries(CURVES.map((name, i) => [name, valueOf(name, i)])));
}
