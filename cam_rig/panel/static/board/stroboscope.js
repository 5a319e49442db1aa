// The turning cam under flashes: only what a flash shows is drawn, so that a cam that makes whole
// turns between two flashes stands still. Nothing flashes on the page; it is redrawn at most once
// a frame.
import { element, shown } from "../common/charts.js";
import { $, field } from "../common/dom.js";
import { text } from "../common/texts.js";

const MARGIN = 10;

export class Stroboscope {
  /** @param {Board} board */
  constructor({ colours, follower, rpm }) {
    this.colours = colours;
    this.follower = follower;
    /** @type {Disc[]} */
    this.discs = [];
    this.turns = 0;
    this.speed = rpm;
    /** @type {Numbers} */
    this.lift = [];
    /** When it began to run (ms). @type {number | null} */
    this.since = null;
    this.seen = 0;
    this.unit = 0; // px/mm, once there are discs and room
    this.place = $("strobe");
    this.svg = element("svg", { role: "img", "aria-label": text("strobe") });
    this.place.append(this.svg);
    this.cam = element("g", {}, this.svg);
    this.held = element("g", {}, this.svg);
    field("flashes").value = String(rpm);
    $("flashes").addEventListener("input", () => this.#again());
    $("as_speed").addEventListener("click", () => { field("flashes").value = String(this.speed); this.#again(); });
    $("flash").addEventListener("click", () => this.#flash(1));
    $("run").addEventListener("click", () => this.#run(this.since === null));
    // Who asked for less motion steps by the button, flash by flash.
    const calm = matchMedia("(prefers-reduced-motion: reduce)");
    const respect = () => { $("run").hidden = calm.matches; if (calm.matches) this.#run(false); };
    calm.addEventListener("change", respect);
    respect();
    new ResizeObserver(() => this.#place()).observe(this.place);
    this.#again();
  }

  /** Flashes a minute. */
  get rate() { return field("flashes").checkValidity() ? field("flashes").valueAsNumber : NaN; }

  /** The lift (m) at equal steps of a turn, and the cam speed. @param {Numbers} lift @param {number} rpm */
  law(lift, rpm) {
    this.lift = lift;
    if (rpm !== this.speed) { this.speed = rpm; this.#again(); } else this.#say();
  }

  /** Contours in mm, of points at equal steps of the cam angle. @param {Disc[]} discs */
  shapes(discs) {
    this.discs = discs;
    this.#place();
  }

  /** @param {boolean} on */
  #run(on) {
    this.since = on ? performance.now() : null;
    this.seen = 0;
    $("run").setAttribute("aria-pressed", String(on));
    $("run").textContent = text(on ? "strobe_stop" : "strobe_run");
    if (on) requestAnimationFrame(() => this.#frame());
  }

  /** Speed or flashes changed: those to come are counted from now on. */
  #again() {
    if (this.since !== null) { this.since = performance.now(); this.seen = 0; }
    this.#say();
  }

  #frame() {
    if (this.since === null) return;
    const flashes = Math.floor(((performance.now() - this.since) / 6e4) * this.rate);
    if (flashes > this.seen) {
      this.#flash(flashes - this.seen);
      this.seen = flashes;
    }
    requestAnimationFrame(() => this.#frame());
  }

  /** So many flashes later: what the last one shows. @param {number} count */
  #flash(count) {
    const turns = count * (this.speed / this.rate);
    if (!Number.isFinite(turns)) return;
    this.turns = (this.turns + turns) % 1;
    this.#show();
    this.#say();
  }

  /** Where the cam is, and how fast it seems to turn. */
  #say() {
    const per = this.speed / this.rate;
    const part = per - Math.round(per);
    $("seems").textContent = !Number.isFinite(per) ? text("strobe_range")
      : Math.abs(part) < 1e-9 ? text("strobe_still", { turns: shown(Math.round(per)) })
        : text(part > 0 ? "strobe_forward" : "strobe_backward", { rpm: shown(Math.abs(part) * this.rate, 3) });
    const n = this.lift.length;
    const lift = n ? (this.lift[Math.round(this.turns * n) % n] * 1e3).toFixed(3) : "–";
    $("phase").textContent = text("strobe_phase", { angle: (this.turns * 360).toFixed(1), lift });
  }

  /** The discs, drawn once for each law; then they are only turned. */
  #place() {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !this.discs.length) return;
    const reach = Math.max(...this.discs.flatMap(({ points, pitch }) => [points, pitch ?? points].flatMap(([xs, ys]) => xs.map((x, i) => Math.hypot(x, ys[i])))));
    const radius = reach + this.follower.roller_mm;
    this.unit = (Math.min(width, height) / 2 - MARGIN) / radius;
    this.svg.setAttribute("viewBox", `${-width / 2} ${-height / 2} ${width} ${height}`);
    const parts = document.createDocumentFragment();
    for (const { points } of this.discs) {
      const line = points[0].map((x, i) => this.#px([x, points[1][i]]).join(" ")).join("L");
      element("path", { class: "curve", stroke: this.colours.contour, d: `M${line}Z` }, parts);
    }
    // A spoke at cam angle 0: what is seen to creep on a disc that is nearly round.
    element("path", { class: "curve ghost", stroke: this.colours.ghost, d: `M0 0L${this.#px([0, this.discs[0].points[1][0]]).join(" ")}` }, parts);
    this.cam.replaceChildren(parts);
    this.#show();
  }

  /** @param {Pair} point */
  #px([x, y]) { return [(this.unit * x).toFixed(1), (-this.unit * y).toFixed(1)]; }

  #show() {
    if (!this.unit) return;
    const angle = this.turns * 2 * Math.PI;
    this.cam.setAttribute("transform", `rotate(${(-this.turns * 360).toFixed(2)})`);
    const parts = document.createDocumentFragment();
    element("path", { class: "zero", d: "M-6 0H6M0 -6V6" }, parts);
    for (const disc of this.discs) this.#follower(disc, angle, parts);
    this.held.replaceChildren(parts);
    this.svg.dataset.degrees = (this.turns * 360).toFixed(3);
  }

  /**
   * Roller, knife edge or face where it touches, with its stem or arm.
   * @param {Disc} disc @param {number} angle @param {DocumentFragment} parts
   */
  #follower({ points, pitch }, angle, parts) {
    const touch = turned(points, this.turns, angle);
    const centre = pitch ? turned(pitch, this.turns, angle) : touch;
    const [x, y] = this.#px(centre);
    const stroke = this.colours.force;
    const { roller_mm: roller, pivot_mm: pivot } = this.follower;
    if (pitch && roller) element("circle", { class: "curve", stroke, cx: x, cy: y, r: this.unit * roller }, parts);
    if (!pitch) {
      const [[x0, y0], [x1, y1]] = [-1, 1].map((step) => turned(points, this.turns + step / points[0].length, angle));
      const size = 14 / (this.unit * (Math.hypot(x1 - x0, y1 - y0) || 1));
      const [dx, dy] = [size * (x1 - x0), size * (y1 - y0)];
      const [a, b] = [this.#px([touch[0] - dx, touch[1] - dy]), this.#px([touch[0] + dx, touch[1] + dy])];
      element("path", { class: "curve", stroke, d: `M${a.join(" ")}L${b.join(" ")}` }, parts);
    }
    const end = pivot === null ? [x, Number(y) > 0 ? "1000" : "-1000"] : this.#px([pivot, 0]);
    element("path", { class: "curve ghost", stroke, d: `M${x} ${y}L${end.join(" ")}` }, parts);
  }
}

/**
 * A point of a closed curve in the cam's frame, between two of those given, as the cam has turned.
 * @param {Points} points @param {number} turns @param {number} angle @returns {Pair}
 */
function turned([xs, ys], turns, angle) {
  const n = xs.length;
  const at = (((turns % 1) + 1) % 1) * n;
  const [i, part] = [Math.floor(at) % n, at - Math.floor(at)];
  const between = (/** @type {number[]} */ values) => values[i] + part * (values[(i + 1) % n] - values[i]);
  const [x, y] = [between(xs), between(ys)];
  return [Math.cos(angle) * x - Math.sin(angle) * y, Math.sin(angle) * x + Math.cos(angle) * y];
}
