// The picture of the rig, its gauges and the charts of a turn: what runs, or what is expected.
import { recoloured } from "../common/canvas.js";
import { shown } from "../common/charts.js";
import { $, decode, say } from "../common/dom.js";
import { text } from "../common/texts.js";
/** @import { Rows } from "./playback.js" */
/** @import { Crossing } from "../common/rig.js" */
/** @import { Sample } from "./turns.js" */
import { Playback, rowsOf } from "./playback.js";
import { length, Lens, RigPicture } from "../common/rig.js";
import { TurnCharts } from "./turns.js";

const TURN = 2 * Math.PI;
const GAUGES = ["angle", "lift", "force", "gap"];
/** Without a graphics card every frame is the processor's work, and one in so long (ms) is enough. */
const FRAME_MS = accelerated() ? 0 : 32;
/** It may be asked for so much (ms) before its time: then it is one of those of the screen. */
const EARLY_MS = 10;
/** A cam that did not come is asked for again after so long (ms). */
const AGAIN_MS = 1000;
/** The cam is watched, curves are read: so often (ms) those are drawn, less often where nobody sees them grow. */
const CURVES_MS = FRAME_MS && 100, WHOLE_MS = 200;

function accelerated() {
  const context = document.createElement("canvas").getContext("webgl");
  const named = context?.getExtension("WEBGL_debug_renderer_info");
  const renderer = context && named ? context.getParameter(named.UNMASKED_RENDERER_WEBGL) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return Boolean(context) && !/swiftshader|llvmpipe|software/i.test(renderer);
}

export class Stage {
  /** `pacing()` gives the drive's pace: real_time, a factor as 0.5x, or free. @param {() => string | undefined} pacing */
  constructor(pacing) {
    this.pacing = pacing;
    this.turns = false;
    this.rpm = 0;
    /** @type {string | null} */
    this.cam = null;
    /** A settled turn that is expected. @type {Rows | null} */
    this.known = null;
    this.at = 0; // the cam angle, rad
    this.frame = 0;
    this.waits = 0; // for the next frame
    this.due = 0; // when (ms)
    this.stood = false; // has turned, and stands: no force of a motion is left
    this.halted = false; // has just come to stand, and is to be drawn where
    this.curved = 0; // when (ms) the curves were drawn
    /** When (ms) it was drawn, while it moves. @type {number | undefined} */
    this.drawn = undefined;
    this.playback = new Playback();
    this.lens = new Lens();
    this.rig = new RigPicture($("rig"), text("rig_picture"), this.lens);
    this.charts = new TurnCharts($("curves"), (angle) => this.#hover(angle));
    /** The last turn that is over, until it is shown. @type {[Sample[], Crossing[]] | null} */
    this.over = null;
    this.charts.told = (...turn) => { this.over = turn; };
    recoloured(() => {
      this.charts.recolour();
      this.charts.draw(this.at); // paper does not wait for a frame
    });
  }

  /** A block of a tick has come. @param {ArrayBuffer} block */
  take(block) {
    this.playback.push(block);
    if (this.drawn === undefined) this.#soon(); // else a frame is on its way
  }

  /** What the bench says: another cam is drawn anew, a cam that stands is held. @param {Live} live @param {boolean} turns */
  show({ graph, values, state, setup }, turns) {
    const cam = values.law_server?.cam || state.cam || setup.cam;
    if (cam !== this.cam) this.#load(cam);
    if (graph === "starting") {
      this.playback.reset();
      this.over = null;
    }
    if (this.turns && !turns) this.halted = this.stood = true;
    if (turns || graph === "starting") this.stood = false;
    [this.turns, this.rpm] = [turns, state.rpm ?? 0];
    if (this.halted) this.#soon();
  }

  /** @param {string} cam */
  async #load(cam) {
    this.cam = cam;
    const answer = await fetch(`/bench/cam/${encodeURIComponent(cam)}`).catch(() => null);
    if (cam !== this.cam) return;
    if (!answer?.ok) {
      setTimeout(() => { if (cam === this.cam) this.#load(cam); }, AGAIN_MS);
      return;
    }
    this.rig.load(await answer.json());
    this.charts.clear();
    this.over = null;
    this.#still();
  }

  /** A settled turn as the server found it; null where there is none. @param {Expected | null} found */
  expect(found) {
    this.known = found && rowsOf(decode(found.curves), 0);
    this.charts.expected(this.known);
    this.rig.strongest = this.known ? Math.max(1, ...this.known.force) : 1;
    this.lens.widest = this.known ? Math.max(...this.known.gap) : 0;
    if (!this.turns) this.#still();
    this.#soon();
  }

  /** The highest the follower is off its cam in what is expected, µm. */
  get highest() { return this.known ? Math.max(...this.known.gap) : 0; }

  /** While the cam stands, the pointer on a chart turns it. @param {number | null} angle */
  #hover(angle) {
    if (this.turns || angle === null) return;
    this.stood = false; // what is expected at that angle is asked for
    this.at = angle;
    this.#still();
  }

  /** The cam at an angle, with what is expected there. */
  #still() {
    if (this.turns || !this.rig.picture) return;
    const { known, at } = this;
    const i = known ? Math.min(known.angle.length - 1, Math.round((at / TURN) * known.angle.length)) : 0;
    const moving = this.stood ? { force: NaN, gap: 0 } : { force: known?.force[i] ?? 0, gap: known?.gap[i] ?? 0 };
    const pose = { angle: at, lift: known?.lift[i] ?? 0, ...moving };
    this.#pose(pose);
    this.#stands(pose);
    this.#soon();
  }

