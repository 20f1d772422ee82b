// The page: from controls and address to charts, table, printer page and sentences.
//
// Every change makes a complete new state, and every state is shown completely.
import { onField } from "./address.js";
import { panelsOf, readout } from "./chart-data.js";
import { Charts } from "./charts.js";
import { startCopying } from "./copying.js";
import { brief, ending, experiment, largestError } from "./experiment.js";
import { startGuide } from "./guide.js";
import { idleSwitches } from "./idle.js";
import { limitOf } from "./limit.js";
import { printerPage } from "./printer-page.js";
import {
  activeIn,
  commandOf,
  defaultState,
  fragmentOf,
  hasStopTest,
  listingOf,
  omegaFrom,
  positiveFrom,
  sceneOfCase,
  stateFrom,
  stepsFrom,
  suppliedIn,
  written,
} from "./state.js";
import { StepViewer } from "./steps.js";
import { whyEnded } from "./why.js";

// Time (ms) after the last change until the switches are tried.
const IDLE_DELAY = 60;
const data = window.laboratoryData;
const element = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];
const places = all("[data-panel]").map((each) => [each.dataset.panel, each]);
const charts = new Charts(Object.fromEntries(places), tellPointer, pick);
const steps = new StepViewer(data, () => charts.mark(steps.time));
let state = defaultState(data);
let found = null;
// The pinned state and its experiment, or null.
let pinned = null;
let pinnedFound = null;
let limit = null;
let panels = null;
// By field: what is wrong with its content, until it is corrected.
const wrong = new Map();
// The switches are tried a moment after the last change.
let waiting = null;

// Compute a state and show it, together with the problems of the input that requested it.
function show(next, problems = []) {
  state = next;
  tell(problems);
  showControls();
  found = experiment(data, state);
  limit = limitOf(data, found);
  element("status").textContent = `${ending(found)}${errorTold(found)}${withoutTruth()}`;
  element("why-head").textContent =
    found.run.ended === "complete" ? "Why did it not stop early?" : "Why did it stop?";
  element("why").textContent = whyEnded(found);
  element("limit").textContent = limit.sentence;
  element("show-limit").disabled = limit.omega === null;
  element("printer-page").textContent = printerPage(
    data.printer[state.program],
    found.scene,
    found.run,
  );
  showPinned();
  steps.show(found);
  showCharts();
  const listing = listingOf(data, state);
  element("sheet-told").textContent =
    `Case ${state.case}, ${state.program}, ${listing === "some" ? "some faults" : listing}: ${shortEnding(found)}`;
  element("copied").textContent = "";
  element("command").textContent = commandOf(data, state);
  element("address").href = `#${fragmentOf(data, state, pinned)}`;
  showRows();
  clearTimeout(waiting);
  waiting = setTimeout(showIdle, IDLE_DELAY);
}

function errorTold(experiment) {
  const error = largestError(experiment);
  return error === null ? "" : ` Largest error of omega: ${brief(error)} rad/s.`;
}

function shortEnding({ run }) {
  if (run.ended === "stopped") return `stopped at step ${run.stop.step}`;
  return run.ended === "overflow" ? `overflow in step ${run.rows.length + 1}` : "complete";
}

function showPinned() {
  element("unpin").hidden = pinned === null;
  element("pinned").hidden = pinned === null;
  element("difference").hidden = pinned === null;
  for (const each of all(".with-pin")) each.hidden = pinned === null;
  if (pinned === null) return;
  element("pinned-command").textContent = commandOf(data, pinned);
  element("pinned-ending").textContent = `${ending(pinnedFound)}${errorTold(pinnedFound)}`;
}

function pin(next) {
  pinned = next;
  pinnedFound = next === null ? null : experiment(data, next);
}

function showCharts() {
  const omega = element("show-limit").checked ? limit.omega : null;
  panels = panelsOf(found, pinnedFound, omega, { solution: element("show-solution").checked });
  element("quotient").hidden = found.tests.length === 0;
  const { run, times } = found;
  const words = run.stop ? `step ${run.stop.step}: ${run.stop.variable}` : "overflow";
  const end =
    run.ended === "complete" ? null : { time: times[Math.max(run.rows.length - 1, 0)], words };
  charts.show(panels.panels, panels.times, steps.time, end);
}

function tellPointer(index) {
  element("readout").textContent = readout(panels, index);
}

// Show the step whose time is nearest to a time of the panels.
function pick(index) {
  const last = found.run.rows.length;
  if (last === 0) return;
  steps.choose(Math.min(Math.max(Math.round(panels.times[index] / state.stepSize), 1), last));
  charts.mark(steps.time);
}

// Say beside each switch whether it does nothing here.
function showIdle() {
  const reasons = idleSwitches(data, state);
  for (const box of all("input[name=switch]")) {
    const reason = reasons.get(box.value);
    const label = box.closest("label");
    label.classList.toggle("idle", reason !== null);
    label.querySelector(".reason").textContent = reason === null ? "" : `No effect here: ${reason}.`;
  }
  // Choices without effect are last in their group, the others in their order.
  for (const group of all("fieldset.switches")) {
    const labels = [...group.querySelectorAll("label")];
    const rank = (label) => Number(reasons.get(label.querySelector("input").value) !== null);
    const order = (label) => data.flags.findIndex(({ id }) => id === label.querySelector("input").value);
    const sorted = labels.toSorted((a, b) => rank(a) - rank(b) || order(a) - order(b));
    if (sorted.some((label, n) => label !== labels[n])) {
      const active = document.activeElement;
      group.append(...sorted);
      active?.focus({ preventScroll: true });
    }
  }
}

