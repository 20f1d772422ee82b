// Code that the programs share: right-hand sides, torque, and the record of a run.
import { cosine, sine } from "./circular.js";

// Return A, B, C of equations 13-15, without unit.
export function eulerCoefficients(scene) {
  if (scene.body.coefficients) return scene.body.coefficients;
  const [first, second, third] = scene.body.moments;
  return [(second - third) / first, (third - first) / second, (first - second) / third];
}

// Return F, G, H of equations 16-18 at the angular velocity u (rad/s2).
export function omegaRate([a, b, c], m, u) {
  return [m[0] + a * u[1] * u[2], m[1] + b * u[0] * u[2], m[2] + c * u[0] * u[1]];
}

// Return F/m - omega x V in body axes (m/s2).
export function velocityRate(acceleration, u, v) {
  return [
    acceleration[0] + v[1] * u[2] - v[2] * u[1],
    acceleration[1] + v[2] * u[0] - v[0] * u[2],
    acceleration[2] + v[0] * u[1] - v[1] * u[0],
  ];
}

// Return force over mass along each axis (m/s2). A corrected program has one mass, the first.
export function accelerations(scene, listing) {
  const massAlong = (axis) => scene.masses[listing.has("three-masses") ? axis : 0];
  return scene.forces.map((force, axis) => force / massAlong(axis));
}

// Return the torque over moment that Table 1 specifies initially (1/s2), or null if it specifies
// none. By the conjecture `initial-torque` it acts over the first step.
export function initialTorque(scene) {
  const { moments } = scene.body;
  if (!scene.initial_torque || !moments) return null;
  return scene.initial_torque.map((n, axis) => n / moments[axis]);
}

// Return M = N / I at `time` (1/s2).
export function normalizedTorque(scene, time) {
  const { moments } = scene.body;
  const torque = torqueAt(scene.torque, time);
  return moments ? torque.map((n, axis) => n / moments[axis]) : torque;
}

// Return N at `time` (s); its terms are added in the order of the definition.
function torqueAt(law, time) {
  if (!varies(law)) return law.constant;
  const torque = law.constant.map((constant, axis) => constant + law.rate[axis] * time);
  const add = (waves, circular) => {
    for (const { amplitude, frequency } of waves) {
      const value = circular(frequency * time);
      for (let axis = 0; axis < 3; axis++) torque[axis] += amplitude[axis] * value;
    }
  };
  add(law.sines, sine);
  add(law.cosines, cosine);
  return torque;
}

function varies(law) {
  const amplitudes = [...law.sines, ...law.cosines].map((wave) => wave.amplitude);
  return [law.rate, ...amplitudes].some((values) => values.some((value) => value !== 0));
}

export function allFinite(values) {
  return values.every(Number.isFinite);
}

// The rows of a run as written to TAPE5: TIME (s), U1 to U3 (rad/s), V1 to V3 (m/s).
export class Record {
  constructor() {
    this.rows = [];
    this.ier = [];
  }

  add(time, omega, velocity, ier = 0) {
    this.rows.push([time, ...omega, ...velocity]);
    this.ier.push(ier);
  }

  trajectory(ended = "complete", stop = null, printsIer = true) {
    return { rows: this.rows, ended, stop, ier: printsIer ? this.ier : null };
  }
}
