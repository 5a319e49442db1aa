// A link that opens the same law: cam, speed and ordinates in the address, behind #.
import { $, copy, status } from "../common/dom.js";
import { text } from "../common/texts.js";

/** @typedef {{ordinates: number[], rpm: number}} Drawn */

/**
 * now() is what is drawn, put(found) draws what a link has.
 * @param {Board} board @param {() => Drawn} now @param {(found: Drawn) => void} put
 */
export function listenForLinks(board, now, put) {
  const open = () => {
    const asked = new URLSearchParams(location.hash.slice(1));
    if (!asked.has("ordinates")) return;
    const found = { ordinates: (asked.get("ordinates") ?? "").split("_").map(Number), rpm: Number(asked.get("rpm")) };
    const [least, most] = board.rpm_range;
    const whole = found.ordinates.length === board.start.length && found.ordinates.every(Number.isFinite) && found.rpm >= least && found.rpm <= most;
    if (whole && asked.get("cam") === board.cam.name) put(found);
    else status(text("link_of_other", { cam: asked.get("cam") ?? "–", own: board.cam.name }));
  };
  addEventListener("hashchange", open);
  open();

  $("link").addEventListener("click", async () => {
    const { ordinates, rpm } = now();
    const words = new URLSearchParams({ cam: board.cam.name, rpm: String(rpm), ordinates: ordinates.join("_") });
    history.replaceState(null, "", `#${words}`);
    await copy(location.href, "link_copied", "link_in_address");
  });
}
