// Plot of the readings: one marker per reading, and the curves of theory on request.
import { axisTicks, Chart, extent, legendItem, markerStyle } from "../common/charts.js";
import { formatNumber } from "../common/texts.js";

/** Colour of a single curve of theory. */
const THEORY_COLOUR = "#333";

/** Curves at equal steps of x. @typedef {{step: number, curves: number[][]}} Theory */

export class ReadingsPlot {
  /** @param {HTMLElement} parent @param {HTMLElement} legend @param {LabSheet} sheet @param {{x: string, y: string}} titles */
  constructor(parent, legend, sheet, { x, y }) {
    this.sheet = sheet;
    /** @type {LabReading[]} */
    this.readings = [];
    /** @type {Theory | null} */
    this.theory = null;
    this.chart = new Chart(parent, { title: y, x: sheet.plot.x, xTicks: axisTicks(...sheet.plot.x, 6), xTitle: x });
    this.chart.fit(...sheet.plot.y, true);
    this.chart.onResize = () => this.draw(this.readings, this.theory);
    const values = sheet.options[sheet.marker] ?? [];
    legend.replaceChildren(...values.map((value, i) => (
      legendItem(typeof value === "number" ? `+${formatNumber(value)} kg` : value, markerStyle(i, sheet.colours)))));
  }

  /** @param {LabReading[]} readings @param {Theory | null} theory */
  draw(readings, theory) {
    [this.readings, this.theory] = [readings, theory];
    const { colours } = this.sheet;
    const points = readings.flatMap(({ point }) => (point ? [point] : []));
    const curves = theory?.curves ?? [];
    this.chart.fit(...extent([points.map(({ y }) => y), ...curves]));
    this.chart.drawMarkers(points.map((point) => ({ ...point, ...markerStyle(point.marker, colours) })));
    colours.forEach((colour, i) => {
      const style = { colour: curves.length > 1 ? colour : THEORY_COLOUR, kind: "theory", step: theory?.step ?? 1 };
      this.chart.drawCurve(`theory${i}`, curves[i], style);
    });
  }
}
