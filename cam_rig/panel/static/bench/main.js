// The live bench: every control is a node's own parameter or service, and shows what the node says.
import { shown } from "../common/charts.js";
import { loadTexts, text } from "../common/texts.js";
import { $, field, post, say, status } from "../common/dom.js";
import { Knob, typed } from "../common/knob.js";
import { Link, Newest } from "./link.js";
import { NoiseChart } from "./noise.js";
import { length } from "../common/rig.js";
import { Stage } from "./stage.js";
import { Sound } from "./sound.js";

const LOST = "contact lost";
/** What may change with every tick. */
const NUMBERS = ["type", "level", "losses", "contact", "late"];
/** How long (ms) the lamp shows a contact that was lost: it may have been for a millisecond. */
const LAMP_MS = 400;
/** What a speed does is waited for so long (ms): the server may be compiling its search. */
const WAITS_MS = 60_000, AGAIN_MS = 1000;
/** What is read out has stayed so long (ms). */
const ANNOUNCE_MS = 1500;
/** A level is shown at once, or so often (ms) where it has changed by less (dB): what lies between it and the turning
 * cam is composed anew each time. */
const METER_MS = 200, STEP_DB = 1;
/** A volume and a level (dB) from which on headphones are warned of: assumed, of no standard. */
const LOUD = 0.5, LOUD_DB = 100;
const SETUP = /** @type {const} */ (["model", "added_mass", "spring_stiffness", "preload"]);

await loadTexts();
/**
 * @type {{rig: {name: string}, has_screen: boolean, models: string[], model: string, settings: Record<string, {node: string, choices: string[]}>,
 *   knob: Pair, speeds: Pair, colours: string[], max_added_mass: number}}
 */
const about = await (await fetch("/bench/about")).json();
/** What may be set, has choices, and a list on the page; the speed alone has a knob. */
const SELECTS = Object.keys(about.settings).filter((name) => $(name) && about.settings[name].choices.length);
/** What the bench said last. @type {Live | null} */
let now = null;

// -- what is there once -----------------------------------------------------------------------------
/** @param {string} model */
function heading(model) {
  say("title", text("bench_title", { rig: about.rig.name, model: text(`short_${model}`) }));
}
heading(about.model);
document.title = `${text("nav_bench")} – cam_rig`;
for (const id of ["rerun", "rerun_note"]) $(id).hidden = !about.has_screen;
/** @type {Record<string, string>} */
const words = { real_time: text("pace_real"), free: text("pace_free") };
/** @type {Record<string, (value: string) => string>} */
const named = { pacing: (pace) => words[pace] ?? pace.replace("x", "×"), time_weighting: (name) => text(`weighting_${name}`) };
for (const id of SELECTS) fill(id, about.settings[id].choices, named[id]);
fill("model", about.models, (name) => text(`model_${name}`));
field("added_mass").max = String(about.max_added_mass);
[field("rpm").min, field("rpm").max] = about.speeds.map(String);
/** @param {string} id @param {string[]} values */
function fill(id, values, named = (/** @type {string} */ value) => value) {
  for (const value of values) $(id).append(new Option(named(value), value));
}

