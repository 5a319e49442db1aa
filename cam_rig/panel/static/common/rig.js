// The cam under its follower, drawn to scale: it turns, the spring works, the force pushes.
import { brush, colours, recoloured, sharpness, size } from "./canvas.js";
import { shown } from "./charts.js";

/** Sizes over the ring's radius: its ticks, its numbers, the room around. */
const TICK = [1.03, 1.06], NUMBER = 1.15, NUMBER_SIZE = 0.075, AROUND = 1.25;
/** The longest arrow over the ring's radius, and a follower in flight at most, in lifts. */
const ARROW = 0.55, HIGHEST = 1.35;
/** Least and greatest width of the lens (px), and a gap (µm) that is worth one. */
const LENS = [84, 116], SEEN_GAP = 10;
/** Of the cam (px): its outline's width, and a dash of its base circle. */
const OUTLINE = 2.4, DASH = 4;
/** Coils of the spring, and its width over the reach. */
const COILS = 7, WIDE = 0.09;
export const degrees = (/** @type {number} */ radians) => (radians * 180) / Math.PI;
/** A line through points. */
export const path = (/** @type {number[]} */ xs, /** @type {number[]} */ ys) => `M${Array.from(xs, (x, i) => `${x} ${ys[i]}`).join("L")}`;

const COLOURS = /** @type {const} */ (["card", "metal", "accent", "ghost", "line", "quiet", "page", "text", "of-follower", "of-force", "of-gap", "of-landing", "of-lift-off"]);
/** @typedef {Record<typeof COLOURS[number], string>} Colours */

