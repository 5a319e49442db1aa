// The follower's motion as it is drawn: blocks of a tick, played a little behind the newest one.
import { NAME } from "./link.js";

/** Rows of a block, in this order: rad, mm, m/s, m/s², N, µm. */
export const ROWS = /** @type {const} */ (["angle", "lift", "velocity", "acceleration", "force", "gap"]);
/** @typedef {typeof ROWS[number]} Row */
/** @typedef {Record<Row, Float32Array>} Rows */
/** @typedef {Record<Row, number>} Sample */
/** How far (s of wall time, and ticks) the picture is behind the newest block. */
const BEHIND_S = 0.065, BEHIND_TICKS = 1.5;
/** What the picture is off its place is made up within about so long (s); more (s) is jumped. */
const PULL_S = 0.3, FARTHEST_S = 0.4;

/** Doubles before a block's rows: rig time and step (s), and samples. */
const HEAD = 3;

/** Rows of 32-bit floats `(6, n)` from a byte on. @param {ArrayBuffer} buffer @param {number} from */
export function rowsOf(buffer, from, count = (buffer.byteLength - from) / 4 / ROWS.length) {
  return each((_, i) => new Float32Array(buffer, from + 4 * i * count, count));
}

export class Playback {
  /** @type {{time: number, step: number, count: number, rows: Rows}[]} */
  blocks = [];
  /** Of the picture (s). @type {number | null} */
  time = null;
  /** Of the newest sample (s). @type {number | null} */
  end = null;
  /** When the newest block began (s). @type {number | null} */
  start = null;
  tick = 0;
  at = 0;
  /** Where it is. @type {Sample | null} */
  before = null;

  /** Nothing is known of the motion any more. */
  reset() {
    [this.blocks, this.time, this.end] = [[], null, null];
    [this.tick, this.at, this.before] = [0, 0, null];
  }

  /** One block after the other. @param {ArrayBuffer} buffer */
  push(buffer) {
    for (let from = NAME; from < buffer.byteLength;) {
      const [time, step, count] = new Float64Array(buffer, from, HEAD);
      from += 8 * HEAD;
      if (count) this.#push(time, step, count, rowsOf(buffer, from, count));
      from += 4 * ROWS.length * count;
    }
  }

  /** @param {number} time @param {number} step @param {number} count @param {Rows} rows */
  #push(time, step, count, rows) {
    if (this.end !== null && time < this.end - 10 * step) this.reset(); // another run
    this.tick = time - (this.start ?? time) || this.tick;
    this.start = time;
    this.end = time + step * (count - 1);
    this.blocks.push({ time, step, count, rows });
  }

  /**
   * Go on by wall time (s) at a pace (rig time over wall time); what was passed, and where it is.
   * @param {number} seconds @param {number} pace
   */
  advance(seconds, pace) {
    if (this.end === null) return { passed: [], now: null };
    const goal = this.end - Math.max(BEHIND_S * pace, BEHIND_TICKS * this.tick);
    const off = goal - (this.time ?? goal) - seconds * pace;
    if (this.time === null || Math.abs(off) > FARTHEST_S * pace + 2 * this.tick) this.time = goal;
    else this.time = Math.min(this.end, this.time + Math.max(0, seconds * pace + off * Math.min(1, seconds / PULL_S)));
    return { passed: this.#passed(this.time), now: this.before };
  }

  /** Where it stands once nothing comes any more. */
  settle() {
    if (this.end !== null) this.time = this.end;
    return { passed: this.#passed(this.time ?? 0), now: this.before };
  }

  /** @param {number} now */
  #passed(now) {
    /** @type {Rows[]} */
    const passed = [];
    while (this.blocks.length) {
      const { time, step, count, rows } = this.blocks[0];
      const upTo = Math.min(count, Math.floor((now - time) / (step || 1) + 1e-6) + 1);
      if (upTo > this.at) {
        passed.push(each((name) => rows[name].subarray(this.at, upTo)));
        this.before = each((name) => rows[name][upTo - 1]);
        this.at = upTo;
      }
      if (this.at < count) {
        const part = (now - time) / (step || 1) - (this.at - 1);
        if (this.at > 0 && part > 0) this.before = between(rows, this.at - 1, Math.min(1, part));
        break;
      }
      this.blocks.shift();
      this.at = 0;
    }
    return passed;
  }
}

/** Something of each row. @template T @param {(name: Row, i: number) => T} of @returns {Record<Row, T>} */
function each(of) { return /** @type {Record<Row, T>} */ (Object.fromEntries(ROWS.map((name, i) => [name, of(name, i)]))); }

/** @param {Rows} rows @param {number} i @param {number} part */
function between(rows, i, part) { return each((name) => rows[name][i] + part * (rows[name][i + 1] - rows[name][i])); }
