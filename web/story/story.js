// The story: each scene runs the programs again when the reader changes something.
//
// The page has all words, and the numbers and curves of the first state of each scene. The script
// shows the words that apply (`data-when`), and replaces numbers (`data-slot`) and curves.
import { reference } from "../laboratory/reference.js";
import { PROGRAMS } from "../programs/programs.js";
import { Trace } from "../programs/trace.js";
import { draw, mark } from "./chart.js";
import { prose } from "./numbers.js";

const { scenes, original, letters, lipschitz, fractions } = window.storyData;
const element = (id) => document.getElementById(id);
const all = (selector) => [...document.querySelectorAll(selector)];
const chosen = (name) => document.querySelector(`input[name="${name}"]:checked`)?.value;

// Run a program in a case: as printed, without some of its faults, with any number of steps.
function run(number, program, { without = [], parts = 1, stops = true, trace = null } = {}) {
  const scene = scenes[number];
  const { step_size, steps } = scene.run;
  const finer = { ...scene, run: { step_size: step_size / parts, steps: steps * parts } };
  const active = new Set(original[program].filter((name) => !without.includes(name)));
  const found = PROGRAMS[program].run(finer, active, lipschitz, stops, trace);
  const times = Array.from({ length: steps * parts }, (_, n) => (n + 1) * finer.run.step_size);
  return { ...found, scene: finer, times };
}

// Return the first component of omega with its start (rad/s), and the times (s).
function firstOmega({ rows, scene, times }) {
  return [[0, ...times.slice(0, rows.length)], [scene.initial.omega[0], ...rows.map((row) => row[1])]];
}

// Return the largest distance of some components of omega from functions of time (rad/s).
function distance({ rows }, goal, components = [0, 1, 2]) {
  const each = rows.flatMap((row, n) => components.map((axis) => Math.abs(row[axis + 1] - goal[n][axis])));
  return each.reduce((most, value) => Math.max(most, value), 0);
}

function fill(slot, value) {
  for (const each of all(`[data-slot="${slot}"]`)) {
    each.value = String(value);
    each.textContent = prose(value, Number(each.dataset.digits));
  }
}

function say(name, text) {
  for (const each of all(`[data-text="${name}"]`)) each.textContent = text;
}

// Show the words of a scene that apply, and hide the others.
function show(scene, ...words) {
  for (const each of element(scene).querySelectorAll("[data-when]")) {
    each.hidden = !each.dataset.when.split(" ").some((word) => words.includes(word));
  }
}

function onChange(names, update) {
  for (const each of all(names.map((name) => `input[name="${name}"]`).join())) {
    each.addEventListener("change", update);
  }
  update();
}

// Run all three programs, and tell what the chosen one did.
function claim() {
  const letter = chosen("trust");
  show("claim", letter);
  if (letter === undefined) return;
  for (const program of Object.values(letters)) {
    const found = run(2, program);
    draw(element("chart-claim"), program, ...firstOmega(found));
    const error = distance(found, reference(found.scene, found.times), [0]);
    fill(program === "runge-kutta" ? "stop-error" : "sine", error);
  }
}

const answer = element("stop").querySelector(".answer");

// Draw the run step by step, unless the reader prefers no motion.
function predict() {
  const chart = element("chart-stop");
  const found = run(2, "runge-kutta");
  const omega = firstOmega(found)[1];
  const steps = [...omega.keys()];
  const predicted = Number(element("prediction").value);
  fill("predicted", predicted);
  fill("run-step", found.stop.step);
  fill("quotient", found.stop.quotient);
  say("variable", found.stop.variable);
  show("stop", "predicted");
  delete chart.dataset.waiting;
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let shown = still ? steps.length : 1;
  const advance = () => {
    draw(chart, "runge-kutta", steps.slice(0, shown), omega.slice(0, shown));
    answer.hidden = shown < steps.length;
    if (shown++ < steps.length) requestAnimationFrame(advance);
  };
  advance();
}

function choosePrediction() {
  const predicted = Number(element("prediction").value);
  document.querySelector("output[for=prediction]").textContent = predicted;
  mark(element("chart-stop"), "prediction", predicted);
}

// Show a step: V2, and the quotient of V2, or that of U1 if the test reads omega alone.
function turn() {
  const alone = element("omega-alone").checked;
  const trace = new Trace(0);
  const without = alone ? ["lipschitz-tests-velocity"] : [];
  const found = run(2, "runge-kutta", { without, trace });
  const quotients = trace.tests.map((tests) => {
    const [, change, by] = tests.find(([variable]) => variable === (alone ? "U1" : "V2"));
    return change / by;
  });
  const slider = element("step");
  slider.max = found.rows.length;
  const step = Number(slider.value);
  const steps = Array.from({ length: found.rows.length + 1 }, (_, n) => n);
  const velocity = [0, ...found.rows.map((row) => row[5])];
  draw(element("chart-velocity"), "runge-kutta", steps, velocity);
  draw(element("chart-quotient"), "runge-kutta", steps.slice(1), quotients);
  draw(element("chart-quotient"), "threshold", [0, 100], [lipschitz, lipschitz]);
  for (const name of ["velocity", "quotient"]) mark(element(`chart-${name}`), "marker", step);
  document.querySelector("output[for=step]").textContent = step;
  say("tested", alone ? "U1" : "V2");
  fill("at-step", step);
  fill("at-velocity", velocity[step]);
  fill("at-quotient", quotients[step - 1]);
  if (alone) {
    fill("alone-step", found.stop.step);
    say("alone-variable", found.stop.variable);
  }
  show("turning-point", "at-step", alone ? "alone" : "");
}

