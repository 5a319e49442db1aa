// What is written: the cam's file, the contour as DXF, and the command that designs on from it.
import { text } from "../common/texts.js";

const $ = (id) => document.getElementById(id);

/** ordinates() gives those that are drawn; status(words, wrong) tells what came of it. */
export function listenForFiles(ordinates, status) {
  const ask = (path, more = {}) => fetch(path, { method: "POST", body: JSON.stringify({ ...more, ordinates: ordinates() }) });

  $("controls").addEventListener("submit", async (event) => {
    event.preventDefault();
    const answer = await ask("/save", { name: $("name").value });
    const found = await answer.json();
    if (!answer.ok) return status(text("not_saved", found), true);
    $("command").textContent = found.command;
    $("design").hidden = false;
    if (found.why_not === null) return status(text("saved", found), false);
    return status(text("saved_not_made", found), true);
  });

  $("dxf").addEventListener("click", async () => {
    const answer = await ask("/dxf");
    if (!answer.ok) return status(text("no_dxf", await answer.json()), true);
    const link = document.createElement("a");
    link.href = URL.createObjectURL(await answer.blob());
    link.download = `${$("name").value || "cam"}.dxf`;
    link.click();
    URL.revokeObjectURL(link.href);
    return status(text("dxf_made", { name: link.download }), false);
  });

  $("copy").addEventListener("click", async () => {
    const range = document.createRange();
    range.selectNodeContents($("command"));
    getSelection().removeAllRanges();
    getSelection().addRange(range);
    try {
      await navigator.clipboard.writeText($("command").textContent);
      status(text("copied"), false);
    } catch (refused) { // the browser does not let a page: it is selected, to be copied by hand
      if (!(refused instanceof DOMException)) throw refused;
      status(text("copy_by_hand"), false);
    }
  });
}
