// The readings' plot: a marker a reading, and the curves of theory when they are asked for.
import { Chart, entry, extent, look, ticks } from "../common/charts.js";

export class ReadingsPlot {
  /**
   * Of the lab's own axes; the key says what each marker is of.
   * @param {HTMLElement} place @param {HTMLElement} key @param {LabSheet} sheet @param {{x: string, y: string}} titles
   */
  constructor(place, key, sheet, { x, y }) {
    this.sheet = sheet;
    /** @type {LabReading[]} */
    this.readings = [];
    /** What is expected, once it is asked for. @type {{step: number, curves: number[][]} | null} */
    this.theory = null;
    this.chart = new Chart(place, { title: y, x: sheet.plot.x, xTicks: ticks(...sheet.plot.x, 6), xTitle: x });
    this.chart.fit(...sheet.plot.y, true);
    this.chart.resized = () => this.draw(this.readings);
    const kinds = sheet.options[sheet.marker] ?? [];
    key.replaceChildren(...kinds.map((kind, i) => entry(sheet.marker === "added_mass" ? `+${kind} kg` : String(kind), look(i, sheet.colours))));
  }

  /** @param {LabReading[]} readings */
  draw(readings) {
    this.readings = readings;
    const points = readings.flatMap(({ point }) => (point ? [point] : []));
    const curves = this.theory?.curves ?? [];
    this.chart.fit(...extent([points.map(({ y }) => y), ...curves]));
    this.chart.points("readings", points.map(({ x, y, marker, full }) => ({ x, y, full, ...look(marker, this.sheet.colours) })));
    for (let i = 0; i < this.sheet.colours.length; i += 1) {
      const colour = curves.length > 1 ? this.sheet.colours[i] : "#333";
      this.chart.curve(`theory${i}`, curves[i], { colour, kind: "theory", step: this.theory?.step ?? 1 });
    }
  }
}
