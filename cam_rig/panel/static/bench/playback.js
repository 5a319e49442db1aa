// The follower's motion as it is drawn: blocks of a tick, played a little behind the newest one.
import { NAME } from "./link.js";

/** Rows of a block, in this order: rad, mm, m/s, m/s², N, µm. */
export const ROWS = ["angle", "lift", "velocity", "acceleration", "force", "gap"];
/** How far (s of wall time, and ticks) the picture is behind the newest block. */
const BEHIND_S = 0.05, BEHIND_TICKS = 1.5;
/** What the picture is off its place is made up within about so long (s); more (s) is jumped. */
const PULL_S = 0.3, FARTHEST_S = 0.4;

/** Rows of 32-bit floats `(6, n)` from a byte on. */
export function rowsOf(buffer, from) {
  const count = (buffer.byteLength - from) / 4 / ROWS.length;
  return Object.fromEntries(ROWS.map((name, i) => [name, new Float32Array(buffer, from + 4 * i * count, count)]));
}

export class Playback {
  constructor() { this.reset(); }

  /** Nothing is known of the motion any more. */
  reset() { Object.assign(this, { blocks: [], time: null, end: null, tick: 0, at: 0, before: null }); }

  push(buffer) {
    const [time, step] = new Float64Array(buffer, NAME, 2);
    const rows = rowsOf(buffer, NAME + 16);
    const count = rows.angle.length;
    if (!count) return;
    if (this.end !== null && time < this.end - 10 * step) this.reset(); // another run
    this.tick = time - (this.start ?? time) || this.tick;
    this.start = time;
    this.end = time + step * (count - 1);
    this.blocks.push({ time, step, count, rows });
  }

  /** Go on by wall time (s) at a pace (rig time over wall time); what was passed, and where it is. */
  advance(seconds, pace) {
    if (this.end === null) return { passed: [], now: null };
    const goal = this.end - Math.max(BEHIND_S * pace, BEHIND_TICKS * this.tick);
    const off = goal - (this.time ?? goal) - seconds * pace;
    if (this.time === null || Math.abs(off) > FARTHEST_S * pace + 2 * this.tick) this.time = goal;
    else this.time = Math.min(this.end, this.time + Math.max(0, seconds * pace + off * Math.min(1, seconds / PULL_S)));
    return { passed: this.#passed(), now: this.before };
  }

  /** Where it stands once nothing comes any more. */
  settle() {
    if (this.end !== null) this.time = this.end;
    return { passed: this.#passed(), now: this.before };
  }

  #passed() {
    const passed = [];
    while (this.blocks.length) {
      const { time, step, count, rows } = this.blocks[0];
      const upTo = Math.min(count, Math.floor((this.time - time) / (step || 1) + 1e-6) + 1);
      if (upTo > this.at) {
        passed.push(Object.fromEntries(ROWS.map((name) => [name, rows[name].subarray(this.at, upTo)])));
        this.before = Object.fromEntries(ROWS.map((name) => [name, rows[name][upTo - 1]]));
        this.at = upTo;
      }
      if (this.at < count) {
        const part = (this.time - time) / (step || 1) - (this.at - 1);
        if (this.at > 0 && part > 0) this.before = between(rows, this.at - 1, Math.min(1, part));
        break;
      }
      this.blocks.shift();
      this.at = 0;
    }
    return passed;
  }
}

function between(rows, i, part) {
  return Object.fromEntries(ROWS.map((name) => [name, rows[name][i] + part * (rows[name][i + 1] - rows[name][i])]));
}
