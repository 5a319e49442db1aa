// Drawing board: the page computes the law of the ordinates at once, the server its exact results.
/** @import { Motion } from "./law.js" */
/** @import { Drawing } from "./links.js" */
import { extent, lineColour } from "../common/charts.js";
import { ContourChart } from "../common/contour.js";
import { $, field, setDisabled, setText, setValue, showRefusal, showStatus } from "../common/dom.js";
import { KEY_STEPS, typedNumber } from "../common/knob.js";
import { degrees } from "../common/rig.js";
import { Store } from "../common/store.js";
import { errorText, formatNumber, loadTexts, text } from "../common/texts.js";
import { BoardCharts, SECOND_COLOUR } from "./charts.js";
import { decodeLaw, listenForChoices, listenForSecond } from "./choices.js";
import { Connection } from "./connection.js";
import { listenForFiles, showDesign } from "./files.js";
import { Handles, pullWeights } from "./handles.js";
import { History } from "./history.js";
import { DrawnLaw, MOTION_POINTS, contactForce } from "./law.js";
import { listenForLinks } from "./links.js";
import { fillHeading, renderReadouts } from "./readouts.js";
import { PeaksTable } from "./tables.js";

/** Half widths (deg) of a pull. 0 moves a single ordinate. */
const PULL_WIDTHS_DEG = [0, 10, 20, 40];
/** Largest magnitude of an ordinate, in lifts, as in cam files. */
const MAX_ORDINATE = 100;
/** Range of the speed slider, rpm. */
const SLIDER_RPM = [20, 2000];

await loadTexts();
/** @type {Board} */
const board = await (await fetch("/board")).json();
const drawnLaw = new DrawnLaw(board);
const start = Float64Array.from(board.start);
const liftMm = board.cam.lift_m * 1e3;
const handleData = board.handles.map((handle) => {
  const k = Math.round((handle.angle / (2 * Math.PI)) * MOTION_POINTS) % MOTION_POINTS;
  return { ...handle, k, angle: (2 * Math.PI * k) / MOTION_POINTS };
});

/** Law that is drawn next to that of the board. @typedef {{title: string, motion: Motion, figures: Figures}} SecondLaw */

/**
 * State of the board, with the base radius in mm. Arrays are replaced and never changed.
 *
 * `makeable` are the ordinates of the last law that can be made. `mayShrink` is true for one frame
 * after a gesture. `isFastCurrent` is true if the fast results are those of the ordinates.
 * @typedef {{ordinates: Float64Array, rpm: number, baseRadius: number, cursorDeg: number, spectrum: string, second: SecondLaw | null,
 *   fast: FastResults | null, full: FullResults | null, isFastCurrent: boolean, makeable: Float64Array | null,
 *   mayShrink: boolean}} BoardState
 */
const store = new Store(/** @type {BoardState} */ ({
  ordinates: Float64Array.from(board.ordinates),
  rpm: board.rpm,
  baseRadius: board.base_radius_mm,
  cursorDeg: 0,
  spectrum: "force",
  second: null,
  fast: null,
  full: null,
  isFastCurrent: false,
  makeable: board.start_can_be_made ? start : null,
  mayShrink: true,
}), render);
const { state } = store;
const charts = new BoardCharts(board, drawnLaw);
const contour = new ContourChart($("contour"), board.colours, text("contour"));
const peaks = {
  own: new PeaksTable("peaks", "", "currentColor"),
  second: new PeaksTable("second_peaks", "second", lineColour(SECOND_COLOUR)),
};

// -- rendering ------------------------------------------------------------------------------------

/** @param {BoardState} present */
function render(present) {
  const { ordinates, rpm, fast } = present;
  const motion = charts.motion(charts.law(ordinates));
  const speed = (rpm * 2 * Math.PI) / 60;
  charts.draw(present);
  handles.draw(motion[0], ordinates, liftMm);
  if (fast?.follower) contour.draw(fast.discs, fast.follower, present.mayShrink);
  present.mayShrink = false;
  peaks.own.draw(board.cam.title, fast?.figures, present.isFastCurrent);
  peaks.second.draw(present.second?.title ?? "", present.second?.figures, true);
  setText("acceleration", `${formatNumber(Math.max(...extent([motion[2]]).map(Math.abs)) * speed ** 2)} m/s²`);
  renderCursor(motion, present.cursorDeg, speed);
  renderReadouts(present, board.cam.sprung);
  if (document.activeElement !== $("rpm")) setValue("rpm", Number(rpm.toPrecision(6)));
  if (document.activeElement !== $("base_radius")) setValue("base_radius", Number(present.baseRadius.toPrecision(6)));
  setValue("knob", Math.log(rpm));
  setDisabled("undo", !history.past.length);
  setDisabled("redo", !history.future.length);
}