function tell(problems = []) {
  element("problems").textContent = [...problems, ...wrong.values()].join("; ");
}

function withoutTruth() {
  const { truth, times } = found;
  if (truth.length === times.length) return "";
  return ` The solution is followed for ${truth.length} of ${times.length} steps.`;
}

function showControls() {
  element("case").value = state.case;
  element("heading").textContent = data.headings[state.case].join("; ");
  const supplied = suppliedIn(data, state);
  element("assumed-case").hidden = supplied === "";
  element("assumed-what").textContent = supplied;
  const values = {
    omega0: (state.omega0 ?? sceneOfCase(data, state.case).initial.omega).map(written).join(", "),
    "step-size": written(state.stepSize),
    steps: String(state.steps),
    lipschitz: written(state.lipschitz),
  };
  for (const [id, value] of Object.entries(values)) {
    if (wrong.has(id)) continue;
    element(id).value = value;
    element(id).removeAttribute("aria-invalid");
  }
  element("program").value = state.program;
  const listing = listingOf(data, state);
  for (const radio of all("input[name=listing]")) {
    radio.checked = radio.value === listing;
    // The reader comes there by a switch.
    if (radio.value === "some") radio.disabled = listing !== "some";
  }
  for (const box of all("input[name=switch]")) {
    const label = box.closest("label");
    const absent = !label.dataset.programs.split(" ").includes(state.program);
    box.disabled = absent;
    label.classList.toggle("absent", absent);
    box.checked = !absent && state.active.includes(box.value);
  }
  element("stop-test").hidden = !hasStopTest(state.program);
  element("stops").checked = state.stops;
  element("lipschitz").disabled = !state.stops;
}

// The table takes longer than all else, so it is made only when it is open.
function showRows() {
  if (!element("numbers").open || found === null) return;
  const { run, times, errors } = found;
  const rows = run.rows.map(([time, ...values], n) => {
    const error = errors[n] === null ? "" : brief(Math.max(...errors[n]));
    const cells = [...[times[n], ...values, time].map(written), run.ier?.[n] ?? "", error];
    return `<tr><td>${[n + 1, ...cells].join("</td><td>")}</td></tr>`;
  });
  element("rows").innerHTML = rows.join("");
}

// Show a state that a control made, and write it into the address.
function change(next) {
  show(next);
  history.replaceState(null, "", `#${fragmentOf(data, state, pinned)}`);
}

function onChange(id, taken) {
  element(id).addEventListener("change", () => change(taken(element(id))));
}

function fromAddress() {
  wrong.clear();
  const { state: asked, pinned: other, problems } = stateFrom(data, location.hash);
  pin(other);
  show(asked, problems);
}

onChange("case", ({ value }) => ({ ...state, case: Number(value), omega0: null }));
onChange("program", ({ value }) => ({ ...state, program: value }));
onChange("stops", ({ checked }) => ({ ...state, stops: checked }));
const onNumber = (id, read, taken) =>
  onField(element(id), wrong, tell, read, (value) => change(taken(value)));
onNumber("omega0", omegaFrom, (omega) => {
  const own = sceneOfCase(data, state.case).initial.omega;
  return { ...state, omega0: omega.every((x, axis) => Object.is(x, own[axis])) ? null : omega };
});
onNumber("step-size", positiveFrom, (stepSize) => ({ ...state, stepSize }));
onNumber("steps", stepsFrom(data), (steps) => ({ ...state, steps }));
onNumber("lipschitz", positiveFrom, (lipschitz) => ({ ...state, lipschitz }));
for (const radio of all("input[name=listing]")) {
  radio.addEventListener("change", () => {
    const base = radio.value;
    if (base === "some") return;
    change({ ...state, base, active: activeIn(data, base) });
  });
}
for (const box of all("input[name=switch]")) {
  box.addEventListener("change", () => {
    const others = state.active.filter((name) => name !== box.value);
    change({ ...state, active: box.checked ? [...others, box.value] : others });
  });
}
for (const id of ["show-solution", "show-limit"]) element(id).addEventListener("change", showCharts);
element("pin").addEventListener("click", () => {
  pin(state);
  change(state);
});
element("unpin").addEventListener("click", () => {
  pin(null);
  change(state);
  element("pin").focus();
});
element("sheet").addEventListener("click", () => {
  const isOpen = element("sheet").getAttribute("aria-expanded") === "true";
  element("sheet").setAttribute("aria-expanded", String(!isOpen));
});
startGuide((words) => {
  wrong.clear();
  const asked = stateFrom(data, words);
  pin(asked.pinned);
  element("show-limit").checked = true;
  change(asked.state);
});
startCopying();
element("reset").addEventListener("click", () => {
  wrong.clear();
  pin(null);
  change(defaultState(data));
});
element("numbers").addEventListener("toggle", showRows);
window.addEventListener("hashchange", fromAddress);
document.addEventListener("themechange", () => charts.recolour());
// A page is printed in the colours for paper, whatever the colours of the screen.
matchMedia("print").addEventListener("change", () => charts.recolour());

for (const id of ["choices", "charts", "step-viewer", "told"]) element(id).hidden = false;
fromAddress();