/** On one canvas: a page of moving SVG costs its style, layout and paint in every frame. */
export class RigPicture {
  /** @param {HTMLElement} place @param {string} label @param {Lens | null} lens over the corner of the picture */
  constructor(place, label, lens = null) {
    this.place = place;
    this.lens = lens;
    this.canvas = Object.assign(document.createElement("canvas"), { role: "img", ariaLabel: label });
    place.append(this.canvas);
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { alpha: false }));
    /** What stands still behind it. */
    this.behind = document.createElement("canvas");
    this.colours = colours(COLOURS);
    this.strongest = 1;
    this.ring = 0;
    /** Left and right, bottom and top of all that may be seen (mm). @type {[Pair, Pair]} */
    this.view = [[0, 1], [0, 1]];
    /** Of the axis (px), and px/mm. */
    this.frame = [0, 0, 1];
    /** Pixels of the screen to a px. */
    this.scale = 0;
    this.fonts = { lens: "", number: "" };
    /** @type {CamPicture | null} */
    this.picture = null;
    /** @type {Pose} */
    this.posed = { angle: 0, lift: 0, force: 0, gap: 0 };
    /** The cam with its outline and within it, and the dashes of its base circle. */
    this.outer = new Path2D();
    this.inner = new Path2D();
    this.base = new Path2D();
    /** @type {Path2D[]} */
    this.follower = [];
    this.landings = new Path2D();
    this.lift_offs = new Path2D();
    new ResizeObserver(() => this.#resize()).observe(place);
    recoloured(() => {
      this.colours = colours(COLOURS);
      this.#resize();
    });
  }

  /** A cam's picture as the server describes it (mm and rad). @param {CamPicture} picture */
  load(picture) {
    this.picture = picture;
    const { contour, outline } = picture;
    this.ring = 1.04 * Math.max(...contour[0].map((x, i) => Math.hypot(x, contour[1][i])));
    this.follower = outline.map((strip) => new Path2D(path(...strip))).reverse();
    this.view = view(picture, this.ring);
    this.marks([]);
    this.#resize();
  }

  /** The view fills what room there is. */
  #resize() {
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !height || !this.picture) return;
    const [[left, right], [bottom, top]] = this.view;
    const unit = Math.min(width / (right - left), height / (top - bottom));
    this.frame = [width / 2 - (unit * (left + right)) / 2, height / 2 + (unit * (bottom + top)) / 2, unit];
    const { contour, base } = this.picture;
    [this.outer, this.inner] = [0.5, -0.5].map((part) => new Path2D(`${path(...offset(contour, (part * OUTLINE) / unit))}Z`));
    this.base = dashes(base, DASH / unit);
    this.scale = sharpness();
    for (const one of [this.canvas, this.behind]) size(one, width, height);
    const family = getComputedStyle(this.place).fontFamily;
    this.fonts = { lens: `600 13px ${family}`, number: `${NUMBER_SIZE * this.ring * unit}px ${family}` };
    // Chosen once, as far as may be: to choose a font lays the page out.
    [this.context.font, this.context.textAlign] = [this.fonts.lens, "center"];
    this.#stands(this.picture, brush(this.behind), width, height);
    this.#draw();
  }

  /** In mm from the axis, upwards. @param {CanvasRenderingContext2D} context */
  #metric(context) {
    const [x0, y0, unit] = this.frame;
    context.setTransform(this.scale * unit, 0, 0, -this.scale * unit, this.scale * x0, this.scale * y0);
  }

  /**
   * Fill and outline, or one of them; widths in px.
   * @param {CanvasRenderingContext2D} context @param {Path2D} shape @param {{fill?: string, line?: string, width?: number}} look
   */
  #paint(context, shape, { fill, line, width = 2 }) {
    if (fill) {
      context.fillStyle = fill;
      context.fill(shape);
    }
    if (!line) return;
    context.strokeStyle = line;
    context.lineWidth = width / this.frame[2];
    context.stroke(shape);
  }

  /**
   * A ring of degrees around the cam, at whose angle the mark on the cam points, and the guide.
   * @param {CamPicture} picture @param {CanvasRenderingContext2D} context @param {number} width @param {number} height
   */
  #stands(picture, context, width, height) {
    const { ring, colours: of } = this;
    context.fillStyle = of.card;
    context.fillRect(0, 0, width, height);
    if (!picture.swings) this.#numbers(picture, context);
    const dial = new Path2D();
    for (let d = 0; d < 360; d += 10) {
      const [x, y] = towards(d);
      const long = ring * (d % 30 ? TICK[0] : TICK[1]);
      dial.moveTo(x * ring, y * ring);
      dial.lineTo(x * long, y * long);
    }
    dial.addPath(circle(ring));
    this.#metric(context);
    this.#paint(context, dial, { line: of.line, width: 1.4 });
    for (const strip of picture.support) this.#paint(context, new Path2D(path(...strip)), { fill: of.line, line: of.ghost, width: 1.4 });
  }

  /** An arm crosses them, and leaves them to be read. @param {CamPicture} picture @param {CanvasRenderingContext2D} context */
  #numbers({ swings }, context) {
    const { ring, colours: of, frame: [x0, y0, unit] } = this;
    [context.font, context.textAlign, context.textBaseline] = [this.fonts.number, "center", "middle"];
    [context.fillStyle, context.strokeStyle, context.lineJoin] = [of.quiet, of.card, "round"];
    context.lineWidth = 0.35 * NUMBER_SIZE * ring * unit;
    for (let d = 0; d < 360; d += 30) {
      const [x, y] = towards(d);
      if (!swings && y > 0.9) continue; // the follower stands there
      const at = /** @type {const} */ ([`${d}°`, x0 + unit * x * ring * NUMBER, y0 - unit * y * ring * NUMBER]);
      context.strokeText(...at);
      context.fillText(...at);
    }
  }

  /** @param {Pose} pose */
  pose(pose) {
    this.posed = pose;
    this.strongest = Math.max(this.strongest, pose.force || 0);
    if (sharpness() === this.scale) this.#draw();
    else this.#resize(); // on another screen, or seen larger
  }

  #draw() {
    const { picture, context, posed: { angle, lift, force, gap }, colours: of, ring } = this;
    if (!picture || !this.scale) return;
    context.resetTransform();
    context.drawImage(this.behind, 0, 0);
    [context.lineJoin, context.lineCap] = ["round", "butt"];
    this.#metric(context);
    context.save();
    context.rotate(angle);
    this.#turning(picture);
    context.restore();
    const drawn = Math.min(lift, HIGHEST * picture.max_lift);
    this.#paint(context, new Path2D(coils(picture, drawn)), { line: of.quiet });
    const [[x, y], turn] = stand(picture, drawn);
    context.save();
    context.translate(x, y);
    context.rotate(turn);
    for (const strip of this.follower) this.#paint(context, strip, { fill: of.card, line: of["of-follower"], width: 2.4 });
    context.restore();
    const [px, py, nx, ny] = touched(picture, angle);
    const up = gap / 1000;
    if (gap > 0) this.#paint(context, new Path2D(`M${px} ${py}l${nx * up} ${ny * up}`), { line: of["of-gap"], width: 4 });
    context.lineCap = "round";
    const length = (ARROW * ring * force) / this.strongest;
    if (force > 0) this.#paint(context, new Path2D(arrow(px, py, nx, ny, length, 0.035 * ring)), { line: of["of-force"], width: 4 });
    context.setTransform(this.scale, 0, 0, this.scale, 0, 0);
    if (picture.swings) {
      context.save();
      this.#numbers(picture, context);
      context.restore();
    }
    this.lens?.draw(context, of, this.canvas.width / this.scale);
  }

  /** The cam, with the mark of its angle, and where contact was lost and found. @param {CamPicture} picture */
  #turning({ contour }) {
    const { context, colours: of } = this;
    this.#paint(context, this.outer, { fill: of.accent }); // two fills are a third of a stroke's work
    this.#paint(context, this.inner, { fill: of.metal });
    this.#paint(context, this.base, { line: of.ghost, width: 1 });
    this.#paint(context, new Path2D(`M0 0L${contour[0][0]} ${contour[1][0]}`), { line: of.accent });
    this.#paint(context, circle(0.09 * this.ring), { fill: of.card, line: of.accent });
    this.#paint(context, this.landings, { fill: of["of-landing"] });
    this.#paint(context, this.lift_offs, { line: of["of-lift-off"] });
  }

  /** Where on the cam contact was lost and found again. @param {Crossing[]} events */
  marks(events) {
    [this.landings, this.lift_offs] = [new Path2D(), new Path2D()];
    if (!this.picture) return;
    const size = 0.03 * this.ring;
    for (const { angle, landing } of events.slice(0, 60)) {
      const [px, py, nx, ny] = touched(this.picture, angle);
      const [x, y] = [px - nx * 1.6 * size, py - ny * 1.6 * size];
      const at = new DOMMatrix().rotateSelf(-degrees(angle)).translateSelf(x, y);
      (landing ? this.landings : this.lift_offs).addPath(circle(size), at);
    }
  }
}

