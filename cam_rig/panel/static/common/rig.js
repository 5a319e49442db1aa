// The cam under its follower, drawn to scale: the cam turns, the spring moves, an arrow shows the force.
import { contextOf, onColourChange, pixelRatio, readColours, resizeCanvas } from "./canvas.js";
import { union } from "./charts.js";
import { formatNumber } from "./texts.js";

// Lengths relative to the radius of the ring of degrees.
/** Ends of the short and of the long ticks of the ring. */
const SHORT_TICK = 1.03, LONG_TICK = 1.06;
/** Radius and height of the numbers of the ring. */
const NUMBER_RADIUS = 1.15, NUMBER_SIZE = 0.075;
/** Radius of the visible area. */
const VIEW_RADIUS = 1.25;
/** Length of the arrow of the largest force. */
const ARROW_LENGTH = 0.55;

/** Largest displayed displacement of a follower in flight, relative to the largest lift. */
const MAX_FLIGHT = 1.35;
/** Smallest and largest width of the lens, px, and the smallest gap that is displayed in it, µm. */
const LENS_WIDTH = [84, 116], MIN_LENS_GAP = 10;
/** Width of the cam's outline, and length of the dashes of its base circle, px. */
const OUTLINE = 2.4, DASH = 4;
/** Number of coils of the spring, and its half width relative to the follower's reach. */
const COILS = 7, SPRING_WIDTH = 0.09;
/** Largest number of displayed lift-offs and landings. */
const MAX_EVENTS = 60;

export const degrees = (/** @type {number} */ radians) => (radians * 180) / Math.PI;

/** Return the SVG path of a line through points. @param {Points} points */
export const polyline = ([xs, ys]) => `M${Array.from(xs, (x, i) => `${x} ${ys[i]}`).join("L")}`;

/** Return a gap (µm) with its unit. @param {number} gap */
export function formatGap(gap) {
  return gap < 1000 ? `${formatNumber(gap, 3)} µm` : `${formatNumber(gap / 1000, 3)} mm`;
}

const COLOURS = /** @type {const} */ (["card", "metal", "accent", "ghost", "line", "quiet", "page", "text", "of-follower", "of-force", "of-gap", "of-landing", "of-lift-off"]);
/** @typedef {Record<typeof COLOURS[number], string>} Colours */
/** Loss of contact or landing at a cam angle, rad. @typedef {{angle: number, isLanding: boolean}} ContactEvent */

