// The page: from controls and address to motion, drawings, numbers and sentences.
import { onField } from "../laboratory/address.js";
import { inSpace, torqueFree } from "./closed-form.js";
import { amplification } from "./digits.js";
import { Drawing } from "./drawing.js";
import {
  bodyOf,
  commandOf,
  fragmentOf,
  listed,
  momentsFrom,
  omegaFrom,
  stateFrom,
  stateOfBody,
  timeFrom,
} from "./state.js";

const data = window.bodyData;
const element = (id) => document.getElementById(id);
const [space, polhode, herpolhode] = ["space", "polhode", "herpolhode"].map(element);
const drawing = new Drawing({ space, polhode, herpolhode });
// The slider of the time is logarithmic: from its second position on, 0.01 s to the latest time.
const DECADES = Math.log10(data.longest) + 2;
const POSITIONS = Number(element("slider").max);
// The time (ms) between changes of the numbers while the body moves.
const REFRESH = 250;
let state = stateOfBody(data, data.first);
let motion = null;
let remaining = null;
let isPlaying = false;
let isSeen = true;
// Time of the last frame, ms.
let last = null;
// Time at which the numbers were last changed, ms.
let told = 0;
// By field: what is wrong with its content, until it is corrected.
const wrong = new Map();

const wordsOf = ({ children: [head, value] }) => `${head.textContent}: ${value.textContent}`;
const brief = (x) => (x === 0 ? "0" : String(Number(x.toPrecision(3))));
const rounded = (values) => values.map((x) => x.toFixed(6)).join(", ");
const seconds = (t) => (t < Infinity ? `${Number(t.toPrecision(12))} s` : "none");

// Show a state, together with the problems of the input that requested it.
function show(next, problems = []) {
  const isSame = motion && next.moments === state.moments && next.omega0 === state.omega0;
  state = next;
  if (!isSame) {
    motion = torqueFree(state.moments, state.omega0);
    remaining = amplification(state.moments, state.omega0);
    drawing.setMotion(motion, state.moments);
    element("told").textContent = sentence();
  }
  tell(problems);
  showControls();
  showTime();
  draw();
}

function change(next) {
  show(next);
  history.replaceState(null, "", `#${fragmentOf(data, state)}`);
}

function tell(problems = []) {
  element("problems").textContent = [...problems, ...wrong.values()].join("; ");
}

// Return what the motion does, in words.
function sentence() {
  const { axes, flipTime, isSteady, least, peak } = motion;
  const [first, middle, third] = axes.map((axis) => state.moments[axis]);
  const name = (place) => axes[place] + 1;
  if (isSteady) return "This rotation is steady: omega is constant in the body and in space.";
  if (flipTime === Infinity) {
    return `This motion is on the separatrix: it approaches a spin about axis ${name(1)} and never returns.`;
  }
  const extreme = third < first ? "smallest" : "largest";
  const circles = `Omega circles axis ${name(2)}, which has the ${extreme} moment. `;
  if (first === middle) {
    return `${circles}Two moments are equal: one circle in the body takes ${brief(2 * flipTime)} s.`;
  }
  const angle = (Math.atan2(third * least, middle * peak) * 180) / Math.PI;
  return (
    `${circles}Omega about axis ${name(1)}, the middle one, changes its sign every ` +
    `${brief(flipTime)} s: this is the flip. Axis ${name(1)} swings between ${brief(angle)} ` +
    `and ${(180 - angle).toFixed(1)} degrees from the angular momentum.`
  );
}

function showControls() {
  element("body").value = bodyOf(data, state)?.id ?? "";
  for (const id of ["moments", "omega0"]) setField(id, listed(state[id]));
}

function setField(id, value) {
  // What is being typed while the body moves is left alone.
  if (wrong.has(id) || (isPlaying && element(id) === document.activeElement)) return;
  element(id).value = value;
  element(id).removeAttribute("aria-invalid");
}