// -- commands -----------------------------------------------------------------------------------------
/** @type {Sound} */
const sound = new Sound((listens) => link.ask({ do: "listen", value: listens }));
const stage = new Stage(() => now?.values.cam_drive?.pacing);
/** @type {Link} */
const link = new Link(live, (block) => stage.take(block), (samples) => sound.play(samples), (on) => {
  status(on ? "" : text("disconnected_bench"));
  if (on && sound.on) link.ask({ do: "listen", value: true });
  if (on) watch();
  else gone();
});
/** A page that nobody sees is sent no motion. */
function watch() { link.ask({ do: "watch", value: !document.hidden }); }
document.addEventListener("visibilitychange", watch);
/** Nothing is known of the bench any more. */
function gone() {
  enable(false, false);
  for (const id of ["emergency", "apply"]) field(id).disabled = true;
  for (const id of ["speed", "level"]) $(id).textContent = "–";
  field("meter").value = "0";
  for (const id of ["graph", "ros", "late"]) $(id).textContent = "";
  [now, lostAt] = [null, -Infinity];
  lamp("");
}
/** @param {object} command */
async function ask(command) {
  const answer = await link.ask(command);
  status(answer.success ? "" : answer.words || text("disconnected_bench"));
  return answer;
}
/** A speed that is chosen before the nodes are there. @type {number | null} */
let wanted = null;
const speed = new Newest(async (/** @type {number} */ rpm) => {
  const { success } = await ask({ do: "set", name: "rpm", value: rpm });
  if (!success) again();
});
/** @param {number} rpm */
function choose_speed(rpm) {
  if (runs(now)) speed.put(rpm);
  else wanted = rpm;
  forecast();
}
const knob = new Knob($("knob"), about.knob, text("commanded"), (rpm) => {
  field("rpm").value = String(rpm);
  choose_speed(rpm);
});
$("rpm").addEventListener("change", () => {
  const rpm = typed(field("rpm"), about.speeds);
  if (rpm === null) return;
  knob.show(rpm);
  choose_speed(rpm);
});
for (const service of ["start", "stop", "reset"]) $(service).addEventListener("click", () => ask({ do: "call", value: service }));
$("emergency").addEventListener("click", () => ask({ do: "call", value: "emergency_stop" }));
for (const id of SELECTS) $(id).addEventListener("change", async () => {
  const answer = await ask({ do: "set", name: id, value: field(id).value });
  if (!answer.success && now) choose(id, now);
});
$("volume").addEventListener("input", () => {
  sound.volume(field("volume").valueAsNumber);
  again();
});
// A browser lets nothing be heard before something on the page is pressed.
if (sound.remembered) addEventListener("pointerdown", () => {
  field("volume").value = String(sound.remembered);
  sound.volume(sound.remembered);
}, { once: true });
$("take_over").addEventListener("click", () => ask({ do: "take_over" }));
$("setup").addEventListener("submit", (event) => {
  event.preventDefault();
  const value = Object.fromEntries(SETUP.map((id) => [id, id === "model" ? field(id).value : field(id).valueAsNumber]));
  ask({ do: "set_up", value }).then(({ success }) => { edited = !success; });
});
let edited = false; // what is typed is not overwritten before it is set up
$("setup").addEventListener("input", () => {
  edited = true;
  forecast();
});
$("note").addEventListener("click", async () => {
  const { success, noted, words: why } = await ask({ do: "note" });
  $("noted").textContent = success && noted ? text("noted", { rpm: shown(noted.rpm, 5), level: shown(noted.level_db, 4) }) : why;
});
$("clear").addEventListener("click", () => ask({ do: "clear" }));
$("keep").addEventListener("click", () => ask({ do: "keep" }));
$("rerun").addEventListener("click", () => ask({ do: "rerun" }));

// -- what is shown ------------------------------------------------------------------------------------
const chart = new NoiseChart($("noise"), $("noise_key"), about.colours);
let [lostAt, metered] = [-Infinity, -Infinity];
/** The level that is shown, dB. @type {number | null} */
let read = null;
/** Until one that differs little is. */
let reads = 0;
/** Until the lamp is looked at again. */
let lamps = 0;

/** What has changed, or all of it. @param {Partial<Live>} news */
function live(news) {
  const { contact: before, losses: known } = now ?? {};
  const message = now = /** @type {Live} */ ({ ...now, ...news });
  const { drive, state, contact, losses } = message;
  const turns = drive === "turning" && "rpm" in state;
  if ([before, contact].includes(LOST) || losses > (known ?? losses)) lostAt = performance.now();
  lamp(contact);
  meter(message.level);
  say("late", message.late ? text("late") : "");
  hide("loud", !(sound.on && field("volume").valueAsNumber > LOUD && (message.level ?? 0) > LOUD_DB));
  announce(message, turns);
  if (news.readings) chart.draw(news.readings);
  if (Object.keys(news).some((name) => !NUMBERS.includes(name))) settings(message, turns);
}
/** @param {number | null} level dB, null where none is known */
function meter(level) {
  clearTimeout(reads);
  const since = performance.now() - metered;
  if (since < METER_MS && level !== null && read !== null && Math.abs(level - read) < STEP_DB) {
    reads = setTimeout(() => meter(level), METER_MS - since);
    return;
  }
  [metered, read] = [performance.now(), level];
  say("level", level === null ? "–" : level.toFixed(1));
  put("meter", level ?? 0);
}
/** What was held back, as long as something was typed, is shown. */
const again = () => setTimeout(() => now && live(now));
addEventListener("focusout", again);