/** Picture of the rig on a canvas, because moving SVG costs style, layout and paint in every frame. */
export class RigPicture {
  /** @param {HTMLElement} parent @param {string} label @param {Lens | null} lens */
  constructor(parent, label, lens = null) {
    this.parent = parent;
    this.lens = lens;
    this.canvas = Object.assign(document.createElement("canvas"), { role: "img", ariaLabel: label });
    parent.append(this.canvas);
    this.context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d", { alpha: false }));
    /** Parts that do not move. */
    this.background = document.createElement("canvas");
    this.colours = readColours(COLOURS);
    /** Largest force of the present cam, N. */
    this.maxForce = 1;
    /** Radius of the ring of degrees, mm. */
    this.ring = 0;
    /** Visible area, mm. @type {{x: Pair, y: Pair}} */
    this.view = { x: [0, 1], y: [0, 1] };
    /** Position of the axis (px), and px/mm. */
    this.frame = { x: 0, y: 0, unit: 1 };
    /** Screen pixels per px, 0 before the first layout. */
    this.ratio = 0;
    this.fonts = { lens: "", number: "" };
    /** @type {CamPicture | null} */
    this.picture = null;
    /** @type {Pose} */
    this.pose = { angle: 0, lift: 0, force: 0, gap: 0 };
    /** Cam with its outline, cam within its outline, and base circle. */
    this.outer = new Path2D();
    this.inner = new Path2D();
    this.base = new Path2D();
    /** @type {Path2D[]} */
    this.follower = [];
    this.landings = new Path2D();
    this.liftOffs = new Path2D();
    new ResizeObserver(() => this.#resize()).observe(parent);
    onColourChange(() => {
      this.colours = readColours(COLOURS);
      this.#resize();
    });
  }

  /** Display another cam. @param {CamPicture} picture */
  load(picture) {
    this.picture = picture;
    const [xs, ys] = picture.contour;
    this.ring = 1.04 * Math.max(...xs.map((x, i) => Math.hypot(x, ys[i])));
    this.follower = picture.outline.map((outline) => new Path2D(polyline(outline))).reverse();
    this.view = visibleArea(picture, this.ring);
    this.setEvents([]);
    this.#resize();
  }

  #resize() {
    const { picture, view, parent: { clientWidth: width, clientHeight: height } } = this;
    if (!width || !height || !picture) return;
    const unit = Math.min(width / (view.x[1] - view.x[0]), height / (view.y[1] - view.y[0]));
    this.frame = { x: width / 2 - (unit * (view.x[0] + view.x[1])) / 2, y: height / 2 + (unit * (view.y[0] + view.y[1])) / 2, unit };
    [this.outer, this.inner] = [0.5, -0.5].map((side) => new Path2D(`${polyline(offset(picture.contour, (side * OUTLINE) / unit))}Z`));
    this.base = dashedCircle(picture.base, DASH / unit);
    this.ratio = pixelRatio();
    for (const canvas of [this.canvas, this.background]) resizeCanvas(canvas, width, height);
    const family = getComputedStyle(this.parent).fontFamily;
    this.fonts = { lens: `600 13px ${family}`, number: `${NUMBER_SIZE * this.ring * unit}px ${family}` };
    // The font is set once, because setting it causes a layout of the page.
    [this.context.font, this.context.textAlign] = [this.fonts.lens, "center"];
    this.#drawBackground(picture, contextOf(this.background), width, height);
    this.#draw();
  }

