// The digits that remain of a motion whose start is known to 16 digits.
import { torqueFree } from "./closed-form.js";

// The perturbation of omega, relative to the largest component of omega.
const PERTURBATION = 2 ** -48;
const HALF_ULP = 2 ** -53;

// Return a function of the time (s). It returns { growth, angle, digits }: the error amplification
// of omega from time 0, by finite differences as in fortran/modern/torque_free_differences.f90, the
// angle (rad) by which a relative perturbation of omega turns the body, over the perturbation, and
// the decimal digits that remain of omega and of the attitude.
export function amplification(moments, omega0) {
  const size = Math.max(...omega0.map(Math.abs));
  const motion = torqueFree(moments, omega0);
  const axes = size > 0 ? [0, 1, 2] : [];
  const perturbed = axes.map((axis) => {
    const beside = [...omega0];
    beside[axis] += PERTURBATION * size;
    return { other: torqueFree(moments, beside), step: beside[axis] - omega0[axis] };
  });
  return (t) => {
    const plain = motion.at(t);
    const sums = [0, 0, 0];
    let angle = 0;
    for (const { other, step } of perturbed) {
      const { omega, attitude } = other.at(t);
      omega.forEach((x, i) => (sums[i] += Math.abs(x - plain.omega[i]) / step));
      const moved = Math.hypot(...attitude.map((x, i) => x - plain.attitude[i]));
      angle += (2 * moved * size) / step;
    }
    const growth = Math.max(1, ...sums);
    const remain = (factor) => Math.max(0, -Math.log10(HALF_ULP * Math.max(1, factor)));
    return { growth, angle, digits: [remain(growth), remain(angle)] };
  };
}
