// Picture of the rig, gauges, and charts of a turn: the present motion, or the predicted turn.
/** @import { ContactEvent } from "../common/rig.js" */
/** @import { Sample, TurnCurves } from "./playback.js" */
import { $, decodeBase64, setText } from "../common/dom.js";
import { degrees, formatGap, Lens, RigPicture } from "../common/rig.js";
import { formatFixed, formatNumber, text } from "../common/texts.js";
import { Playback, readCurves } from "./playback.js";
import { TurnCharts } from "./turns.js";

const TURN = 2 * Math.PI;
const GAUGES = ["angle", "lift", "force", "gap"];
/** Time (ms) between two frames. Without a graphics card each frame needs the processor. */
const FRAME_MS = hasGraphicsCard() ? 0 : 32;
/** Time (ms) by which a frame is requested early, so that it falls on a frame of the screen. */
const EARLY_MS = 10;
/** Time (ms) after which a cam that was not received is requested again. */
const RETRY_MS = 1000;
/** Time (ms) between two drawings of the curves, and that if a turn is shorter. */
const CURVES_MS = FRAME_MS && 100, SHORT_TURN_MS = 200;
/** Longest wall time (s) by which a frame advances the motion. */
const MAX_FRAME_S = 0.25;

function hasGraphicsCard() {
  const context = document.createElement("canvas").getContext("webgl");
  const info = context?.getExtension("WEBGL_debug_renderer_info");
  const renderer = context && info ? context.getParameter(info.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return Boolean(context) && !/swiftshader|llvmpipe|software/i.test(renderer);
}

export class Stage {
  constructor() {
    /** Pace of the drive: real_time, a factor such as 0.5x, or free. */
    this.pacing = "real_time";
    this.isTurning = false;
    this.rpm = 0;
    /** @type {string | null} */
    this.cam = null;
    /** Predicted steady turn. @type {TurnCurves | null} */
    this.predicted = null;
    /** Displayed cam angle, rad. */
    this.angle = 0;
    /** Animation frame that is requested, 0 without one, and timer of the next request. */
    this.frame = 0;
    this.timer = 0;
    /** Times (ms) at which a frame is due, and at which the last frame and the last curves were drawn. */
    this.dueMs = 0;
    /** @type {number | null} */
    this.frameMs = null;
    this.curvesMs = 0;
    /** True if the cam has stopped after a motion. No force of that motion is displayed then. */
    this.hasStopped = false;
    /** True until the position of a cam that has just stopped is drawn. */
    this.isStopping = false;
    this.playback = new Playback();
    this.lens = new Lens();
    this.rig = new RigPicture($("rig"), text("rig_picture"), this.lens);
    this.charts = new TurnCharts($("curves"), (angle) => this.#turnTo(angle));
    /** Last completed turn until it is displayed. @type {{samples: Sample[], events: ContactEvent[]} | null} */
    this.completed = null;
    this.charts.onTurn = (samples, events) => { this.completed = { samples, events }; };
  }

  /** Add the samples of ticks. @param {ArrayBuffer} block */
  add(block) {
    this.playback.push(block);
    if (this.frameMs === null) this.#requestFrame();
  }

  /** Display the state of the bench. @param {Live} live @param {string} cam @param {boolean} isTurning */
  show({ graph, parameters, state }, cam, isTurning) {
    const isStarting = graph === "starting";
    this.pacing = parameters.cam_drive?.pacing ?? "real_time";
    if (cam !== this.cam) this.#load(cam);
    if (isStarting) {
      this.playback.reset();
      this.completed = null;
    }
    if (this.isTurning && !isTurning) this.isStopping = this.hasStopped = true;
    if (isTurning || isStarting) this.hasStopped = false;
    [this.isTurning, this.rpm] = [isTurning, state.rpm ?? 0];
    if (this.isStopping) this.#requestFrame();
  }

  /** @param {string} cam */
  async #load(cam) {
    this.cam = cam;
    const answer = await fetch(`/bench/cam/${encodeURIComponent(cam)}`).catch(() => null);
    if (cam !== this.cam) return;
    if (!answer?.ok) {
      setTimeout(() => { if (cam === this.cam) this.#load(cam); }, RETRY_MS);
      return;
    }
    this.rig.load(await answer.json());
    this.charts.clear();
    this.completed = null;
    this.#drawStopped();
  }

  /** Display a predicted turn, or none. @param {Expected | null} expected */
  setPredicted(expected) {
    this.predicted = expected && readCurves(decodeBase64(expected.curves), 0);
    this.charts.setPredicted(this.predicted);
    this.rig.maxForce = Math.max(1, ...this.predicted?.force ?? []);
    this.lens.maxGap = this.maxPredictedGap;
    if (!this.isTurning) this.#drawStopped();
    this.#requestFrame();
  }

  /** Largest gap of the predicted turn, µm. */
  get maxPredictedGap() { return Math.max(0, ...this.predicted?.gap ?? []); }

  /** Turn a stopped cam to an angle (rad). @param {number} angle */
  #turnTo(angle) {
    if (this.isTurning) return;
    this.hasStopped = false; // display the predicted force
    this.angle = angle;
    this.#drawStopped();
  }

  /** Draw the stopped cam with the predicted values at its angle. */
  #drawStopped() {
    if (this.isTurning || !this.rig.picture) return;
    const { predicted, angle } = this;
    const count = predicted?.angle.length ?? 1;
    const i = Math.min(count - 1, Math.round((angle / TURN) * count));
    const force = this.hasStopped ? NaN : predicted?.force[i] ?? 0;
    const gap = this.hasStopped ? 0 : predicted?.gap[i] ?? 0;
    this.#drawPose({ angle, lift: predicted?.lift[i] ?? 0, force, gap });
    this.#requestFrame();
  }

  #requestFrame() { this.frame ||= requestAnimationFrame((nowMs) => this.#draw(nowMs)); }

  /** Request the frame after that of a time. @param {number} nowMs */
  #requestNextFrame(nowMs) {
    clearTimeout(this.timer);
    this.dueMs = Math.max(nowMs + FRAME_MS / 2, this.dueMs + FRAME_MS); // a late frame is made up for once
    if (FRAME_MS) this.timer = setTimeout(() => this.#requestFrame(), this.dueMs - EARLY_MS - performance.now());
    else this.#requestFrame();
  }

  /** @param {number} nowMs */
  #draw(nowMs) {
    this.frame = 0;
    const { playback, pacing, isTurning } = this;
    const seconds = Math.min(MAX_FRAME_S, (nowMs - (this.frameMs ?? nowMs)) / 1000);
    this.frameMs = nowMs;
    const factor = pacing === "real_time" ? 1 : pacing === "free" ? 1e9 : Number.parseFloat(pacing);
    const { passed, sample } = isTurning ? playback.advance(seconds, factor) : playback.finish();
    for (const curves of passed) this.charts.add(curves);
    if (sample && (isTurning || this.isStopping || passed.length) && this.rig.picture) {
      this.angle = ((sample.angle % TURN) + TURN) % TURN;
      this.#drawPose(isTurning ? sample : { ...sample, angle: this.angle, force: NaN, gap: 0 });
    }
    this.isStopping = false;
    const period = 60_000 / (this.rpm * factor) < SHORT_TURN_MS ? SHORT_TURN_MS : CURVES_MS;
    if (!isTurning || !CURVES_MS || nowMs - this.curvesMs > period) {
      this.curvesMs = nowMs;
      this.charts.draw(this.angle);
      this.#showCompletedTurn();
    }
    if (isTurning && playback.end !== null) this.#requestNextFrame(nowMs);
    else this.frameMs = null;
  }

  /** Draw cam, follower and gap, and the values of a stopped cam. @param {Pose} pose */
  #drawPose(pose) {
    this.lens.setGap(pose.gap);
    this.rig.setPose(pose);
    if (this.isTurning) return;
    const { angle, lift, force, gap } = pose;
    this.#showGauges("text", [
      `${formatFixed(degrees(angle), 0)}°`,
      `${formatFixed(lift, 2)} mm`,
      Number.isNaN(force) ? "–" : `${formatNumber(force)} N`,
      gap > 0 ? formatGap(gap) : "0",
    ]);
  }

  /** Show values of a stopped cam, or the largest values of a turn. @param {"text" | "turning"} kind @param {string[]} values */
  #showGauges(kind, values) {
    GAUGES.forEach((name, i) => {
      setText(`name_${name}`, text($(`name_${name}`).dataset[kind] ?? ""));
      setText(`at_${name}`, values[i]);
    });
  }

  /** Show lift-offs, landings and largest values of a completed turn once. */
  #showCompletedTurn() {
    if (!this.completed) return;
    const { samples, events } = this.completed;
    this.completed = null;
    this.rig.setEvents(events);
    if (!this.isTurning) return;
    const max = (/** @type {"lift" | "force" | "gap"} */ name) => Math.max(0, ...samples.map((sample) => sample[name]));
    const landings = events.filter(({ isLanding }) => isLanding).length;
    const gap = landings ? formatGap(max("gap")) : "0";
    this.#showGauges("turning", [String(landings), `${formatFixed(max("lift"), 2)} mm`, `${formatNumber(max("force"))} N`, gap]);
  }
}
