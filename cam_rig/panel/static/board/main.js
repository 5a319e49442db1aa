// The drawing board: what is dragged changes the law here at once; the server says what is exact.
import { extent, shown } from "../common/charts.js";
import { ContourChart } from "../common/contour.js";
import { degrees } from "../common/rig.js";
import { $, field, status } from "../common/dom.js";
import { Handles, weights } from "./drag.js";
import { History } from "./history.js";
import { contactForce, doubles, motion, pull, readTable } from "./law.js";
import { Pictures } from "./pictures.js";
import { Readouts } from "./readouts.js";
import { Stroboscope } from "./stroboscope.js";
import { STEPS, typed } from "../common/knob.js";
import { heardOfDesign, listenForFiles } from "./files.js";
import { loadTexts, text } from "../common/texts.js";
import { Wire } from "../common/wire.js";
import { listenForLinks } from "./links.js";

const radians = (/** @type {number} */ degrees) => (degrees * Math.PI) / 180;

await loadTexts();
/** @type {Board} */
const board = await (await fetch("/board")).json();
const table = readTable(board);
const state = { ordinates: Float64Array.from(board.ordinates), rpm: board.rpm };
const start = Float64Array.from(board.start);
const lift = board.cam.lift_m;
/** What was sent with a number, and what another page sent. @type {Map<number | "moved", Float64Array>} */
const sent = new Map();

const pictures = new Pictures(board, table, motion(table, start), new ContourChart($("contour"), board.colours, text("contour"), board.picture));
const readouts = new Readouts(board);
const stroboscope = new Stroboscope(board);

/** Half widths (deg) of what a handle pulls; 0 is one ordinate. */
const WIDTHS_DEG = [0, 10, 20, 40];

// -- what is seen ---------------------------------------------------------------------------------
let asked = false;
function draw(anew = false) {
  pictures.draw(state.ordinates, state.rpm, anew);
  handles.place(pictures.motion[0], state.ordinates, lift * 1e3);
  stroboscope.law(pictures.motion[0], state.rpm);
  const peak = extent([pictures.motion[2]]).map(Math.abs);
  $("acceleration").textContent = `${shown(Math.max(...peak) * speed() ** 2, 4)} m/s²`;
  cursor();
}
/** Of the cam, rad/s. */
function speed() { return (state.rpm * 2 * Math.PI) / 60; }

// -- the cursor: one cam angle in all charts, and the cam as it has turned --------------------------
function cursor() {
  const at = field("cursor").valueAsNumber;
  const k = Math.round((at / 360) * board.points) % board.points;
  const [s, slope, bend] = pictures.motion.map((values) => values[k]);
  pictures.contour.pose(radians(at), s * 1e3);
  for (const chart of [...pictures.charts, pictures.force]) chart.cursor(at);
  $("at_cursor").textContent = text("cursor_words", {
    angle: at, lift: shown(s * 1e3, 4), velocity: shown(slope * speed(), 3), acceleration: shown(bend * speed() ** 2, 3), force: shown(contactForce([s, slope, bend].map((value) => Float64Array.of(value)), board.rig, state.rpm)[0], 3),
  });
}
$("cursor").addEventListener("input", cursor);
for (const chart of [...pictures.charts, pictures.force]) {
  chart.svg.addEventListener("pointermove", (event) => {
    const part = (event.clientX - chart.svg.getBoundingClientRect().left - chart.right(0)) / (chart.right(360) - chart.right(0));
    if (part < 0 || part >= 1) return;
    field("cursor").valueAsNumber = Math.floor(360 * part);
    cursor();
  });
}
/** Draw with the next frame: however many events there are, a frame is drawn once. */
function drawSoon() {
  if (asked) return;
  asked = true;
  requestAnimationFrame(() => { asked = false; draw(); });
}
function changed() {
  readouts.stale();
  drawSoon();
  wire.change();
}

// -- what is dragged ------------------------------------------------------------------------------
const drawn = () => ({ ordinates: Array.from(state.ordinates), rpm: state.rpm });
const history = new History(
  drawn,
  (before) => { put(before); changed(); settle(); },
  () => {
    field("undo").disabled = !history.past.length;
    field("redo").disabled = !history.future.length;
  },
);
/** @param {{ordinates: number[], rpm: number}} to */
function put({ ordinates, rpm }) {
  state.ordinates = Float64Array.from(ordinates);
  setSpeed(rpm);
}
/** After a gesture the axes may shrink again. */
function settle() { requestAnimationFrame(() => draw(true)); }
/** Something that is done at once, and undone as one step. @param {() => void} does */
function gesture(does) {
  history.begin();
  does();
  changed();
  history.end();
  settle();
}
/**
 * Move what a handle pulls: by(index) gives the way of its own ordinate's whole weight, in lifts.
 * @param {Handle} handle @param {(index: number) => number} by
 */
