// The contour of the cam with the path of its roller; what cannot be is red, and said in words.
import { element, shown } from "./charts.js";

export class ContourChart {
  constructor(place, colours, label) {
    Object.assign(this, { place, colours, box: null, discs: [] });
    this.svg = element("svg", { role: "img", "aria-label": label });
    place.append(this.svg);
    this.scale = element("g", {}, this.svg);
    this.curves = element("g", {}, this.svg);
    new ResizeObserver(() => this.draw(this.discs)).observe(place);
  }

  /** Discs with points and pitch in mm, ``(2, n)``; `anew` lets the scale shrink. */
  draw(discs, anew = false) {
    this.discs = discs;
    const { clientWidth: width, clientHeight: height } = this.place;
    if (!width || !discs.length) return;
    const box = bounds(discs);
    this.box = anew || !this.box ? box : union(this.box, box);
    const [[left, right], [bottom, top]] = this.box;
    const unit = Math.min((width - 12) / (right - left), (height - 28) / (top - bottom));
    const [x0, y0] = [width / 2 - (unit * (left + right)) / 2, height / 2 - 8 + (unit * (bottom + top)) / 2];
    const at = ([xs, ys], i) => `${(x0 + unit * xs[i]).toFixed(1)} ${(y0 - unit * ys[i]).toFixed(1)}`;
    const line = (points, indices) => `M${indices.map((i) => at(points, i)).join("L")}`;
    const parts = document.createDocumentFragment();
    this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
    for (const { points, pitch, undercut, steep } of discs) {
      const all = points[0].map((_, i) => i);
      element("path", { class: "body", d: `${line(points, all)}Z` }, parts);
      if (pitch) element("path", { class: "curve pitch", stroke: this.colours.pitch, d: `${line(pitch, all)}Z` }, parts);
      element("path", { class: "curve", stroke: this.colours.contour, d: `${line(points, all)}Z` }, parts);
      for (const [indices, kind] of [[undercut, "bad"], [steep, "steep"]]) {
        for (const run of runs(indices)) element("path", { class: `curve ${kind}`, d: line(points, run) }, parts);
      }
    }
    this.curves.replaceChildren(parts);
    this.#ruler([x0, y0], height, unit);
  }

  /** The axis, and a length to measure by. */
  #ruler([x, y], height, unit) {
    const raw = 70 / unit;
    const power = 10 ** Math.floor(Math.log10(raw));
    const length = [5, 2, 1].find((part) => part * power <= raw) * power;
    const parts = document.createDocumentFragment();
    element("path", { class: "zero", d: `M${x - 6} ${y}H${x + 6}M${x} ${y - 6}V${y + 6}` }, parts);
    element("path", { class: "frame", d: `M8 ${height - 8}v-4v4h${length * unit}v-4` }, parts);
    element("text", { x: 12, y: height - 14 }, parts).textContent = `${shown(length)} mm`;
    this.scale.replaceChildren(parts);
  }
}

/** Least and greatest x and y (mm) of discs and their pitch curves, and of the axis. */
function bounds(discs) {
  return [0, 1].map((i) => {
    const values = [0, ...discs.flatMap(({ points, pitch }) => [...points[i], ...(pitch?.[i] ?? [])])];
    return [Math.min(...values), Math.max(...values)];
  });
}

function union(one, other) {
  return one.map(([low, high], i) => [Math.min(low, other[i][0]), Math.max(high, other[i][1])]);
}

/** Neighbours together; a single one has length by its next. */
function runs(indices) {
  const found = [];
  for (const i of indices) {
    const last = found.at(-1);
    if (last && last.at(-1) === i - 1) last.push(i);
    else found.push([i]);
  }
  return found.map((run) => (run.length > 1 ? run : [Math.max(0, run[0] - 1), run[0]]));
}
