// Tables of the board: peaks of the laws, and checks of the contour.
import { svgElement } from "../common/charts.js";
import { $, create, setHidden, setText } from "../common/dom.js";
import { errorText, formatNumber, text } from "../common/texts.js";

/** Units of the peaks of s', s'' and s'''. */
const PEAKS = ["peak1", "peak2", "peak3"];
/** @type {Record<CheckResult["relation"], string>} */
const RELATIONS = { "more than": ">", "less than": "<", "at most": "≤" };

/** Magnitude of a checked value below which it is a rounding error, and below which two digits are shown, in its unit. */
const ROUNDING = 1e-9, SMALL = 1e-4;

/**
 * Return a table with a row for each list of cells. The first cell of a row is its heading.
 * @param {string[]} headings @param {string[][]} rows
 */
function rowsOf(headings, rows) {
  const head = create("tr");
  head.append(...headings.map((textContent) => create("th", { scope: "col", textContent })));
  const body = rows.map(([heading, ...cells]) => {
    const row = create("tr");
    row.append(create("th", { scope: "row", textContent: heading }), ...cells.map((textContent) => create("td", { textContent })));
    return row;
  });
  return [head, ...body];
}

/** Table of the largest and least values of s', s'' and s''' of a law. */
export class PeaksTable {
  /** @param {string} id @param {string} kind of the law's curve @param {string} colour */
  constructor(id, kind, colour) {
    this.table = $(id);
    this.caption = create("caption");
    this.line = curveSample(kind, colour);
    /** @type {Figures | null} */
    this.displayed = null;
  }

  /** @param {string} title @param {Figures | null | undefined} figures @param {boolean} isCurrent */
  draw(title, figures, isCurrent) {
    setHidden(this.table.id, !figures);
    this.table.classList.toggle("stale", !isCurrent);
    if (!figures || figures === this.displayed) return;
    this.displayed = figures;
    this.caption.replaceChildren(this.line, text("peaks_of", { title, continuity: figures.continuity }));
    const rows = figures.peaks.map(({ largest, least, coefficient }, i) => [
      text(PEAKS[i]),
      ...[largest, least].flatMap(({ value, angle_deg: angle }) => [formatNumber(value, 6), `${formatNumber(angle, 5)}°`]),
      coefficient === null ? "–" : formatNumber(coefficient, 5),
    ]);
    const headings = [text("derivative"), text("largest"), text("at"), text("least"), text("at"), text("of_rise")];
    this.table.replaceChildren(this.caption, ...rowsOf(headings, rows));
  }
}

/** Return a sample of a curve for a legend. @param {string} kind @param {string} stroke */
export function curveSample(kind, stroke) {
  const svg = svgElement("svg", { class: "sample", viewBox: "0 0 34 10", "aria-hidden": "true" });
  svgElement("path", { class: `curve ${kind}`, stroke, d: "M0 5H34" }, svg);
  return svg;
}

/** Results whose checks are displayed. @type {FullResults | null} */
let checked = null;

/** Show all checks of the contour, and the number of failed checks. @param {FullResults | null} full @param {boolean} isCurrent */
export function renderChecks(full, isCurrent) {
  $("checks").classList.toggle("stale", !isCurrent);
  if (!full || full === checked) return;
  checked = full;
  const failed = full.checks.filter(({ passed }) => !passed).length;
  const values = { count: full.checks.length, failed };
  setText("checks_title", text(full.check_error ? "checks_none" : failed ? "checks_failed" : "checks_passed", values));
  $("checks_title").classList.toggle("fault", failed > 0 || Boolean(full.check_error));
  const headings = [text("check"), text("value"), text("at"), text("allowed"), text("check_result")];
  const rows = full.checks.map((check) => [
    errorText(check.title),
    check.value === null ? "∞" : quantity(check.value, check.unit),
    check.angle_deg === null ? "" : `${formatNumber(check.angle_deg)}°`,
    `${RELATIONS[check.relation]}\u00a0${quantity(check.limit, check.unit)}`,
    text(check.passed ? "check_ok" : "check_fails"),
  ]);
  $("checks").replaceChildren(...rowsOf(headings, rows));
  $("checks").querySelectorAll("tr").forEach((row, i) => row.classList.toggle("fault", i > 0 && !full.checks[i - 1].passed));
}

/** Return a value with its unit. A rounding error is 0. @param {number} value @param {string} unit */
function quantity(value, unit) {
  const size = Math.abs(value);
  const number = formatNumber(size < ROUNDING ? 0 : value, size < SMALL ? 2 : 5);
  return `${number}${/** @type {Record<string, string>} */ ({ "°": "°", crossings: "", 1: "" })[unit] ?? ` ${unit}`}`;
}
