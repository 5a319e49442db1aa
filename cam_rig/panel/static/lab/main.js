// A lab sheet: a set-up, a knob, a lamp, the force over the turn, and what the student reads.
import { Newest } from "../bench/link.js";
import { Chart, extent, shown } from "../common/charts.js";
import { $, field } from "../common/dom.js";
import { Knob } from "../common/knob.js";
import { RigPicture } from "../common/rig.js";
import { loadTexts, text } from "../common/texts.js";
import { JumpPlot } from "./plot.js";
import { TurnSound } from "./turn_sound.js";

const CHOICES = /** @type {const} */ ({ spring_stiffness: ["springs", "N/m"], added_mass: ["added_masses", "kg"], preload: ["preloads", "N"] });

await loadTexts();
/** @type {LabSheet} */
const sheet = await (await fetch("/lab/sheet")).json();
const chosen = { rpm: sheet.knob[0], spring_stiffness: sheet.springs[0], added_mass: sheet.added_masses[0], preload: sheet.preloads[0] };

// -- what is there once -----------------------------------------------------------------------------
document.title = `${text("nav_lab")} – cam_rig`;
$("title").textContent = text("bench_title", { rig: sheet.cam.name, model: sheet.rig.name });
$("task_words").textContent = text(`lab_${sheet.lab}_task`, { mass: shown(sheet.rig.mass) });
const steps = text(`lab_${sheet.lab}_steps`).split("\n");
$("steps").replaceChildren(...steps.map((step) => Object.assign(document.createElement("li"), { textContent: step })));
if (sheet.seed) {
  const percent = Object.fromEntries(Object.entries(sheet.tolerances ?? {}).map(([key, part]) => [key, shown(100 * part)]));
  $("hidden_words").textContent = text("lab_hidden", { seed: sheet.seed, ...percent });
}
field("student").value = sheet.student;
field("student").maxLength = sheet.max_name;
for (const name of /** @type {(keyof typeof CHOICES)[]} */ (Object.keys(CHOICES))) {
  const [list, unit] = CHOICES[name];
  for (const [i, value] of sheet[list].entries()) {
    const input = Object.assign(document.createElement("input"), { type: "radio", name, value: String(value), checked: i === 0 });
    const label = document.createElement("label");
    label.append(input, `${shown(value)} ${unit}`);
    $(name).append(label);
    input.addEventListener("change", () => { chosen[name] = value; values(); turn.put(); });
  }
}
[field("rpm").min, field("rpm").max] = sheet.knob.map(String);
$("theory").hidden = Boolean(sheet.seed);
$("load_words").textContent = text("lab_load_words", { lift: shown(1000 * sheet.lift) });

/** What is set up, as the drawing's letters have it; a hidden rig's are those of its labels. */
function values() {
  const { spring_stiffness: k, added_mass: added, preload } = chosen;
  $("values").textContent = text("lab_values", { k: shown(k), m: shown(sheet.rig.mass + added), preload: shown(preload), lift: shown(1000 * sheet.lift) });
}
values();
const rig = new RigPicture($("rig_drawing"), text("rig_picture"));
rig.load(await (await fetch("/lab/picture")).json());
rig.pose({ angle: 0, lift: 0, force: 0, gap: 0 });

const force = new Chart($("force"), { title: text("newton"), x: [0, 360], xTicks: [0, 60, 120, 180, 240, 300, 360], xTitle: text("angle") });
const plot = new JumpPlot($("plot"), $("plot_key"), sheet);
/** @type {number[] | null} */
let drawn = null;
/** @param {number[]} values */
const drawForce = (values) => force.curve("force", values, { colour: sheet.force_colour, step: 360 / values.length });
force.resized = () => { if (drawn) drawForce(drawn); };

// -- the drive -----------------------------------------------------------------------------------------
const sound = new TurnSound(() => turn.put());
/** @type {Newest<void>} */
const turn = new Newest(observe);
const knob = new Knob($("knob"), sheet.knob, text("speed"), (rpm) => speed(rpm));
/** @param {number} rpm */
function speed(rpm) {
  chosen.rpm = rpm;
  field("rpm").value = String(rpm);
  turn.put();
}
$("rpm").addEventListener("change", () => {
  if (!field("rpm").reportValidity() || !Number.isFinite(field("rpm").valueAsNumber)) return;
  knob.show(field("rpm").valueAsNumber);
  speed(field("rpm").valueAsNumber);
});
$("volume").addEventListener("input", () => sound.volume(field("volume").valueAsNumber));

/**
 * What the server answers; null where it refused, and the page says why.
 * @param {string} path @param {object} value @returns {Promise<any>}
 */
async function post(path, value) {
  try {
    const answer = await fetch(path, { method: "POST", body: JSON.stringify(value) });
    const found = await answer.json();
    status(answer.ok ? "" : text("refused", { words: found.words }));
    return answer.ok ? found : null;
  } catch (error) {
    if (!(error instanceof TypeError || error instanceof SyntaxError)) throw error;
    status(text("disconnected_bench"));
    return null;
  }
}
/** @param {string} sentence */
function status(sentence) {
  $("status").textContent = sentence;
  $("status").classList.toggle("fault", Boolean(sentence));
}

/** Shows what is seen of the set-up and speed; whether contact is lost, null where it is not known. */
async function observe() {
  const asked = { ...chosen };
  const seen = await post("/lab/turn", { ...asked, sound: sound.on });
  document.body.dataset.shown = seen ? JSON.stringify(asked) : "";
  if (!seen) return null;
  const lost = seen.contact_lost || seen.was_lost;
  $("lamp").classList.toggle("lost", lost);
  say("contact", text(lost ? "contact_is_lost" : "contact_is_kept"));
  say("on_the_way", seen.contact_lost || !seen.was_lost ? "" : text("lab_on_the_way"));
  drawn = seen.force;
  force.fit(Math.min(0, ...extent([drawn])), extent([drawn])[1], true);
  drawForce(seen.force);
  sound.play(seen.sound, seen.rate);
  return lost;
}
/** @param {string} id @param {string} sentence */
function say(id, sentence) {
  if ($(id).textContent !== sentence) $(id).textContent = sentence;
}

// -- the readings ----------------------------------------------------------------------------------------
$("record").addEventListener("click", async () => {
  const reading = { ...chosen };
  const lost = await observe(); // of this set-up and speed, and not of the one before
  if (lost === null || (!lost && !confirm(text("lab_record_anyway", { rpm: shown(reading.rpm, 6) })))) return;
  const found = await post("/lab/record", reading);
  if (!found) return;
  show(found);
  const { number, rpm } = found.readings.at(-1);
  $("recorded").textContent = text("lab_recorded", { number, rpm: shown(rpm, 6) });
});
$("student").addEventListener("change", async () => {
  const found = await post("/lab/student", { student: field("student").value });
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
  const on = plot.slope === null;
  plot.slope = on ? (await (await fetch("/lab/theory")).json()).slope : null;
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
    for (const value of [reading.number, reading.spring_stiffness, reading.added_mass, reading.preload, reading.rpm]) {
      row.append(Object.assign(document.createElement("td"), { textContent: shown(value, 6) }));
    }
    return row;
  }).reverse());
}

knob.show(chosen.rpm);
show(sheet);
speed(chosen.rpm);
