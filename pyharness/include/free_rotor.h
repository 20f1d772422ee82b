/* Torque-free motion of a rigid body in closed form: angular velocity and attitude. C99 and C++.

   Copy this one file. It needs a mathematical library and nothing else: no allocation, no static
   state, no locale, no error number that it reads. Two threads may use one prepared rotor.

     free_rotor_prepare(&rotor, moments, omega0, q0)  compute all that does not depend on the time
     free_rotor_at(&rotor, t, omega, q)               state at the time t, before or after 0
     free_rotor_step(moments, dt, omega, q)           replace a state by the state dt later
     free_rotor_step_compensated(moments, dt, omega, q, rest)
                                                      the same, with the rounding errors kept

   The same names with the suffix f have binary32 (float) arguments.

   moments  principal moments of inertia I1, I2, I3 in any unit; above 0. The moments need not satisfy
            the triangle inequality.
   omega    angular velocity about the principal axes of the body, rad/s.
   q        unit quaternion from body to space, scalar first: v_space = q v_body q*, and
            q' = q (0, omega)/2. An initial q of any norm but 0 is normalised.
   t, dt    time, s; of either sign.

   The equations are I1 omega1' = (I2 - I3) omega2 omega3 and so on, and the one for q'. Every
   function returns one of the codes below. After any code but FREE_ROTOR_OK the results are
   unchanged, and neither a NaN nor an infinity is ever written.

   free_rotor_at: neither run time nor error depends on t, apart from rounding of the inputs. Use it for
   as long as no torque acts. free_rotor_step knows only the last state, so that its rounding errors
   add up as a random walk. With `rest`, an array of seven numbers that is 0 at first, it keeps the
   part of the state that does not fit into omega and q. Set it to 0 when you change omega or q.

   Range: the largest moment is at most 2**99 times the smallest. A component of the initial omega below
   1e-90 of the largest counts as 0, but near the unstable middle axis it is kept, and below about
   1e-120 refused. |phase| is at most 1e15 rad, in binary32 8e6 rad.

   Compile without -ffast-math, which deletes compensated sums. Methods: theta functions, Landen's
   transformation and the arithmetic-geometric mean (docs/explanation/attitude.md of pyharness).

   This file includes itself: once for binary64, once for binary32. MIT licence. */
#ifndef FREE_ROTOR_H
#define FREE_ROTOR_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>

#ifdef __FAST_MATH__
#error "free_rotor.h: compile without -ffast-math; it deletes compensated sums"
#endif
/* 16 concerns only numbers of 16 bits. */
#if defined(__FLT_EVAL_METHOD__) && __FLT_EVAL_METHOD__ != 0 && __FLT_EVAL_METHOD__ != 16
#error "free_rotor.h: intermediate results have more digits; on x86 compile with -msse2 -mfpmath=sse"
#endif

enum {
  FREE_ROTOR_OK = 0,
  FREE_ROTOR_INVALID = 1,  /* not finite, a moment that is not above 0, or a quaternion 0 */
  FREE_ROTOR_RANGE = 2,    /* outside the range that is stated above */
  FREE_ROTOR_PHASE = 3,    /* the time is so long that the phase has no correct digit */
  FREE_ROTOR_OVERFLOW = 4  /* a component of omega is larger than the largest number */
};

/* How the theta functions are summed. */
enum { FR_TRIGONOMETRIC = 1, FR_HYPERBOLIC = 2, FR_SEPARATRIX = 3 };

#if defined(__GNUC__)
#define FR_FUNCTION static inline __attribute__((unused))
#else
#define FR_FUNCTION static inline
#endif

/* Whether fma is an instruction. */
#if defined(FP_FAST_FMA) || defined(__FMA__) || defined(__aarch64__)
#define FR_FMA 1
#else
#define FR_FMA 0
#endif

#ifdef __cplusplus
#define FR_ZERO {}
#else
#define FR_ZERO {0}
#endif

#define FR_ORDERS 30    /* terms of a Taylor step; 28 at the most are used */
#define FR_LEVELS 16    /* of the arithmetic-geometric mean; a modulus of 1e-120 needs 13 */

#define FR_PART 64
#define FR_REAL double
#define FR_(name) name
#define FR_PICK(binary64, binary32) (binary64)
#include "free_rotor.h"
#undef FR_PART
#undef FR_REAL
#undef FR_
#undef FR_PICK

#define FR_PART 32
#define FR_REAL float
#define FR_(name) name##f
#define FR_PICK(binary64, binary32) (binary32)
#include "free_rotor.h"
#undef FR_PART
#undef FR_REAL
#undef FR_
#undef FR_PICK

/* ---- Preparation, in binary64 for both. A pair is a number and its rounding error. ---- */

typedef struct { double high, low; } fr_pair;

FR_FUNCTION fr_pair fr_of(double x) { fr_pair y; y.high = x; y.low = 0.0; return y; }

FR_FUNCTION fr_pair fr_times(double x, double y)
{
  fr_pair found;
  fr_two_product(x, y, &found.high, &found.low);
  return found;
}

FR_FUNCTION fr_pair fr_less(double x, double y)
{
  fr_pair found;
  fr_two_sum(x, -y, &found.high, &found.low);
  return found;
}

FR_FUNCTION fr_pair fr_negative(fr_pair x) { x.high = -x.high; x.low = -x.low; return x; }

FR_FUNCTION fr_pair fr_absolute(fr_pair x) { return x.high < 0.0 ? fr_negative(x) : x; }

FR_FUNCTION fr_pair fr_add(fr_pair x, fr_pair y)
{
  double total, rest;
  fr_pair found;
  fr_two_sum(x.high, y.high, &total, &rest);
  rest += x.low + y.low;
  found.high = total + rest;  /* the high parts may have cancelled */
  found.low = rest - (found.high - total);
  return found;
}

FR_FUNCTION fr_pair fr_subtract(fr_pair x, fr_pair y) { return fr_add(x, fr_negative(y)); }

FR_FUNCTION fr_pair fr_multiply(fr_pair x, fr_pair y)
{
  fr_pair found = fr_times(x.high, y.high);
  found.low += x.high * y.low + x.low * y.high;
  return found;
}

FR_FUNCTION fr_pair fr_scale(fr_pair x, double factor)
{
  fr_pair found = fr_times(x.high, factor);
  found.low += x.low * factor;
  return found;
}

FR_FUNCTION fr_pair fr_divide(fr_pair x, fr_pair y)
{
  fr_pair found, product;
  found.high = x.high / y.high;
  product = fr_times(found.high, y.high);
  found.low = ((x.high - product.high) + ((x.low - product.low) - found.high * y.low)) / y.high;
  return found;
}

FR_FUNCTION fr_pair fr_root(fr_pair x)
{
  fr_pair found, square;
  found.high = sqrt(x.high);
  square = fr_times(found.high, found.high);
  found.low = ((x.high - square.high) + (x.low - square.low)) / (found.high + found.high);
  return found;
}

