// The live bench: every control is a node's own parameter or service, and shows what the node says.
import { ContourChart } from "../common/contour.js";
import { shown } from "../common/charts.js";
import { loadTexts, text } from "../common/texts.js";
import { Knob } from "../common/knob.js";
import { Link, Newest } from "./link.js";
import { NoiseChart } from "./noise.js";
import { Sound } from "./sound.js";

const $ = (id) => document.getElementById(id);
/** How long (ms) the lamp shows a contact that was lost: it may have been for a millisecond. */
const LAMP_MS = 400;
const SETUP = ["model", "added_mass", "spring_stiffness", "preload"];

await loadTexts();
const about = await (await fetch("/bench/about")).json();
/** What may be set, has choices, and a list on the page; the speed alone has a knob. */
const SELECTS = Object.keys(about.settings).filter((name) => $(name) && about.settings[name].choices.length);
let now = null;

// -- what is there once -----------------------------------------------------------------------------
function heading(model) {
  const said = text("bench_title", { rig: about.rig.title, model: text(`model_${model}`) });
  if ($("title").textContent !== said) $("title").textContent = said;
}
heading(about.model);
document.title = `${text("nav_bench")} – cam_rig`;
if (!about.has_screen) $("picture").remove();
const words = { real_time: text("pace_real"), free: text("pace_free") };
const named = { pacing: (pace) => words[pace] ?? pace.replace("x", "×"), time_weighting: (name) => text(`weighting_${name}`) };
for (const id of SELECTS) fill(id, about.settings[id].choices, named[id]);
fill("model", about.models, (name) => text(`model_${name}`));
$("added_mass").max = about.max_added_mass;
[$("rpm").min, $("rpm").max] = about.speeds;
function fill(id, values, named = (value) => value) {
  for (const value of values) $(id).append(new Option(named(value), value));
}

// -- commands -----------------------------------------------------------------------------------------
const sound = new Sound((listens) => link.ask({ do: "listen", value: listens }));
const link = new Link(live, (samples) => sound.play(samples), (on) => {
  status(on ? "" : text("disconnected_bench"), !on);
  if (on && sound.on) link.ask({ do: "listen", value: true });
  if (!on) gone();
});
/** Nothing is known of the bench any more. */
function gone() {
  enable(false);
  for (const id of ["emergency", "apply"]) $(id).disabled = true;
  for (const id of ["speed", "level"]) $(id).textContent = "–";
  $("meter").value = 0;
  for (const id of ["graph", "ros", "late"]) $(id).textContent = "";
  lostAt = -Infinity;
  lamp("");
}
function status(sentence, wrong) {
  $("status").textContent = sentence;
  $("status").classList.toggle("fault", Boolean(wrong));
}
async function ask(command) {
  const answer = await link.ask(command);
  status(answer.success ? "" : answer.words || text("disconnected_bench"), !answer.success);
  return answer;
}
const speed = new Newest((rpm) => ask({ do: "set", name: "rpm", value: rpm }));
const knob = new Knob($("knob"), about.knob, text("commanded"), (rpm) => {
  $("rpm").value = rpm;
  speed.put(rpm);
});
$("rpm").addEventListener("change", () => {
  if (!$("rpm").reportValidity() || !Number.isFinite($("rpm").valueAsNumber)) return;
  knob.show($("rpm").valueAsNumber);
  speed.put($("rpm").valueAsNumber);
});
$("poster_start")?.addEventListener("click", () => ask({ do: "call", value: "start" }));
for (const service of ["start", "stop", "reset"]) $(service).addEventListener("click", () => ask({ do: "call", value: service }));
$("emergency").addEventListener("click", () => ask({ do: "call", value: "emergency_stop" }));
for (const id of SELECTS) $(id).addEventListener("change", async () => {
  const answer = await ask({ do: "set", name: id, value: $(id).value });
  if (!answer.success && now) choose(id, now);
});
$("volume").addEventListener("input", () => sound.volume($("volume").valueAsNumber));
$("take_over").addEventListener("click", () => ask({ do: "take_over" }));
$("setup").addEventListener("submit", (event) => {
  event.preventDefault();
  const value = Object.fromEntries(SETUP.map((id) => [id, id === "model" ? $(id).value : $(id).valueAsNumber]));
  ask({ do: "set_up", value }).then(({ success }) => { edited = !success; });
});
let edited = false; // what is typed is not overwritten before it is set up
$("setup").addEventListener("input", () => { edited = true; });
$("note").addEventListener("click", async () => {
  const { success, noted, words: why } = await ask({ do: "note" });
  const { rpm, level_db: level } = noted ?? {};
  $("noted").textContent = success ? text("noted", { rpm: shown(rpm, 5), level: shown(level, 4) }) : why;
});
$("clear").addEventListener("click", () => ask({ do: "clear" }));
$("keep").addEventListener("click", () => ask({ do: "keep" }));
if (about.has_screen) $("toggle").addEventListener("click", () => {
  const open = $("toggle").getAttribute("aria-expanded") !== "true";
  $("toggle").setAttribute("aria-expanded", String(open));
  $("toggle").textContent = text(open ? "hide" : "show");
  $("picture").classList.toggle("closed", !open);
  picture();
});

// -- what is shown ------------------------------------------------------------------------------------
const chart = new NoiseChart($("noise"), $("noise_key"), about.colours);
let [lostAt, losses] = [-Infinity, Infinity];

