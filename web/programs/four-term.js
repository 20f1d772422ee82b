// Four-term collocation: the second program of the appendix, Jacobs 1982, IV.2.
//
// The residual is zero at .2, .4, .6 and .8 of the interval. There is no stop test.
import { march } from "./collocation.js";
import { accelerations, eulerCoefficients, omegaRate, velocityRate } from "./equations.js";

// A collocation program has no stop test, so that its constant and its switch have no effect here.
export function run(scene, listing, _lipschitz, _mayStop, trace = null) {
  const coefficients = eulerCoefficients(scene);
  const acceleration = accelerations(scene, listing);

  const rates = (torques, k, x) => {
    const u = x.slice(0, 3);
    const v = x.slice(3);
    return [...omegaRate(coefficients, torques[k], u), ...velocityRate(acceleration, u, v)];
  };

  return march(scene, listing, (dt) => [dt * 0.2, dt * 0.4, dt * 0.6, dt * 0.8], rates, trace);
}
