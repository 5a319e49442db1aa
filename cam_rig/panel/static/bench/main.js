// Live bench: every control is a parameter or a service of a node, and displays the value that the node reports.
import { $, create, field, post, readNumber, setDisabled, setHidden, setText, setValue, showStatus } from "../common/dom.js";
import { Knob, typedNumber } from "../common/knob.js";
import { LatestSender } from "../common/latest.js";
import { formatGap } from "../common/rig.js";
import { Store } from "../common/store.js";
import { errorText, formatFixed, formatNumber, loadTexts, text } from "../common/texts.js";
import { Connection } from "./connection.js";
import { NoiseChart } from "./noise.js";
import { LiveSound } from "./sound.js";
import { Stage } from "./stage.js";

/** Contact state of a tick in which the follower left the cam. */
const LOST = "contact lost";
/** Time (ms) for which the lamp stays on, because a loss of contact may last a millisecond. */
const LAMP_MS = 400;
/** Timeout (ms) of a prediction, for which the server may compile its search, and time until the next attempt. */
const TIMEOUT_MS = 60_000, RETRY_MS = 1000;
/** Time (ms) for which values must stay unchanged before a screen reader announces them. */
const ANNOUNCE_MS = 1500;
/** Volume and level (dB) above which the page warns users of headphones. They are assumed, not from a standard. */
const LOUD_VOLUME = 0.5, LOUD_DB = 100;
/** Fields of the set-up. */
const SETUP = /** @type {const} */ (["model", "added_mass", "spring_stiffness", "preload"]);

await loadTexts();
/**
 * @type {{rig: {name: string}, has_rerun: boolean, models: string[], model: string, settings: Record<string, {node: string, choices: string[]}>,
 *   knob: Pair, speeds: Pair, colours: string[], max_added_mass: number}}
 */
const about = await (await fetch("/bench/about")).json();
/** Settings with a list on the page. */
const SELECTS = Object.keys(about.settings).filter((name) => $(name) && about.settings[name].choices.length);

/**
 * State of the bench. `live` is null without a connection. `wantedRpm` is a speed that was chosen before the nodes
 * have started. `isSetupEdited` is true if the set-up on the page is not applied yet. `prediction` is that of
 * `requested`, if `isPredictionCurrent`.
 * @typedef {{live: Live | null, wantedRpm: number | null, lostUntilMs: number, isSetupEdited: boolean, noted: string,
 *   requested: string, prediction: Expected | {message: string} | null, isPredictionCurrent: boolean}} BenchState
 */
const store = new Store(/** @type {BenchState} */ ({
  live: null,
  wantedRpm: null,
  lostUntilMs: 0,
  isSetupEdited: false,
  noted: "",
  requested: "",
  prediction: null,
  isPredictionCurrent: false,
}), render);
const { state } = store;
const stage = new Stage();
const chart = new NoiseChart($("noise"), $("noise_key"), about.colours);
const sound = new LiveSound((isOn) => connection.request({ do: "listen", value: isOn }));

/** @param {Live | null} live */
const isRunning = (live) => live?.graph === "running" && Object.keys(live.parameters).length > 0;
/** @param {Live} live */
const isTurning = ({ drive, state: camState }) => drive === "turning" && "rpm" in camState;
/** @param {Live} live @returns {string} */
const mountedCam = ({ parameters, state: camState, setup }) => parameters.law_server?.cam || camState.cam || setup.cam;

// -- rendering ------------------------------------------------------------------------------------

/** @param {BenchState} present */
function render({ live, lostUntilMs, isSetupEdited, noted, prediction, isPredictionCurrent }) {
  renderControls(live);
  renderValues(live, lostUntilMs);
  setText("noted", noted);
  for (const id of ["forecast", "jumps"]) $(id).classList.toggle("old", !isPredictionCurrent);
  renderPrediction(prediction);
  if (!live) return;
  renderHeading(live.setup.model);
  if (!isSetupEdited) for (const id of SETUP) setValue(id, live.setup[id]);
  for (const id of SELECTS) renderSelect(id, live);
  renderSpeed(live);
  renderList("kept", live.kept_bags.map((path) => text("kept", { path })));
  renderList("log", live.log.map(errorText));
  renderRerun(live);
  chart.draw(live.readings);
  stage.show(live, mountedCam(live), isTurning(live));
  requestPrediction(live);
}

