// What is written: the cam's file, the contour as DXF, and the command that designs on from it.
import { shown } from "../common/charts.js";
import { $, copy, field, post, status } from "../common/dom.js";
import { text } from "../common/texts.js";

/** The cam that was saved last: a design begins there. @type {string | null} */
let saved = null;

/** ordinates() gives those that are drawn. @param {() => number[]} ordinates */
export function listenForFiles(ordinates) {
  const ask = (/** @type {string} */ path, more = {}) => post(path, { ...more, ordinates: ordinates() });

  $("controls").addEventListener("submit", async (event) => {
    event.preventDefault();
    const answer = await ask("/save", { name: field("name").value });
    const found = await answer.json();
    if (!answer.ok) return status(text("not_saved", found));
    $("command").textContent = found.command;
    saved = field("name").value;
    $("design").hidden = false;
    return status(text(found.why_not === null ? "saved" : "saved_not_made", found), found.why_not !== null);
  });

  $("dxf").addEventListener("click", async () => {
    const answer = await ask("/dxf");
    if (!answer.ok) return status(text("no_dxf", await answer.json()));
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await answer.blob());
    link.download = `${field("name").value || "cam"}.dxf`;
    link.click();
    URL.revokeObjectURL(link.href);
    return status(text("dxf_made", { name: link.download }), false);
  });

  $("open").addEventListener("click", () => field("file").click());
  $("file").addEventListener("change", async () => {
    const [file] = field("file").files ?? [];
    if (!file) return;
    const answer = await post("/open", { text: await file.text() });
    field("file").value = "";
    if (!answer.ok) status(text("not_opened", { name: file.name, ...(await answer.json()) }));
  });

  $("on_bench").addEventListener("click", async () => {
    const answer = await ask("/bench/mount");
    if (answer.ok) location.assign("/bench");
    else status(text("not_on_bench", await answer.json()));
  });

  $("design_run").addEventListener("click", async () => {
    running(true);
    const answer = await post("/design", { name: saved });
    if (answer.ok) return;
    running(false);
    status(text("not_designed", await answer.json()));
  });

  $("design_stop").addEventListener("click", () => fetch("/design/stop", { method: "POST" }));

  $("copy").addEventListener("click", async () => {
    const range = document.createRange();
    range.selectNodeContents($("command"));
    getSelection()?.removeAllRanges();
    getSelection()?.addRange(range);
    await copy($("command").textContent ?? "", "copied", "copy_by_hand");
  });
}

/** @param {boolean} on */
function running(on) {
  $("design_run").hidden = on;
  $("design_stop").hidden = !on;
  $("design_progress").textContent = on ? text("designing") : "";
}

/**
 * What a design has come to; put(motion) is given its law, in base64, once there is one.
 * @param {Design} found @param {(motion: string) => void} put
 */
export function heardOfDesign({ so_far_rpm: best, rpm, path, motion, words, stopped }, put) {
  if (best !== undefined) {
    running(true);
    $("design_progress").textContent = text("design_so_far", { rpm: shown(best) });
    return;
  }
  running(false);
  if (stopped) status(text("design_stopped"), false);
  else if (words !== undefined) status(text("not_designed", { words }));
  else {
    put(motion);
    status(text("designed", { rpm: shown(rpm, 5), path }), false);
  }
}
