// The citation of a page, a card, a claim, an entry or a run, as BibTeX and CSL-JSON. Without
// scripts, the links lead to the page that tells how to cite.

import { startCopying } from "../laboratory/copying.js";

const { address, publish, bibtex, csl, digest } = window.citeData;
const PLACE = "@PLACE@";
const PATH = "@PATH@";

const here = document.getElementById("cite-page");
const path = here.dataset.path;
let dialog = null;

function made() {
  const made = document.createElement("dialog");
  made.className = "citation-dialog";
  made.setAttribute("aria-labelledby", "cite-head");
  made.innerHTML = `<form method="dialog"><button class="button">Close</button></form>
    <h2 id="cite-head">Cite <span id="cite-place"></span></h2>
    <p><code id="cite-address"></code>, text <code id="cite-digest"></code></p>
    <p class="muted" id="cite-publish"></p>
    <h3>BibTeX</h3><pre tabindex="0" role="group" aria-label="BibTeX"><code id="cite-bibtex"></code></pre>
    <h3>CSL-JSON</h3><pre tabindex="0" role="group" aria-label="CSL-JSON"><code id="cite-csl"></code></pre>
    <p><button type="button" class="button copy" data-of="cite-bibtex">Copy BibTeX</button>
    <button type="button" class="button copy" data-of="cite-csl">Copy CSL-JSON</button>
    <span id="cite-copied" class="muted" role="status"></span></p>`;
  document.body.append(made);
  startCopying(made, "cite-copied");
  return made;
}

function show(place, anchor) {
  dialog ??= made();
  const to = anchor ? `${path}#${anchor}` : path;
  const filled = (text) => text.replaceAll(PLACE, () => place).replaceAll(PATH, () => to);
  const tell = (name, text) => {
    dialog.querySelector(`#cite-${name}`).textContent = text;
  };
  tell("place", place);
  tell("address", address + to);
  tell("digest", digest);
  tell("publish", address ? "" : publish);
  tell("bibtex", filled(bibtex));
  tell("csl", JSON.stringify(csl, (_, each) => (typeof each === "string" ? filled(each) : each), 2));
  tell("copied", "");
  dialog.showModal();
}

here.addEventListener("click", (event) => {
  event.preventDefault();
  const state = decodeURIComponent(location.hash.slice(1));
  // A page with a state, as the laboratory's, is cited with it.
  const told = state.includes("=") ? `: ${state.replaceAll("&", ", ")}` : "";
  show(`${here.dataset.cite}${told}`, told ? location.hash.slice(1) : "");
});
for (const each of document.querySelectorAll("[data-cite]:not(#cite-page)")) {
  const button = document.createElement("button");
  button.type = "button";
  button.className = "button cite-here";
  button.textContent = "Cite";
  const isState = each.matches("[data-state]");
  button.addEventListener("click", () => (isState ? here.click() : show(each.dataset.cite, each.closest("[id]").id)));
  each.append(" ", button);
}
