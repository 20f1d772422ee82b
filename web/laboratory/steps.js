// The step viewer: the numbers of one step, and the cards that run in it with their values.
import { passesOf, traced } from "./cards.js";
import { quotientsOf } from "./why.js";
import { written } from "./state.js";

const element = (id) => document.getElementById(id);

export class StepViewer {
  // `moved` gets the number of a step, from 1, that the reader has chosen.
  constructor(data, moved) {
    this.data = data;
    this.found = null;
    this.chosen = null; // null: the last step
    element("step").addEventListener("input", () => {
      this.choose(Number(element("step").value));
      moved();
    });
  }

  // Show an experiment, at the chosen step if it has one, or else at its last step.
  show(found) {
    this.found = found;
    const last = found.run.rows.length;
    const slider = element("step");
    slider.disabled = last === 0;
    slider.max = String(Math.max(last, 1));
    this.tell();
  }

  choose(step) {
    this.chosen = step;
    this.tell();
  }

  // The number of the step that is shown, or 0 if the run has none.
  get step() {
    const last = this.found.run.rows.length;
    return Math.min(this.chosen ?? last, last);
  }

  // The time (s) of the step that is shown, or null.
  get time() {
    return this.step > 0 ? this.found.times[this.step - 1] : null;
  }

  tell() {
    const { step } = this;
    const { state, run, times } = this.found;
    element("step").value = String(step);
    element("step-numbers").innerHTML = step > 0 ? numbers(this.found, step) : "";
    const last = run.rows.length;
    const told = step > 0 ? `${step} of ${last}, at ${written(Number(times[step - 1].toPrecision(12)))} s` : "none";
    element("step-told").textContent = told;
    element("step").setAttribute("aria-valuetext", `step ${told}`);
    const passes = step > 0 ? passesOf(this.data, state, traced(this.data, state, step), step) : [];
    const table = document.querySelector(".cards table");
    for (const body of [...table.tBodies]) body.remove();
    table.insertAdjacentHTML("beforeend", passes.map((pass) => passHtml(pass, state.program)).join(""));
  }
}

// Return a number with four significant digits, and nothing for none.
function short(value) {
  return value === undefined || value === null ? "" : written(Number(value.toPrecision(4)));
}

// Return the texts of a number and of its solution with as many digits as they need to differ by
// three of them; all digits are in the table of all numbers.
function alike(value, solved) {
  if (typeof solved !== "number") return [short(value), ""];
  const scale = Math.max(Math.abs(value), Math.abs(solved));
  const apart = Math.abs(value - solved);
  if (apart === 0 || !Number.isFinite(scale)) return [written(value), written(solved)];
  const digits = Math.min(Math.max(Math.ceil(Math.log10(scale / apart)) + 2, 4), 17);
  return [value, solved].map((each) => written(Number(each.toPrecision(digits))));
}

function numbers({ run, truth, errors, tests }, step) {
  const row = run.rows[step - 1];
  const names = ["U1", "U2", "U3", "V1", "V2", "V3"];
  const quotients = new Map(quotientsOf(tests)[step - 1] ?? []);
  const lines = names.map((name, n) => {
    const solved = n < 3 ? truth[step - 1]?.[n] : undefined;
    const error = n < 3 ? errors[step - 1]?.[n] : undefined;
    const quotient = quotients.get(name);
    const cells = [...alike(row[n + 1], solved), ...[error, quotient].map(short)];
    return `<tr><th scope="row">${name}</th><td>${cells.join("</td><td>")}</td></tr>`;
  });
  const joint = ["U", "UV"]
    .filter((name) => quotients.has(name))
    .map((name) => `<tr><th scope="row">${name}</th><td></td><td></td><td></td><td>${short(quotients.get(name) ?? 0)}</td></tr>`);
  return [...lines, ...joint].join("");
}

function passHtml({ title, lines }, program) {
  const rows = lines.map(({ number, text, values, inserted, replaced, stops, skipped }) => {
    const own = number === undefined || inserted;
    const name = own
      ? `<span class="muted">${number ?? "no card"}</span>`
      : `<a href="listing/${program}.html#${number}">${number}</a>`;
    const marks = [
      ...(inserted ? ["inserted by a correction"] : []),
      ...(replaced ? ["corrected"] : []),
      ...(stops ? ["ends the run"] : []),
      ...(skipped ? ["not reached"] : []),
    ];
    const told = values.map(([each, value]) => `${each} = ${written(value)}`).join("<br>");
    const kind = stops ? ' class="stops"' : skipped ? ' class="skipped"' : "";
    const mark = marks.length > 0 ? `<span class="mark">${marks.join(", ")}</span>` : "";
    return `<tr${kind}><th scope="row">${name}</th><td><code>${text.trim()}</code> ${mark}</td><td>${told}</td></tr>`;
  });
  return `<tbody><tr class="pass"><th colspan="3" scope="rowgroup">${title}</th></tr>${rows.join("")}</tbody>`;
}
