// Lab sheet: set-up, knob, lamp, force over the turn, and the student's readings.
/** @import { Theory } from "./plot.js" */
import { TurnSound } from "../bench/sound.js";
import { ANGLE_TICKS, Chart, extent } from "../common/charts.js";
import { $, create, field, post, setHidden, setText, showRefusal, showStatus } from "../common/dom.js";
import { Knob, typedNumber } from "../common/knob.js";
import { LatestSender } from "../common/latest.js";
import { Lens, RigPicture } from "../common/rig.js";
import { Store } from "../common/store.js";
import { formatFixed, formatNumber, loadTexts, text } from "../common/texts.js";
import { ReadingsPlot } from "./plot.js";

const UNITS = /** @type {const} */ ({ spring_stiffness: "N/m", added_mass: "kg", preload: "N", cam: "" });
/** Texts of the table's columns. */
const HEADINGS = /** @type {const} */ ({ spring_stiffness: "lab_spring_unit", added_mass: "lab_mass_unit", preload: "lab_preload_unit", cam: "cam" });

await loadTexts();
/** Path of this sheet. Each group of a class has its own sheet. */
const path = location.pathname.replace(/\/$/, "");
/** @type {LabSheet} */
const sheet = await (await fetch(`${path}/sheet`)).json();
const options = /** @type {(keyof typeof UNITS)[]} */ (Object.keys(sheet.options));
/** Return a text of this lab. @param {string} key @param {Record<string, string | number>} [values] */
const labText = (key, values) => text(`lab_${sheet.lab}_${key}`, values);

/**
 * Observed turn of a set-up and speed. The sound is in base64.
 * @typedef {{contact_lost: boolean, was_lost: boolean, curve: number[], lift: number[], gap: number[], measured: number | null, sound?: string, rate: number}} Turn
 */
/**
 * State of the sheet. `turn` is the observed turn of `observed`, null if it was refused.
 * @typedef {{setup: Record<string, number | string>, rpm: number, turn: Turn | null, observed: object | null,
 *   readings: LabReading[], file: string | null, result: string, isPlotted: boolean, theory: Theory | null, isTurning: boolean}} LabState
 */
const store = new Store(/** @type {LabState} */ ({
  setup: Object.fromEntries(options.map((name) => [name, sheet.options[name][0]])),
  rpm: sheet.knob[0],
  turn: null,
  observed: null,
  readings: sheet.readings,
  file: sheet.file,
  result: "",
  isPlotted: false,
  theory: null,
  isTurning: !matchMedia("(prefers-reduced-motion: reduce)").matches,
}), render);
const { state } = store;

// -- rendering ------------------------------------------------------------------------------------

const picture = new RigPicture($("rig_drawing"), text("rig_picture"), new Lens());
const force = new Chart($("force"), { title: labText("curve_unit"), x: [0, 360], xTicks: ANGLE_TICKS, xTitle: text("angle") });
force.onResize = () => store.update();
const plot = new ReadingsPlot($("plot"), $("plot_key"), sheet, { x: labText("x"), y: labText("y") });

/** @param {LabState} present */
function render({ setup, turn, observed, readings, file, result, isPlotted, theory, isTurning }) {
  renderSetup(setup);
  setToggle("turning", "aria-pressed", isTurning, isTurning ? "lab_hold" : "lab_turn");
  requestFrame();
  if (turn) renderTurn(turn);
  document.body.dataset.shown = observed ? JSON.stringify(observed) : "";
  setText("recorded", result);
  setHidden("plotted", !isPlotted);
  setToggle("plot_it", "aria-expanded", isPlotted, isPlotted ? "lab_plot_off" : "lab_plot");
  setToggle("theory", "aria-pressed", theory !== null, theory ? "lab_theory_off" : "lab_theory");
  setHidden("theory_words", theory === null);
  if (readings !== plot.readings || theory !== plot.theory) plot.draw(readings, theory);
  setHidden("csv", !readings.length);
  setText("file", file ? text("lab_file", { path: file }) : "");
  renderTable(readings);
}

/** @param {string} id @param {string} attribute @param {boolean} isOn @param {string} key */
function setToggle(id, attribute, isOn, key) {
  $(id).setAttribute(attribute, String(isOn));
  setText(id, text(key));
}

/** Show the numbers of a set-up by the letters of the formulas. Those of a hidden rig are its labels. @param {LabState["setup"]} setup */
function renderSetup(setup) {
  const number = (/** @type {number | string} */ value) => formatNumber(Number(value));
  const values = text("lab_values", {
    k: number(setup.spring_stiffness ?? sheet.rig.spring_stiffness),
    m: number(sheet.rig.mass + Number(setup.added_mass ?? 0)),
    preload: number(setup.preload ?? sheet.rig.preload),
  });
  const { critical_lift_m: lift } = sheet;
  setText("values", lift === null ? values : `${values} · s = ${formatNumber(1000 * lift)} mm`);
  loadPicture(String(setup.cam ?? sheet.cams[0]));
}
let pictured = "";
/** @param {string} cam */
async function loadPicture(cam) {
  if (cam === pictured) return;
  pictured = cam;
  const data = await (await fetch(`${path}/picture/${encodeURIComponent(cam)}`)).json();
  if (cam === pictured) picture.load(data);
}

