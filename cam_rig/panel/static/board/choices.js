// Cam and rig of the board, and the law that is drawn next to that of the board.
/** @import { SecondLaw } from "./main.js" */
import { $, field, post, showRefusal, showStatus } from "../common/dom.js";
import { errorText } from "../common/texts.js";
import { motionOf, readLaw } from "./law.js";

/** Key of sessionStorage with the id of the select whose choice reloads the page. */
const CHOSEN = "chosen";

/** Fill the selects of cam and rig. A choice applies to the server's board, which lets all pages reload. @param {Board} board */
export function listenForChoices({ cam, rig, cams, rigs }) {
  for (const [name, title] of Object.entries(cams)) $("cam").append(new Option(title, name));
  for (const [name, title] of Object.entries(rigs)) $("rig").append(Object.assign(new Option(name), { title }));
  for (const [id, present] of [["cam", cam.name], ["rig", rig.name]]) {
    field(id).value = present;
    $(id).addEventListener("change", async () => {
      sessionStorage.setItem(CHOSEN, id);
      const answer = await post("/choose", { [id]: field(id).value }).catch(() => null); // null without a connection
      if (answer?.ok) return;
      sessionStorage.removeItem(CHOSEN);
      field(id).value = present;
      if (answer) showRefusal("not_chosen", await answer.json());
    });
  }
  $(sessionStorage.getItem(CHOSEN) ?? "")?.focus(); // the reloaded page keeps the focus
  sessionStorage.removeItem(CHOSEN);
}

/** Fill the select of the second law. @param {Board} board @param {(law: SecondLaw | null) => void} show */
export function listenForSecond(board, show) {
  for (const [name, title] of Object.entries(board.cams)) $("second").append(new Option(title, name));
  $("second").addEventListener("change", async () => {
    const name = field("second").value;
    const answer = name ? await fetch(`/other/${name}`).catch(() => null) : null; // null without a connection
    const law = await answer?.json();
    if (field("second").value !== name) return; // another law has been selected meanwhile
    if (answer && !answer.ok) showStatus(errorText(law.message));
    show(answer?.ok ? decodeLaw(law) : null);
  });
}

/** Return a law of a message with its motion. @param {OtherLaw} law @returns {SecondLaw} */
export const decodeLaw = ({ title, law, figures }) => ({ title, figures, motion: motionOf(readLaw(law)) });