/* Multiply a sum of three numbers, each the rounding error of the one before, by y. */
FR_FUNCTION void fr_longer(double x[3], double y)
{
  double first, middle, rest, left;
  const double third = x[2] * y;
  fr_two_product(x[1], y, &middle, &rest);
  fr_two_product(x[0], y, &x[0], &first);
  fr_two_sum(first, middle, &x[1], &left);
  x[2] = left + (rest + third);
}

/* Divide x by the power of two that brings its largest element into [1/2, 1), if that is above
   `large` or below 1/large; return the exponent. */
FR_FUNCTION int fr_bring_near_one(double *x, int n, double large)
{
  double largest = 0.0;
  int i, power = 0;
  for (i = 0; i < n; i++)
    if (fabs(x[i]) > largest) largest = fabs(x[i]);
  if (!(largest > 0.0) || (largest <= large && largest >= 1.0 / large)) return 0;
  (void)frexp(largest, &power);
  for (i = 0; i < n; i++) x[i] = ldexp(x[i], -power);
  return power;
}

/* Reduce sn, cn, dn of a phase to the sine and cosine that remain when Landen's transformations have
   reduced the modulus to 0. Every sum has only positive terms. s and c may have a common factor. */
FR_FUNCTION void fr_descend(double comodulus, double *s, double *c, double *delta)
{
  double a = 1.0, b = comodulus;
  int n;
  for (n = 0; n < FR_LEVELS; n++) {
    const double mean = 0.5 * (a + b), twice = 2.0 / (1.0 + *delta);
    *delta = sqrt(0.5 * twice * (b + a * *delta) / mean);
    *s = *s * twice * mean / a;
    *c = *c * twice / *delta;
    if (fabs(a - b) <= 4e-9 * a) break;
    b = sqrt(a * b);
    a = mean;
  }
}

/* Compute the weights of the series in sines and cosines. `square` is the square of the nome, and
   `over_pole` is it over pole[0]. */
FR_FUNCTION void fr_take_sines(fr_theta *theta, const double pole[2], double comodulus, double square,
                               double over_pole)
{
  const double q = sqrt(square), square2 = square * square, square3 = square2 * square,
               square4 = square2 * square2, square6 = square3 * square3;
  double s = 1.0, c = sqrt(1.0 + pole[0]), delta = sqrt(1.0 + pole[1]);
  double up, down, theta2, theta3, theta4;
  theta->nome = q;
  theta->powers[0] = 2.0 * q;
  theta->powers[1] = 2.0 * square2;
  theta->powers[2] = 2.0 * q * square4;
  theta->powers[3] = 2.0 * square4 * square4;
  theta->even[0] = 1.0 - square * (1.0 - square2 * (1.0 - square3));
  theta->even[1] = 2.0 * square3 * (1.0 - square3);
  theta->odd[0] = 2.0 * square * (1.0 - square2 * (1.0 - square3));
  theta->odd[1] = 2.0 * square6;
  theta2 = 1.0 + square * (1.0 + square2 * (1.0 + square3));
  up = 1.0 + (theta->powers[1] + theta->powers[3]);
  down = theta->powers[0] + theta->powers[2];
  theta3 = up + down;
  theta4 = up - down;
  theta->size[0] = theta4 / theta2;
  theta->size[1] = theta3 / theta2;
  theta->size[2] = theta4 / theta3;
  fr_descend(comodulus, &s, &c, &delta);
  c = (s + c) * (s + c);
  up = over_pole * c;
  down = square * pole[0] / c;
  theta->c[0] = 1.0;
  theta->c[1] = -(up + down);
  theta->s[1] = -(up - down);
  theta->c[2] = square2 * (up * up + down * down);
  theta->s[2] = square2 * (up * up - down * down);
  theta->c[3] = -square6 * (up * up * up + down * down * down);
  theta->s[3] = -square6 * (up * up * up - down * down * down);
}

/* Compute the weights of the series in exponentials. `square` is the square of the nome. */
FR_FUNCTION void fr_take_exponentials(fr_theta *theta, const double pole[2], double k, double square)
{
  const double square2 = square * square, square4 = square2 * square2;
  double s = 1.0, c = sqrt(pole[0]), delta = c * sqrt((1.0 + pole[1]) / (1.0 + pole[0]));
  double theta2, theta3, theta4, e, power = 1.0, step;
  int n;
  theta->nome = sqrt(square);
  theta->powers[0] = square;
  theta->powers[1] = square2;
  theta->powers[2] = square4;
  theta->powers[3] = square4 * square2;
  theta2 = 1.0 + square2 * (1.0 + square4);
  theta3 = 1.0 + 2.0 * (square + square4);
  theta4 = 1.0 - 2.0 * (square - square4);
  theta->size[0] = 2.0 * theta2 / theta4;
  theta->size[1] = theta3 / theta4;
  theta->size[2] = 2.0 * theta2 / theta3;
  fr_descend(k, &s, &c, &delta);
  e = 0.5 * atan2(s, c);
  step = theta->nome;
  for (n = 0; n < 5; n++) {
    theta->c[n] = power * cos((2 * n + 1) * e);
    theta->s[n] = power * sin((2 * n + 1) * e);
    power *= step;
    step *= square;
  }
  if (theta->kind == FR_HYPERBOLIC) theta->drift = 2.0 * e / 3.141592653589793;
}

/* Choose the series that converges faster, for k**2 = pole[0] pole[1] and k'. The integral has
   1 + pole[0] sn**2 in its denominator, and `pole[0]` may be 0. */
FR_FUNCTION void fr_take_series(fr_theta *theta, const double pole[2], double k, double comodulus)
{
  const double balanced = 0.1085;  /* nome at which K = 2**(1/2) K' */
  double next, square, over_pole;
  if (!(comodulus > 0.0)) {
    theta->kind = FR_SEPARATRIX;
    fr_take_exponentials(theta, pole, 1.0, 0.0);
    return;
  }
  next = 2.0 * sqrt(comodulus) / (1.0 + comodulus);
  over_pole = (1.0 + comodulus) * (1.0 + comodulus);
  over_pole = 0.5 * pole[0] * pole[1] * pole[1] / (over_pole * over_pole)
              / ((1.0 + next) * (1.0 + sqrt(next)) * (1.0 + sqrt(next)));
  square = over_pole * pole[0];
  if (square < 0.015) {
    next = square * square * square * square;
    next = 1.0 + next * (2.0 + 15.0 * next);
    square *= next;
    over_pole *= next;
  }
  if (square < balanced * balanced) {
    theta->kind = FR_TRIGONOMETRIC;
    fr_take_sines(theta, pole, comodulus, square, over_pole);
  } else {
    theta->kind = FR_HYPERBOLIC;
    square = 0.5 * comodulus * comodulus / ((1.0 + k) * (1.0 + sqrt(k)) * (1.0 + sqrt(k)));
    next = square * square * square * square;
    square *= 1.0 + next * (2.0 + 15.0 * next);
    fr_take_exponentials(theta, pole, k, square);
  }
}

