// Contacts and flights of one rigid mass on a turning cam, as cam_rig/dynamics/events/runs.py. Contact
// ends where the force reaches zero, a flight where the mass meets the cam. There is no time stepping.
/** @import { Law } from "./law.js" */
import { forceAt, forceRounding, lossIntervals } from "./force.js";
import { FreeFlight } from "./free_flight.js";
import { requireSmooth } from "./jump_speed.js";
import { findLanding } from "./landing.js";
import { RefusedError, TURN, general } from "./law.js";

/** Smallest range of the cam angle (rad) with a negative force that is a lift-off and not rounding. */
const MIN_LOSS_ANGLE = 1e-9;
/** Height of a bounce below which the mass stays on the cam, relative to the lift and in m. */
const MIN_BOUNCE_RATIO = 1e-12, MIN_BOUNCE_HEIGHT = 1e-15;
/** Number of lift-offs and landings per turn above which a run fails. */
const MAX_EVENTS = 10000;

/** Contact or flight from `start` to `end`, s. @typedef {{start: number, end: number, flight: FreeFlight | null}} Phase */
/** Lift-off or landing. `impulse` (N·s) is 0 at a lift-off. @typedef {{isLanding: boolean, time: number, angle: number, impulse: number}} ContactChange */

export class ContactRun {
  /** Phases and events in the order of time. @type {Phase[]} */
  phases = [];
  /** @type {ContactChange[]} */
  events = [];

  /**
   * Run from rest on the cam at angle 0. Throws a RefusedError for a law with a velocity jump.
   * @param {Law} law @param {Bouncer} rig @param {number} speed rad/s @param {number} turns
   */
  constructor(law, rig, speed, turns) {
    requireSmooth(law);
    if (rig.restitution === null) throw new RefusedError("follower.restitution: is missing; add it to the numbers of the rig");
    this.law = law;
    this.rig = rig;
    this.speed = speed;
    this.restitution = rig.restitution;
    this.duration = (turns * TURN) / speed;
    this.losses = lossIntervals(law, rig, speed);
    this.rounding = forceRounding(law, rig, speed) / rig.mass;
    this.minBounce = Math.max(MIN_BOUNCE_RATIO * law.lift, MIN_BOUNCE_HEIGHT);
    this.time = 0;
    /** Flight from `time` on with the gap and its rate, null in contact. @type {{flight: FreeFlight, gap: number, rate: number} | null} */
    this.flying = null;
    while (this.time < this.duration) {
      if (this.flying) this.#fly(this.flying);
      else this.#ride();
      if (this.events.length > MAX_EVENTS * turns) {
        throw new RefusedError(`more than ${MAX_EVENTS * turns} events in ${general(this.duration, 6)} s at ${general(speed, 6)} rad/s; `
          + `allowed: ${MAX_EVENTS} per turn`);
      }
    }
  }

  /** Return lift (m), velocity (m/s) and acceleration (m/s²) of the cam. @param {number} time */
  #cam(time) {
    const [s, slope, curvature] = this.law.at(this.speed * time);
    return { s, velocity: slope * this.speed, force: forceAt([s, slope, curvature], this.rig, this.speed) };
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
    this.#record(Math.min(liftOff, this.duration), null);
    if (liftOff >= this.duration) return;
    this.events.push({ isLanding: false, time: liftOff, angle: this.speed * liftOff, impulse: 0 });
    this.#launch(0);
  }

  /** Start a flight from the cam with a velocity (m/s) relative to it. @param {number} rate */
  #launch(rate) {
    const { s, velocity } = this.#cam(this.time);
    this.flying = { flight: new FreeFlight(this.rig, s, velocity + rate), gap: 0, rate };
  }

  /** Fly up to the landing. @param {{flight: FreeFlight, gap: number, rate: number}} flying */
  #fly({ flight, gap, rate }) {
    const angle = this.speed * this.time, cam = { law: this.law, speed: this.speed, angle: angle - Math.floor(angle / TURN) * TURN };
    const landing = findLanding(flight, cam, gap, rate, this.rounding, this.duration - this.time);
    const { time: start } = this, end = landing.hasLanded ? Math.min(start + landing.time, this.duration) : this.duration;
    this.#record(end, flight);
    if (landing.hasLanded && landing.rate <= 0) return this.#land(-landing.rate);
    const state = flight.at(end - start);
    this.flying = { flight: new FreeFlight(this.rig, state.y, state.velocity), gap: landing.gap, rate: landing.rate };
  }

  /** Land with a velocity (m/s) relative to the cam. The mass stays on the cam if it would not rebound higher than `minBounce`. @param {number} approach */
  #land(approach) {
    const { time, restitution, rig: { mass } } = this, rebound = restitution * approach;
    const deceleration = this.#cam(time).force / mass;
    const rebounds = rebound > 0 && !(deceleration > 0 && (0.5 * rebound * rebound) / deceleration <= this.minBounce);
    const impulse = mass * (1 + (rebounds ? restitution : 0)) * approach;
    this.events.push({ isLanding: true, time, angle: this.speed * time, impulse });
    this.flying = null;
    if (rebounds) this.#launch(rebound);
  }

  /** Return displacement (m), velocity (m/s) and contact force (N) at a time (s) of the run. @param {number} time */
  at(time) {
    const phase = this.phases.find(({ end }) => time < end) ?? this.phases[this.phases.length - 1];
    if (phase.flight) return { ...phase.flight.at(time - phase.start), force: 0 };
    const { s, velocity, force } = this.#cam(time);
    return { y: s, velocity, force };
  }
}