  #soon() { this.frame ||= requestAnimationFrame((now) => this.#draw(now)); }

  /** The frame after the one of a time (ms). @param {number} now */
  #next(now) {
    clearTimeout(this.waits);
    this.due = Math.max(now + FRAME_MS / 2, this.due + FRAME_MS); // one that came late is made up, no more
    if (FRAME_MS) this.waits = setTimeout(() => this.#soon(), this.due - EARLY_MS - performance.now());
    else this.#soon();
  }

  /** @param {number} now */
  #draw(now) {
    this.frame = 0;
    const { playback } = this;
    const seconds = Math.min(0.25, (now - (this.drawn ?? now)) / 1000);
    this.drawn = now;
    const pace = this.pacing();
    const factor = pace === "real_time" || !pace ? 1 : pace === "free" ? 1e9 : Number.parseFloat(pace);
    const found = this.turns ? playback.advance(seconds, factor) : playback.settle();
    for (const rows of found.passed) this.charts.take(rows);
    if (found.now && (this.turns || this.halted || found.passed.length) && this.rig.picture) {
      this.at = ((found.now.angle % TURN) + TURN) % TURN;
      const pose = this.turns ? found.now : { ...found.now, force: NaN, gap: 0 };
      this.#pose(pose);
      if (!this.turns) this.#stands({ ...pose, angle: this.at });
    }
    this.halted = false;
    const every = 60_000 / (this.rpm * factor) < WHOLE_MS ? WHOLE_MS : CURVES_MS;
    if (!this.turns || !CURVES_MS || now - this.curved > every) {
      this.curved = now;
      this.charts.draw(this.at);
      this.#turned();
    }
    if (this.turns && playback.end !== null) this.#next(now);
    else this.drawn = undefined;
  }

  /** The cam, its follower, and the gap under the lens. @param {Pose} pose */
  #pose(pose) {
    this.lens.show(pose.gap);
    this.rig.pose(pose);
  }

  /** What the gauges say, and of what: where the cam stands, or the most of a turn. @param {"text" | "turning"} kind @param {string[]} said */
  #gauges(kind, ...said) {
    GAUGES.forEach((name, i) => {
      say(`name_${name}`, text($(`name_${name}`).dataset[kind] ?? ""));
      say(`at_${name}`, said[i]);
    });
  }

  /** @param {Pose} pose */
  #stands({ angle, lift, force, gap }) {
    this.#gauges("text", `${((angle * 180) / Math.PI).toFixed(0)}°`, `${(lift + 0).toFixed(2).replace(/^-(0\.0+)$/, "$1")} mm`, Number.isNaN(force) ? "–" : `${shown(force, 4)} N`, gap > 0 ? length(gap) : "0");
  }

  /** Where contact was lost and found in the last turn, and the most of it, where it is another one. */
  #turned() {
    if (!this.over) return;
    const [turn, events] = this.over;
    this.over = null;
    this.rig.marks(events);
    if (!this.turns) return;
    /** @param {"lift" | "force" | "gap"} name */
    const most = (name) => turn.reduce((found, one) => Math.max(found, one[name]), 0);
    const landings = events.filter(({ landing }) => landing).length;
    this.#gauges("turning", String(landings), `${most("lift").toFixed(2)} mm`, `${shown(most("force"), 4)} N`, landings ? length(most("gap")) : "0");
  }
}