  /** Draw in mm from the axis, with y upwards. @param {CanvasRenderingContext2D} context */
  #useMillimetres(context) {
    const { x, y, unit } = this.frame;
    context.setTransform(this.ratio * unit, 0, 0, -this.ratio * unit, this.ratio * x, this.ratio * y);
  }

  /**
   * Fill a shape and draw its outline, or one of them. The width is in px.
   * @param {CanvasRenderingContext2D} context @param {Path2D} shape @param {{fill?: string, line?: string, width?: number}} style
   */
  #paint(context, shape, { fill, line, width = 2 }) {
    if (fill) {
      context.fillStyle = fill;
      context.fill(shape);
    }
    if (!line) return;
    context.strokeStyle = line;
    context.lineWidth = width / this.frame.unit;
    context.stroke(shape);
  }

  /**
   * Draw the ring of degrees and the guide. The mark on the cam points to the cam angle.
   * @param {CamPicture} picture @param {CanvasRenderingContext2D} context @param {number} width @param {number} height
   */
  #drawBackground(picture, context, width, height) {
    const { ring, colours } = this;
    context.fillStyle = colours.card;
    context.fillRect(0, 0, width, height);
    if (!picture.is_oscillating) this.#drawNumbers(picture, context);
    const dial = new Path2D();
    for (let angle = 0; angle < 360; angle += 10) {
      const [x, y] = direction(angle);
      const end = ring * (angle % 30 ? SHORT_TICK : LONG_TICK);
      dial.moveTo(x * ring, y * ring);
      dial.lineTo(x * end, y * end);
    }
    dial.addPath(circle(ring));
    this.#useMillimetres(context);
    this.#paint(context, dial, { line: colours.line, width: 1.4 });
    for (const outline of picture.support) {
      this.#paint(context, new Path2D(polyline(outline)), { fill: colours.line, line: colours.ghost, width: 1.4 });
    }
  }

  /** Draw the numbers of the ring, above an arm that crosses them. @param {CamPicture} picture @param {CanvasRenderingContext2D} context */
  #drawNumbers({ is_oscillating: isOscillating }, context) {
    const { ring, colours, frame } = this;
    [context.font, context.textAlign, context.textBaseline] = [this.fonts.number, "center", "middle"];
    [context.fillStyle, context.strokeStyle, context.lineJoin] = [colours.quiet, colours.card, "round"];
    context.lineWidth = 0.35 * NUMBER_SIZE * ring * frame.unit;
    const radius = frame.unit * ring * NUMBER_RADIUS;
    for (let angle = 0; angle < 360; angle += 30) {
      const [x, y] = direction(angle);
      if (!isOscillating && y > 0.9) continue; // position of the follower
      context.strokeText(`${angle}°`, frame.x + radius * x, frame.y - radius * y);
      context.fillText(`${angle}°`, frame.x + radius * x, frame.y - radius * y);
    }
  }

  /** @param {Pose} pose */
  setPose(pose) {
    this.pose = pose;
    this.maxForce = Math.max(this.maxForce, pose.force || 0);
    if (pixelRatio() === this.ratio) this.#draw();
    else this.#resize(); // the page is on another screen, or zoomed
  }

  #draw() {
    const { picture, context, pose: { angle, lift, force, gap }, colours, ring } = this;
    if (!picture || !this.ratio) return;
    context.resetTransform();
    context.drawImage(this.background, 0, 0);
    [context.lineJoin, context.lineCap] = ["round", "butt"];
    this.#useMillimetres(context);
    context.save();
    context.rotate(angle);
    this.#drawCam(picture);
    context.restore();
    const drawnLift = Math.min(lift, MAX_FLIGHT * picture.max_lift);
    this.#paint(context, new Path2D(spring(picture, drawnLift)), { line: colours.quiet });
    const follower = followerPose(picture, drawnLift);
    context.save();
    context.translate(follower.x, follower.y);
    context.rotate(follower.turn);
    for (const outline of this.follower) this.#paint(context, outline, { fill: colours.card, line: colours["of-follower"], width: 2.4 });
    context.restore();
    const contact = contactPoint(picture, angle), size = gap / 1000;
    if (gap > 0) {
      const line = new Path2D(`M${contact.x} ${contact.y}l${contact.normalX * size} ${contact.normalY * size}`);
      this.#paint(context, line, { line: colours["of-gap"], width: 4 });
    }
    context.lineCap = "round";
    if (force > 0) {
      const shape = arrow(contact, (ARROW_LENGTH * ring * force) / this.maxForce, 0.035 * ring);
      this.#paint(context, new Path2D(shape), { line: colours["of-force"], width: 4 });
    }
    context.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    if (picture.is_oscillating) {
      context.save();
      this.#drawNumbers(picture, context);
      context.restore();
    }
    this.lens?.draw(context, colours, this.canvas.width / this.ratio);
  }

  /** Draw the cam with the mark of its angle, the lift-offs and the landings. @param {CamPicture} picture */
  #drawCam({ contour: [xs, ys] }) {
    const { context, colours } = this;
    this.#paint(context, this.outer, { fill: colours.accent }); // two fills take a third of the time of a stroke
    this.#paint(context, this.inner, { fill: colours.metal });
    this.#paint(context, this.base, { line: colours.ghost, width: 1 });
    this.#paint(context, new Path2D(`M0 0L${xs[0]} ${ys[0]}`), { line: colours.accent });
    this.#paint(context, circle(0.09 * this.ring), { fill: colours.card, line: colours.accent });
    this.#paint(context, this.landings, { fill: colours["of-landing"] });
    this.#paint(context, this.liftOffs, { line: colours["of-lift-off"] });
  }

  /** Mark lift-offs and landings on the cam. @param {ContactEvent[]} events */
  setEvents(events) {
    [this.landings, this.liftOffs] = [new Path2D(), new Path2D()];
    if (!this.picture) return;
    const size = 0.03 * this.ring;
    for (const { angle, isLanding } of events.slice(0, MAX_EVENTS)) {
      const { x, y, normalX, normalY } = contactPoint(this.picture, angle);
      const position = new DOMMatrix().rotateSelf(-degrees(angle)).translateSelf(x - normalX * 1.6 * size, y - normalY * 1.6 * size);
      (isLanding ? this.landings : this.liftOffs).addPath(circle(size), position);
    }
  }
}

