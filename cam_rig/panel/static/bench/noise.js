// Chart of level over speed: one marker per reading, with shape and colour of its cam.
import { axisTicks, Chart, extent, legendItem, markerStyle } from "../common/charts.js";
import { text } from "../common/texts.js";

/** Smallest ranges of the axes: speed (rpm) and level (dB). */
const MIN_RANGE_RPM = 600, MIN_RANGE_DB = [60, 100];

export class NoiseChart {
  /** @param {HTMLElement} parent @param {HTMLElement} legend @param {string[]} colours */
  constructor(parent, legend, colours) {
    this.legend = legend;
    this.colours = colours;
    /** @type {NotedReading[]} */
    this.readings = [];
    /** Cams in the order of their first readings. @type {string[]} */
    this.cams = [];
    this.chart = new Chart(parent, { title: text("level_db"), x: [0, MIN_RANGE_RPM], xTicks: [], xTitle: text("speed_rpm") });
    this.chart.onResize = () => this.#draw();
    this.#draw();
  }

  /** Draw readings unless they are already displayed. @param {NotedReading[]} readings */
  draw(readings) {
    if (readings === this.readings) return;
    this.readings = readings;
    for (const { cam } of readings) if (!this.cams.includes(cam)) this.cams.push(cam);
    this.legend.replaceChildren(...this.cams.map((cam) => legendItem(cam, this.#styleOf(cam))));
    this.#draw();
  }

  #draw() {
    const { readings, chart } = this;
    const maxRpm = Math.max(MIN_RANGE_RPM, ...readings.map(({ rpm }) => Math.ceil(rpm / 100) * 100));
    [chart.x, chart.xTicks] = [[0, maxRpm], axisTicks(0, maxRpm, 6)];
    chart.fit(...extent([MIN_RANGE_DB, readings.map((reading) => reading.level_db)]), true);
    chart.drawMarkers(readings.map(({ cam, rpm: x, level_db: y, contact }) => (
      { x, y, ...this.#styleOf(cam), is_filled: contact === "contact lost" })));
  }

  /** @param {string} cam */
  #styleOf(cam) { return markerStyle(this.cams.indexOf(cam), this.colours); }
}
