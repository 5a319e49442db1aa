// The cam under its follower, drawn to scale: it turns, the spring works, the force pushes.
import { element, shown } from "./charts.js";

/** Sizes over the ring's radius: its ticks, its numbers, the room around. */
const TICK = [1.03, 1.06], NUMBER = 1.15, AROUND = 1.25;
/** The longest arrow over the ring's radius, and a follower in flight at most, in lifts. */
const ARROW = 0.55, HIGHEST = 1.35;
/** Coils of the spring, and its width over the reach. */
const COILS = 7, WIDE = 0.09;
export const degrees = (/** @type {number} */ radians) => (radians * 180) / Math.PI;
/** A line through points. */
export const path = (/** @type {number[]} */ xs, /** @type {number[]} */ ys) => `M${Array.from(xs, (x, i) => `${x} ${ys[i]}`).join("L")}`;

export class RigPicture {
  /** @param {HTMLElement} place @param {string} label */
  constructor(place, label) {
    this.svg = element("svg", { role: "img", "aria-label": label });
    place.append(this.svg);
    this.strongest = 1;
    this.ring = 0;
    /** @type {CamPicture | null} */
    this.picture = null;
    // Until there is a cam.
    this.cam = this.landings = this.follower = element("g", {});
    this.spring = this.gap = this.arrow = element("path", {});
  }

  /** A cam's picture as the server describes it (mm and rad). @param {CamPicture} picture */
  load(picture) {
    this.picture = picture;
    const { contour, support, outline } = picture;
    this.ring = 1.04 * Math.max(...contour[0].map((x, i) => Math.hypot(x, contour[1][i])));
    const rig = element("g", { transform: "scale(1 -1)" });
    this.#ring(rig);
    this.cam = element("g", {}, rig);
    const closed = `${path(...contour)}Z`;
    element("path", { class: "disc", d: closed }, this.cam);
    element("circle", { class: "base", r: picture.base }, this.cam);
    element("path", { class: "zero_mark", d: `M0 0L${contour[0][0]} ${contour[1][0]}` }, this.cam);
    element("circle", { class: "hub", r: 0.09 * this.ring }, this.cam);
    this.landings = element("g", {}, this.cam);
    for (const strip of support) element("path", { class: "guide", d: path(...strip) }, rig);
    this.spring = element("path", { class: "spring" }, rig);
    this.follower = element("g", {}, rig);
    for (const strip of [...outline].reverse()) element("path", { class: "follower", d: path(...strip) }, this.follower);
    this.gap = element("path", { class: "gap" }, rig);
    this.arrow = element("path", { class: "force" }, rig);
    this.svg.replaceChildren(rig);
    this.#numbers(picture);
    this.#frame(picture);
    this.marks([]);
  }

  /** A ring of degrees around the cam; the mark on the cam points at its angle. @param {SVGGElement} rig */
  #ring(rig) {
    const parts = [];
    for (let d = 0; d < 360; d += 10) {
      const [x, y] = towards(d);
      const long = d % 30 ? TICK[0] : TICK[1];
      parts.push(`M${x * this.ring} ${y * this.ring}L${x * this.ring * long} ${y * this.ring * long}`);
    }
    element("circle", { class: "ring", r: this.ring }, rig);
    element("path", { class: "ring", d: parts.join("") }, rig);
  }

  /** @param {CamPicture} picture */
  #numbers({ swings }) {
    const size = 0.075 * this.ring;
    for (let d = 0; d < 360; d += 30) {
      const [x, y] = towards(d);
      if (!swings && y > 0.9) continue; // the follower stands there
      const number = element("text", { class: "degrees", x: x * this.ring * NUMBER, y: 0.35 * size - y * this.ring * NUMBER }, this.svg);
      number.textContent = `${d}°`;
      number.style.fontSize = `${size}px`; // of the drawing's own millimetres
    }
  }

  /** The view that holds it all, at any lift. @param {CamPicture} picture */
  #frame(picture) {
    const far = AROUND * this.ring;
    let [left, right, bottom, top] = [-far, far, -far, far];
    const take = (/** @type {number} */ x, /** @type {number} */ y) => { left = Math.min(left, x); right = Math.max(right, x); bottom = Math.min(bottom, y); top = Math.max(top, y); };
    for (const [xs, ys] of picture.support) xs.forEach((x, i) => take(x, ys[i]));
    for (const lift of [0, HIGHEST * picture.max_lift]) {
      const [[x0, y0], turn] = stand(picture, lift);
      for (const [xs, ys] of picture.outline) {
        xs.forEach((x, i) => take(x0 + x * Math.cos(turn) - ys[i] * Math.sin(turn), y0 + x * Math.sin(turn) + ys[i] * Math.cos(turn)));
      }
    }
    const room = 0.03 * (top - bottom);
    this.svg.setAttribute("viewBox", `${left - room} ${-top - room} ${right - left + 2 * room} ${top - bottom + 2 * room}`);
  }

  /** @param {Pose} pose */
  pose({ angle, lift, force, gap }) {
    const { picture } = this;
    if (!picture) return;
    const drawn = Math.min(lift, HIGHEST * picture.max_lift);
    const [[x, y], turn] = stand(picture, drawn);
    this.cam.setAttribute("transform", `rotate(${degrees(angle)})`);
    this.follower.setAttribute("transform", `translate(${x} ${y}) rotate(${degrees(turn)})`);
    redraw(this.spring, coils(picture, drawn));
    const { touch, normal } = picture;
    const count = touch[0].length;
    const i = ((Math.round((angle / (2 * Math.PI)) * count) % count) + count) % count;
    const [px, py, nx, ny] = [touch[0][i], touch[1][i], normal[0][i], normal[1][i]];
    this.strongest = Math.max(this.strongest, force || 0);
    const length = (ARROW * this.ring * force) / this.strongest;
    redraw(this.arrow, force > 0 ? arrow(px, py, nx, ny, length, 0.035 * this.ring) : "");
    const up = gap / 1000;
    redraw(this.gap, gap > 0 ? `M${px} ${py}l${nx * up} ${ny * up}` : "");
  }

  /** Where on the cam contact was lost and found again. @param {Crossing[]} events */
  marks(events) {
    if (!this.picture) return;
    const { touch, normal } = this.picture;
    this.landings.replaceChildren(...events.slice(0, 60).map(({ angle, landing }) => {
      const count = touch[0].length;
      const i = ((Math.round((angle / (2 * Math.PI)) * count) % count) + count) % count;
      const size = 0.03 * this.ring;
      const [x, y] = [touch[0][i] - normal[0][i] * 1.6 * size, touch[1][i] - normal[1][i] * 1.6 * size];
      return element("circle", { class: landing ? "landing" : "lift_off", cx: x, cy: y, r: size, transform: `rotate(${-degrees(angle)})` });
    }));
  }
}