/** Magnified gap in a corner of the picture: cam below, follower above. */
export class Lens {
  /** Gap that fills the lens, and displayed gap, µm. */
  maxGap = 0;
  gap = 0;
  cam = new Path2D("M-60 60V14Q0 6 60 14V60Z");
  roller = new Path2D("M-60 -90V0Q0 20 60 0V-90Z");
  glass = circle(46);

  /** @param {number} gap µm */
  setGap(gap) {
    this.gap = gap;
    this.maxGap = Math.max(this.maxGap, gap);
  }

  /** Draw the lens if a gap is visible. @param {CanvasRenderingContext2D} context @param {Colours} colours @param {number} width */
  draw(context, colours, width) {
    if (this.maxGap <= MIN_LENS_GAP && !this.gap) return;
    const unit = Math.min(LENS_WIDTH[1], Math.max(LENS_WIDTH[0], 0.22 * width)) / 100;
    context.translate(width - 50 * unit, 50 * unit);
    context.scale(unit, unit);
    context.save();
    context.clip(this.glass);
    context.fillStyle = colours.card;
    context.fill(this.glass);
    context.lineWidth = 1.5;
    [context.fillStyle, context.strokeStyle] = [colours.metal, colours.accent];
    context.fill(this.cam);
    context.stroke(this.cam);
    context.translate(0, (-48 * this.gap) / Math.max(this.maxGap, MIN_LENS_GAP));
    [context.fillStyle, context.strokeStyle] = [colours.page, colours["of-follower"]];
    context.fill(this.roller);
    context.stroke(this.roller);
    context.restore();
    [context.strokeStyle, context.lineWidth] = [colours.ghost, 3];
    context.stroke(this.glass);
    context.fillStyle = colours.text;
    context.fillText(formatGap(this.gap), 0, 64);
  }
}

// Geometry, in mm and rad.

/** Return a closed line that is offset outwards. @param {Points} points @param {number} distance @returns {Points} */
function offset([xs, ys], distance) {
  const next = (/** @type {number} */ i) => (i + 1) % xs.length;
  const last = (/** @type {number} */ i) => (i + xs.length - 1) % xs.length;
  const orientation = Math.sign(xs.reduce((area, x, i) => area + x * ys[next(i)] - xs[next(i)] * ys[i], 0));
  const normals = xs.map((_, i) => [ys[next(i)] - ys[last(i)], xs[last(i)] - xs[next(i)]]);
  const factors = normals.map(([x, y]) => (orientation * distance) / (Math.hypot(x, y) || 1));
  return [xs.map((x, i) => x + factors[i] * normals[i][0]), ys.map((y, i) => y + factors[i] * normals[i][1])];
}

/** Return a circle of dashes with equal gaps. @param {number} radius @param {number} length of a dash */
function dashedCircle(radius, length) {
  const shape = new Path2D(), step = Math.PI / Math.round((Math.PI * radius) / length);
  for (let angle = 0; angle < 2 * Math.PI - step / 2; angle += 2 * step) {
    shape.moveTo(radius * Math.cos(angle), radius * Math.sin(angle));
    shape.lineTo(radius * Math.cos(angle + step), radius * Math.sin(angle + step));
  }
  return shape;
}

/** @param {number} radius */
function circle(radius) {
  const shape = new Path2D();
  shape.arc(0, 0, radius, 0, 2 * Math.PI);
  return shape;
}

