// Stand-in for the server on the static board: it answers the requests of the page from the data in the
// file, and computes the fast results by the core. It replaces connection.js in the exported file.
import { $, decodeBase64 } from "../common/dom.js";
import { evaluateFast } from "../core/results.js";
import { MM } from "../core/units.js";
import { DrawnLaw } from "./law.js";

/** Cam, rig and drawing that a reloaded page keeps. @typedef {{cam: string, rig: string, drawing: Drawn | null}} Choice */
/** @typedef {{ordinates: number[], rpm: number, base_radius_mm: number}} Drawn */

const packed = new Blob([decodeBase64($("data").textContent ?? "")]);
/** Key of sessionStorage with the choice. Another file in the same tab has another key. */
const CHOICE = `board ${location.pathname} ${packed.size}`;
/** @type {StaticData} */
const data = await new Response(packed.stream().pipeThrough(new DecompressionStream("gzip"))).json();
/** @type {Choice} */
const choice = { ...data.first, drawing: null, ...JSON.parse(sessionStorage.getItem(CHOICE) ?? "{}") };
addEventListener("pagehide", () => sessionStorage.setItem(CHOICE, JSON.stringify(choice)));

// What needs a server is not on the static page.
for (const element of document.querySelectorAll("[data-server]")) element.remove();
$("expert_title").dataset.text = "expert_static";
$("more_results").setAttribute("open", "");
$("checks_static").hidden = false;
$("controls").addEventListener("submit", (event) => event.preventDefault());

/** Answers to the requests of the page, by the start of their path. @type {Record<string, (name: string, body: any) => unknown>} */
const ANSWERS = {
  "/languages": () => data.languages,
  "/static/": (name) => data.texts[name],
  "/board": readBoard,
  "/other/": (name) => data.cams[name].static.second,
  "/choose": (_, { cam, rig }) => {
    if (cam !== undefined) [choice.cam, choice.drawing] = [cam, null];
    if (rig !== undefined) choice.rig = rig;
    onOpened();
    return choice;
  },
};

/** Return the data of the board for the chosen cam and rig. */
function readBoard() {
  const cam = data.cams[choice.cam], { drawing } = choice;
  return { ...data.board, ...cam, rig: data.rigs[choice.rig], ...drawing };
}

/** Lets the page reload. */
let onOpened = () => {};

/** @param {RequestInfo | URL} path @param {RequestInit} [options] */
globalThis.fetch = async (path, options = {}) => {
  const start = Object.keys(ANSWERS).find((key) => String(path).startsWith(key)) ?? "";
  const answer = ANSWERS[start](String(path).slice(start.length), options.body && JSON.parse(String(options.body)));
  return new Response(JSON.stringify(answer));
};

/** Connection to the core in the page. A change is evaluated after the events that caused it. */
export class Connection {
  isPending = false;
  number = 0;
  version = 0;

  /**
   * @param {(number: number) => Drawn} read returns the change of a number
   * @param {(message: BoardMessage, isPending: boolean) => void} onMessage
   */
  constructor(read, onMessage) {
    this.read = read;
    this.onMessage = onMessage;
    this.law = new DrawnLaw(data.cams[choice.cam]);
    onOpened = () => onMessage({ type: "opened" }, false);
    const { ordinates, rpm, base_radius_mm, generation } = readBoard();
    const drawing = { ordinates, rpm, base_radius_mm };
    setTimeout(() => {
      if (this.isPending) return; // a link has changed the drawing meanwhile
      onMessage({ type: "changed", number: null, generation, ...drawing, ...this.#evaluate(drawing) }, false);
    });
  }

  /** Evaluate the drawing soon. */
  change() {
    if (this.isPending) return;
    this.isPending = true;
    setTimeout(() => this.flush());
  }

  /** Evaluate the newest drawing. */
  flush() {
    if (!this.isPending) return;
    this.isPending = false;
    this.number += 1;
    const drawing = this.read(this.number);
    choice.drawing = drawing;
    this.onMessage({ type: "fast", number: this.number, ...this.#evaluate(drawing) }, false);
  }

  /** @param {Drawn} drawing */
  #evaluate({ ordinates, base_radius_mm: base }) {
    const cam = data.cams[choice.cam].static, follower = { ...cam.follower, base_radius: base / MM };
    this.version += 1;
    return { version: this.version, ...evaluateFast({ ...cam, follower }, this.law.of(ordinates), data.rigs[choice.rig]) };
  }
}