/* Compute the phase that has the values cn, sn, dn, and its rounding error, by the difference that
   the series then show; near the separatrix it counts. `slope` is the phase over u. */
FR_FUNCTION void fr_take_start(free_rotor *rotor, double k, double comodulus, double slope, double cn,
                               double sn, double dn)
{
  double found[3], s = sn, c = cn, delta = dn, part;
  if (rotor->theta.kind == FR_SEPARATRIX) {
    rotor->start[0] = copysign(0.5 * log((1.0 + fabs(sn)) / dn), sn);
  } else {
    fr_descend(comodulus, &s, &c, &delta);
    rotor->start[0] = atan2(s, c);
  }
  fr_elliptic(&rotor->theta, rotor->start[0], 0.0, found, &c, &s, &part);
  rotor->start[1] = slope * (sn * found[0] * found[2] - found[1] * cn * dn)
                    / (dn * dn + (k * sn * cn) * (k * sn * cn));
}

/* Differences that determine an orbit, without sign: d[0] = |I2 - I3| and so on, and
   e[0] = d[1] I1 omega1**2 + d[0] I2 omega2**2 and so on. */
typedef struct { fr_pair d[3], e[3], energy[3]; } fr_gaps;

/* Compute I3 omega3**2 |I2 - I3| - I1 omega1**2 |I1 - I2| near the separatrix, where nearly all of it
   cancels, from products of three numbers each. */
FR_FUNCTION fr_pair fr_narrow_gap(const double moment[3], const double w[3], const fr_gaps *gaps)
{
  double x[3] = {0.0, 0.0, 0.0}, y[3] = {0.0, 0.0, 0.0};
  fr_pair gap;
  x[0] = w[2];
  fr_longer(x, w[2]);
  fr_longer(x, moment[2]);
  fr_longer(x, gaps->d[0].high);
  y[0] = w[0];
  fr_longer(y, w[0]);
  fr_longer(y, moment[0]);
  fr_longer(y, gaps->d[2].high);
  gap = fr_add(fr_add(fr_less(x[0], y[0]), fr_less(x[1], y[1])), fr_less(x[2], y[2]));
  return fr_add(gap, fr_subtract(fr_scale(gaps->energy[2], gaps->d[0].low),
                                 fr_scale(gaps->energy[0], gaps->d[2].low)));
}

/* Compute the mean rates. The rate of the phase comes from the arithmetic-geometric mean, and that of
   the rotation about the angular momentum, an integral of the third kind, from the sum that
   accompanies the mean (Gauss). */
FR_FUNCTION void fr_take_rates(free_rotor *rotor, const double moment[3], fr_pair momentum,
                               fr_pair inertia, fr_pair larger, fr_pair smaller, const fr_gaps *gaps,
                               const double pole[2])
{
  const bool by_moments = pole[0] < pole[1];  /* the pole that is nearer to 0 */
  fr_pair a = larger, g = smaller, p, total = fr_of(1.0), share = total, part, mean = a, rate;
  double half;
  int n;
  if (by_moments)
    p = fr_root(fr_divide(fr_multiply(fr_multiply(gaps->d[1], gaps->e[2]), fr_of(moment[1])),
                          fr_of(moment[0])));
  else
    p = fr_multiply(momentum,
                    fr_root(fr_divide(fr_multiply(gaps->d[1], gaps->d[0]), fr_of(moment[2]))));
  for (n = 0; n < FR_LEVELS; n++) {
    mean = fr_scale(fr_add(a, g), 0.5);
    part = fr_multiply(a, g);
    a = fr_divide(part, p);
    share = fr_scale(fr_multiply(share, fr_divide(fr_subtract(p, a), fr_add(p, a))), 0.5);
    total = fr_add(total, share);
    if (fabs(share.high) <= 1e-17) break;
    p = fr_scale(fr_add(p, a), 0.5);
    a = mean;
    g = fr_root(part);
  }
  /* One more level would subtract the following term. */
  half = (mean.high - g.high) + (mean.low - g.low);
  mean.low -= half * half / (4.0 * mean.high);
  mean = fr_divide(mean, inertia);
  rotor->frequency[0] = mean.high;
  rotor->frequency[1] = mean.low;
  if (by_moments) {
    part = fr_subtract(fr_of(2.0 * moment[1]), fr_scale(fr_multiply(gaps->d[2], total), rotor->sense));
    rate = fr_divide(fr_multiply(momentum, part), fr_scale(fr_times(moment[0], moment[1]), 4.0));
    rate = fr_subtract(rate, fr_scale(mean, 0.5 * rotor->sense));
  } else {
    part = fr_add(fr_scale(fr_multiply(momentum, momentum), 2.0),
                  fr_scale(fr_multiply(gaps->e[0], total), rotor->sense));
    rate = fr_divide(part, fr_scale(momentum, 4.0 * moment[2]));
  }
  rotor->half_rate[0] = rate.high;
  rotor->half_rate[1] = rate.low;
}

/* Compute K/(2 K'): half the arithmetic-geometric mean of 1 and k, over that of 1 and k'. */
FR_FUNCTION void fr_take_ratio(fr_theta *theta, fr_pair a, fr_pair g, fr_pair other)
{
  fr_pair mean = a;
  int n;
  for (n = 0; n < FR_LEVELS; n++) {
    mean = fr_scale(fr_add(a, g), 0.5);
    if (fabs(a.high - g.high) <= 1e-10 * a.high) break;
    g = fr_root(fr_multiply(a, g));
    a = mean;
  }
  mean = fr_divide(fr_scale(mean, 0.5), other);
  theta->ratio[0] = mean.high;
  theta->ratio[1] = mean.low;
}