/** Return a number without digits below 1e-9, which are rounding errors of the law. @param {number} value */
const withoutRounding = (value) => Number(value.toFixed(9)) || 0;

/** Show one cam angle in all charts, and turn the cam to it. @param {Motion} motion @param {number} angleDeg @param {number} speed */
function renderCursor(motion, angleDeg, speed) {
  const k = Math.round((angleDeg / 360) * MOTION_POINTS) % MOTION_POINTS;
  const point = motion.map((curve) => curve.subarray(k, k + 1)), [[lift], [slope], [curvature]] = point;
  const onCam = { y: lift, velocity: slope * speed, acceleration: curvature * speed ** 2, force: contactForce(point, board.rig, state.rpm)[0] };
  const { y, velocity, acceleration, force } = charts.flightAt(state, (angleDeg * Math.PI) / 180) ?? onCam;
  contour.setPose((angleDeg * Math.PI) / 180, y * 1e3);
  for (const chart of charts.overAngle) chart.drawCursor(angleDeg);
  setText("at_cursor", text("cursor_words", {
    angle: angleDeg,
    lift: formatNumber(withoutRounding(y * 1e3)),
    velocity: formatNumber(withoutRounding(velocity), 3),
    acceleration: formatNumber(withoutRounding(acceleration), 3),
    force: formatNumber(force, 3),
    torque: formatNumber(force * slope, 3),
  }));
}

// -- changes --------------------------------------------------------------------------------------

/** Change the drawing, and send it to the server. @param {Partial<BoardState>} changes */
function change(changes) {
  store.update({ ...changes, isFastCurrent: false });
  connection.change();
}

/** Let the axes shrink after a gesture. */
const settle = () => store.update({ mayShrink: true });

/** Return the drawing as it is sent and stored. */
const readDrawing = () => ({ ordinates: Array.from(state.ordinates), rpm: state.rpm, base_radius_mm: state.baseRadius });
/** Return the values of the state for a drawing. @param {Drawing} drawing */
const drawn = ({ ordinates, rpm, base_radius_mm: baseRadius }) => ({ ordinates: Float64Array.from(ordinates), rpm, baseRadius });
const history = new History(readDrawing, (drawing) => change({ ...drawn(drawing), mayShrink: true }));

/** Make a change that is undone as one step. @param {Partial<BoardState>} changes */
function changeAsStep(changes) {
  history.begin();
  change({ ...changes, mayShrink: true });
  history.end();
}

/**
 * Move the ordinates that a handle pulls. `wayOf(index)` is the way of full weight, in lifts.
 * @param {Handle} handle @param {(index: number) => number} wayOf
 */
function pull(handle, wayOf) {
  const ordinates = state.ordinates.slice();
  for (const [{ index }, weight] of weightsOf(handle)) {
    const value = ordinates[index] + weight * wayOf(index);
    ordinates[index] = Math.min(MAX_ORDINATE, Math.max(-MAX_ORDINATE, value));
  }
  change({ ordinates });
}

/** @param {Handle} handle */
const weightsOf = (handle) => pullWeights(handleData, handle, (Number(field("width").value) * Math.PI) / 180);

const endGesture = () => {
  history.end();
  settle();
  connection.flush();
};

const handles = new Handles(charts.laws[0], handleData, {
  limit: MAX_ORDINATE * liftMm,
  begin: () => history.begin(),
  move(handle, lift) {
    const present = charts.motion(charts.law(state.ordinates))[0][handle.k];
    const effect = weightsOf(handle).reduce((sum, [{ index }, weight]) => sum + weight * drawnLaw.sensitivity(handle.k, index), 0);
    pull(handle, () => (lift - present) / effect);
  },
  step: (handle, lifts) => pull(handle, () => lifts),
  reset: (handle) => pull(handle, (index) => start[index] - state.ordinates[index]),
  end: endGesture,
  focus: ({ angle }) => moveCursor(degrees(angle)),
});

// -- controls -------------------------------------------------------------------------------------

/** @param {number} angleDeg */
function moveCursor(angleDeg) {
  field("cursor").valueAsNumber = angleDeg;
  store.update({ cursorDeg: field("cursor").valueAsNumber });
}
$("cursor").addEventListener("input", () => store.update({ cursorDeg: field("cursor").valueAsNumber }));
for (const chart of charts.overAngle) {
  chart.svg.addEventListener("pointermove", (event) => {
    const fraction = chart.xFraction(event);
    if (fraction >= 0 && fraction < 1) moveCursor(Math.floor(360 * fraction));
  });
}
for (const chart of [...charts.overAngle, charts.spectrum]) chart.onResize = () => store.update();

