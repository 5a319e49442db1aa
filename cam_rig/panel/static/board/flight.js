// Flight of the follower at a speed above its jump speed: one rigid mass from rest, in its last turn.
/** @import { ContactChange } from "../core/contact_run.js" */
import { ContactRun } from "../core/contact_run.js";
import { RefusedError } from "../core/refusal.js";
import { DEGREE, RPM, TURN } from "../core/units.js";
/** @import { Law } from "../core/law.js" */
import { errorText, formatNumber, text } from "../common/texts.js";
import { MOTION_POINTS } from "./law.js";

/** Number of turns from rest. The last turn is displayed. */
const TURNS = 6;
/** Number of lift-offs and landings that are stated. */
const MAX_STATED = 6;

/** Last turn of a run in which contact is lost. `message` is the reason why there is no run. */
export class Flight {
  /** @param {Law} law @param {Bouncer} rig @param {number} rpm */
  constructor(law, rig, rpm) {
    this.speed = rpm * RPM;
    this.mass = rig.mass;
    this.message = "";
    /** @type {ContactRun | null} */
    this.run = null;
    try {
      this.run = new ContactRun(law, rig, this.speed, TURNS);
    } catch (error) {
      if (!(error instanceof RefusedError)) throw error;
      this.message = error.message;
    }
    /** True if contact is lost in the run. */
    this.isLost = Boolean(this.run?.events.length);
    /** Contact force (N) at equal steps of the turn, 0 in flight. @type {Float64Array | null} */
    this.force = this.isLost ? Float64Array.from({ length: MOTION_POINTS }, (_, k) => this.at((TURN * k) / MOTION_POINTS).force) : null;
  }

  /** Return displacement (m), velocity (m/s), acceleration (m/s²) and contact force (N) at a cam angle (rad) of the turn. @param {number} angle */
  at(angle) { return /** @type {ContactRun} */ (this.run).at((angle + (TURNS - 1) * TURN) / this.speed); }

  /** Return the lift-offs and landings of the turn in words. */
  describe() {
    if (this.message) return errorText(this.message);
    const start = (TURNS - 1) * TURN, events = (this.run?.events ?? []).filter(({ angle }) => angle >= start);
    if (!events.length) return text(this.at(0).force > 0 ? "flight_over" : "flight_whole", { turn: TURNS });
    const stated = events.slice(0, MAX_STATED).map((event) => describeEvent(event, start));
    if (events.length > MAX_STATED) stated.push(text("flight_more", { count: events.length - MAX_STATED }));
    return text("flight", { turn: TURNS, events: stated.join(", ") });
  }
}

/** @param {ContactChange} event @param {number} start cam angle at the start of the turn */
function describeEvent({ isLanding, angle, velocity }, start) {
  const values = { angle: formatNumber((angle - start) * DEGREE), velocity: formatNumber(velocity, 3) };
  return text(isLanding ? "landing_at" : "lift_off_at", values);
}
