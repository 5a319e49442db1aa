// The readings' plot: the square of the jump speed over the load on the mass, a marker a reading.
import { Chart, entry, look, ticks } from "../common/charts.js";
import { text } from "../common/texts.js";

/** rpm² of one unit of the plot: 400 rpm are 160. */
const UNIT = 1000;

export class JumpPlot {
  /** @param {HTMLElement} place @param {HTMLElement} key @param {LabSheet} sheet */
  constructor(place, key, sheet) {
    this.sheet = sheet;
    /** @type {LabReading[]} */
    this.readings = [];
    /** Of what is expected, once it is asked for. @type {number | null} */
    this.slope = null;
    const most = Math.ceil(sheet.loads[1] / 50) * 50;
    this.chart = new Chart(place, { title: text("lab_square"), x: [0, most], xTicks: ticks(0, most, 6), xTitle: text("lab_load") });
    this.chart.fit(0, sheet.knob[1] ** 2 / UNIT, true);
    this.chart.resized = () => this.draw(this.readings);
    key.replaceChildren(...sheet.added_masses.map((mass) => entry(`+${mass} kg`, this.#look(mass))));
  }

  /** @param {LabReading[]} readings */
  draw(readings) {
    this.readings = readings;
    this.chart.points("readings", readings.map(({ load, rpm, added_mass: mass, preload }) => (
      { x: load, y: rpm ** 2 / UNIT, ...this.#look(mass), full: preload !== this.sheet.preloads[0] })));
    const step = this.chart.x[1];
    this.chart.curve("theory", this.slope === null ? null : [0, (this.slope * step) / UNIT], { colour: "#333", kind: "theory", step });
  }

  /** @param {number} mass */
  #look(mass) { return look(this.sheet.added_masses.indexOf(mass), this.sheet.colours); }
}