function pullBy(handle, by) {
  for (const [{ index }, weight] of weights(own, handle, radians(Number(field("width").value)))) {
    const value = state.ordinates[index] + weight * by(index);
    state.ordinates[index] = Math.min(FARTHEST, Math.max(-FARTHEST, value));
  }
  changed();
}
const own = board.handles.map((handle) => {
  const k = Math.round((handle.angle / (2 * Math.PI)) * board.points) % board.points;
  return { ...handle, k, angle: (2 * Math.PI * k) / board.points };
});
const FARTHEST = 100; // lifts, of an ordinate
/** @type {import("./drag.js").Act} */
const act = {
  least: -FARTHEST * lift * 1e3,
  most: FARTHEST * lift * 1e3,
  begin: () => history.begin(),
  move(handle, height) {
    const now = motion(table, state.ordinates)[0][handle.k];
    const moved = weights(own, handle, radians(Number(field("width").value)));
    const lever = moved.reduce((sum, [{ index }, weight]) => sum + weight * pull(table, handle.k, index), 0);
    pullBy(handle, () => (height - now) / lever);
  },
  step: (handle, lifts) => pullBy(handle, () => lifts),
  home: (handle) => pullBy(handle, (index) => start[index] - state.ordinates[index]),
  end() { history.end(); settle(); wire.flush(); },
};
const handles = new Handles(pictures.charts[0], own, act, {
  label: (i) => text("handle", { number: i + 1, count: own.length }),
  value: ({ k, angle }) => text("handle_value", { lift: shown(pictures.motion[0][k] * 1e3, 5), angle: shown(degrees(angle), 4) }),
});
handles.circles.forEach((circle, i) => circle.addEventListener("focus", () => {
  field("cursor").valueAsNumber = degrees(own[i].angle);
  cursor();
}));
pictures.charts[0].resized = drawSoon;
for (const chart of pictures.all) chart.resized = drawSoon;

// -- the knob, on a scale of equal ratios ---------------------------------------------------------
const KNOB = [20, 2000];
/** @param {number} rpm */
function setSpeed(rpm) {
  state.rpm = rpm;
  field("rpm").value = String(Number(rpm.toPrecision(6)));
  field("knob").value = String(Math.log(rpm));
}
[field("knob").min, field("knob").max] = KNOB.map((rpm) => String(Math.log(rpm)));
$("knob").setAttribute("aria-label", text("speed"));
[field("rpm").min, field("rpm").max] = board.rpm_range.map(String);
$("knob").addEventListener("input", () => {
  history.begin();
  setSpeed(Math.round(Math.exp(field("knob").valueAsNumber)));
  changed();
});
$("knob").addEventListener("keydown", (event) => {
  const by = STEPS[event.key];
  if (by === undefined) return;
  event.preventDefault();
  history.begin();
  setSpeed(Math.min(board.rpm_range[1], Math.max(board.rpm_range[0], Math.round(state.rpm) + by)));
  changed();
  history.end();
});
$("knob").addEventListener("change", () => { history.end(); settle(); wire.flush(); });
$("rpm").addEventListener("change", () => {
  const rpm = typed(field("rpm"), board.rpm_range);
  if (rpm !== null) gesture(() => setSpeed(rpm));
});

// -- buttons and keys -----------------------------------------------------------------------------
$("undo").addEventListener("click", () => history.undo());
$("redo").addEventListener("click", () => history.redo());
$("reset").addEventListener("click", () => gesture(() => { state.ordinates = start.slice(); }));
addEventListener("keydown", (event) => {
  if (!(event.ctrlKey || event.metaKey) || /** @type {Element} */ (event.target).matches("input:not([type=range])")) return;
  const key = event.key.toLowerCase();
  if (key === "z" && !event.shiftKey) history.undo();
  else if (key === "y" || (key === "z" && event.shiftKey)) history.redo();
  else return;
  event.preventDefault();
});
listenForFiles(() => Array.from(state.ordinates));
for (const width of WIDTHS_DEG) $("width").append(new Option(width ? text("width_deg", { width }) : text("width_one"), String(width)));
for (const name of board.cams) $("second").append(new Option(name, name));
$("second").addEventListener("change", async () => {
  const name = field("second").value;
  const answer = name ? await fetch(`/other/${name}`) : null;
  const found = answer && (await answer.json());
  if (field("second").value !== name) return; // another was chosen meanwhile
  if (answer && !answer.ok) status(found.words);
  showSecond(answer?.ok ? found.motion : null);
});
/** A law beside the board's own, in base64; null shows none. @param {string | null} motion */
function showSecond(motion) {
  const flat = motion ? doubles(motion) : null;
  pictures.second = flat ? Array.from({ length: board.orders }, (_, i) => flat.subarray(i * board.points, (i + 1) * board.points)) : null;
  draw(true);
}
$("spectrum_of").addEventListener("change", () => draw(true));

// -- the server -----------------------------------------------------------------------------------
/** @param {BoardMessage} message @param {boolean} pending */
function heard(message, pending) {
  if (message.type === "refused") status(text("refused", message));
  if (message.type === "rest") readouts.rest(message);
  if (message.type === "design") heardOfDesign(message, showSecond);
  if (message.type === "opened") { // by this page or another: a link was of the cam before
    window.history.replaceState(null, "", location.pathname);
    location.reload();
  }
  if (message.type === "moved") { put(message); sent.set("moved", Float64Array.from(message.ordinates)); }
  if (message.type !== "exact" && message.type !== "moved") return;
  const ordinates = sent.get(message.number ?? "moved");
  for (const number of sent.keys()) if (number !== "moved" && number <= (message.number ?? 0)) sent.delete(number);
  readouts.exact(message);
  const turned = pictures.judged(ordinates, message);
  if (message.discs.length) stroboscope.shapes(message.discs);
  // What turned good or bad at rest may have other axes; in the middle of a gesture they stay.
  if (message.type === "moved" || (turned && !history.before)) settle();
  else if (turned) drawSoon();
  if (!pending) readouts.current();
}
const wire = new Wire(
  (number) => {
    sent.set(number, state.ordinates.slice());
    return drawn();
  },
  heard,
  (on) => status(on ? "" : text("disconnected")),
);
setSpeed(state.rpm);
history.told();
draw(true);
listenForLinks(board, drawn, (found) => gesture(() => put(found)));