/** All but the numbers of a tick. @param {Live} message @param {boolean} turns */
function settings(message, turns) {
  heading(message.setup.model);
  const { graph, drive, state, values } = message;
  sound.rate = message.sound_rate;
  hide("holder", message.holds);
  say("relative", message.calibrated_on ? text("calibrated", { cam: message.calibrated_on }) : text("level_relative"));
  const off = { start: drive === "emergency" || drive === "turning", stop: drive !== "turning", keep: !("cam" in state) };
  enable(message.holds && runs(message), message.holds, off);
  if (wanted !== null && message.holds && runs(message)) {
    speed.put(wanted);
    wanted = null;
  }
  disable("emergency", !runs(message));
  disable("apply", !message.holds || graph === "starting");
  screen(message);
  hide("csv", !message.readings.length);
  graphWords(message);
  say("speed", "rpm" in state ? shown(turns ? state.rpm : 0, 5) : "–");
  const ear = values.microphone;
  say("quantity", ear ? `dB, L${ear.frequency_weighting}${ear.time_weighting}` : "dB");
  if (!knob.held && !speed.pending && wanted === null && document.activeElement !== $("rpm")) {
    const commanded = values.cam_drive?.rpm || message.setup.rpm;
    knob.show(commanded);
    put("rpm", Number(commanded.toPrecision(6)));
  }
  for (const id of SELECTS) choose(id, message);
  if (!edited) for (const id of SETUP) put(id, message.setup[id]);
  list("kept", message.kept, (path) => Object.assign(document.createElement("li"), { textContent: text("kept", { path }) }));
  list("log", message.log, (line) => Object.assign(document.createElement("li"), { textContent: line }));
  stage.show(message, turns);
  forecast();
}

/** @param {Live | null} message */
function runs(message) { return message?.graph === "running" && Object.keys(message.values).length > 0; }

/**
 * `on`: the nodes are there; `may`: this page holds the controls, and a speed may be chosen; `off`: what cannot be done now.
 * @param {boolean} on @param {boolean} may @param {Record<string, boolean>} off
 */
function enable(on, may, off = {}) {
  knob.enable(may);
  disable("rpm", !may);
  for (const id of ["start", "stop", "reset", ...SELECTS, "note", "clear", "keep", "rerun"]) disable(id, !on || Boolean(off[id]));
}
// A message comes many times a second: a control is touched only where it changes, for then the page is laid out anew.
/** @param {string} id @param {boolean} off */
function disable(id, off) {
  if (field(id).disabled !== off) field(id).disabled = off;
}
/** @param {string} id @param {boolean} off */
function hide(id, off) {
  if ($(id).hidden !== off) $(id).hidden = off;
}
/** @param {string} id @param {string | number} value */
function put(id, value) {
  if (field(id).value !== String(value)) field(id).value = String(value);
}

/** Rerun's page, under the name by which this one was opened: another one has none of its cookies. @param {Live} live */
function screen({ screen: address }) {
  hide("screen", !address);
  const open = /** @type {HTMLAnchorElement} */ ($("screen"));
  if (address && !open.href) open.href = Object.assign(new URL(address), { hostname: location.hostname }).href;
  if (address) $("rerun").hidden = $("rerun_note").hidden = true;
}

/** @param {Live} live */
function graphWords({ graph, words: why, domain, drive, waits_for: nodes }) {
  say("ros", graph === "running" ? text("ros", { domain }) : "");
  const key = graph !== "running" ? `graph_${graph}` : nodes ? "drive_waits" : `drive_${drive}`;
  say("graph", text(key, { why, nodes }));
  $("graph").classList.toggle("fault", graph === "failed" || drive === "emergency");
}