function slow() {
  const without = all("input[name=fault]").filter((box) => !box.checked).map((box) => box.value);
  const parts = Math.round(scenes[2].run.step_size / Number(element("step-size").value));
  const found = run(2, "runge-kutta", { without, parts, stops: false });
  draw(element("chart-half-speed"), "runge-kutta", ...firstOmega(found));
  const truth = reference(found.scene, found.times);
  const half = reference(found.scene, found.times.map((t) => t / 2));
  const start = found.scene.initial.omega;
  const limit = half.map((row) => row.map((value, axis) => 2 * value - start[axis]));
  const solution = distance(found, truth, [0]);
  fill("from-limit", distance(found, limit, [0]));
  for (const name of ["from-solution", "one-solution", "none-solution"]) fill(name, solution);
  show("half-speed", ["both", "one", "none"][without.length]);
}

function blind() {
  const [number, program] = [chosen("blind-case"), chosen("blind-program")];
  const found = run(number, program);
  draw(element(`chart-blind-${number}`), "runge-kutta", ...firstOmega(found));
  fill(`blind-steps-${number}`, found.rows.length);
  fill(`blind-error-${number}`, distance(found, reference(found.scene, found.times), [0]));
  const radio = document.querySelector("input[name=blind-program]:checked");
  say(`blind-program-${number}`, radio.parentElement.textContent.trim());
  show("blind", `case-${number}`);
}

// Show the points of collocation of a step, and the run in Case 6 to which they lead.
function points() {
  const program = chosen("points-program");
  const grows = element("points-fault").checked;
  const step = Number(element("points-step").value);
  const chart = element("chart-points");
  const { step_size: size, steps: count } = scenes[6].run;
  const steps = Array.from({ length: count }, (_, n) => n + 1);
  for (let n = 1; n <= 4; n += 1) {
    const part = fractions[program][n - 1];
    const places = part === undefined ? [] : steps.map((each) => part * size * (grows ? each : 1));
    draw(chart, `point-${n}`, places.length > 0 ? steps : [], places);
  }
  mark(chart, "marker", step);
  const found = run(6, program, { without: grows ? [] : ["dt-accumulates"] });
  for (const name of Object.keys(fractions)) {
    draw(element("chart-points-run"), name, ...(name === program ? firstOmega(found) : [[], []]));
  }
  document.querySelector("output[for=points-step]").textContent = step;
  fill("points-at", step);
  fill("point-first", fractions[program][0] * size * (grows ? step : 1));
  fill("point-last", fractions[program].at(-1) * size * (grows ? step : 1));
  fill("points-steps", found.rows.length);
  fill("points-error", distance(found, reference(found.scene, found.times), [0]));
}

// Run all programs in all cases but the first, and compare Runge-Kutta with collocation.
function race() {
  const listing = chosen("race");
  const without = listing === "original" ? [] : Object.values(original).flat();
  const cases = Object.keys(scenes).map(Number).filter((number) => number > 1);
  const errors = {};
  for (const program of Object.keys(original)) {
    errors[program] = cases.map((number) => {
      const found = run(number, program, { without });
      return distance(found, reference(found.scene, found.times));
    });
    draw(element(`chart-race-${listing}`), program, cases, errors[program]);
  }
  show("corrected", listing);
  if (listing === "original") return;
  const ratios = cases.map((_, n) => {
    const both = ["two-term", "four-term"].map((name) => errors[name][n] / errors["runge-kutta"][n]);
    return both.sort((x, y) => x - y);
  });
  const known = ratios.filter((_, n) => cases[n] !== 7);
  fill("ratio", ratios[0][0]);
  fill("least-ratio", Math.min(...known.map(([least]) => least)));
  fill("most-ratio", Math.max(...known.map(([, most]) => most)));
  const last = cases.indexOf(7);
  fill("seven-two", errors["two-term"][last] / errors["runge-kutta"][last]);
  fill("seven-four", errors["four-term"][last] / errors["runge-kutta"][last]);
}

onChange(["trust"], claim);
answer.hidden = true;
element("chart-stop").dataset.waiting = "";
choosePrediction();
element("prediction").addEventListener("input", choosePrediction);
element("run").addEventListener("click", predict);
element("step").addEventListener("input", turn);
element("omega-alone").addEventListener("change", turn);
turn();
element("step-size").addEventListener("change", slow);
onChange(["fault"], slow);
onChange(["blind-case", "blind-program"], blind);
element("points-step").addEventListener("input", points);
element("points-fault").addEventListener("change", points);
onChange(["points-program"], points);
onChange(["race"], race);