/** @param {string} model */
function renderHeading(model) {
  setText("title", text("bench_title", { rig: about.rig.name, model: text(`short_${model}`) }));
}

/** Enable the controls that may be used. @param {Live | null} live */
function renderControls(live) {
  const hasControls = Boolean(live?.has_controls), drive = live?.drive;
  const isReady = hasControls && isRunning(live);
  knob.enable(hasControls);
  setDisabled("rpm", !hasControls);
  for (const id of ["reset", ...SELECTS, "note", "clear", "rerun"]) setDisabled(id, !isReady);
  setDisabled("start", !isReady || drive === "emergency" || drive === "turning");
  setDisabled("stop", !isReady || drive !== "turning");
  setDisabled("keep", !isReady || !("cam" in (live?.state ?? {})));
  setDisabled("emergency", !isRunning(live)); // every page may use it
  setDisabled("apply", !hasControls || live?.graph === "starting");
  setHidden("holder", live?.has_controls ?? true);
  setHidden("csv", !live?.readings.length);
}

/** Show the values that the nodes report. @param {Live | null} live @param {number} lostUntilMs */
function renderValues(live, lostUntilMs) {
  const level = live?.level ?? null;
  const isLost = live?.contact === LOST || performance.now() < lostUntilMs;
  const contact = text(isLost ? "contact_is_lost" : live?.contact ? "contact_is_kept" : "contact_unknown");
  const rpm = live && "rpm" in live.state ? formatNumber(isTurning(live) ? live.state.rpm : 0, 5) : "–";
  setText("speed", rpm);
  setText("level", level === null ? "–" : formatFixed(level, 1));
  setValue("meter", level ?? 0);
  $("lamp").classList.toggle("lost", isLost);
  $("lamp").classList.toggle("none", !live?.contact);
  setText("contact", contact);
  setText("late", live?.is_late ? text("late") : "");
  setHidden("loud", !(sound.isOn && field("volume").valueAsNumber > LOUD_VOLUME && (level ?? 0) > LOUD_DB));
  setText("graph", live ? graphText(live) : "");
  $("graph").classList.toggle("fault", live?.graph === "failed" || live?.drive === "emergency");
  setText("ros", live?.graph === "running" ? text("ros", { domain: live.domain }) : "");
  const microphone = live?.parameters.microphone;
  setText("quantity", microphone ? `dB, L${microphone.frequency_weighting}${microphone.time_weighting}` : "dB");
  setText("relative", live?.calibrated_on ? text("calibrated", { cam: live.calibrated_on }) : text("level_relative"));
  announce(live && isTurning(live)
    ? text("announced", { rpm, contact, level: level === null ? "–" : formatFixed(level, 0) }) : "");
}

/** @param {Live} live */
function graphText({ graph, failure, drive, waits_for: nodes }) {
  if (graph === "off") return "";
  if (graph !== "running") return text(`graph_${graph}`, { reason: errorText(failure) });
  return text(nodes ? "drive_waits" : `drive_${drive}`, { nodes });
}

let announced = "", announceTimer = 0;
/** Announce values to a screen reader once they stay unchanged. @param {string} values */
function announce(values) {
  if (values === announced) return;
  announced = values;
  clearTimeout(announceTimer);
  announceTimer = setTimeout(() => setText("announce", announced), ANNOUNCE_MS);
}

/** Show the commanded speed, unless a person is changing it. @param {Live} live */
function renderSpeed({ parameters, setup }) {
  if (knob.isHeld || speedSender.isBusy || state.wantedRpm !== null || document.activeElement === $("rpm")) return;
  const rpm = parameters.cam_drive?.rpm || setup.rpm;
  knob.show(rpm);
  setValue("rpm", Number(rpm.toPrecision(6)));
}

