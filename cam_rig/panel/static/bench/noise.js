// The noise-against-rpm chart: a marker a reading, a shape and a colour a cam.
import { Chart, entry, extent, look, ticks } from "../common/charts.js";
import { text } from "../common/texts.js";

export class NoiseChart {
  /** @param {HTMLElement} place @param {HTMLElement} key @param {string[]} colours */
  constructor(place, key, colours) {
    this.key = key;
    this.colours = colours;
    /** @type {NotedReading[]} */
    this.readings = [];
    /** Cams, in the order in which they came. @type {string[]} */
    this.names = [];
    this.chart = new Chart(place, { title: text("level_db"), x: [0, 600], xTicks: ticks(0, 600, 6), xTitle: text("speed_rpm") });
    this.chart.fit(60, 100, true);
    this.chart.resized = () => this.draw(this.readings);
  }

  /** @param {NotedReading[]} readings */
  draw(readings) {
    this.readings = readings;
    for (const { cam } of readings) if (!this.names.includes(cam)) this.names.push(cam);
    if (this.key.childElementCount !== this.names.length) this.key.replaceChildren(...this.names.map((cam) => entry(cam, this.#look(cam))));
    const most = Math.max(600, ...readings.map(({ rpm }) => Math.ceil(rpm / 100) * 100));
    this.chart.x = [0, most];
    this.chart.xTicks = ticks(0, most, 6);
    const [low, high] = extent([readings.map(({ level_db: level }) => level)]);
    this.chart.fit(Math.min(60, low), Math.max(100, high), true);
    this.chart.points("noise", readings.map(({ cam, rpm, level_db: y, contact }) => ({ x: rpm, y, ...this.#look(cam), full: contact === "contact lost" })));
  }

  /** @param {string} cam */
  #look(cam) { return look(this.names.indexOf(cam), this.colours); }
}