function live(message) {
  now = message;
  heading(message.setup.model);
  const { graph, drive, state, values, contact } = message;
  if (message.sound_rate) sound.rate = message.sound_rate;
  $("holder").hidden = message.holds;
  $("relative").textContent = message.calibrated_on ? text("calibrated", { cam: message.calibrated_on }) : text("level_relative");
  const runs = graph === "running" && Object.keys(values).length > 0;
  enable(message.holds && runs);
  $("start").disabled ||= drive === "emergency";
  if ($("poster_start")) $("poster_start").disabled = $("start").disabled || drive === "turning";
  $("emergency").disabled = !runs;
  $("apply").disabled = !message.holds || graph === "starting";
  $("keep").disabled ||= !("cam" in state);
  $("csv").hidden = !message.readings.length;
  graphWords(message);
  const turns = drive === "turning" && "rpm" in state;
  $("speed").textContent = "rpm" in state ? shown(turns ? state.rpm : 0, 5) : "–";
  $("level").textContent = message.level === null ? "–" : message.level.toFixed(1);
  $("meter").value = message.level ?? 0;
  const ear = values.microphone;
  $("quantity").textContent = ear ? `dB, L${ear.frequency_weighting}${ear.time_weighting}` : "dB";
  if (contact === "contact lost" || message.losses > losses) lostAt = performance.now();
  losses = message.losses;
  lamp(contact);
  $("late").textContent = message.late ? text("late") : "";
  if (!knob.held && !speed.pending && values.cam_drive && document.activeElement !== $("rpm")) {
    const commanded = values.cam_drive.rpm || message.setup.rpm;
    knob.show(commanded);
    $("rpm").value = Number(commanded.toPrecision(6));
  }
  for (const id of SELECTS) choose(id, message);
  if (!edited) for (const id of SETUP) $(id).value = message.setup[id];
  chart.draw(message.readings);
  list("ended", Object.entries(message.ended), ended);
  list("kept", message.kept, (path) => Object.assign(document.createElement("li"), { textContent: text("kept", { path }) }));
  list("log", message.log, (line) => Object.assign(document.createElement("li"), { textContent: line }));
  picture();
}

function enable(on) {
  knob.enable(on);
  for (const id of ["rpm", "start", "stop", "reset", ...SELECTS, "note", "clear", "keep"]) $(id).disabled = !on;
}

function graphWords({ graph, words: why, domain, drive, waits_for: nodes }) {
  $("ros").textContent = graph === "running" ? text("ros", { domain }) : "";
  const key = graph !== "running" ? `graph_${graph}` : nodes ? "drive_waits" : `drive_${drive}`;
  const said = text(key, { why, nodes });
  if ($("graph").textContent !== said) $("graph").textContent = said;
  $("graph").classList.toggle("fault", graph === "failed" || drive === "emergency");
}

function lamp(contact) {
  const lost = performance.now() - lostAt < LAMP_MS;
  if (lost) setTimeout(() => lamp(now.contact), LAMP_MS);
  $("lamp").classList.toggle("lost", lost);
  $("lamp").classList.toggle("none", !contact);
  const said = text(lost ? "contact_is_lost" : contact ? "contact_is_kept" : "contact_unknown");
  if ($("contact").textContent !== said) $("contact").textContent = said;
}

function choose(id, { values, state, setup }) {
  const given = id === "cam" ? values.law_server?.cam || state.cam || setup.cam : values[about.settings[id].node]?.[id];
  if (given === undefined || document.activeElement === $(id)) return;
  if (![...$(id).options].some(({ value }) => value === given)) $(id).append(new Option(given, given));
  $(id).value = given;
}

/** A list is made anew only where it has changed, so that a button in it can be pressed. */
const lists = {};
function list(id, items, made) {
  const said = JSON.stringify([items, now.holds]);
  if (lists[id] === said) return;
  lists[id] = said;
  $(id).replaceChildren(...items.map(made));
}
function ended([node, why]) {
  const item = Object.assign(document.createElement("li"), { textContent: `${why} ` });
  const button = Object.assign(document.createElement("button"), { type: "button", textContent: text("start_again", { node }), disabled: !now.holds });
  button.addEventListener("click", () => ask({ do: "start_again", value: node }));
  item.append(button);
  return item;
}

// -- the picture of the rig: Rerun's page, behind a poster until it shows the rig --------------------
let pictured = false;
addEventListener("message", ({ source, data }) => {
  if (data !== "shown" || source !== $("rerun")?.contentWindow || pictured) return;
  pictured = true;
  picture();
});
const poster = about.has_screen ? new ContourChart($("poster_cam"), about.contour_colours, text("contour")) : null;
let posted = null;

function picture() {
  if (!about.has_screen) return;
  const open = $("toggle").getAttribute("aria-expanded") === "true";
  const address = open && now?.screen;
  $("stage").hidden = !open;
  $("rerun").hidden = !address;
  // Under the name by which this page was opened: another one has none of its cookies.
  if (address && !$("rerun").src) $("rerun").src = Object.assign(new URL(address), { hostname: location.hostname }).href;
  if (!address && $("rerun").src) {
    $("rerun").removeAttribute("src");
    pictured = false;
  }
  $("poster").hidden = pictured;
  if (now && open && !pictured) post(now);
}

/** The cam that is mounted, until Rerun shows it turn. */
async function post({ state, setup, drive }) {
  const said = drive === "turning" ? text("picture_waits") : "";
  if ($("no_picture").textContent !== said) $("no_picture").textContent = said;
  const cam = now.values.law_server?.cam || state.cam || setup.cam;
  if (cam === posted) return;
  posted = cam;
  const answer = await fetch(`/bench/cam/${encodeURIComponent(cam)}`);
  if (!answer.ok || cam !== posted) return;
  const { title, discs } = await answer.json();
  $("poster_title").textContent = title;
  poster.draw(discs, true);
}
