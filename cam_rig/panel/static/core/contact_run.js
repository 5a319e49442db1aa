// Contacts and flights of one rigid mass on a turning cam, as cam_rig/dynamics/events/runs.py. Contact
// ends where the force reaches zero, a flight where the mass meets the cam. There is no time stepping.
/** @import { Law } from "./law.js" */
import { forceAt, forceRounding, lossIntervals } from "./force.js";
import { FreeFlight } from "./free_flight.js";
import { SAME_ANGLE, findLanding } from "./landing.js";
import { RefusedError, general } from "./refusal.js";
import { TURN } from "./units.js";

/** Smallest range of the cam angle (rad) with a negative force that is a lift-off and not rounding. */
const MIN_LOSS_ANGLE = 1e-9;
/** Height of a bounce below which the mass stays on the cam, relative to the lift and in m. */
const MIN_BOUNCE_RATIO = 1e-12, MIN_BOUNCE_HEIGHT = 1e-15;
/** Smallest jump of the cam's velocity that is not rounding, relative to cam speed times lift. */
const MIN_VELOCITY_STEP = 1e-12;
/** Rounding of the angle at the end of the run. A velocity jump there is after the run. */
const END_ANGLE = 1e-9;
/** Number of lift-offs and landings per turn above which a run fails. */
const MAX_EVENTS = 10000;

/** Contact or flight from `start` to `end`, s. @typedef {{start: number, end: number, flight: FreeFlight | null}} Phase */
/** Lift-off or landing at a time (s) and a cam angle (rad). `velocity` (m/s) is that towards the cam, and `impulse` (N·s) that of the landing, both 0 at a lift-off. @typedef {{isLanding: boolean, time: number, angle: number, velocity: number, impulse: number}} ContactChange */

export class ContactRun {
  /** Phases and events in the order of time. @type {Phase[]} */
  phases = [];
  /** @type {ContactChange[]} */
  events = [];

  /**
   * Run from rest on the cam at angle 0. Throws a RefusedError without a restitution, or after too many events.
   * @param {Law} law @param {Bouncer} rig @param {number} speed rad/s @param {number} turns
   */
  constructor(law, rig, speed, turns) {
    if (rig.restitution === null) throw new RefusedError("follower.restitution: is missing; add it to the numbers of the rig");
    this.law = law;
    this.rig = rig;
    this.speed = speed;
    this.restitution = rig.restitution;
    this.duration = (turns * TURN) / speed;
    this.losses = lossIntervals(law, rig, speed);
    this.rounding = forceRounding(law, rig, speed) / rig.mass;
    this.minBounce = Math.max(MIN_BOUNCE_RATIO * law.lift, MIN_BOUNCE_HEIGHT);
    /** Jumps of the cam's velocity ahead: time (s) and step (m/s). */
    this.jumps = velocityJumps(law, speed, turns);
    this.time = 0;
    /** Flight from `time` on with the gap and its rate, null in contact. @type {{flight: FreeFlight, gap: number, rate: number} | null} */
    this.flying = null;
    this.#passJump(0);
    while (this.time < this.duration) {
      if (this.flying) this.#fly(this.flying);
      else this.#ride();
      if (this.events.length > MAX_EVENTS * turns) {
        throw new RefusedError(`more than ${MAX_EVENTS * turns} events in ${general(this.duration, 6)} s at ${general(speed, 6)} rad/s; `
          + `allowed: ${MAX_EVENTS} per turn`);
      }
    }
  }