/** Select the reported value, unless a person is selecting another. @param {string} id @param {Live} live */
function renderSelect(id, live) {
  const value = id === "cam" ? mountedCam(live) : live.parameters[about.settings[id].node]?.[id];
  if (value === undefined || field(id).value === value || document.activeElement === $(id)) return;
  const { options } = /** @type {HTMLSelectElement} */ ($(id));
  if (![...options].some((option) => option.value === value)) $(id).append(new Option(value, value));
  field(id).value = value;
}

/** @param {string} id @param {string[]} lines */
function renderList(id, lines) {
  if ($(id).textContent !== lines.join("")) $(id).replaceChildren(...lines.map((textContent) => create("li", { textContent })));
}

/** Link to Rerun's page, under the host name of this page, because another has none of its cookies. @param {Live} live */
function renderRerun({ rerun_address: address }) {
  const link = /** @type {HTMLAnchorElement} */ ($("screen"));
  if (address && !link.href) link.href = Object.assign(new URL(address), { hostname: location.hostname }).href;
  setHidden("screen", !address);
  for (const id of ["rerun", "rerun_note"]) setHidden(id, !about.has_rerun || Boolean(address));
}

/** @type {BenchState["prediction"]} */
let displayedPrediction = null;
/** Show a prediction: curves, margin of contact, and jump speeds. @param {BenchState["prediction"]} prediction */
function renderPrediction(prediction) {
  if (prediction === null || prediction === displayedPrediction) return;
  displayedPrediction = prediction;
  if ("message" in prediction) {
    stage.setPredicted(null);
    setText("forecast", errorText(prediction.message));
    return;
  }
  stage.setPredicted(prediction);
  const { rpm, contact_lost: isLost, is_steady: isSteady, min_force_n: minForce, level_db: level } = prediction;
  const key = !isLost ? "forecast_kept" : isSteady ? "forecast_lost" : "forecast_irregular";
  setText("forecast", text(key, {
    rpm: formatNumber(rpm, 5), min: formatNumber(minForce), gap: formatGap(stage.maxPredictedGap), level: level === null ? "–" : formatFixed(level, 1),
  }));
  const jumps = prediction.jumps.map(({ model, rpm: jump }) => ({
    rpm: jump ?? Infinity,
    title: text("jump_by", { model: text(`short_${model}`), rpm: jump === null ? "∞" : formatNumber(jump, 5) }),
  }));
  knob.showJumps(jumps);
  setText("jumps", jumps.map(({ title }) => title).join(" · "));
}

// -- predictions ----------------------------------------------------------------------------------

/** Request the prediction of the set-up on the page at the speed of the knob. @param {Live} live */
function requestPrediction(live) {
  const rpm = readNumber(field("rpm"));
  if (!(rpm >= about.speeds[0] && rpm <= about.speeds[1])) return;
  const setup = { cam: mountedCam(live), rpm, ...readSetup() };
  const requested = JSON.stringify(setup);
  if (requested === state.requested || Object.values(setup).includes(NaN)) return;
  store.update({ requested, isPredictionCurrent: false });
  predictionSender.put(setup);
}
const predictionSender = new LatestSender(async (/** @type {object} */ setup) => {
  const answer = await post("/bench/expected", setup, { signal: AbortSignal.timeout(TIMEOUT_MS) }).catch(() => null);
  const prediction = await answer?.json().catch(() => null);
  if (prediction) return store.update({ prediction, isPredictionCurrent: JSON.stringify(setup) === state.requested });
  setTimeout(() => store.update({ requested: "" }), RETRY_MS);
});

/** Return the set-up on the page. */
function readSetup() {
  return Object.fromEntries(SETUP.map((id) => [id, id === "model" ? field(id).value : readNumber(field(id))]));
}

// -- commands -------------------------------------------------------------------------------------