/** @param {string} contact */
function lamp(contact) {
  const lost = contact === LOST || performance.now() - lostAt < LAMP_MS;
  clearTimeout(lamps); // each message looks at it
  if (lost && contact !== LOST) lamps = setTimeout(() => lamp(contact), LAMP_MS);
  $("lamp").classList.toggle("lost", lost);
  $("lamp").classList.toggle("none", !contact);
  say("contact", text(lost ? "contact_is_lost" : contact ? "contact_is_kept" : "contact_unknown"));
}

/** @param {string} id @param {Live} live */
function choose(id, live) {
  const given = id === "cam" ? mounted(live) : live.values[about.settings[id].node]?.[id];
  if (given === undefined || field(id).value === given || document.activeElement === $(id)) return;
  const { options } = /** @type {HTMLSelectElement} */ ($(id));
  if (![...options].some(({ value }) => value === given)) $(id).append(new Option(given, given));
  field(id).value = given;
}

/** A list is made anew only where it has changed, so that a button in it can be pressed. @type {Record<string, string>} */
const lists = {};
/** @template T @param {string} id @param {T[]} items @param {(item: T) => Element} made */
function list(id, items, made) {
  const said = JSON.stringify([items, now?.holds]);
  if (lists[id] === said) return;
  lists[id] = said;
  $(id).replaceChildren(...items.map(made));
}

// -- what a speed will do, before it is turned at and beside what it does ------------------------------
let asked = "";
const expected = new Newest(async (/** @type {object} */ given) => {
  const answer = await post("/bench/expected", given, { signal: AbortSignal.timeout(WAITS_MS) }).catch(() => null);
  const found = await answer?.json().catch(() => null);
  if (!found) {
    asked = "";
    setTimeout(forecast, AGAIN_MS);
    return;
  }
  if (JSON.stringify(given) === asked) for (const id of ["forecast", "jumps"]) $(id).classList.remove("old");
  stage.expect(answer?.ok ? found : null);
  if (!answer?.ok) return say("forecast", found.words);
  const { rpm, lost, settled, least_n: least, level_db: level, jumps: speeds } = /** @type {Expected} */ (found);
  const values = { rpm: shown(rpm, 5), least: shown(least, 4), gap: length(stage.highest), level: level === null ? "–" : level.toFixed(1) };
  say("forecast", text(!lost ? "forecast_kept" : settled ? "forecast_lost" : "forecast_irregular", values));
  const jumps = speeds.map(({ model, rpm: jump }) => ({ rpm: jump ?? Infinity, words: text("jump_by", { model: text(`short_${model}`), rpm: jump === null ? "∞" : shown(jump, 5) }) }));
  knob.jump(jumps);
  say("jumps", jumps.map(({ words: said }) => said).join(" · "));
});

/** Ask for what the set-up on the page does at the knob's speed, where that is another one. */
function forecast() {
  const rpm = field("rpm").valueAsNumber;
  if (!now || !(rpm >= about.speeds[0] && rpm <= about.speeds[1])) return;
  /** @type {Record<string, string | number>} */
  const given = { cam: mounted(now), rpm, model: field("model").value };
  for (const id of SETUP.slice(1)) given[id] = field(id).valueAsNumber;
  const key = JSON.stringify(given);
  if (key === asked || Object.values(given).includes(NaN)) return;
  asked = key;
  for (const id of ["forecast", "jumps"]) $(id).classList.add("old");
  expected.put(given);
}
/** @param {Live} live @returns {string} */
function mounted({ values, state, setup }) { return values.law_server?.cam || state.cam || setup.cam; }

/** For who cannot see it: speed, contact and level, once they have stayed as they are. */
let [heard, waits] = ["", 0];
/** @param {Live} live @param {boolean} turns */
function announce({ state, level, contact }, turns) {
  const said = turns ? text("announced", { rpm: shown(state.rpm, 4), contact: text(contact === LOST ? "contact_is_lost" : "contact_is_kept"), level: level === null ? "–" : Math.round(level) }) : "";
  if (said === heard) return;
  heard = said;
  clearTimeout(waits);
  waits = setTimeout(() => say("announce", heard), ANNOUNCE_MS);
}