/** A length of so many µm as one reads it. @param {number} gap */
export function length(gap) { return gap < 1000 ? `${shown(gap, 3)} µm` : `${shown(gap / 1000, 3)} mm`; }

/** The gap under a lens: cam below, follower above, as far apart as it says. */
export class Lens {
  /** @param {HTMLElement} place */
  constructor(place) {
    this.svg = element("svg", { viewBox: "-50 -50 100 118", "aria-hidden": "true" });
    const clip = element("clipPath", { id: "lens_clip" }, element("defs", {}, this.svg));
    element("circle", { r: 46 }, clip);
    const inside = element("g", { "clip-path": "url(#lens_clip)" }, this.svg);
    element("circle", { class: "glass", r: 46 }, inside);
    element("path", { class: "disc", d: "M-60 60V14Q0 6 60 14V60Z" }, inside);
    this.follower = element("path", { class: "roller", d: "M-60 -90V0Q0 20 60 0V-90Z" }, inside);
    element("circle", { class: "rim", r: 46 }, this.svg);
    this.words = element("text", { y: 64, "text-anchor": "middle" }, this.svg);
    this.widest = 1;
    place.append(this.svg);
  }

  /** A gap (µm); the widest of late fills the glass. @param {number} gap */
  show(gap) {
    this.widest = Math.max(this.widest, gap, 10);
    this.follower.setAttribute("transform", `translate(0 ${(-48 * gap) / this.widest})`);
    const said = length(gap);
    if (this.words.textContent !== said) this.words.textContent = said;
  }
}

/** In a dwell or in contact a path stays as it is, and is not to be painted anew. @param {Element} drawn @param {string} d */
function redraw(drawn, d) {
  if (drawn.getAttribute("d") !== d) drawn.setAttribute("d", d);
}

/** @typedef {{angle: number, landing: boolean}} Crossing */

/**
 * Where the follower's origin is at a lift (mm), and how it is turned.
 * @param {CamPicture} picture @param {number} lift @returns {[Pair, number]}
 */
export function stand({ origin, along, turn, turns }, lift) {
  return [[origin[0] + along[0] * lift, origin[1] + along[1] * lift], turn + turns * lift];
}

/**
 * From the follower to what stands still: along the guide, or from an arm's end upwards.
 * @param {CamPicture} picture @param {number} lift
 */
function coils(picture, lift) {
  const { place, swings, support, reach, roller, max_lift: most } = picture;
  const part = lift / (most || 1);
  const [x0, y0] = swings ? place.map(([from, to]) => from + part * (to - from)) : stand(picture, lift)[0];
  const foot = y0 + Math.max(roller, 0.06 * reach);
  const head = swings ? Math.max(...place[1]) + 0.7 * reach : Math.min(...support[0][1]);
  const [half, step] = [WIDE * reach, (head - foot) / (2 * COILS)];
  const turns = Array.from({ length: 2 * COILS - 1 }, (_, i) => `L${x0 + (i % 2 ? half : -half)} ${foot + (i + 1) * step}`);
  return `M${x0 - half} ${foot}H${x0 + half}M${x0} ${foot}${turns.join("")}L${x0} ${head}`;
}

/** @param {number} angle */
function towards(angle) {
  const turn = (angle * Math.PI) / 180;
  return [-Math.sin(turn), Math.cos(turn)];
}

/** @param {number} x @param {number} y @param {number} nx @param {number} ny @param {number} length @param {number} head */
function arrow(x, y, nx, ny, length, head) {
  const [ex, ey] = [x + nx * length, y + ny * length];
  const [bx, by] = [ex - nx * 2 * head, ey - ny * 2 * head];
  const barbs = length > 2 * head ? `M${bx - ny * head} ${by + nx * head}L${ex} ${ey}L${bx + ny * head} ${by - nx * head}` : "";
  return `M${x} ${y}L${ex} ${ey}${barbs}`;
}