// Show everything that depends on the time, except the drawings.
function showTime() {
  const { time, moments } = state;
  const [start, here] = [motion.at(0), motion.at(time)];
  const energy = ({ omega: w }) => w.reduce((sum, x, i) => sum + moments[i] * x * x, 0);
  const momentum = ({ omega: w, attitude: q }) => inSpace(q, w.map((x, i) => moments[i] * x));
  const [before, after] = [momentum(start), momentum(here)];
  const { digits, growth } = remaining(time);
  const next = motion.flipAfter(time);
  const drifts = [
    Math.abs(energy(here) - energy(start)) / (energy(start) || 1),
    Math.hypot(...after.map((x, i) => x - before[i])) / (Math.hypot(...before) || 1),
  ];
  const numbers = {
    time: seconds(time),
    omega: `${rounded(here.omega)} rad/s`,
    attitude: rounded(here.attitude),
    flip: seconds(next),
    drift: drifts.map(brief).join(" and "),
    digits: `${digits.map((x) => x.toFixed(1)).join(" and ")} (error amplification ${brief(growth)})`,
  };
  for (const [id, text] of Object.entries(numbers)) element(`at-${id}`).textContent = text;
  if (!isPlaying) {
    const rows = [...document.querySelectorAll(".numbers > div")];
    element("status").textContent = rows.map(wordsOf).join("; ");
  }
  setField("time", time);
  const slider = element("slider");
  slider.value = time < 0.01 ? 0 : 1 + ((Math.log10(time) + 2) / DECADES) * (POSITIONS - 1);
  slider.setAttribute("aria-valuetext", seconds(time));
  element("flip").disabled = !(next <= data.longest);
  const { command, file } = commandOf(data, state);
  element("command").textContent = command;
  element("scene").textContent = file;
  element("scene-file").hidden = file === "";
}

function draw() {
  drawing.draw(state.time, (Number(element("view").value) * Math.PI) / 180);
}

function play(wanted) {
  isPlaying = wanted;
  last = null;
  element("play").textContent = wanted ? "Pause" : "Play";
  if (wanted) {
    element("status").textContent = "Playing.";
    requestAnimationFrame(advance);
  } else {
    change({ ...state, time: Number(state.time.toPrecision(9)) });
  }
}

// Advance the time by a frame. Browsers call no frame of a hidden page; the clock stops with them.
function advance(now) {
  if (!isPlaying) return;
  const passed = last === null ? 0 : Math.min(100, now - last) / 1000;
  last = now;
  if (isSeen) {
    const time = Math.min(data.longest, state.time + passed * Number(element("speed").value));
    state = { ...state, time };
    draw();
    if (now - told > REFRESH) {
      told = now;
      showTime();
    }
    if (time === data.longest) return play(false);
  }
  requestAnimationFrame(advance);
}

function fromAddress() {
  wrong.clear();
  const { state: asked, problems } = stateFrom(data, location.hash);
  show(asked, problems);
}

const onNumber = (id, read, taken) =>
  onField(element(id), wrong, tell, read, (value) => change(taken(value)));
onNumber("moments", momentsFrom, (moments) => ({ ...state, moments }));
onNumber("omega0", omegaFrom, (omega0) => ({ ...state, omega0 }));
onNumber("time", timeFrom(data), (time) => ({ ...state, time }));
element("body").addEventListener("change", ({ target }) => {
  wrong.clear();
  if (target.value) change(stateOfBody(data, target.value));
});
element("slider").addEventListener("input", ({ target }) => {
  wrong.delete("time");
  const place = (Number(target.value) - 1) / (POSITIONS - 1);
  const time = place < 0 ? 0 : Number((10 ** (DECADES * place - 2)).toPrecision(4));
  change({ ...state, time: Math.min(time, data.longest) });
});
element("view").addEventListener("input", draw);
element("play").addEventListener("click", () => play(!isPlaying));
element("flip").addEventListener("click", () => {
  change({ ...state, time: motion.flipAfter(state.time) });
});
window.addEventListener("hashchange", fromAddress);
const recolour = () => {
  drawing.recolour();
  draw();
};
document.addEventListener("themechange", () => motion && recolour());
// A page is printed in the colours for paper, whatever the colours of the screen.
matchMedia("print").addEventListener("change", recolour);

element("tumbling").hidden = false;
fromAddress();
new ResizeObserver(draw).observe(space);
new IntersectionObserver(([{ isIntersecting }]) => {
  isSeen = isIntersecting;
}).observe(space);
// An address that names a time shows this time.
if (!matchMedia("(prefers-reduced-motion: reduce)").matches && state.time === 0) play(true);
