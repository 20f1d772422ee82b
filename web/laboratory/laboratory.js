// The page: from controls and address to charts, table, printer page and sentences.
//
// Every change makes a complete new state, and every state is shown completely.
import { Charts } from "./charts.js";
import { brief, ending, experiment, largestError } from "./experiment.js";
import { printerPage } from "./printer-page.js";
import {
  StateError,
  activeIn,
  commandOf,
  defaultState,
  fragmentOf,
  hasStopTest,
  omegaFrom,
  positiveFrom,
  sceneOfCase,
  stateFrom,
  stepsFrom,
  written,
} from "./state.js";

const data = window.laboratoryData;
const element = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];
const charts = new Charts(
  element("omega-chart"),
  element("error-chart"),
  element("readout"),
  (component) => all("input[name=component]")[component].checked,
);
let state = defaultState(data);
let found = null;
// By field: what is wrong with its content, until it is corrected.
const wrong = new Map();

// Compute a state and show it, together with the problems of the input that requested it.
function show(next, problems = []) {
  state = next;
  tell(problems);
  showControls();
  found = experiment(data, state);
  const error = largestError(found);
  const known = error === null ? "" : ` Largest error of omega: ${brief(error)} rad/s.`;
  element("status").textContent = `${ending(found)}${known}${withoutTruth()}`;
  element("printer-page").textContent = printerPage(
    data.printer[state.program],
    found.scene,
    found.run,
  );
  charts.show(found);
  element("copied").textContent = "";
  element("command").textContent = commandOf(data, state);
  element("address").href = `#${fragmentOf(data, state)}`;
  showRows();
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
  for (const radio of all("input[name=listing]")) radio.checked = radio.value === state.base;
  for (const box of all("input[name=switch]")) {
    const label = box.closest("label");
    label.hidden = !label.dataset.programs.split(" ").includes(state.program);
    box.checked = state.active.includes(box.value);
  }
  for (const fieldset of all("fieldset.switches")) {
    fieldset.hidden = !fieldset.querySelector("label:not([hidden])");
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
  history.replaceState(null, "", `#${fragmentOf(data, state)}`);
}

// Read a field of numbers when it changes. A valid value is used. Otherwise the problem is shown,
// and the field stays as it is until it is corrected.
function onNumber(id, read, taken) {
  element(id).addEventListener("change", () => {
    try {
      const value = read(element(id).value, id);
      wrong.delete(id);
      change(taken(value));
    } catch (error) {
      if (!(error instanceof StateError)) throw error;
      wrong.set(id, error.message);
      tell();
      element(id).setAttribute("aria-invalid", "true");
    }
  });
}

function onChange(id, taken) {
  element(id).addEventListener("change", () => change(taken(element(id))));
}

function fromAddress() {
  wrong.clear();
  const { state: asked, problems } = stateFrom(data, location.hash);
  show(asked, problems);
}

onChange("case", ({ value }) => ({ ...state, case: Number(value), omega0: null }));
onChange("program", ({ value }) => ({ ...state, program: value }));
onChange("stops", ({ checked }) => ({ ...state, stops: checked }));
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
    change({ ...state, base, active: activeIn(data, base) });
  });
}
for (const box of all("input[name=switch]")) {
  box.addEventListener("change", () => {
    const others = state.active.filter((name) => name !== box.value);
    change({ ...state, active: box.checked ? [...others, box.value] : others });
  });
}
for (const box of all("input[name=component]")) {
  box.addEventListener("change", () => charts.choose());
}
for (const button of all("button.copy")) {
  const of = element(button.dataset.of);
  button.hidden = navigator.clipboard === undefined;
  button.addEventListener("click", async () => {
    try {
      await navigator.clipboard.writeText(of.href ?? of.textContent);
      element("copied").textContent = "copied";
    } catch {
      element("copied").textContent = "the browser allows no copying from here";
    }
  });
}
element("reset").addEventListener("click", () => {
  wrong.clear();
  change(defaultState(data));
});
element("numbers").addEventListener("toggle", showRows);
window.addEventListener("hashchange", fromAddress);
document.addEventListener("themechange", () => charts.recolour());
// A page is printed in the colours for paper, whatever the colours of the screen.
matchMedia("print").addEventListener("change", () => charts.recolour());

for (const block of [...all(".controls"), element("charts")]) block.hidden = false;
fromAddress();