/** @param {object} command */
async function request(command) {
  const answer = await connection.request(command);
  showStatus(answer.success ? "" : errorText(answer.message) || text("disconnected_bench"));
  if (!answer.success) store.update(); // controls display the reported values again
  return answer;
}
const speedSender = new LatestSender((/** @type {number} */ rpm) => request({ do: "set", name: "rpm", value: rpm }));
/** @param {number} rpm */
function setSpeed(rpm) {
  if (isRunning(state.live)) speedSender.put(rpm);
  store.update(isRunning(state.live) ? {} : { wantedRpm: rpm });
}
const knob = new Knob($("knob"), about.knob, text("commanded"), (rpm) => {
  setValue("rpm", rpm);
  setSpeed(rpm);
});
[field("rpm").min, field("rpm").max] = about.speeds.map(String);
$("rpm").addEventListener("change", () => {
  const rpm = typedNumber(field("rpm"), about.speeds);
  if (rpm === null) return;
  knob.show(rpm);
  setSpeed(rpm);
});
for (const service of ["start", "stop", "reset"]) $(service).addEventListener("click", () => request({ do: "call", value: service }));
$("emergency").addEventListener("click", () => request({ do: "call", value: "emergency_stop" }));
for (const command of ["take_over", "clear", "keep", "rerun"]) $(command).addEventListener("click", () => request({ do: command }));
$("note").addEventListener("click", async () => {
  const { success, reading, message } = await request({ do: "note" });
  const noted = success && reading
    ? text("noted", { rpm: formatNumber(reading.rpm, 5), level: formatNumber(reading.level_db) }) : errorText(message);
  store.update({ noted });
});

/** Name of a value of a setting. @type {Record<string, (value: string) => string>} */
const valueNames = {
  pacing: (pace) => ({ real_time: text("pace_real"), free: text("pace_free") })[pace] ?? `${formatNumber(Number.parseFloat(pace))}×`,
  time_weighting: (name) => text(`weighting_${name}`),
};
for (const id of SELECTS) {
  for (const value of about.settings[id].choices) $(id).append(new Option(valueNames[id]?.(value) ?? value, value));
  $(id).addEventListener("change", async () => {
    await request({ do: "set", name: id, value: field(id).value });
    store.update();
  });
}

for (const model of about.models) $("model").append(new Option(text(`model_${model}`), model));
field("added_mass").max = String(about.max_added_mass);
$("setup").addEventListener("input", () => store.update({ isSetupEdited: true }));
$("setup").addEventListener("submit", async (event) => {
  event.preventDefault();
  const { success } = await request({ do: "set_up", value: readSetup() });
  store.update({ isSetupEdited: !success });
});

$("volume").addEventListener("input", () => {
  sound.setVolume(field("volume").valueAsNumber);
  store.update();
});
// A browser plays no sound before the first interaction with the page.
if (sound.storedVolume) {
  addEventListener("pointerdown", () => {
    setValue("volume", sound.storedVolume);
    sound.setVolume(sound.storedVolume);
  }, { once: true });
}
addEventListener("focusout", () => store.update()); // fields that had the focus display the reported values

// -- the server -----------------------------------------------------------------------------------

/** @param {Partial<Live>} changes of the state, which is complete in the first message */
function receive(changes) {
  const before = state.live;
  const live = /** @type {Live} */ ({ ...before, ...changes });
  sound.rate = live.sound_rate;
  const wasLost = [before?.contact, live.contact].includes(LOST) || live.contact_losses > (before?.contact_losses ?? live.contact_losses);
  if (wasLost) {
    state.lostUntilMs = performance.now() + LAMP_MS;
    setTimeout(() => store.update(), LAMP_MS);
  }
  store.update({ live });
  if (state.wantedRpm !== null && live.has_controls && isRunning(live)) {
    speedSender.put(state.wantedRpm);
    state.wantedRpm = null;
  }
}

const connection = new Connection({
  onLive: receive,
  onMotion: (block) => stage.add(block),
  onSound: (samples) => sound.play(samples),
  onStatus: (isOpen) => {
    showStatus(isOpen ? "" : text("disconnected_bench"));
    if (!isOpen) return store.update({ live: null, lostUntilMs: 0 });
    if (sound.isOn) connection.request({ do: "listen", value: true });
    return watch();
  },
});
/** Request the motion only while the page is visible. */
function watch() { connection.request({ do: "watch", value: !document.hidden }); }
document.addEventListener("visibilitychange", watch);
renderHeading(about.model);
document.title = `${text("nav_bench")} – cam_rig`;
for (const id of ["rerun", "rerun_note"]) setHidden(id, !about.has_rerun);