/* Compute rates, phase and theta series of a motion that is not steady. */
FR_FUNCTION void fr_prepare_orbit(free_rotor *rotor, const double moment[3], const double w[3],
                                  const fr_gaps *gaps)
{
  const double e1 = gaps->e[0].high, e3 = gaps->e[2].high;
  const fr_pair *energy = gaps->energy;
  double largest[3], pole[2], k, comodulus = 0.0, slope;
  fr_pair momentum = fr_add(fr_add(fr_scale(energy[0], moment[0]), fr_scale(energy[1], moment[1])),
                            fr_scale(energy[2], moment[2]));
  fr_pair inertia = fr_root(fr_scale(fr_times(moment[0], moment[1]), moment[2]));
  fr_pair larger = fr_root(fr_multiply(gaps->d[0], gaps->e[2])), smaller, rate;
  int i;
  momentum = fr_root(momentum);
  /* (I2 - I1) I3/((I3 - I2) I1) and I1 E1/(I3 E3), whose product is k**2. */
  pole[0] = gaps->d[2].high * moment[2] / (gaps->d[0].high * moment[0]);
  pole[1] = e1 * moment[0] / (e3 * moment[2]);
  k = sqrt(pole[0] * pole[1]);
  largest[0] = sqrt(e1 / (moment[0] * gaps->d[1].high));
  largest[1] = sqrt(e1 / (moment[1] * gaps->d[0].high));
  largest[2] = sqrt(e3 / (moment[2] * gaps->d[1].high));
  rotor->sense = moment[2] < moment[0] ? -1.0 : 1.0;
  for (i = 0; i < 3; i++) rotor->direction[i] = moment[i] / momentum.high;
  if (gaps->e[1].high > 0.0) {
    smaller = fr_root(fr_multiply(gaps->d[1], gaps->e[1]));
    comodulus = smaller.high / larger.high;
    fr_take_rates(rotor, moment, momentum, inertia, larger, smaller, gaps, pole);
  } else {
    rate = fr_scale(fr_divide(larger, inertia), 0.5);
    rotor->frequency[0] = rate.high;
    rotor->frequency[1] = rate.low;
    rate = fr_scale(fr_divide(momentum, fr_of(moment[1])), 0.5);
    rotor->half_rate[0] = rate.high;
    rotor->half_rate[1] = rate.low;
  }
  rate.high = rotor->frequency[0];
  rate.low = rotor->frequency[1];
  slope = rate.high * inertia.high / larger.high;
  fr_take_series(&rotor->theta, pole, k, comodulus);
  if (rotor->theta.kind == FR_HYPERBOLIC)
    fr_take_ratio(&rotor->theta, larger, fr_root(fr_multiply(gaps->d[2], gaps->e[0])),
                  fr_multiply(rate, inertia));
  if (e1 > 1e-240 * e3)
    fr_take_start(rotor, k, comodulus, slope, w[0] / largest[0], rotor->sense * w[1] / largest[1],
                  w[2] / largest[2]);
  else  /* about axis 3, except for a negligible perturbation */
    largest[0] = largest[1] = 0.0;
  largest[1] *= rotor->sense;
  for (i = 0; i < 3; i++) rotor->theta.size[i] *= largest[i];
}

/* Order the axes by their moments, then point axes 3 and 1 along omega, and axis 2 so that they are
   right-handed. Axis 3 is that about which omega keeps its sign. Return whether there is a form. */
FR_FUNCTION bool fr_take_axes(free_rotor *rotor, double moment[3], double w[3], fr_gaps *gaps)
{
  const double given[3] = {moment[0], moment[1], moment[2]}, rates[3] = {w[0], w[1], w[2]};
  int low = 0, high, i;
  bool turned = false;
  if (given[1] < given[low]) low = 1;
  if (given[2] < given[low]) low = 2;
  high = (low + 1) % 3;
  if (given[3 - low - high] >= given[high]) high = 3 - low - high;
  rotor->axes[0] = high;
  rotor->axes[1] = 3 - low - high;
  rotor->axes[2] = low;
  for (;;) {
    for (i = 0; i < 3; i++) {
      moment[i] = given[rotor->axes[i]];
      w[i] = rates[rotor->axes[i]];
      gaps->energy[i] = fr_scale(fr_times(w[i], w[i]), moment[i]);
    }
    gaps->d[0] = fr_absolute(fr_less(moment[1], moment[2]));
    gaps->d[1] = fr_absolute(fr_less(moment[0], moment[2]));
    gaps->d[2] = fr_absolute(fr_less(moment[0], moment[1]));
    gaps->e[1] = fr_subtract(fr_multiply(gaps->energy[2], gaps->d[0]),
                             fr_multiply(gaps->energy[0], gaps->d[2]));
    if (fabs(gaps->e[1].high) <= 1e-4 * gaps->energy[2].high * gaps->d[0].high)
      gaps->e[1] = fr_narrow_gap(moment, w, gaps);
    if (turned || !(gaps->e[1].high < 0.0)) break;
    turned = true;  /* omega about the other extreme axis keeps its sign */
    i = rotor->axes[0];
    rotor->axes[0] = rotor->axes[2];
    rotor->axes[2] = i;
  }
  if (gaps->e[1].high < 0.0) gaps->e[1] = fr_of(0.0);
  gaps->e[0] = fr_add(fr_multiply(gaps->energy[0], gaps->d[1]),
                      fr_multiply(gaps->energy[1], gaps->d[0]));
  gaps->e[2] = fr_add(fr_multiply(gaps->energy[2], gaps->d[1]),
                      fr_multiply(gaps->energy[1], gaps->d[2]));
  for (i = 0; i < 3; i += 2) rotor->signs[i] = copysign(1.0, w[i]);
  rotor->signs[1] = rotor->signs[0] * rotor->signs[2];
  if ((rotor->axes[0] + 1) % 3 != rotor->axes[1]) rotor->signs[1] = -rotor->signs[1];
  for (i = 0; i < 3; i++) w[i] *= rotor->signs[i];
  rotor->is_steady = !(gaps->d[0].high * gaps->e[2].high > 0.0)
                     || !(fabs(w[0]) > 0.0 || fabs(w[2]) > 0.0);
  return rotor->is_steady || gaps->energy[2].high * gaps->d[1].high > 1e-240 * gaps->e[2].high;
}

/* Set to 0 the components of omega whose squares could underflow in what follows. They have no effect
   but near the unstable middle axis, where they are kept. */
FR_FUNCTION void fr_drop_faint(const double moment[3], double w[3])
{
  int i, j, k, largest = 0, kept = 0;
  for (i = 1; i < 3; i++)
    if (fabs(w[i]) > fabs(w[largest])) largest = i;
  for (i = 0; i < 3; i++)
    if (fabs(w[i]) > 1e-90 * fabs(w[largest])) kept++;
  j = (largest + 1) % 3;
  k = (largest + 2) % 3;
  if (kept == 1 && (moment[j] < moment[largest]) == (moment[largest] < moment[k])
      && (moment[j] > moment[largest]) == (moment[largest] > moment[k]))
    return;
  for (i = 0; i < 3; i++)
    if (!(fabs(w[i]) > 1e-90 * fabs(w[largest]))) w[i] = 0.0;
}

