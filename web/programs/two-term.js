// Two-term collocation: the first program of the appendix, Jacobs 1982, IV.2.
//
// The residual is zero at one third and two thirds of the interval. There is no stop test.
import { march } from "./collocation.js";
import { accelerations, eulerCoefficients, omegaRate, velocityRate } from "./equations.js";

// A collocation program has no stop test, so that its constant and its switch have no effect here.
export function run(scene, listing, _lipschitz, _mayStop, trace = null) {
  const [a, b, c] = eulerCoefficients(scene);
  const unsetC1 = 0;
  const acceleration = accelerations(scene, listing);

  const rates = (torques, k, x) => {
    let coefficients = [a, b, c];
    let forces = acceleration;
    if (k === 0 && listing.has("c1-for-c")) coefficients = [a, b, unsetC1];
    if (k === 2 && listing.has("x3-reads-acl2")) {
      forces = [acceleration[1], acceleration[1], acceleration[2]];
    }
    const u = x.slice(0, 3);
    const v = x.slice(3);
    return [...omegaRate(coefficients, torques[k], u), ...velocityRate(forces, u, v)];
  };

  return march(scene, listing, (dt) => [dt / 3, (2 * dt) / 3], rates, trace);
}
