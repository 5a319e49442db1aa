// Numbers and words from the server; those of an earlier law are marked until the new ones come.
import { shown } from "../common/charts.js";
import { $, field, status } from "../common/dom.js";
import { text } from "../common/texts.js";

const AT_REST = ["jump", "residual", "level"];

export class Readouts {
  /** @param {Board} board */
  constructor(board) {
    const { rig, cam } = board;
    /** @type {number | null} */
    this.version = null;
    this.sprung = cam.sprung;
    $("title").textContent = text("bench_title", { rig: cam.name, model: rig.name });
    document.title = `${cam.name} – cam_rig`;
    const { drawn_as: drawn, distance_m: distance } = board;
    $("class").textContent = drawn === null ? text("own")
      : text(drawn.exact ? "exact" : "nearest", { degree: drawn.degree, distance: shown(distance * 1e6, 2) });
    $("jump_title").textContent = text(rig.two_masses ? "jump" : "jump_one", { seconds: rig.from_rest_s });
    $("level_title").textContent = rig.calibrated_on ? text("level", { cam: rig.calibrated_on }) : text("level_relative");
    field("name").value = `${cam.name}_drawn`;
    /** @type {string[]} */
    this.checks = [];
    /** @type {string[]} */
    this.faults = [];
    this.stale();
  }

  /** The law has changed: what was found of it belongs to the one before. */
  stale() { for (const id of ["jump_rigid", ...AT_REST]) $(id).classList.add("stale"); }

  /** @param {Exact | Moved} found */
  exact({ version, faults, warnings, jump_rigid: jump, pressure }) {
    this.version = version;
    for (const id of AT_REST) $(id).classList.add("stale");
    value("jump_rigid", this.sprung ? jump : { words: text("held") }, 5, "rpm");
    $("pressure_angle").textContent = pressure === null ? "–"
      : text("of_allowed", { value: shown(pressure.value_deg, 3), allowed: shown(pressure.allowed_deg, 3) });
    $("pressure_angle").classList.toggle("fault", pressure !== null && pressure.value_deg > pressure.allowed_deg);
    this.#made(faults.length === 0);
    this.faults = [...faults, ...warnings].map(inWords);
    this.checks = [];
    this.#list();
  }

  /** Nothing newer is on its way. */
  current() { $("jump_rigid").classList.remove("stale"); }

  /** @param {Rest} message */
  rest(message) {
    if (message.version !== this.version) return;
    if (message.words) return status(message.words);
    value("jump", this.sprung ? message.jump : { words: text("held") }, 5, "rpm");
    value("residual", message.residual_um, 4, "µm");
    value("level", message.level_db, 4, "dB");
    this.checks = message.checks;
    this.#made(message.made);
    $("file_jump_row").hidden = message.file_jump === undefined;
    if (message.file_jump) value("file_jump", this.sprung ? message.file_jump : { words: text("held") }, 5, "rpm");
    this.#list();
  }

  /** Numbers of a law that cannot be made are those of its motion alone, and are marked. @param {boolean} made */
  #made(made) {
    $("not_made").hidden = made;
    $("results").classList.toggle("not_made", !made);
  }

  /** At rest the checks say it all; until then what was seen of the contour. */
  #list() {
    const lines = this.checks.length ? this.checks : this.faults;
    const items = lines.map((words) => Object.assign(document.createElement("li"), { textContent: words, lang: this.checks.length ? "en" : "" }));
    if ($("faults").textContent !== lines.join("")) $("faults").replaceChildren(...items);
  }
}

/** @param {Fault} fault */
function inWords(fault) {
  if (fault.key === "error") return fault.words;
  const { key, angle_deg: angle, value_deg: found, allowed_deg: allowed } = fault;
  return text(key, { angle: shown(angle, 3), value: found && shown(found, 3), allowed: allowed && shown(allowed, 3) });
}

/** Of the unit of a readout: less is not told apart. */
const LEAST = 1e-3;

/** @param {string} id @param {Found} found @param {number} digits @param {string} unit */
function value(id, { value: number, words }, digits, unit) {
  const size = number === undefined ? "" : Math.abs(number) < LEAST ? text("below", { value: LEAST }) : shown(number, digits);
  $(id).textContent = words ?? (number === undefined ? text("at_no_speed") : `${size} ${unit}`);
  $(id).classList.remove("stale");
  $(id).classList.toggle("words", number === undefined);
}
