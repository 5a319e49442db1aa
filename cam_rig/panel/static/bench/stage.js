// The picture of the rig, its gauges and the charts of a turn: what runs, or what is expected.
import { recoloured } from "../common/canvas.js";
import { shown } from "../common/charts.js";
import { $, say } from "../common/dom.js";
import { text } from "../common/texts.js";
/** @import { Rows } from "./playback.js" */
/** @import { Crossing } from "../common/rig.js" */
/** @import { Sample } from "./turns.js" */
import { Playback, rowsOf } from "./playback.js";
import { length, Lens, RigPicture } from "../common/rig.js";
import { TurnCharts } from "./turns.js";

const TURN = 2 * Math.PI;
const GAUGES = ["angle", "lift", "force", "gap"];
/** Without a graphics card every frame is the processor's work, and one in so long (ms) is enough: 30 a second. */
const FRAME_MS = accelerated() ? 0 : 25;

/** The cam is watched, curves are read: so often (ms) those are drawn. */
const CURVES_MS = FRAME_MS && 100;

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
    /** @type {string | null} */
    this.cam = null;
    /** A settled turn that is expected. @type {Rows | null} */
    this.known = null;
    this.at = 0; // the cam angle, rad
    this.frame = 0;
    this.waits = 0; // for the next frame
    this.stood = false; // has turned, and stands: no force of a motion is left
    this.halted = false; // has just come to stand, and is to be drawn where
    this.curved = 0; // when (ms) the curves were drawn
    /** When (ms) it was drawn, while it moves. @type {number | undefined} */
    this.drawn = undefined;
    this.playback = new Playback();
    this.lens = new Lens();
    this.rig = new RigPicture($("rig"), text("rig_picture"), this.lens);
    this.charts = new TurnCharts($("curves"), (angle) => this.#hover(angle));
    this.charts.told = (turn, events) => {
      this.rig.marks(events);
      if (this.turns) this.#turned(turn, events);
    };
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
    if (graph === "starting") this.playback.reset();
    if (this.turns && !turns) this.halted = this.stood = true;
    if (turns || graph === "starting") this.stood = false;
    this.turns = turns;
    if (this.halted) this.#soon();
  }

  /** @param {string} cam */
  async #load(cam) {
    this.cam = cam;
    const answer = await fetch(`/bench/cam/${encodeURIComponent(cam)}`).catch(() => null);
    if (cam !== this.cam) return;
    if (!answer?.ok) { this.cam = null; return; }
    this.rig.load(await answer.json());
    this.charts.clear();
    this.#still();
  }

  /** A settled turn as the server found it; null where there is none. @param {Expected | null} found */
  expect(found) {
    this.known = found && rowsOf(Uint8Array.from(atob(found.curves), (character) => character.charCodeAt(0)).buffer, 0);
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

  /** The frame after the one that was just drawn. */
  #next() {
    clearTimeout(this.waits);
    if (FRAME_MS) this.waits = setTimeout(() => this.#soon(), FRAME_MS);
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
    if (!this.turns || now - this.curved > CURVES_MS) {
      this.curved = now;
      this.charts.draw(this.at);
    }
    if (this.turns && playback.end !== null) this.#next();
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

  /** A turn is over. @param {Sample[]} turn @param {Crossing[]} events */
  #turned(turn, events) {
    /** @param {"lift" | "force" | "gap"} name */
    const most = (name) => turn.reduce((found, one) => Math.max(found, one[name]), 0);
    const landings = events.filter(({ landing }) => landing).length;
    this.#gauges("turning", String(landings), `${most("lift").toFixed(2)} mm`, `${shown(most("force"), 4)} N`, landings ? length(most("gap")) : "0");
  }
}
