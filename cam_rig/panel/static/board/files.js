// Files of the board: cam file, contour as DXF, and a design from the saved cam.
/** @import { Drawing } from "./links.js" */
import { $, copyText, create, field, post, setHidden, setText, showRefusal, showStatus } from "../common/dom.js";
import { errorText, formatNumber, text } from "../common/texts.js";

/** Name of the cam that was saved last, from which a design starts. @type {string | null} */
let savedName = null;

/** @param {() => Drawing} readDrawing */
export function listenForFiles(readDrawing) {
  const send = (/** @type {string} */ path, more = {}) => post(path, { ...more, ...readDrawing() });

  const save = async () => {
    const name = field("name").value;
    const answer = await send("/save", { name });
    const saved = await answer.json();
    if (!answer.ok) return showRefusal("not_saved", saved);
    const { path, command, cannot_be_made: reason } = saved;
    $("command").textContent = command;
    savedName = name;
    setHidden("design", false);
    if (reason === null) return showStatus(text("saved", { path }), false);
    return showStatus(text("saved_not_made", { path, reason: errorText(reason) }));
  };
  $("save").addEventListener("click", save);
  $("name").addEventListener("keydown", (event) => event.key === "Enter" && save());

  $("dxf").addEventListener("click", async () => {
    const answer = await send("/dxf");
    if (!answer.ok) return showRefusal("no_dxf", await answer.json());
    const link = create("a", { href: URL.createObjectURL(await answer.blob()), download: `${field("name").value || "cam"}.dxf` });
    link.click();
    URL.revokeObjectURL(link.href);
    return showStatus(text("dxf_made", { name: link.download }), false);
  });

  $("open").addEventListener("click", () => field("file").click());
  $("file").addEventListener("change", async () => {
    const [file] = field("file").files ?? [];
    if (!file) return;
    const answer = await post("/open", { text: await file.text() });
    field("file").value = "";
    if (!answer.ok) showRefusal("not_opened", await answer.json(), { name: file.name });
  });

  $("on_bench").addEventListener("click", async () => {
    const answer = await send("/bench/mount");
    if (answer.ok) location.assign("/bench");
    else showRefusal("not_on_bench", await answer.json());
  });

  $("design_run").addEventListener("click", async () => {
    showProgress(text("designing"));
    const answer = await post("/design", { name: savedName });
    if (answer.ok) return;
    showProgress("");
    showRefusal("not_designed", await answer.json());
  });
  $("design_stop").addEventListener("click", () => fetch("/design/stop", { method: "POST" }));

  $("copy").addEventListener("click", () => {
    getSelection()?.selectAllChildren($("command"));
    copyText($("command").textContent ?? "", "copied", "copy_by_hand");
  });
}

/** Show the progress of a running design, or an empty text if none runs. @param {string} progress */
function showProgress(progress) {
  setHidden("design_run", progress !== "");
  setHidden("design_stop", progress === "");
  setText("design_progress", progress);
}

/** Show the state of a design. @param {Design} design @param {(law: OtherLaw) => void} onDesigned */
export function showDesign(design, onDesigned) {
  if (design.best_rpm !== undefined) return showProgress(text("design_so_far", { rpm: formatNumber(design.best_rpm) }));
  showProgress("");
  if (design.stopped) return showStatus(text("design_stopped"), false);
  if (design.message !== undefined) return showRefusal("not_designed", { message: design.message });
  onDesigned(design.law);
  return showStatus(text("designed", { rpm: formatNumber(design.rpm, 5), path: design.path }), false);
}