/* Prepare a rotor; omega and moments are brought near 1 if they differ from it by more than `large`. */
FR_FUNCTION int fr_prepare(free_rotor *rotor, const double moments[3], const double omega0[3],
                           const double q0[4], double large)
{
  static const free_rotor nothing = FR_ZERO;
  double moment[3], w[3], q[4], turn[4] = {1.0, 0.0, 0.0, 0.0}, unused[3];
  fr_gaps gaps;
  fr_pair speed;
  int i;
  *rotor = nothing;
  rotor->status = FREE_ROTOR_INVALID;
  for (i = 0; i < 4; i++) q[i] = q0[i];
  if (!fr_is_state(moments, omega0) || !fr_unit(q)) return rotor->status;
  for (i = 0; i < 3; i++) {
    moment[i] = moments[i];
    w[i] = rotor->omega[i] = omega0[i];
  }
  for (i = 0; i < 4; i++) rotor->q[i] = q[i];
  rotor->status = FREE_ROTOR_RANGE;
  (void)fr_bring_near_one(moment, 3, large);
  rotor->exponent = fr_bring_near_one(w, 3, large);
  for (i = 0; i < 3; i++)
    if (!(moment[i] >= 7.888609052210118e-31)) return rotor->status;
  fr_drop_faint(moment, w);
  if (!fr_take_axes(rotor, moment, w, &gaps)) return rotor->status;
  if (rotor->is_steady) {
    speed = fr_add(fr_add(fr_times(w[0], w[0]), fr_times(w[1], w[1])), fr_times(w[2], w[2]));
    if (speed.high > 0.0) {
      speed = fr_root(speed);
      rotor->half_rate[0] = 0.5 * speed.high;
      rotor->half_rate[1] = 0.5 * speed.low;
      for (i = 0; i < 3; i++) rotor->direction[i] = w[i] / speed.high;
    }
  } else {
    fr_prepare_orbit(rotor, moment, w, &gaps);
    (void)fr_turned(rotor, 0.0, unused, turn);
  }
  /* q at time 0 must be the specified one: q(t) = before turn(t). */
  q[0] = rotor->q[0];
  for (i = 0; i < 3; i++) {
    q[1 + i] = rotor->signs[i] * rotor->q[1 + rotor->axes[i]];
    turn[1 + i] = -turn[1 + i];
  }
  fr_quaternion_product(q, turn, rotor->before);
  rotor->status = FREE_ROTOR_OK;
  return rotor->status;
}

FR_FUNCTION int free_rotor_prepare(free_rotor *rotor, const double moments[3], const double omega0[3],
                                   const double q0[4])
{
  return fr_prepare(rotor, moments, omega0, q0, 1.2676506002282294e30);
}

FR_FUNCTION int free_rotor_preparef(free_rotorf *rotor, const float moments[3], const float omega0[3],
                                    const float q0[4])
{
  static const free_rotorf nothing = FR_ZERO;
  double moment[3], w[3], q[4];
  free_rotor wide;
  int i;
  for (i = 0; i < 3; i++) {
    moment[i] = (double)moments[i];
    w[i] = (double)omega0[i];
  }
  for (i = 0; i < 4; i++) q[i] = (double)q0[i];
  (void)fr_prepare(&wide, moment, w, q, 4.0);
  /* A nome below the smallest binary32 number would make a separatrix of an orbit. */
  if (wide.theta.kind == FR_HYPERBOLIC && wide.theta.nome < 1e-36) wide.status = FREE_ROTOR_RANGE;
  *rotor = nothing;
  rotor->status = wide.status;
  if (wide.status != FREE_ROTOR_OK) return rotor->status;
  rotor->is_steady = wide.is_steady;
  rotor->exponent = wide.exponent;
  rotor->theta.kind = wide.theta.kind;
  for (i = 0; i < 3; i++) rotor->axes[i] = wide.axes[i];
#define FR_NARROW(member, n) \
  for (i = 0; i < (n); i++) rotor->member[i] = (float)wide.member[i]
#define FR_NARROW_PAIR(member) \
  rotor->member[0] = (float)(wide.member[0] + wide.member[1]); \
  rotor->member[1] = (float)((wide.member[0] - (double)rotor->member[0]) + wide.member[1])
  FR_NARROW(signs, 3);
  FR_NARROW(omega, 3);
  FR_NARROW(q, 4);
  FR_NARROW(before, 4);
  FR_NARROW(direction, 3);
  FR_NARROW(theta.size, 3);
  FR_NARROW(theta.powers, 4);
  FR_NARROW(theta.even, 2);
  FR_NARROW(theta.odd, 2);
  FR_NARROW(theta.c, 5);
  FR_NARROW(theta.s, 5);
  FR_NARROW_PAIR(half_rate);
  FR_NARROW_PAIR(frequency);
  FR_NARROW_PAIR(start);
  FR_NARROW_PAIR(theta.ratio);
#undef FR_NARROW
#undef FR_NARROW_PAIR
  rotor->sense = (float)wide.sense;
  rotor->theta.nome = (float)wide.theta.nome;
  rotor->theta.drift = (float)wide.theta.drift;
  return rotor->status;
}

#undef FR_FUNCTION
#undef FR_FMA
#undef FR_ORDERS
#undef FR_LEVELS
#undef FR_ZERO

#elif defined(FR_PART)

/* ---- Once for each precision: evaluation and step. FR_(name) has the suffix f in binary32. ---- */

/* The theta series of sn, cn, dn and of the integral of the third kind, a = arg(C + i S) + drift v. */
typedef struct {
  int kind;
  FR_REAL size[3];         /* factors of cn, sn, dn, with the amplitudes of omega */
  FR_REAL nome, powers[4], even[2], odd[2];
  FR_REAL c[5], s[5];      /* weights of C and S */
  FR_REAL ratio[2], drift; /* x over v, the phases of the two series; a pair */
} FR_(fr_theta);

/* A prepared motion, in axes of its own: axis 2 has the middle moment, omega about axis 3 keeps its
   sign, and the axes are right-handed. The elements are not for use. */
typedef struct {
  int status, exponent;    /* the time's unit is 2**-exponent s */
  bool is_steady;
  int axes[3];             /* axis of the body for each axis of the orbit */
  FR_REAL signs[3];        /* a component of the orbit is this times that of the body */
  FR_REAL omega[3], q[4];  /* at time 0, in axes of the body */
  FR_REAL before[4];       /* q = before turn */
  FR_REAL half_rate[2];    /* of the rotation about L; a pair, as the next two */
  FR_REAL frequency[2];    /* of the phase */
  FR_REAL start[2];        /* phase at time 0 */
  FR_REAL direction[3];    /* times omega it is L/|L|; of a steady omega, omega/|omega| */
  FR_REAL sense;           /* sign of the phase */
  FR_(fr_theta) theta;
} FR_(free_rotor);

FR_FUNCTION int FR_(free_rotor_prepare)(FR_(free_rotor) *rotor, const FR_REAL moments[3],
                                        const FR_REAL omega0[3], const FR_REAL q0[4]);

/* total + rest = x + y, exactly (Knuth). */
FR_FUNCTION void FR_(fr_two_sum)(FR_REAL x, FR_REAL y, FR_REAL *total, FR_REAL *rest)
{
  const FR_REAL sum = x + y, part = sum - x;
  *rest = (x - (sum - part)) + (y - part);
  *total = sum;
}