/** @param {Turn} turn */
function renderTurn(turn) {
  const { contact_lost: isLost, was_lost: wasLost, measured, curve } = turn;
  const isLampOn = isLost || wasLost;
  setHidden("lamp", !sheet.shows_force && !isLampOn); // elsewhere it would never change
  $("lamp").classList.toggle("lost", isLampOn);
  setText("contact", text(isLampOn ? "contact_is_lost" : "contact_is_kept"));
  setText("on_the_way", wasLost && !isLost ? text("lab_on_the_way") : "");
  setText("measured", measured === null ? "–" : labText("shows", { value: formatFixed(measured, 1) }));
  const [low, high] = extent([curve]);
  if (sheet.shows_force) picture.maxForce = Math.max(1, high);
  if (picture.lens) picture.lens.maxGap = Math.max(0, ...turn.gap);
  force.fit(Math.min(0, low), high, true);
  force.drawCurve("force", curve.length ? curve : null, { colour: sheet.curve_colour, step: 360 / curve.length });
}

// -- the moving cam -------------------------------------------------------------------------------

/** Factor by which the picture is slower than the cam, and shortest time (ms) between two pictures. */
const SLOWNESS = 20, FRAME_MS = 30;
/** Longest time (s) by which a frame advances the cam. */
const MAX_FRAME_S = 0.25;
/** Displayed cam angle, rad, time (ms) of the last picture, and requested frame. */
let angle = 0, frameMs = 0, frame = 0;

function requestFrame() { frame ||= requestAnimationFrame(drawFrame); }

/** Turn the cam, and draw it with the follower of the observed turn. @param {number} nowMs */
function drawFrame(nowMs) {
  frame = 0;
  const { turn, rpm, isTurning } = state;
  if (isTurning && nowMs - frameMs < FRAME_MS) return requestFrame();
  const elapsed = Math.min(MAX_FRAME_S, (nowMs - frameMs) / 1000);
  frameMs = nowMs;
  if (isTurning) angle = (angle + (elapsed * rpm * Math.PI) / (30 * SLOWNESS)) % (2 * Math.PI);
  const count = turn?.lift.length ?? 0;
  if (turn && count) {
    const i = Math.floor((angle / (2 * Math.PI)) * count) % count;
    picture.lens?.setGap(turn.gap[i]);
    picture.setPose({ angle, lift: turn.lift[i], force: sheet.shows_force ? turn.curve[i] : 0, gap: turn.gap[i] });
  }
  if (isTurning && !document.hidden) requestFrame();
}

/** @type {LabReading[] | null} */
let tabulated = null;
/** @param {LabReading[]} readings */
function renderTable(readings) {
  if (readings === tabulated) return;
  tabulated = readings;
  $("rows").replaceChildren(...readings.map((reading) => {
    const results = [...(sheet.has_instrument ? [reading.measured] : []), ...(sheet.has_answer ? [reading.answer] : [])];
    const cells = [reading.number, ...options.map((name) => reading[name]), reading.rpm, ...results];
    const row = create("tr");
    row.append(...cells.map((value) => create("td", { textContent: typeof value === "number" ? formatNumber(value, 6) : value })));
    return row;
  }).reverse());
}

/** Fill the parts that do not change. */
function fillPage() {
  document.title = `${text("nav_lab")} – cam_rig`;
  /** @type {HTMLAnchorElement} */ ($("csv")).href = `${path}/readings.csv`;
  setText("title", text("bench_title", { rig: sheet.cams.join(", "), model: sheet.rig.name }));
  setText("task_words", labText("task", { mass: formatNumber(sheet.rig.mass), scatter: formatNumber(sheet.scatter_db ?? 0) }));
  $("steps").replaceChildren(...labText("steps").split("\n").map((textContent) => create("li", { textContent })));
  if (sheet.seed) {
    const percent = Object.entries(sheet.tolerances ?? {}).map(([name, tolerance]) => [name, formatNumber(100 * tolerance)]);
    setText("hidden_words", labText("hidden", { seed: sheet.seed, ...Object.fromEntries(percent) }));
  }
  field("student").value = sheet.student;
  field("student").maxLength = sheet.max_name;
  [field("rpm").min, field("rpm").max] = sheet.knob.map(String);
  setHidden("theory", Boolean(sheet.seed));
  setText("load_words", labText("plot_words", { lift: formatNumber(1000 * (sheet.critical_lift_m ?? 0)) }));
  setText("curve_title", labText("curve"));
  setText("pace", text("lab_pace", { factor: SLOWNESS }));
  setHidden(`formula_${sheet.lab}`, false);
  setText("formula_words", labText("formula"));
  setHidden("loudness", !sheet.has_sound);
  setHidden("instrument", !sheet.has_instrument);
  setHidden("answering", !sheet.has_answer);
  if (sheet.has_instrument) setText("instrument_of", labText("measured"));
  if (sheet.has_answer) {
    setText("question", labText("question"));
    setText("answer_unit", sheet.unit);
  }
  const results = [...(sheet.has_instrument ? [labText("measured_unit")] : []), ...(sheet.has_answer ? [labText("answer_unit")] : [])];
  const headings = ["#", ...options.map((name) => text(HEADINGS[name])), text("lab_speed_unit"), ...results];
  $("heads").replaceChildren(...headings.map((textContent) => create("th", { scope: "col", textContent })));
}

