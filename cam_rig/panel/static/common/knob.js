// A speed knob with a logarithmic scale, turned by pointer or keys, and the field of a typed speed.
import { svgElement } from "./charts.js";
import { readNumber, showStatus } from "./dom.js";
import { formatNumber, text } from "./texts.js";

/** Angle of the lowest speed from the top, and angle of the whole scale, deg. */
const FIRST = -135, SWEEP = 270;
/** Radius of the scale and of its numbers, in units of the drawing. */
const SCALE_RADIUS = 44, NUMBER_RADIUS = 57;
/** Speeds (rpm) with a number on the scale. */
const NUMBERED_RPM = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
/** Smallest angle (deg) between the number of an end of the scale and another number. */
const END_GAP = 24;
/** Change of the speed (rpm) by each key. @type {Record<string, number>} */
export const KEY_STEPS = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 };

export class Knob {
  /**
   * @param {HTMLElement} parent @param {Pair} range of the speed, rpm
   * @param {string} label @param {(rpm: number) => void} onTurn called with the speed after each change by a person
   */
  constructor(parent, range, label, onTurn) {
    this.parent = parent;
    this.range = range;
    this.onTurn = onTurn;
    this.rpm = NaN;
    this.isHeld = false;
    this.isEnabled = true;
    /** Angles (deg) of the mark and of the pointer while the knob is held. */
    this.markAngle = 0;
    this.pointerAngle = 0;
    const svg = svgElement("svg", { viewBox: "-70 -64 140 122", "aria-hidden": "true" });
    parent.append(svg);
    svgElement("path", { class: "track", d: arc(FIRST, FIRST + SWEEP) }, svg);
    this.turned = svgElement("path", { class: "turned" }, svg);
    svgElement("circle", { class: "cap", r: 32 }, svg);
    this.mark = svgElement("path", { class: "mark", d: "M0 -14V-29" }, svg);
    this.jumps = svgElement("g", {}, svg);
    const ends = range.map((end) => this.#angle(end));
    const isApart = (/** @type {number} */ rpm) => ends.every((end) => Math.abs(this.#angle(rpm) - end) >= END_GAP);
    const within = NUMBERED_RPM.filter((rpm) => rpm > range[0] && rpm < range[1] && isApart(rpm));
    for (const rpm of [range[0], ...within, range[1]]) {
      const [x, y] = polar(this.#angle(rpm), NUMBER_RADIUS);
      svgElement("text", { x, y: y + 3.5 }, svg).textContent = formatNumber(Math.round(rpm));
    }
    const attributes = { "aria-label": label, "aria-valuemin": range[0], "aria-valuemax": range[1] };
    for (const [name, value] of Object.entries(attributes)) parent.setAttribute(name, String(value));
    parent.addEventListener("pointerdown", (event) => this.#grab(event));
    parent.addEventListener("pointermove", (event) => this.isHeld && this.#drag(event));
    for (const end of ["pointerup", "pointercancel"]) parent.addEventListener(end, () => { this.isHeld = false; });
    parent.addEventListener("keydown", (event) => this.#pressKey(event));
    this.show(range[0]);
  }

  /** Return the angle (deg) of a speed. @param {number} rpm */
  #angle(rpm) {
    const [low, high] = this.range.map(Math.log);
    return FIRST + SWEEP * Math.min(1, Math.max(0, (Math.log(rpm) - low) / (high - low)));
  }

  /** Mark jump speeds on the scale. @param {{rpm: number, title: string}[]} speeds */
  showJumps(speeds) {
    const visible = speeds.filter(({ rpm }) => rpm > this.range[0] && rpm < this.range[1]);
    this.jumps.replaceChildren(...visible.map(({ rpm, title }) => {
      const mark = svgElement("path", { class: "jump", d: "M0 -40L-4 -33H4Z", transform: `rotate(${this.#angle(rpm)})` });
      svgElement("title", {}, mark).textContent = title;
      return mark;
    }));
  }

  /** @param {boolean} isEnabled */
  enable(isEnabled) {
    this.isEnabled = isEnabled;
    this.isHeld &&= isEnabled;
    const isDisabled = String(!isEnabled);
    if (this.parent.getAttribute("aria-disabled") !== isDisabled) this.parent.setAttribute("aria-disabled", isDisabled);
  }

  /** Show a speed. @param {number} rpm */
  show(rpm) {
    if (rpm === this.rpm) return;
    this.rpm = rpm;
    const angle = this.#angle(rpm);
    this.turned.setAttribute("d", arc(FIRST, angle));
    this.mark.setAttribute("transform", `rotate(${angle})`);
    this.parent.setAttribute("aria-valuenow", String(rpm));
    this.parent.setAttribute("aria-valuetext", `${formatNumber(rpm, 6)} rpm`);
  }

  /** @param {number} rpm */
  #turnTo(rpm) {
    const [low, high] = this.range;
    this.show(Math.round(Math.min(high, Math.max(low, rpm))));
    this.onTurn(this.rpm);
  }

  /** @param {PointerEvent} event */
  #grab(event) {
    if (!this.isEnabled) return;
    this.isHeld = true;
    this.parent.setPointerCapture(event.pointerId);
    this.markAngle = this.#angle(this.rpm);
    this.pointerAngle = this.#angleOf(event);
  }

  /** Return the angle (deg) of the pointer about the centre. @param {PointerEvent} event */
  #angleOf({ clientX, clientY }) {
    const { left, top, width, height } = this.parent.getBoundingClientRect();
    return (Math.atan2(clientX - left - width / 2, top + height / 2 - clientY) * 180) / Math.PI;
  }

  /** Turn the mark by the angle of the pointer's motion, the shorter way. @param {PointerEvent} event */
  #drag(event) {
    const angle = this.#angleOf(event);
    const change = ((angle - this.pointerAngle + 540) % 360) - 180;
    this.pointerAngle = angle;
    this.markAngle = Math.min(FIRST + SWEEP, Math.max(FIRST, this.markAngle + change));
    const [low, high] = this.range.map(Math.log);
    this.#turnTo(Math.exp(low + ((this.markAngle - FIRST) / SWEEP) * (high - low)));
  }

  /** @param {KeyboardEvent} event */
  #pressKey(event) {
    const ends = /** @type {Record<string, number>} */ ({ Home: this.range[0], End: this.range[1] });
    const rpm = ends[event.key] ?? Math.round(this.rpm) + (KEY_STEPS[event.key] ?? NaN);
    if (!this.isEnabled || Number.isNaN(rpm)) return;
    event.preventDefault();
    this.#turnTo(rpm);
  }
}

/**
 * Return a typed number, by default a speed. Show the rule and return null if it is out of range.
 * @param {HTMLInputElement} input @param {Pair} range @param {string} rule key of the text of the rule
 */
export function typedNumber(input, [low, high], rule = "speed_range") {
  const number = readNumber(input);
  const isValid = number >= low && number <= high;
  const values = { value: input.value || "–", low: formatNumber(low, 6), high: formatNumber(high, 6) };
  showStatus(isValid ? "" : text(rule, values));
  return isValid ? number : null;
}

/** @param {number} angle deg from the top @param {number} radius */
function polar(angle, radius) {
  const radians = (angle * Math.PI) / 180;
  return [radius * Math.sin(radians), -radius * Math.cos(radians)];
}

/** @param {number} start @param {number} stop */
function arc(start, stop) {
  const [[x0, y0], [x1, y1]] = [polar(start, SCALE_RADIUS), polar(stop, SCALE_RADIUS)];
  return `M${x0} ${y0}A${SCALE_RADIUS} ${SCALE_RADIUS} 0 ${stop - start > 180 ? 1 : 0} 1 ${x1} ${y1}`;
}