/** Return the contact point and the outward normal at a cam angle. @param {CamPicture} picture @param {number} angle */
function contactPoint({ contact, normal }, angle) {
  const count = contact[0].length;
  const i = ((Math.round((angle / (2 * Math.PI)) * count) % count) + count) % count;
  return { x: contact[0][i], y: contact[1][i], normalX: normal[0][i], normalY: normal[1][i] };
}

/**
 * Return the ranges of x and y of cam, ring, guide and follower at any lift.
 * @param {CamPicture} picture @param {number} ring
 */
function visibleArea(picture, ring) {
  const radius = VIEW_RADIUS * ring;
  /** @type {{x: Pair, y: Pair}} */
  const area = { x: [-radius, radius], y: [-radius, radius] };
  const include = (/** @type {number} */ x, /** @type {number} */ y) => {
    [area.x, area.y] = [union(area.x, [x, x]), union(area.y, [y, y])];
  };
  for (const [xs, ys] of picture.support) xs.forEach((x, i) => include(x, ys[i]));
  for (const lift of [0, MAX_FLIGHT * picture.max_lift]) {
    const { x: x0, y: y0, turn } = followerPose(picture, lift);
    for (const [xs, ys] of picture.outline) {
      xs.forEach((x, i) => include(x0 + x * Math.cos(turn) - ys[i] * Math.sin(turn), y0 + x * Math.sin(turn) + ys[i] * Math.cos(turn)));
    }
  }
  const margin = 0.03 * (area.y[1] - area.y[0]);
  for (const range of [area.x, area.y]) [range[0], range[1]] = [range[0] - margin, range[1] + margin];
  return area;
}

/** Return position and turn of the follower at a lift (mm). @param {FollowerPicture} picture @param {number} lift */
export function followerPose({ origin, origin_per_mm: perMm, turn, turn_per_mm: turnPerMm }, lift) {
  return { x: origin[0] + perMm[0] * lift, y: origin[1] + perMm[1] * lift, turn: turn + turnPerMm * lift };
}

/** Return the spring from the follower to the guide, or upwards from the end of an arm. @param {CamPicture} picture @param {number} lift */
function spring(picture, lift) {
  const { centre, is_oscillating: isOscillating, support, reach, roller, max_lift: maxLift } = picture;
  const fraction = lift / (maxLift || 1);
  const pose = followerPose(picture, lift);
  const [x, y] = isOscillating ? centre.map(([first, last]) => first + fraction * (last - first)) : [pose.x, pose.y];
  const bottom = y + Math.max(roller, 0.06 * reach);
  const top = isOscillating ? Math.max(...centre[1]) + 0.7 * reach : Math.min(...support[0][1]);
  const halfWidth = SPRING_WIDTH * reach, step = (top - bottom) / (2 * COILS);
  const coils = Array.from({ length: 2 * COILS - 1 }, (_, i) => `L${x + (i % 2 ? halfWidth : -halfWidth)} ${bottom + (i + 1) * step}`);
  return `M${x - halfWidth} ${bottom}H${x + halfWidth}M${x} ${bottom}${coils.join("")}L${x} ${top}`;
}

/** Return the direction of a cam angle on the ring. @param {number} angle deg */
function direction(angle) {
  const radians = (angle * Math.PI) / 180;
  return [-Math.sin(radians), Math.cos(radians)];
}

/** @param {ReturnType<typeof contactPoint>} contact @param {number} length @param {number} head */
function arrow({ x, y, normalX, normalY }, length, head) {
  const [tipX, tipY] = [x + normalX * length, y + normalY * length];
  const [baseX, baseY] = [tipX - normalX * 2 * head, tipY - normalY * 2 * head];
  const barbs = `M${baseX - normalY * head} ${baseY + normalX * head}L${tipX} ${tipY}L${baseX + normalY * head} ${baseY - normalX * head}`;
  return `M${x} ${y}L${tipX} ${tipY}${length > 2 * head ? barbs : ""}`;
}