/** Add a radio button for each value of the set-up. */
function addOptions() {
  for (const name of options) {
    setHidden(name, false);
    sheet.options[name].forEach((value, i) => {
      const input = create("input", { type: "radio", name, value: String(value), checked: i === 0 });
      const label = create("label");
      label.append(input, typeof value === "number" ? `${formatNumber(value)} ${UNITS[name]}` : value);
      $(name).append(label);
      input.addEventListener("change", () => changeSetup({ setup: { ...state.setup, [name]: value } }));
    });
  }
}

// -- the drive ------------------------------------------------------------------------------------

const sound = new TurnSound(() => turnSender.put());
/** @type {LatestSender<void>} */
const turnSender = new LatestSender(observe);
/** Change set-up or speed, and observe its turn. @param {Partial<LabState>} changes */
function changeSetup(changes) {
  store.update(changes);
  turnSender.put();
}
/** @param {number} rpm */
function setSpeed(rpm) {
  field("rpm").value = String(rpm);
  changeSetup({ rpm });
}
const knob = new Knob($("knob"), sheet.knob, text("speed"), setSpeed);
$("rpm").addEventListener("change", () => {
  const rpm = typedNumber(field("rpm"), sheet.knob);
  if (rpm === null) return;
  knob.show(rpm);
  setSpeed(rpm);
});
$("volume").addEventListener("input", () => sound.setVolume(field("volume").valueAsNumber));

/**
 * Return the server's answer. Show the reason and return null if it refuses.
 * @param {string} name @param {object} value @returns {Promise<any>}
 */
async function send(name, value) {
  try {
    const answer = await post(path + name, value);
    const data = await answer.json();
    if (answer.ok) showStatus("");
    else showRefusal("refused", data);
    return answer.ok ? data : null;
  } catch (error) {
    if (!(error instanceof TypeError || error instanceof SyntaxError)) throw error;
    showStatus(text("disconnected_bench"));
    return null;
  }
}

/** Observe the turn of the present set-up and speed. Return it, or null if it was refused. @returns {Promise<Turn | null>} */
async function observe() {
  const observed = { ...state.setup, rpm: state.rpm };
  const turn = await send("/turn", { ...observed, sound: sound.isOn });
  store.update(turn ? { turn, observed } : { observed: null });
  if (turn) sound.play(turn.sound, turn.rate);
  return turn;
}

// -- the readings ---------------------------------------------------------------------------------

/** Return the last row. @param {{readings: LabReading[]}} notebook */
const lastRow = ({ readings }) => /** @type {LabReading} */ (readings.at(-1));

$("record").addEventListener("click", async () => {
  const reading = { ...state.setup, rpm: state.rpm };
  const turn = await observe(); // the displayed turn may be that of another speed
  if (!turn) return;
  const isEarly = !sheet.has_instrument && !turn.contact_lost && !turn.was_lost;
  if (isEarly && !confirm(text("lab_record_anyway", { rpm: formatNumber(reading.rpm, 6) }))) return;
  const notebook = await send("/record", reading);
  if (!notebook) return;
  const { number, rpm } = lastRow(notebook);
  store.update({ ...notebook, result: text("lab_recorded", { number, rpm: formatNumber(rpm ?? 0, 6) }) });
  if (sheet.has_instrument) turnSender.put(); // the scatter of the next reading differs
});
$("answering").addEventListener("submit", async (event) => {
  event.preventDefault();
  const notebook = await send("/answer", { ...state.setup, answer: field("answer").value });
  if (!notebook) return;
  field("answer").value = "";
  const { number, answer } = lastRow(notebook);
  store.update({ ...notebook, result: text("lab_answered", { number, answer: formatNumber(answer ?? 0, 6), unit: sheet.unit }) });
});
$("student").addEventListener("change", () => send("/student", { student: field("student").value }));
$("turning").addEventListener("click", () => store.update({ isTurning: !state.isTurning }));
document.addEventListener("visibilitychange", requestFrame);
$("plot_it").addEventListener("click", () => store.update({ isPlotted: !state.isPlotted }));
$("theory").addEventListener("click", async () => {
  store.update({ theory: state.theory ? null : await (await fetch(`${path}/theory`)).json() });
});

fillPage();
addOptions();
setSpeed(state.rpm);