  /** Return the motion of a mass on the cam, after a jump at this time (s). @param {number} time */
  #cam(time) {
    const motion = this.law.at(this.speed * time, 2, SAME_ANGLE), [y, slope, curvature] = motion;
    return { y, velocity: slope * this.speed, acceleration: curvature * this.speed ** 2, force: forceAt(motion, this.rig, this.speed) };
  }

  /** Time (s) at which the present phase ends at the latest: the next velocity jump, or the end of the run. */
  get #limit() { return this.jumps.length ? this.jumps[0].time : this.duration; }

  /** Return the time of an event, or the limit if the event is not before it. @param {number} time */
  #limited(time) {
    const limit = this.#limit;
    return time < limit - (this.jumps.length ? SAME_ANGLE / this.speed : 0) ? time : limit;
  }

  /** @param {number} end @param {FreeFlight | null} flight */
  #record(end, flight) {
    this.phases.push({ start: this.time, end, flight });
    this.time = end;
  }

  /** Stay on the cam up to the lift-off. */
  #ride() {
    const angle = this.speed * this.time, turn = Math.floor(angle / TURN) * TURN;
    const ahead = [...this.losses, ...this.losses.map(([start, end]) => [start + TURN, end + TURN])];
    const loss = ahead.find(([, end]) => turn + end - angle > MIN_LOSS_ANGLE);
    const liftOff = loss ? this.time + Math.max(0, (turn + loss[0] - angle) / this.speed) : Infinity;
    const end = this.#limited(liftOff), isLost = end < this.#limit;
    this.#record(end, null);
    if (isLost) this.#liftOff(0);
    else this.#passJump(end);
  }

  /** Pass the velocity jump at a time: an impact or a lift-off in contact, another gap rate in flight. @param {number} time */
  #passJump(time) {
    if (!this.jumps.length || this.jumps[0].time > time) return;
    const [{ step }] = this.jumps.splice(0, 1);
    if (this.flying) this.flying.rate -= step;
    else if (step > 0) this.#land(step);
    else this.#liftOff(-step);
  }

  /** Leave the cam with its velocity, or with that before a downward jump (m/s). @param {number} step */
  #liftOff(step) {
    this.events.push({ isLanding: false, time: this.time, angle: this.speed * this.time, velocity: 0, impulse: 0 });
    this.#launch(step);
  }

  /** Start a flight from the cam with a velocity (m/s) relative to it. @param {number} rate */
  #launch(rate) {
    const { y, velocity } = this.#cam(this.time);
    this.flying = { flight: new FreeFlight(this.rig, y, velocity + rate), gap: 0, rate };
  }

  /** Fly up to the landing. @param {{flight: FreeFlight, gap: number, rate: number}} flying */
  #fly({ flight, gap, rate }) {
    const angle = this.speed * this.time, cam = { law: this.law, speed: this.speed, angle: angle - Math.floor(angle / TURN) * TURN };
    const { time: start } = this, landing = findLanding(flight, cam, gap, rate, this.rounding, this.#limit - start);
    this.#record(landing.hasLanded ? this.#limited(start + landing.time) : this.#limit, flight);
    const state = flight.at(this.time - start);
    this.flying = { flight: new FreeFlight(this.rig, state.y, state.velocity), gap: landing.gap, rate: landing.rate };
    this.#passJump(this.time);
    if (landing.hasLanded && this.flying.rate <= 0) this.#land(-this.flying.rate);
  }

  /** Land with a velocity (m/s) relative to the cam. The mass stays on the cam if it would not rebound higher than `minBounce`. @param {number} approach */
  #land(approach) {
    const { time, restitution, rig: { mass } } = this, rebound = restitution * approach;
    const deceleration = this.#cam(time).force / mass;
    const rebounds = rebound > 0 && !(deceleration > 0 && (0.5 * rebound * rebound) / deceleration <= this.minBounce);
    const impulse = mass * (1 + (rebounds ? restitution : 0)) * approach;
    this.events.push({ isLanding: true, time, angle: this.speed * time, velocity: approach, impulse });
    this.flying = null;
    if (rebounds) this.#launch(rebound);
  }

  /** Return displacement (m), velocity (m/s), acceleration (m/s²) and contact force (N) at a time (s) of the run. @param {number} time */
  at(time) {
    const { start, flight } = this.phases.find(({ end }) => time < end) ?? this.phases[this.phases.length - 1];
    return flight ? { ...flight.at(time - start), force: 0 } : this.#cam(time);
  }
}

/** Return the jumps of the cam's velocity (m/s) in a run from angle 0, with their times (s). @param {Law} law @param {number} speed @param {number} turns */
function velocityJumps(law, speed, turns) {
  const jumps = law.velocityJumps().filter(({ step }) => Math.abs(step) > MIN_VELOCITY_STEP * law.lift);
  return Array.from({ length: Math.ceil(turns) }, (_, turn) => jumps.map(({ angle, step }) => ({ time: (angle + turn * TURN) / speed, step: step * speed })))
    .flat().filter(({ time }) => time * speed < turns * TURN - END_ANGLE);
}
