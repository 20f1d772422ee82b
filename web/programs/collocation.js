// Collocation as in IV.2: the loop over the steps of the two programs, and one interval.
//
// Every unknown is a polynomial x(0) + c1 t + c2 t^2 + ... (eq. 34) whose derivative equals the
// right-hand side at as many points as there are terms (eq. 36). The right-hand side depends on the
// unknowns: a first estimate takes it as constant, and one correction evaluates it at the points.
import { Record, allFinite, initialTorque, normalizedTorque } from "./equations.js";
import { leqt1f } from "./linear-solver.js";
import { UNKNOWNS, noteAll } from "./trace.js";

const LETTERS = ["F", "G", "H", "X", "Y", "Z"];
const TORQUES = ["M1", "M2", "M3"];

// Run a program whose collocation points in a step are `pointsOf(dt)`. `rates` gets the torques at
// the beginning and at the points, the index k of one of them, and the unknowns there. `trace` is a
// Trace or null.
export function march(scene, listing, pointsOf, rates, trace = null) {
  const { step_size: h, steps } = scene.run;
  let dt = h;
  let time = 0;
  let state = [...scene.initial.omega, 0, 0, 0];
  const record = new Record();
  const first = listing.has("initial-torque") ? initialTorque(scene) : null;

  for (let step = 0; step < steps; step++) {
    const begin = step * h;
    time = time + dt;
    const points = pointsOf(dt);
    let torques;
    if (step === 0 && first !== null) {
      torques = [first, ...points.map(() => first)];
    } else if (listing.has("torque-held")) {
      const held = normalizedTorque(scene, time);
      torques = [held, ...points.map(() => held)];
    } else {
      torques = [0, ...points].map((t) => normalizedTorque(scene, begin + t));
    }
    let ier;
    const note = trace?.recorder(step + 1) ?? null;
    if (note) noteStart(note, time, points, h, state);
    [state, ier] = interval(state, points, h, (k, x) => rates(torques, k, x), note, torques);
    if (!allFinite(state.slice(0, 3))) return record.trajectory("overflow");
    record.add(time, state.slice(0, 3), state.slice(3), ier);
    if (listing.has("dt-accumulates")) dt = dt + h;
    if (note) noteEnd(note, state, dt);
  }
  return record.trajectory();
}

// Return all unknowns at `end`, and IER of the second solution. The collocation points and the end
// are in s from the interval's beginning. `note` records the values unless it is null.
function interval(start, points, end, rates, note, torques) {
  const constant = rates(0, start);
  const [estimate, first] = fit(points, points.map(() => constant));
  const inside = points.map((t) => values(start, estimate, t));
  const atPoints = inside.map((x, k) => rates(k + 1, x));
  const [corrected, ier] = fit(points, atPoints);
  const result = values(start, corrected, end);
  if (note) {
    noteAll(note, TORQUES, torques[0]);
    noteAll(note, LETTERS.map((letter) => `${letter}1`), constant);
    noteSystem(note, points, points.map(() => constant));
    noteSolution(note, estimate, first);
    inside.forEach((x, k) => noteAll(note, unknownsAt(k + 2), x));
    atPoints.forEach((slopes, k) => noteSlopes(note, k + 2, torques[k + 1], slopes));
    noteSystem(note, points, atPoints);
    noteSolution(note, corrected, ier);
    noteAll(note, unknownsAt(points.length + 2), result);
  }
  return [result, ier];
}

// Return the coefficients c1, c2, ... of every unknown whose derivative equals `rates` (eq. 36),
// and IER.
function fit(points, rates) {
  const byUnknown = rates[0].map((_, unknown) => rates.map((at) => at[unknown]));
  return leqt1f(collocationMatrix(points), byUnknown);
}

// Return the derivatives of t, t^2, ... at every point, a row for each point (eq. 36).
function collocationMatrix(points) {
  return points.map((t) =>
    [1, 2 * t, 3 * (t * t), 4 * (t * t * t)].slice(0, points.length),
  );
}

// Return x(0) + c1 t + c2 t^2 + ... for every unknown (eq. 34), added in this order.
function values(start, coefficients, t) {
  const t2 = t * t;
  const powers = [t, t2, t2 * t, t2 * t2];
  return start.map((x, unknown) => {
    let total = x;
    coefficients[unknown].forEach((c, k) => {
      total = total + c * powers[k];
    });
    return total;
  });
}

// Return the names of the unknowns at a point, as in U1(2); point 1 is the interval's beginning.
function unknownsAt(point) {
  return UNKNOWNS.map((name) => `${name}(${point})`);
}

function noteStart(note, time, points, end, state) {
  noteAll(note, unknownsAt(1).map((name) => `before ${name}`), state);
  note("TIME", time);
  [...points, end].forEach((t, k) => note(`T${k + 1}`, t));
  points.forEach((t, k) => points.forEach(() => note(`T(${k + 2})`, t)));
}

// Record the slopes at a point under the names of both decks: F2 in the two-term deck is F(2) in the
// four-term deck.
function noteSlopes(note, point, torque, slopes) {
  noteAll(note, TORQUES, torque);
  noteAll(note, LETTERS.map((letter) => `${letter}${point}`), slopes);
  noteAll(note, LETTERS.map((letter) => `${letter}(${point})`), slopes);
}

// Record the matrix and the right-hand sides of one solution.
function noteSystem(note, points, slopes) {
  collocationMatrix(points).forEach((row, k) =>
    row.forEach((value, power) => note(`A(${k + 1},${power + 1})`, value)),
  );
  slopes.forEach((slope, k) =>
    slope.forEach((value, unknown) => note(`B(${k + 1},${unknown + 1})`, value)),
  );
}

// Record the solution of LEQT1F, which overwrites the right-hand sides.
function noteSolution(note, coefficients, ier) {
  note("IER", ier);
  coefficients.forEach((column, unknown) =>
    column.forEach((value, k) => note(`solved B(${k + 1},${unknown + 1})`, value)),
  );
}

function noteEnd(note, state, dt) {
  noteAll(note, unknownsAt(1), state);
  note("DT", dt);
}