/* product + rest = x y, exactly if nothing underflows (Dekker). */
FR_FUNCTION void FR_(fr_two_product)(FR_REAL x, FR_REAL y, FR_REAL *product, FR_REAL *rest)
{
  const FR_REAL p = x * y;
#if FR_FMA
  *rest = FR_(fma)(x, y, -p);
#else
  const FR_REAL x_part = FR_PICK(134217729.0, 4097.0F) * x, y_part = FR_PICK(134217729.0, 4097.0F) * y;
  const FR_REAL xh = x_part - (x_part - x), yh = y_part - (y_part - y), xl = x - xh, yl = y - yh;
  *rest = (((xh * yh - p) + xh * yl) + xl * yh) + xl * yl;
#endif
  *product = p;
}

FR_FUNCTION void FR_(fr_sine_cosine)(FR_REAL angle, FR_REAL low, FR_REAL *sine, FR_REAL *cosine)
{
  const FR_REAL s = FR_(sin)(angle), c = FR_(cos)(angle);
  FR_REAL s_low = low, c_low = 1;
  if (!(FR_(fabs)(angle) <= FR_PICK(1e6, 64.0F))) {
    s_low = FR_(sin)(low);
    c_low = FR_(cos)(low);
  }
  *sine = s * c_low + c * s_low;
  *cosine = c * c_low - s * s_low;
}

FR_FUNCTION bool FR_(fr_is_finite)(FR_REAL x)
{
  return FR_(fabs)(x) <= FR_PICK(1.7976931348623157e308, 3.40282347e38F);
}

/* Return whether moments and omega are those of a rotor. */
FR_FUNCTION bool FR_(fr_is_state)(const FR_REAL moments[3], const FR_REAL omega[3])
{
  int i;
  for (i = 0; i < 3; i++)
    if (!(moments[i] > 0) || !FR_(fr_is_finite)(moments[i]) || !FR_(fr_is_finite)(omega[i]))
      return false;
  return true;
}

/* Normalise a quaternion of any norm; return false if it is 0 or not finite. */
FR_FUNCTION bool FR_(fr_unit)(FR_REAL q[4])
{
  FR_REAL largest = 0, norm = 0;
  int i, power;
  for (i = 0; i < 4; i++) {
    if (!FR_(fr_is_finite)(q[i])) return false;
    if (FR_(fabs)(q[i]) > largest) largest = FR_(fabs)(q[i]);
  }
  if (!(largest > 0)) return false;
  (void)FR_(frexp)(largest, &power);
  for (i = 0; i < 4; i++) {
    if (power < -30 || power > 30) q[i] = FR_(ldexp)(q[i], -power);
    norm += q[i] * q[i];
  }
  norm = FR_(sqrt)(norm);
  for (i = 0; i < 4; i++) q[i] /= norm;
  return true;
}

FR_FUNCTION void FR_(fr_quaternion_product)(const FR_REAL p[4], const FR_REAL q[4], FR_REAL r[4])
{
  r[0] = p[0] * q[0] - p[1] * q[1] - (p[2] * q[2] + p[3] * q[3]);
  r[1] = p[0] * q[1] + p[1] * q[0] + (p[2] * q[3] - p[3] * q[2]);
  r[2] = p[0] * q[2] + p[2] * q[0] + (p[3] * q[1] - p[1] * q[3]);
  r[3] = p[0] * q[3] + p[3] * q[0] + (p[1] * q[2] - p[2] * q[1]);
}

/* Sum the series in sines and cosines of the phase. */
FR_FUNCTION void FR_(fr_sum_sines)(const FR_(fr_theta) *theta, FR_REAL phase, FR_REAL low,
                                   FR_REAL f[3], FR_REAL *c, FR_REAL *s)
{
  FR_REAL sine, cosine, c2, c4, c6, c8, s2, s4, s6, even, odd, inverse;
  FR_(fr_sine_cosine)(phase, low, &sine, &cosine);
  s2 = 2 * sine * cosine;
  c2 = 1 - 2 * sine * sine;
  s4 = 2 * s2 * c2;
  c4 = 1 - 2 * s2 * s2;
  s6 = s2 * (1 + 2 * c4);
  c6 = c2 * (2 * c4 - 1);
  c8 = 1 - 2 * s4 * s4;
  even = 1 + (theta->powers[1] * c4 + theta->powers[3] * c8);
  odd = theta->powers[0] * c2 + theta->powers[2] * c6;
  inverse = 1 / (even - odd);
  f[2] = theta->size[2] * ((even + odd) * inverse);
  even = theta->even[0] + theta->even[1] * c4;
  odd = theta->odd[0] * c2 + theta->odd[1] * c6;
  f[0] = theta->size[0] * (cosine * (even + odd) * inverse);
  f[1] = theta->size[1] * (sine * (even - odd) * inverse);
  *c = 1 + (theta->c[1] * c2 + (theta->c[2] * c4 + theta->c[3] * c6));
  *s = theta->s[1] * s2 + (theta->s[2] * s4 + theta->s[3] * s6);
}

/* Sum the series in exponentials of x. Every term that grows with |x| has a factor, a power of the
   nome, that keeps it below 1. */
FR_FUNCTION void FR_(fr_sum_exponentials)(const FR_(fr_theta) *theta, FR_REAL phase, FR_REAL low,
                                          FR_REAL f[3], FR_REAL *c, FR_REAL *s, FR_REAL *part)
{
  const FR_REAL *power = theta->powers, q = theta->nome, q2 = power[0];
  FR_REAL x = phase, x_low = low, sense = 1, v, v_low, product, rest, turns;
  FR_REAL g, g2, g4;      /* exp(-2 |x|), its square and so on */
  FR_REAL h = 0, h2, h4;  /* nome exp(2 |x|), which is 1 at the most */
  FR_REAL even, odd, inverse;
  if (theta->kind == FR_HYPERBOLIC) {
    turns = FR_(round)(x / FR_PICK(3.141592653589793, 3.14159274F));
    FR_(fr_two_product)(turns, FR_PICK(3.141592653589793, 3.14159274F), &product, &rest);
    rest = x_low - rest - turns * FR_PICK(1.2246467991473532e-16, -8.74227766e-8F);
    FR_(fr_two_sum)(x - product, rest, &v, &v_low);
    if (turns - 2 * FR_(floor)(turns / 2) > 0) sense = -1;
    *part = v * theta->drift;
    /* Near the separatrix x is a large part of K, so that it must be a pair. */
    FR_(fr_two_product)(theta->ratio[0], v, &x, &x_low);
    x_low += theta->ratio[1] * v + theta->ratio[0] * v_low;
  }
  g = FR_(fabs)(x);
  if (!(g <= FR_PICK(340.0, 42.0F))) g = FR_PICK(340.0, 42.0F);
  g = FR_(exp)(-2 * g);
  if (g > 0 && FR_(fabs)(x_low) <= 1) g -= 2 * g * (x < 0 ? -x_low : x_low);
  if (q > 0) h = q / g;
  g2 = g * g;
  g4 = g2 * g2;
  h2 = h * h;
  h4 = h2 * h2;
  inverse = 1 / ((1 + g2) + q2 * (h2 + q2 * g4) + power[2] * (h4 + power[1] * (g2 * g4)));
  even = 1 + power[1] * (h4 + power[1] * g4);
  odd = (h2 + q2 * g2) + power[3] * (h2 * h4);
  f[0] = sense * theta->size[0] * (g * (even - odd) * inverse);
  f[2] = theta->size[2] * (g * (even + odd) * inverse);
  f[1] = (1 - g2) - q2 * (h2 - q2 * g4) + power[2] * (h4 - power[1] * (g2 * g4));
  f[1] = sense * theta->size[1] * (f[1] * inverse);
  g4 = q2 * q * g4;
  *c = theta->c[3] * (h * h2 + g4) + theta->c[4] * h4;
  *s = theta->s[3] * (h * h2 - g4) + theta->s[4] * h4;
  g4 = q2 * g * g2;
  g2 = q * g2;
  *c = theta->c[0] * (1 + g) + (theta->c[1] * (h + g2) + (theta->c[2] * (h2 + g4) + *c));
  *s = theta->s[0] * (1 - g) + (theta->s[1] * (h - g2) + (theta->s[2] * (h2 - g4) + *s));
  /* So far everything is for |x|, and s has the opposite sign. */
  if (x < 0)
    f[1] = -f[1];
  else
    *s = -*s;
}

