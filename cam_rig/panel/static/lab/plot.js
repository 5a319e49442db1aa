// The readings' plot: the square of the jump speed over the load on the mass, a marker a reading.
import { Chart, MARKERS, element, ticks } from "../common/charts.js";
import { text } from "../common/texts.js";

const SHAPES = Object.keys(MARKERS);
/** rpm² of one unit of the plot: 400 rpm are 160. */
const UNIT = 1000;

export class JumpPlot {
  constructor(place, key, sheet) {
    this.sheet = sheet;
    const most = Math.ceil(sheet.loads[1] / 50) * 50;
    this.chart = new Chart(place, { title: text("lab_square"), x: [0, most], xTicks: ticks(0, most, 6), xTitle: text("lab_load") });
    this.chart.fit(0, sheet.knob[1] ** 2 / UNIT, true);
    this.chart.resized = () => this.draw(this.readings ?? []);
    this.slope = null;
    key.replaceChildren(...sheet.added_masses.map((mass) => this.#entry(mass)));
  }

  draw(readings) {
    this.readings = readings;
    this.chart.points("readings", readings.map(({ load, rpm, added_mass: mass, preload }) => (
      { x: load, y: rpm ** 2 / UNIT, ...this.#look(mass), full: preload !== this.sheet.preloads[0] })));
    const step = this.chart.x[1];
    this.chart.curve("theory", this.slope === null ? null : [0, (this.slope * step) / UNIT], { colour: "#333", kind: "theory", step });
  }

  #look(mass) {
    const i = this.sheet.added_masses.indexOf(mass);
    return { colour: this.sheet.colours[i % this.sheet.colours.length], marker: SHAPES[i % SHAPES.length] };
  }

  #entry(mass) {
    const item = Object.assign(document.createElement("li"), { textContent: `+${mass} kg` });
    const { colour, marker } = this.#look(mass);
    const icon = element("svg", { viewBox: "-8 -8 16 16", "aria-hidden": "true" });
    element("path", { class: "point", d: MARKERS[marker], stroke: colour, fill: "#fff" }, icon);
    item.prepend(icon);
    return item;
  }
}
