// A lab sheet: a set-up, a knob, a lamp, the force over the turn, and what the student reads.
import { Newest } from "../bench/link.js";
import { TurnSound } from "../bench/sound.js";
import { Chart, extent, shown } from "../common/charts.js";
import { $, field, post, say, status } from "../common/dom.js";
import { Knob, typed } from "../common/knob.js";
import { RigPicture } from "../common/rig.js";
import { loadTexts, text } from "../common/texts.js";
import { ReadingsPlot } from "./plot.js";

const UNITS = /** @type {const} */ ({ spring_stiffness: "N/m", added_mass: "kg", preload: "N", cam: "" });

await loadTexts();
/** Where this sheet is served: each group of a class has its own. */
const place = location.pathname.replace(/\/$/, "");
/** @type {LabSheet} */
const sheet = await (await fetch(`${place}/sheet`)).json();
const choices = /** @type {(keyof typeof UNITS)[]} */ (Object.keys(sheet.options));
/** @type {Record<string, number | string>} */
const chosen = Object.fromEntries(choices.map((name) => [name, sheet.options[name][0]]));
let set = sheet.knob[0];
/** A text of this lab. @param {string} key @param {Record<string, string | number>} [values] */
const own = (key, values) => text(`lab_${sheet.lab}_${key}`, values);

// -- what is there once -----------------------------------------------------------------------------
document.title = `${text("nav_lab")} – cam_rig`;
/** @type {HTMLAnchorElement} */ ($("csv")).href = `${place}/readings.csv`;
$("title").textContent = text("bench_title", { rig: sheet.cams.join(", "), model: sheet.rig.name });
$("task_words").textContent = own("task", { mass: shown(sheet.rig.mass), scatter: shown(sheet.scatter_db ?? 0) });
$("steps").replaceChildren(...own("steps").split("\n").map((step) => Object.assign(document.createElement("li"), { textContent: step })));
if (sheet.seed) {
  const percent = Object.fromEntries(Object.entries(sheet.tolerances ?? {}).map(([key, part]) => [key, shown(100 * part)]));
  $("hidden_words").textContent = own("hidden", { seed: sheet.seed, ...percent });
}
field("student").value = sheet.student;
field("student").maxLength = sheet.max_name;
for (const name of choices) {
  $(name).hidden = false;
  for (const [i, value] of sheet.options[name].entries()) {
    const input = Object.assign(document.createElement("input"), { type: "radio", name, value: String(value), checked: i === 0 });
    const label = document.createElement("label");
    label.append(input, typeof value === "number" ? `${shown(value)} ${UNITS[name]}` : value);
    $(name).append(label);
    input.addEventListener("change", () => { chosen[name] = value; values(); turn.put(); });
  }
}
[field("rpm").min, field("rpm").max] = sheet.knob.map(String);
$("theory").hidden = Boolean(sheet.seed);
$("load_words").textContent = own("plot_words", { lift: shown(1000 * (sheet.lift ?? 0)) });
$("curve_title").textContent = own("curve");
$(`formula_${sheet.lab}`).hidden = false;
$("formula_words").textContent = own("formula");
$("loudness").hidden = !sheet.heard;
$("instrument").hidden = !sheet.measured;
$("answering").hidden = !sheet.answered;
if (sheet.measured) $("instrument_of").textContent = own("measured");
if (sheet.answered) [$("asked").textContent, $("answer_unit").textContent] = [own("asked"), sheet.unit];
const HEADS = { spring_stiffness: text("lab_spring_unit"), added_mass: text("lab_mass_unit"), preload: text("lab_preload_unit"), cam: text("cam") };
const heads = ["#", ...choices.map((name) => HEADS[name]), text("lab_speed_unit"), ...(sheet.measured ? [own("measured_unit")] : []), ...(sheet.answered ? [own("answer_unit")] : [])];
$("heads").replaceChildren(...heads.map((words) => Object.assign(document.createElement("th"), { scope: "col", textContent: words })));

/** What is set up, as the drawing's letters have it; a hidden rig's are those of its labels. */
function values() {
  const number = (/** @type {number | string} */ value) => shown(Number(value));
  const words = text("lab_values", {
    k: number(chosen.spring_stiffness ?? sheet.rig.spring_stiffness),
    m: number(sheet.rig.mass + Number(chosen.added_mass ?? 0)),
    preload: number(chosen.preload ?? sheet.rig.preload),
  });
  $("values").textContent = sheet.lift === null ? words : `${words} · s = ${shown(1000 * sheet.lift)} mm`;
  picture(String(chosen.cam ?? sheet.cams[0]));
}
const rig = new RigPicture($("rig_drawing"), text("rig_picture"));
let pictured = "";
/** @param {string} cam */
async function picture(cam) {
  if (cam === pictured) return;
  pictured = cam;
  const found = await (await fetch(`${place}/picture/${encodeURIComponent(cam)}`)).json();
  if (cam !== pictured) return;
  rig.load(found);
  rig.pose({ angle: 0, lift: 0, force: 0, gap: 0 });
}