/* Evaluate cn, sn, dn, times the factors in `size`, and the integral: arg(c + i s) + part. */
FR_FUNCTION void FR_(fr_elliptic)(const FR_(fr_theta) *theta, FR_REAL phase, FR_REAL low, FR_REAL f[3],
                                  FR_REAL *c, FR_REAL *s, FR_REAL *part)
{
  *part = 0;
  if (theta->kind == FR_TRIGONOMETRIC)
    FR_(fr_sum_sines)(theta, phase, low, f, c, s);
  else
    FR_(fr_sum_exponentials)(theta, phase, low, f, c, s, part);
}

/* Compute angular velocity and the rotation, in axes of the orbit, at t in units of the orbit.
   Return false if the phase has no digit. */
FR_FUNCTION bool FR_(fr_turned)(const FR_(free_rotor) *rotor, FR_REAL t, FR_REAL w[3], FR_REAL turn[4])
{
  const FR_REAL longest = FR_PICK(1e15, 8e6F);
  FR_REAL angle = 0, angle_low = 0, rest, sine, cosine, c, s, part, phase, phase_low, along, across;
  FR_REAL inverse, m[3];
  int i;
  if (FR_(fabs)(rotor->half_rate[0]) > 0) {
    FR_(fr_two_product)(rotor->half_rate[0], t, &angle, &angle_low);
    angle_low += rotor->half_rate[1] * t;
  }
  if (!(FR_(fabs)(angle) <= longest / 2 && FR_(fabs)(angle_low) <= longest)) return false;
  if (rotor->is_steady) {
    FR_(fr_sine_cosine)(angle, angle_low, &sine, &cosine);
    turn[0] = cosine;
    for (i = 0; i < 3; i++) turn[1 + i] = rotor->direction[i] * sine;
    return true;
  }
  FR_(fr_two_product)(rotor->frequency[0], t, &phase, &phase_low);
  phase_low += rotor->frequency[1] * t;
  if (!(FR_(fabs)(phase) <= longest && FR_(fabs)(phase_low) <= longest)) return false;
  FR_(fr_two_sum)(rotor->start[0], phase, &phase, &rest);
  FR_(fr_elliptic)(&rotor->theta, phase, rest + (phase_low + rotor->start[1]), w, &c, &s, &part);
  FR_(fr_two_sum)(angle, part * rotor->sense, &angle, &rest);
  FR_(fr_sine_cosine)(angle, angle_low + rest, &sine, &cosine);
  for (i = 0; i < 3; i++) m[i] = w[i] * rotor->direction[i];
  s *= rotor->sense;
  inverse = 1 / FR_(sqrt)((c * c + s * s) * (2 + 2 * m[2]));
  along = (cosine * c - sine * s) * inverse;
  across = (sine * c + cosine * s) * inverse;
  turn[0] = along * (1 + m[2]);
  turn[1] = along * m[1] + across * m[0];
  turn[2] = across * m[1] - along * m[0];
  turn[3] = across * (1 + m[2]);
  return true;
}

/* Compute the state at the time t. */
FR_FUNCTION int FR_(free_rotor_at)(const FR_(free_rotor) *rotor, FR_REAL t, FR_REAL omega[3],
                                   FR_REAL q[4])
{
  FR_REAL w[3], turn[4], found[4];
  int i;
  if (rotor->status != FREE_ROTOR_OK) return rotor->status;
  if (!FR_(fr_is_finite)(t)) return FREE_ROTOR_INVALID;
  if (FR_(fabs)(t) > 0) {
    if (rotor->exponent != 0) t = FR_(ldexp)(t, rotor->exponent);
    if (!FR_(fr_turned)(rotor, t, w, turn)) return FREE_ROTOR_PHASE;
    FR_(fr_quaternion_product)(rotor->before, turn, found);
    if (!rotor->is_steady) {
      for (i = 0; i < 3; i++) {
        w[i] = FR_(ldexp)(rotor->signs[i] * w[i], rotor->exponent);
        if (!FR_(fr_is_finite)(w[i])) return FREE_ROTOR_OVERFLOW;
      }
      for (i = 0; i < 3; i++) omega[rotor->axes[i]] = w[i];
    }
    q[0] = found[0];
    for (i = 0; i < 3; i++) q[1 + rotor->axes[i]] = rotor->signs[i] * found[1 + i];
  }
  if (rotor->is_steady || !(FR_(fabs)(t) > 0))
    for (i = 0; i < 3; i++) omega[i] = rotor->omega[i];
  if (!(FR_(fabs)(t) > 0))
    for (i = 0; i < 4; i++) q[i] = rotor->q[i];
  return FREE_ROTOR_OK;
}

/* Add y and the rest of earlier sums to x, and keep the new rest (NULL: lose it). */
FR_FUNCTION void FR_(fr_add_compensated)(FR_REAL *x, FR_REAL y, FR_REAL *rest)
{
  if (rest)
    FR_(fr_two_sum)(*x, y + *rest, x, rest);
  else
    *x += y;
}

/* Advance by the Taylor series of x = omega dt and of the rotation r, both over one step: x' =
   (A x2 x3, B x3 x1, C x1 x2), r' = r (0, x)/2. Their terms of order k are at most |x| size**k and
   size**k. Only the increments are computed, so that each result is rounded once. */
