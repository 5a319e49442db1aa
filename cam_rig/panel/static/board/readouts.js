// Numbers and faults from the server. Those of an earlier law are marked as stale until the new ones arrive.
/** @import { BoardState } from "./main.js" */
import { $, create, field, setHidden, setText } from "../common/dom.js";
import { errorText, formatNumber, text } from "../common/texts.js";
import { renderChecks } from "./tables.js";

/** Smallest magnitude of a readout, in its unit. */
const RESOLUTION = 1e-3;

/** Return true if the page displays the results of a server, as the static page does not. */
const hasServer = () => Boolean($("jump"));

/** Fill the parts that do not change. @param {Board} board */
export function fillHeading({ rig, cam, b_splines: splines }) {
  setText("title", cam.title);
  setText("rig_title", rig.title);
  setText("motion", text("motion", { lift: formatNumber(cam.lift_m * 1e3) }));
  document.title = `${cam.title} – cam_rig`;
  const key = splines === null ? "own" : splines.exact ? "exact" : "nearest";
  const distance = splines && formatNumber(splines.distance_m * 1e6, 2);
  setText("class", text(key, { degree: splines?.degree, distance }));
  if (!hasServer()) return;
  setText("jump_title", text(rig.two_masses ? "jump" : "jump_one", { seconds: formatNumber(rig.from_rest_s) }));
  setText("level_title", rig.calibrated_on ? text("level", { cam: rig.calibrated_on }) : text("level_relative"));
  setHidden("twist_of", !rig.has_shaft);
  setHidden("fluctuation_of", !rig.has_flywheel);
  field("name").value = `${cam.name}_drawn`;
}

/** @param {BoardState} state @param {boolean} isSprung */
export function renderReadouts({ fast, full, isFastCurrent }, isSprung) {
  if (!fast) return;
  const isFullCurrent = isFastCurrent && full?.version === fast.version;
  const desmodromic = isSprung ? null : { message: text("desmodromic") };
  showValue("jump_rigid", desmodromic ?? fast.jump_rigid, 5, "rpm");
  $("jump_rigid").classList.toggle("stale", !isFastCurrent);
  const { pressure } = fast;
  setText("pressure_angle", pressure === null ? "–"
    : text("of_allowed", { value: formatNumber(pressure.value_deg, 3), allowed: formatNumber(pressure.allowed_deg, 3) }));
  $("pressure_angle").classList.toggle("fault", pressure !== null && pressure.value_deg > pressure.allowed_deg);
  if (hasServer()) renderFull(full, isFullCurrent, desmodromic);
  const canBeMade = full?.version === fast.version ? full.can_be_made : fast.faults.length === 0;
  setHidden("not_made", canBeMade);
  $("results").classList.toggle("not_made", !canBeMade);
  // The failed full checks replace the faults of the fast results.
  const failed = full?.version === fast.version ? failures(full) : [];
  const lines = failed.length ? failed.map(errorText) : [...fast.faults, ...fast.warnings].map(faultText);
  if ($("faults").textContent !== lines.join("")) {
    $("faults").replaceChildren(...lines.map((textContent) => create("li", { textContent })));
  }
}

/** Show the results that take longer, from the server. @param {FullResults | null} full @param {boolean} isCurrent @param {PageValue | null} desmodromic */
function renderFull(full, isCurrent, desmodromic) {
  renderChecks(full, isCurrent);
  for (const id of ["jump", "residual", "level", "twist", "fluctuation"]) $(id).classList.toggle("stale", !isCurrent);
  if (!full) return;
  showValue("jump", desmodromic ?? full.jump, 5, "rpm");
  showValue("residual", full.residual_um, 4, "µm");
  showValue("level", full.level_db, 4, "dB");
  if (full.shaft) showValue("twist", full.shaft.twist_deg, 4, "°");
  if (full.shaft?.fluctuation_percent) showValue("fluctuation", full.shaft.fluctuation_percent, 3, "%");
}

/** @param {FullResults} full */
function failures({ checks, check_error: error }) {
  return error ? [error] : checks.filter(({ passed }) => !passed).map(({ message }) => message);
}

/** @param {Fault} fault */
function faultText(fault) {
  if (fault.key === "error") return errorText(fault.message);
  const { key, angle_deg: angle, value_deg: value, allowed_deg: allowed } = fault;
  return text(key, { angle: formatNumber(angle, 3), value: value && formatNumber(value, 3), allowed: allowed && formatNumber(allowed, 3) });
}

/** @param {string} id @param {PageValue} result @param {number} digits @param {string} unit */
function showValue(id, { value, message }, digits, unit) {
  const isSmall = value !== undefined && Math.abs(value) < RESOLUTION;
  const number = value === undefined ? "" : isSmall ? text("below", { value: formatNumber(RESOLUTION) }) : formatNumber(value, digits);
  const reason = message === undefined ? text("at_no_speed") : errorText(message);
  setText(id, value === undefined ? reason : `${number} ${unit}`);
  $(id).classList.toggle("words", value === undefined);
}