const force = new Chart($("force"), { title: own("curve_unit"), x: [0, 360], xTicks: [0, 60, 120, 180, 240, 300, 360], xTitle: text("angle") });
const plot = new ReadingsPlot($("plot"), $("plot_key"), sheet, { x: own("x"), y: own("y") });
/** @type {number[] | null} */
let drawn = null;
/** @param {number[]} values */
const drawForce = (values) => force.curve("force", values, { colour: sheet.curve_colour, step: 360 / values.length });
force.resized = () => { if (drawn) drawForce(drawn); };

// -- the drive -----------------------------------------------------------------------------------------
const sound = new TurnSound(() => turn.put());
/** @type {Newest<void>} */
const turn = new Newest(observe);
values();
const knob = new Knob($("knob"), sheet.knob, text("speed"), (rpm) => speed(rpm));
/** @param {number} rpm */
function speed(rpm) {
  set = rpm;
  field("rpm").value = String(rpm);
  turn.put();
}
$("rpm").addEventListener("change", () => {
  const rpm = typed(field("rpm"), sheet.knob);
  if (rpm === null) return;
  knob.show(rpm);
  speed(rpm);
});
$("volume").addEventListener("input", () => sound.volume(field("volume").valueAsNumber));

/**
 * What the server answers; null where it refused, and the page says why.
 * @param {string} path @param {object} value @returns {Promise<any>}
 */
async function ask(path, value) {
  try {
    const answer = await post(place + path, value);
    const found = await answer.json();
    status(answer.ok ? "" : text("refused", { words: found.words }));
    return answer.ok ? found : null;
  } catch (error) {
    if (!(error instanceof TypeError || error instanceof SyntaxError)) throw error;
    status(text("disconnected_bench"));
    return null;
  }
}

/** Shows what is seen of the set-up and speed; whether contact is lost, null where it is not known. */
async function observe() {
  const asked = { ...chosen, rpm: set };
  const seen = await ask("/turn", { ...asked, sound: sound.on });
  document.body.dataset.shown = seen ? JSON.stringify(asked) : "";
  if (!seen) return null;
  const lost = seen.contact_lost || seen.was_lost;
  $("lamp").classList.toggle("lost", lost);
  say("contact", text(lost ? "contact_is_lost" : "contact_is_kept"));
  say("on_the_way", seen.contact_lost || !seen.was_lost ? "" : text("lab_on_the_way"));
  $("measured").textContent = seen.measured === null ? "–" : own("shows", { value: seen.measured.toFixed(1) });
  drawn = seen.curve.length ? seen.curve : null;
  force.fit(Math.min(0, ...extent([drawn])), extent([drawn])[1], true);
  if (drawn) drawForce(drawn);
  else force.curve("force", null, { step: 1 });
  sound.play(seen.sound, seen.rate);
  return lost;
}

// -- the readings ----------------------------------------------------------------------------------------
$("record").addEventListener("click", async () => {
  const reading = { ...chosen, rpm: set };
  const lost = await observe(); // of this set-up and speed, and not of the one before
  if (lost === null || (!sheet.measured && !lost && !confirm(text("lab_record_anyway", { rpm: shown(reading.rpm, 6) })))) return;
  const found = await ask("/record", reading);
  if (!found) return;
  show(found);
  const { number, rpm } = found.readings.at(-1);
  $("recorded").textContent = text("lab_recorded", { number, rpm: shown(rpm, 6) });
  if (sheet.measured) turn.put(); // the next reading scatters otherwise
});
$("answering").addEventListener("submit", async (event) => {
  event.preventDefault();
  const found = await ask("/answer", { ...chosen, answer: field("answer").value });
  if (!found) return;
  show(found);
  field("answer").value = "";
  const { number, answer } = found.readings.at(-1);
  $("recorded").textContent = text("lab_answered", { number, answer: shown(answer, 6), unit: sheet.unit });
});
$("student").addEventListener("change", async () => {
  const found = await ask("/student", { student: field("student").value });
  if (found) show(found);
});
$("plot_it").addEventListener("click", () => {
  const on = $("plotted").hidden;
  $("plotted").hidden = !on;
  $("plot_it").setAttribute("aria-expanded", String(on));
  $("plot_it").textContent = text(on ? "lab_plot_off" : "lab_plot");
  plot.draw(plot.readings);
});
$("theory").addEventListener("click", async () => {
  const on = plot.theory === null;
  plot.theory = on ? await (await fetch(`${place}/theory`)).json() : null;
  $("theory").setAttribute("aria-pressed", String(on));
  $("theory").textContent = text(on ? "lab_theory_off" : "lab_theory");
  $("theory_words").hidden = !on;
  plot.draw(plot.readings);
});

/** @param {{readings: LabReading[], file: string | null}} notebook */
function show({ readings, file }) {
  plot.draw(readings);
  $("csv").hidden = !readings.length;
  $("file").textContent = file ? text("kept", { path: file }) : "";
  $("rows").replaceChildren(...readings.map((reading) => {
    const row = document.createElement("tr");
    const more = [...(sheet.measured ? [reading.measured] : []), ...(sheet.answered ? [reading.answer] : [])];
    for (const value of [reading.number, ...choices.map((name) => reading[name]), reading.rpm, ...more]) {
      row.append(Object.assign(document.createElement("td"), { textContent: typeof value === "number" ? shown(value, 6) : value }));
    }
    return row;
  }).reverse());
}

knob.show(set);
show(sheet);
speed(set);