FR_FUNCTION void FR_(fr_taylor)(const FR_REAL euler[3], FR_REAL size, FR_REAL dt, FR_REAL omega[3],
                                FR_REAL q[4], FR_REAL excess, FR_REAL *rest)
{
  static const double over[FR_ORDERS] = {
    1.0 / 1, 1.0 / 2, 1.0 / 3, 1.0 / 4, 1.0 / 5, 1.0 / 6, 1.0 / 7, 1.0 / 8, 1.0 / 9, 1.0 / 10,
    1.0 / 11, 1.0 / 12, 1.0 / 13, 1.0 / 14, 1.0 / 15, 1.0 / 16, 1.0 / 17, 1.0 / 18, 1.0 / 19, 1.0 / 20,
    1.0 / 21, 1.0 / 22, 1.0 / 23, 1.0 / 24, 1.0 / 25, 1.0 / 26, 1.0 / 27, 1.0 / 28, 1.0 / 29, 1.0 / 30};
  FR_REAL x[FR_ORDERS][3], ax[FR_ORDERS][3], r[FR_ORDERS][4];
  FR_REAL bound = size, dw[3] = {0, 0, 0}, dr[4] = {0, 0, 0, 0}, dq[4];
  int orders = 1, i, j, k;
  while (bound > FR_PICK(1.4e-17, 7.5e-9F) && orders < FR_ORDERS - 1) {
    bound *= size;
    orders++;
  }
  for (i = 0; i < 3; i++) {
    x[0][i] = omega[i] * dt;
    r[0][1 + i] = 0;
  }
  r[0][0] = 1;
  for (k = 0; k < orders; k++) {
    FR_REAL a = 0, b = 0, c = 0, r0 = 0, r1 = 0, r2 = 0, r3 = 0;
    const FR_REAL factor = (FR_REAL)over[k], half = factor / 2;
    ax[k][0] = euler[2] * x[k][0];
    ax[k][1] = euler[0] * x[k][1];
    ax[k][2] = euler[1] * x[k][2];
    for (j = 0; j <= k; j++) {
      const FR_REAL *y = x[k - j], *s = r[j];
      a += ax[j][1] * y[2];
      b += ax[j][2] * y[0];
      c += ax[j][0] * y[1];
      r0 -= s[1] * y[0] + s[2] * y[1] + s[3] * y[2];
      r1 += s[0] * y[0] + (s[2] * y[2] - s[3] * y[1]);
      r2 += s[0] * y[1] + (s[3] * y[0] - s[1] * y[2]);
      r3 += s[0] * y[2] + (s[1] * y[1] - s[2] * y[0]);
    }
    x[k + 1][0] = a * factor;
    x[k + 1][1] = b * factor;
    x[k + 1][2] = c * factor;
    r[k + 1][0] = r0 * half;
    r[k + 1][1] = r1 * half;
    r[k + 1][2] = r2 * half;
    r[k + 1][3] = r3 * half;
  }
  for (k = orders; k > 0; k--) {
    for (i = 0; i < 3; i++) dw[i] += x[k][i];
    for (i = 0; i < 4; i++) dr[i] += r[k][i];
  }
  FR_(fr_quaternion_product)(q, dr, dq);
  for (i = 0; i < 3; i++) FR_(fr_add_compensated)(&omega[i], dw[i] / dt, rest ? rest + i : rest);
  /* The norm is drawn back to 1, because rounding would let it drift. */
  for (i = 0; i < 4; i++)
    FR_(fr_add_compensated)(&q[i], dq[i] - excess * q[i] / 2, rest ? rest + 3 + i : rest);
}

/* Replace a state by the state dt later, and keep the rounding errors in rest[7] (NULL: lose them).
   Short steps are Taylor series to the last digit, others the closed form. */
FR_FUNCTION int FR_(free_rotor_step_compensated)(const FR_REAL moments[3], FR_REAL dt,
                                                 FR_REAL omega[3], FR_REAL q[4], FR_REAL *rest)
{
  const FR_REAL least = FR_PICK(7.888609052210118e-31, 7.88860905e-31F);
  FR_REAL euler[3], low, high, spin, size, excess, w[3], p[4], kept[7] = {0, 0, 0, 0, 0, 0, 0};
  FR_(free_rotor) rotor;
  int i, status;
  if (!FR_(fr_is_state)(moments, omega) || !FR_(fr_is_finite)(dt)) return FREE_ROTOR_INVALID;
  low = high = moments[0];
  for (i = 1; i < 3; i++) {
    if (moments[i] < low) low = moments[i];
    if (moments[i] > high) high = moments[i];
  }
  excess = (q[0] * q[0] + q[1] * q[1]) + (q[2] * q[2] + q[3] * q[3]) - 1;
  for (i = 0; i < 4; i++) p[i] = q[i];
  if (!(FR_(fabs)(excess) <= FR_PICK(4e-15, 2e-6F))) {
    if (!FR_(fr_unit)(p)) return FREE_ROTOR_INVALID;
    excess = 0;
  }
  if (!(low >= least * high)) return FREE_ROTOR_RANGE;
  euler[0] = (moments[1] - moments[2]) / moments[0];
  euler[1] = (moments[2] - moments[0]) / moments[1];
  euler[2] = (moments[0] - moments[1]) / moments[2];
  spin = size = 0;
  for (i = 0; i < 3; i++) {
    if (FR_(fabs)(omega[i]) > spin) spin = FR_(fabs)(omega[i]);
    if (FR_(fabs)(euler[i]) > size) size = FR_(fabs)(euler[i]);
    w[i] = omega[i];
  }
  if (size < 1) size = 1;
  size = spin * FR_(fabs)(dt) * size;
  if (size <= FR_PICK(0.25, 0.25F)) {
    for (i = 0; rest && i < 7; i++) kept[i] = rest[i];
    if (FR_(fabs)(dt) > 0)
      FR_(fr_taylor)(euler, size, dt, w, p, excess, rest ? kept : rest);
  } else {
    status = FR_(free_rotor_prepare)(&rotor, moments, omega, p);
    if (status == FREE_ROTOR_OK) status = FR_(free_rotor_at)(&rotor, dt, w, p);
    if (status != FREE_ROTOR_OK) return status;
  }
  for (i = 0; i < 3; i++)
    if (!FR_(fr_is_finite)(w[i])) return FREE_ROTOR_OVERFLOW;
  for (i = 0; i < 3; i++) omega[i] = w[i];
  for (i = 0; i < 4; i++) q[i] = p[i];
  for (i = 0; rest && i < 7; i++) rest[i] = kept[i];
  return FREE_ROTOR_OK;
}

/* Replace a state by the state dt later. */
FR_FUNCTION int FR_(free_rotor_step)(const FR_REAL moments[3], FR_REAL dt, FR_REAL omega[3],
                                     FR_REAL q[4])
{
  FR_REAL *const nothing = 0;
  return FR_(free_rotor_step_compensated)(moments, dt, omega, q, nothing);
}

#endif