/** A length of so many µm as one reads it. @param {number} gap */
export function length(gap) { return gap < 1000 ? `${shown(gap, 3)} µm` : `${shown(gap / 1000, 3)} mm`; }

/** The gap under a lens: cam below, follower above, as far apart as it says. */
export class Lens {
  /** What fills the glass, and what is seen (µm). */
  widest = 0;
  gap = 0;
  cam = new Path2D("M-60 60V14Q0 6 60 14V60Z");
  roller = new Path2D("M-60 -90V0Q0 20 60 0V-90Z");
  glass = circle(46);

  /** A gap (µm); the widest of late fills the glass. @param {number} gap */
  show(gap) {
    this.gap = gap;
    this.widest = Math.max(this.widest, gap);
  }

  /** In the upper right corner, where there is a gap to be seen. @param {CanvasRenderingContext2D} context @param {Colours} of @param {number} width */
  draw(context, of, width) {
    if (this.widest <= SEEN_GAP && !this.gap) return;
    const unit = Math.min(LENS[1], Math.max(LENS[0], 0.22 * width)) / 100;
    context.translate(width - 50 * unit, 50 * unit);
    context.scale(unit, unit);
    context.save();
    context.clip(this.glass);
    context.fillStyle = of.card;
    context.fill(this.glass);
    context.lineWidth = 1.5;
    [context.fillStyle, context.strokeStyle] = [of.metal, of.accent];
    context.fill(this.cam);
    context.stroke(this.cam);
    context.translate(0, (-48 * this.gap) / Math.max(this.widest, SEEN_GAP));
    [context.fillStyle, context.strokeStyle] = [of.page, of["of-follower"]];
    context.fill(this.roller);
    context.stroke(this.roller);
    context.restore();
    [context.strokeStyle, context.lineWidth] = [of.ghost, 3];
    context.stroke(this.glass);
    context.fillStyle = of.text;
    context.fillText(length(this.gap), 0, 64);
  }
}

/** A closed line, moved outwards by a distance. @param {Points} points @param {number} by @returns {Points} */
function offset([xs, ys], by) {
  const { length: count } = xs, next = (/** @type {number} */ i) => (i + 1) % count, last = (/** @type {number} */ i) => (i + count - 1) % count;
  const turns = Math.sign(xs.reduce((area, x, i) => area + x * ys[next(i)] - xs[next(i)] * ys[i], 0));
  const ways = xs.map((_, i) => [ys[next(i)] - ys[last(i)], xs[last(i)] - xs[next(i)]]);
  const far = ways.map(([x, y]) => (turns * by) / (Math.hypot(x, y) || 1));
  return [xs.map((x, i) => x + far[i] * ways[i][0]), ys.map((y, i) => y + far[i] * ways[i][1])];
}

/** A circle of dashes about so long, and as far apart. @param {number} radius @param {number} long */
function dashes(radius, long) {
  const drawn = new Path2D(), step = Math.PI / Math.round((Math.PI * radius) / long);
  for (let angle = 0; angle < 2 * Math.PI - step / 2; angle += 2 * step) {
    drawn.moveTo(radius * Math.cos(angle), radius * Math.sin(angle));
    drawn.lineTo(radius * Math.cos(angle + step), radius * Math.sin(angle + step));
  }
  return drawn;
}

/** @param {number} radius */
function circle(radius) {
  const drawn = new Path2D();
  drawn.arc(0, 0, radius, 0, 2 * Math.PI);
  return drawn;
}

/** Where the follower touches the cam at an angle, and the way out of the cam. @param {CamPicture} picture @param {number} angle */
function touched({ touch, normal }, angle) {
  const count = touch[0].length;
  const i = ((Math.round((angle / (2 * Math.PI)) * count) % count) + count) % count;
  return [touch[0][i], touch[1][i], normal[0][i], normal[1][i]];
}

/**
 * What holds it all, at any lift: left and right, bottom and top (mm).
 * @param {CamPicture} picture @param {number} ring @returns {[Pair, Pair]}
 */
function view(picture, ring) {
  const far = AROUND * ring;
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
  return [[left - room, right + room], [bottom - room, top + room]];
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
