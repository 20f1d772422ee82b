// Collocation as in IV.2: the loop over the steps of the two programs, and one interval.
//
// Every unknown is a polynomial x(0) + c1 t + c2 t^2 + ... (eq. 34) whose derivative equals the
// right-hand side at as many points as there are terms (eq. 36). The right-hand side depends on the
// unknowns: a first estimate takes it as constant, and one correction evaluates it at the points.
import { Record, allFinite, initialTorque, normalizedTorque } from "./equations.js";
import { leqt1f } from "./linear-solver.js";

// Run a program whose collocation points in a step are `pointsOf(dt)`. `rates` gets the torques at
// the beginning and at the points, the index k of one of them, and the unknowns there.
export function march(scene, listing, pointsOf, rates) {
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
    [state, ier] = interval(state, points, h, (k, x) => rates(torques, k, x));
    if (!allFinite(state.slice(0, 3))) return record.trajectory("overflow");
    record.add(time, state.slice(0, 3), state.slice(3), ier);
    if (listing.has("dt-accumulates")) dt = dt + h;
  }
  return record.trajectory();
}

// Return all unknowns at `end`, and IER of the second solution. The collocation points and the end
// are in s from the interval's beginning.
function interval(start, points, end, rates) {
  const constant = rates(0, start);
  const [estimate] = fit(points, points.map(() => constant));
  const atPoints = points.map((t, k) => rates(k + 1, values(start, estimate, t)));
  const [corrected, ier] = fit(points, atPoints);
  return [values(start, corrected, end), ier];
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
