// Links to a law: cam, speed and ordinates in the fragment of the address.
import { $, copyText, showStatus } from "../common/dom.js";
import { text } from "../common/texts.js";

/** @typedef {{ordinates: number[], rpm: number, base_radius_mm: number}} Drawing */

/** @param {Board} board @param {() => Drawing} read @param {(drawing: Drawing) => void} open draws the law of a link */
export function listenForLinks(board, read, open) {
  const openLink = () => {
    const link = new URLSearchParams(location.hash.slice(1));
    if (!link.has("ordinates")) return;
    const ordinates = (link.get("ordinates") ?? "").split("_").map(Number), rpm = Number(link.get("rpm"));
    const base = Number(link.get("base") ?? board.start_base_radius_mm);
    const isWithin = (/** @type {number} */ value, /** @type {Pair} */ [low, high]) => value >= low && value <= high;
    const isValid = ordinates.length === board.start.length && ordinates.every(Number.isFinite)
      && isWithin(rpm, board.rpm_range) && isWithin(base, board.base_radius_range);
    if (isValid && link.get("cam") === board.cam.name) open({ ordinates, rpm, base_radius_mm: base });
    else showStatus(text("link_of_other", { cam: link.get("cam") ?? "–", own: board.cam.name }));
  };
  addEventListener("hashchange", openLink);
  openLink();

  $("link").addEventListener("click", () => {
    const { ordinates, rpm, base_radius_mm: base } = read();
    const link = new URLSearchParams({ cam: board.cam.name, rpm: String(rpm), base: String(base), ordinates: ordinates.join("_") });
    history.replaceState(null, "", `#${link}`);
    copyText(location.href, "link_copied", "link_in_address");
  });
}