[field("knob").min, field("knob").max] = SLIDER_RPM.map((rpm) => String(Math.log(rpm)));
$("knob").setAttribute("aria-label", text("speed"));
[field("rpm").min, field("rpm").max] = board.rpm_range.map(String);
$("knob").addEventListener("input", () => {
  history.begin();
  change({ rpm: Math.round(Math.exp(field("knob").valueAsNumber)) });
});
$("knob").addEventListener("keydown", (event) => {
  const step = KEY_STEPS[event.key];
  if (step === undefined) return;
  event.preventDefault();
  const [low, high] = board.rpm_range;
  changeAsStep({ rpm: Math.min(high, Math.max(low, Math.round(state.rpm) + step)) });
});
$("knob").addEventListener("change", endGesture);
$("rpm").addEventListener("change", () => {
  const rpm = typedNumber(field("rpm"), board.rpm_range);
  if (rpm !== null) changeAsStep({ rpm });
});

[field("base_radius").min, field("base_radius").max] = board.base_radius_range.map(String);
$("base_radius").addEventListener("change", () => {
  const baseRadius = typedNumber(field("base_radius"), board.base_radius_range, "base_range");
  if (baseRadius !== null) changeAsStep({ baseRadius });
});

// A field that loses the focus shows the value of the board again.
for (const id of ["rpm", "base_radius"]) $(id).addEventListener("blur", () => store.update());

$("undo").addEventListener("click", () => history.undo());
$("redo").addEventListener("click", () => history.redo());
$("reset").addEventListener("click", () => changeAsStep({ ordinates: start, baseRadius: board.start_base_radius_mm }));
addEventListener("keydown", (event) => {
  const target = /** @type {Element} */ (event.target);
  if (!(event.ctrlKey || event.metaKey) || target.matches("input:not([type=range])")) return;
  const key = event.key.toLowerCase();
  if (key === "z" && !event.shiftKey) history.undo();
  else if (key === "y" || (key === "z" && event.shiftKey)) history.redo();
  else return;
  event.preventDefault();
});

for (const width of PULL_WIDTHS_DEG) $("width").append(new Option(text(width ? "width_deg" : "width_one", { width }), String(width)));
/** Display a second law, or remove it. @param {SecondLaw | null} second */
const showSecond = (second) => store.update({ second, mayShrink: true });
listenForChoices(board);
listenForSecond(board, showSecond);
$("spectrum_of").addEventListener("change", () => store.update({ spectrum: field("spectrum_of").value, mayShrink: true }));
if ($("save")) listenForFiles(readDrawing); // the static page has no files

// -- the server -----------------------------------------------------------------------------------

/** Sent ordinates by number. @type {Map<number, Float64Array>} */
const sent = new Map();

/** @param {BoardMessage} message @param {boolean} isPending true if a change of this page has no answer yet */
function receive(message, isPending) {
  switch (message.type) {
    case "refused": return showRefusal("refused", message);
    case "design": return showDesign(message, (law) => showSecond(decodeLaw(law)));
    case "full": return message.message === undefined ? store.update({ full: message }) : showStatus(errorText(message.message));
    case "opened": // a link in the address is of the previous cam
      window.history.replaceState(null, "", location.pathname);
      return location.reload();
    case "changed": {
      // Another cam or rig was chosen while the connection was lost.
      if (message.generation !== board.generation) return location.reload();
      const drawing = drawn(message);
      receiveFast(message, drawing.ordinates, true);
      return store.update({ ...drawing, mayShrink: true });
    }
    default: {
      const ordinates = sent.get(message.number) ?? null;
      for (const number of sent.keys()) if (number <= message.number) sent.delete(number);
      return receiveFast(message, ordinates, !isPending);
    }
  }
}

/** @param {FastResults} fast @param {Float64Array | null} ordinates of the results @param {boolean} isFastCurrent */
function receiveFast(fast, ordinates, isFastCurrent) {
  const isFaulty = fast.faults.length > 0;
  // The contour of a law that has none is that of the last law with a contour.
  const discs = fast.discs.length ? fast.discs : state.fast?.discs ?? [];
  const follower = fast.follower ?? state.fast?.follower ?? null;
  store.update({
    fast: { ...fast, discs, follower },
    isFastCurrent,
    makeable: isFaulty ? state.makeable : ordinates ?? state.makeable,
    // Axes do not shrink during a gesture.
    mayShrink: state.mayShrink || !history.before,
  });
}

const connection = new Connection(
  (number) => {
    sent.set(number, state.ordinates);
    return { ...readDrawing(), generation: board.generation };
  },
  receive,
  (isOpen) => showStatus(isOpen ? "" : text("disconnected")),
);
const expert = /** @type {HTMLDetailsElement} */ ($("expert"));
expert.open ||= sessionStorage.getItem("expert") === "open";
expert.addEventListener("toggle", () => sessionStorage.setItem("expert", expert.open ? "open" : ""));
fillHeading(board);
store.update();
listenForLinks(board, readDrawing, (drawing) => changeAsStep(drawn(drawing)));
