// A knob on a scale of equal ratios: by pointer around its middle, or by keys.
import { element, shown } from "./charts.js";
import { status } from "./dom.js";
import { text } from "./texts.js";

const SWEEP = 270, FIRST = -135; // degrees, from above
/** @type {Record<string, number>} */
export const STEPS = { ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1, PageUp: 10, PageDown: -10 };

export class Knob {
  /**
   * `range` in rpm; moved(rpm) is told of every change by a person.
   * @param {HTMLElement} place @param {Pair} range @param {string} label @param {(rpm: number) => void} moved
   */
  constructor(place, range, label, moved) {
    this.place = place;
    this.range = range;
    this.moved = moved;
    this.value = range[0];
    this.held = false;
    this.enabled = true;
    this.at = 0; // angle (deg) of the mark while it is held ...
    this.from = 0; // ... and of the pointer
    const svg = element("svg", { viewBox: "-70 -64 140 122", "aria-hidden": "true" });
    place.append(svg);
    element("path", { class: "track", d: arc(FIRST, FIRST + SWEEP) }, svg);
    this.turned = element("path", { class: "turned" }, svg);
    element("circle", { class: "cap", r: 32 }, svg);
    this.mark = element("path", { class: "mark", d: "M0 -14V-29" }, svg);
    this.jumps = element("g", {}, svg);
    for (const rpm of marks(range)) {
      const [x, y] = point(this.#angle(rpm), 57);
      element("text", { x, y: y + 3.5 }, svg).textContent = shown(rpm);
    }
    place.setAttribute("aria-label", label);
    place.setAttribute("aria-valuemin", String(range[0]));
    place.setAttribute("aria-valuemax", String(range[1]));
    place.addEventListener("pointerdown", (event) => this.#take(event));
    place.addEventListener("pointermove", (event) => this.held && this.#turn(event));
    for (const end of ["pointerup", "pointercancel"]) place.addEventListener(end, () => { this.held = false; });
    place.addEventListener("keydown", (event) => this.#key(event));
    this.show(range[0]);
  }

  /** @param {number} rpm */
  #angle(rpm) {
    const [low, high] = this.range.map(Math.log);
    return FIRST + SWEEP * Math.min(1, Math.max(0, (Math.log(rpm) - low) / (high - low)));
  }

  /** Mark speeds (rpm) on the scale, each with its words. @param {{rpm: number, words: string}[]} speeds */
  jump(speeds) {
    const inside = speeds.filter(({ rpm }) => rpm > this.range[0] && rpm < this.range[1]);
    this.jumps.replaceChildren(...inside.map(({ rpm, words }) => {
      const mark = element("path", { class: "jump", d: "M0 -40L-4 -33H4Z", transform: `rotate(${this.#angle(rpm)})` });
      element("title", {}, mark).textContent = words;
      return mark;
    }));
  }

  /** @param {boolean} on */
  enable(on) {
    this.enabled = on;
    this.held &&= on;
    if (this.place.getAttribute("aria-disabled") !== String(!on)) this.place.setAttribute("aria-disabled", String(!on));
  }

  /** Show a speed (rpm), from wherever it came. @param {number} rpm */
  show(rpm) {
    if (rpm === this.value && this.turned.hasAttribute("d")) return;
    this.value = rpm;
    const angle = this.#angle(rpm);
    this.turned.setAttribute("d", arc(FIRST, angle));
    this.mark.setAttribute("transform", `rotate(${angle})`);
    this.place.setAttribute("aria-valuenow", String(rpm));
    this.place.setAttribute("aria-valuetext", `${shown(rpm, 6)} rpm`);
  }

  /** @param {number} rpm */
  #put(rpm) {
    const [low, high] = this.range;
    this.show(Math.round(Math.min(high, Math.max(low, rpm))));
    this.moved(this.value);
  }

  /** @param {PointerEvent} event */
  #take(event) {
    if (!this.enabled) return;
    this.held = true;
    this.place.setPointerCapture(event.pointerId);
    this.at = this.#angle(this.value);
    this.from = this.#pointer(event);
  }

  /** @param {PointerEvent} event */
  #pointer(event) {
    const box = this.place.getBoundingClientRect();
    return (Math.atan2(event.clientX - box.left - box.width / 2, box.top + box.height / 2 - event.clientY) * 180) / Math.PI;
  }

  /** By how far the pointer goes around the middle, the short way. @param {PointerEvent} event */
  #turn(event) {
    const to = this.#pointer(event);
    const by = ((to - this.from + 540) % 360) - 180;
    this.from = to;
    this.at = Math.min(FIRST + SWEEP, Math.max(FIRST, this.at + by));
    const [low, high] = this.range.map(Math.log);
    this.#put(Math.exp(low + ((this.at - FIRST) / SWEEP) * (high - low)));
  }

  /** @param {KeyboardEvent} event */
  #key(event) {
    const ends = /** @type {Record<string, number>} */ ({ Home: this.range[0], End: this.range[1] });
    const to = ends[event.key] ?? Math.round(this.value) + (STEPS[event.key] ?? NaN);
    if (!this.enabled || Number.isNaN(to)) return;
    event.preventDefault();
    this.#put(to);
  }
}

/** The speed (rpm) that is typed; null where it is none of the range, and the page says why. @param {HTMLInputElement} input @param {Pair} range */
export function typed(input, [low, high]) {
  const rpm = input.valueAsNumber;
  const good = rpm >= low && rpm <= high;
  status(good ? "" : text("speed_range", { value: input.value || "–", low: shown(low, 6), high: shown(high, 6) }));
  return good ? rpm : null;
}

/** @param {number} angle @param {number} radius */
function point(angle, radius) {
  const turn = (angle * Math.PI) / 180;
  return [radius * Math.sin(turn), -radius * Math.cos(turn)];
}

/** @param {number} from @param {number} to */
function arc(from, to) {
  const [[x, y], [u, v]] = [point(from, 44), point(to, 44)];
  return `M${x} ${y}A44 44 0 ${to - from > 180 ? 1 : 0} 1 ${u} ${v}`;
}

/** @param {Pair} range */
function marks([low, high]) {
  return [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000].filter((rpm) => rpm >= low && rpm <= high);
}
