/* Time per step and drift of integrators of a torque-free body, as a Markdown table.

   cc -std=c99 -O2 -I FOLDER benchmark.c -o benchmark -lm, where FOLDER has free_rotor.h; then
   ./benchmark [STEPS [DT]], by default 1000000 steps of 0.001 s. */
#include "free_rotor.h"

#include <stdio.h>
#include <stdlib.h>
#include <time.h>

/* The moments are binary32 numbers, so that both precisions have the same body. */
static const double MOMENTS[3] = {3.0, 2.0, 1.25}, OMEGA[3] = {0.25, 1.125, -0.75};

typedef struct { double omega[3], q[4], rest[7]; } state_t;
typedef void stepper(double dt, state_t *state);

static void cross(const double a[3], const double b[3], double c[3])
{
  c[0] = a[1] * b[2] - a[2] * b[1];
  c[1] = a[2] * b[0] - a[0] * b[2];
  c[2] = a[0] * b[1] - a[1] * b[0];
}

static void ours(double dt, state_t *y) { (void)free_rotor_step(MOMENTS, dt, y->omega, y->q); }

static void ours_compensated(double dt, state_t *y)
{
  (void)free_rotor_step_compensated(MOMENTS, dt, y->omega, y->q, y->rest);
}

static void normalise(double q[4])
{
  const double norm = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 4; i++) q[i] /= norm;
}

static void slope(const double y[7], double f[7])
{
  const double *w = y, *q = y + 3;
  f[0] = (MOMENTS[1] - MOMENTS[2]) / MOMENTS[0] * w[1] * w[2];
  f[1] = (MOMENTS[2] - MOMENTS[0]) / MOMENTS[1] * w[2] * w[0];
  f[2] = (MOMENTS[0] - MOMENTS[1]) / MOMENTS[2] * w[0] * w[1];
  f[3] = -0.5 * (q[1] * w[0] + q[2] * w[1] + q[3] * w[2]);
  f[4] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]);
  f[5] = 0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]);
  f[6] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]);
}

/* The classical Runge-Kutta formula of order 4, with a normalised quaternion. */
static void runge_kutta(double dt, state_t *state)
{
  static const double at[4] = {0.0, 0.5, 0.5, 1.0}, weight[4] = {1.0, 2.0, 2.0, 1.0};
  double y[7], x[7], f[7] = {0}, total[7] = {0};
  for (int i = 0; i < 3; i++) y[i] = state->omega[i];
  for (int i = 0; i < 4; i++) y[3 + i] = state->q[i];
  for (int k = 0; k < 4; k++) {
    for (int i = 0; i < 7; i++) x[i] = y[i] + at[k] * dt * f[i];
    slope(x, f);
    for (int i = 0; i < 7; i++) total[i] += weight[k] * f[i];
  }
  for (int i = 0; i < 7; i++) y[i] += dt / 6.0 * total[i];
  for (int i = 0; i < 3; i++) state->omega[i] = y[i];
  for (int i = 0; i < 4; i++) state->q[i] = y[3 + i];
  normalise(state->q);
}

/* Turn the attitude by omega dt, as game engines do. */
static void turn(double dt, state_t *state)
{
  const double *w = state->omega;
  const double spin = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]), half = 0.5 * spin * dt;
  const double factor = spin > 0.0 ? sin(half) / spin : 0.0;
  const double r[4] = {cos(half), factor * w[0], factor * w[1], factor * w[2]};
  double *q = state->q, p[4];
  for (int i = 0; i < 4; i++) p[i] = q[i];
  q[0] = p[0] * r[0] - p[1] * r[1] - p[2] * r[2] - p[3] * r[3];
  q[1] = p[0] * r[1] + p[1] * r[0] + p[2] * r[3] - p[3] * r[2];
  q[2] = p[0] * r[2] + p[2] * r[0] + p[3] * r[1] - p[1] * r[3];
  q[3] = p[0] * r[3] + p[3] * r[0] + p[1] * r[2] - p[2] * r[1];
  normalise(q);
}

/* MuJoCo's integrator Euler: an explicit gyroscopic torque, then the attitude with the new omega. */
static void semi_implicit(double dt, state_t *state)
{
  double *w = state->omega, momentum[3], torque[3];
  for (int i = 0; i < 3; i++) momentum[i] = MOMENTS[i] * w[i];
  cross(momentum, w, torque);
  for (int i = 0; i < 3; i++) w[i] += dt * torque[i] / MOMENTS[i];
  turn(dt, state);
}

/* Bullet's default: one Newton iteration for an implicit gyroscopic torque in axes of the body. */
static void bullet(double dt, state_t *state)
{
  double *w = state->omega, momentum[3], f[3], j[3][3], a[3], b[3], c[3], determinant;
  const double *m = MOMENTS;
  for (int i = 0; i < 3; i++) momentum[i] = m[i] * w[i];
  cross(w, momentum, f);
  /* Columns of I + dt (skew(omega) I - skew(I omega)). */
  for (int i = 0; i < 3; i++) {
    double e[3] = {0.0, 0.0, 0.0}, first[3], second[3];
    e[i] = 1.0;
    cross(w, e, first);
    cross(momentum, e, second);
    for (int k = 0; k < 3; k++) j[i][k] = m[i] * e[k] + dt * (m[i] * first[k] - second[k]);
  }
  cross(j[1], j[2], a);
  cross(j[2], j[0], b);
  cross(j[0], j[1], c);
  determinant = j[0][0] * a[0] + j[0][1] * a[1] + j[0][2] * a[2];
  w[0] -= dt * (a[0] * f[0] + a[1] * f[1] + a[2] * f[2]) / determinant;
  w[1] -= dt * (b[0] * f[0] + b[1] * f[1] + b[2] * f[2]) / determinant;
  w[2] -= dt * (c[0] * f[0] + c[1] * f[1] + c[2] * f[2]) / determinant;
  turn(dt, state);
}

/* Angular momentum in space, and twice the energy. */
static void invariants(const state_t *y, double momentum[3], double *energy)
{
  const double *q = y->q, vector[3] = {q[1], q[2], q[3]};
  double b[3], u[3], v[3];
  *energy = 0.0;
  for (int i = 0; i < 3; i++) {
    b[i] = MOMENTS[i] * y->omega[i];
    *energy += b[i] * y->omega[i];
  }
  cross(vector, b, u);
  cross(vector, u, v);
  for (int i = 0; i < 3; i++) momentum[i] = b[i] + 2.0 * (q[0] * u[i] + v[i]);
}

static double length(const double v[3]) { return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]); }

static void print_row(const char *name, double seconds, long steps, const state_t *y,
                      const state_t *exact, const state_t *start)
{
  double momentum[3], other[3], across[3], energy, energy0, error[3];
  const double *q = y->q, *p = exact->q;
  invariants(start, other, &energy0);
  invariants(y, momentum, &energy);
  if (!isfinite(energy)) {
    printf("| %s | %.0f | not finite | not finite | not finite | not finite | not finite |\n", name,
           1e9 * seconds / (double)steps);
    return;
  }
  cross(momentum, other, across);
  for (int i = 0; i < 3; i++) error[i] = y->omega[i] - exact->omega[i];
  const double omega_error = length(error) / length(exact->omega);
  /* The vector part of conj(p) q is the sine of half the angle. */
  error[0] = p[0] * q[1] - p[1] * q[0] - p[2] * q[3] + p[3] * q[2];
  error[1] = p[0] * q[2] - p[2] * q[0] - p[3] * q[1] + p[1] * q[3];
  error[2] = p[0] * q[3] - p[3] * q[0] - p[1] * q[2] + p[2] * q[1];
  printf("| %s | %.0f | %.1e | %.1e | %.1e | %.1e | %.1e |\n", name, 1e9 * seconds / (double)steps,
         omega_error, 2.0 * asin(fmin(1.0, length(error))), fabs(energy / energy0 - 1.0),
         fabs(length(momentum) / length(other) - 1.0),
         asin(fmin(1.0, length(across) / (length(momentum) * length(other)))));
}

static double now(void) { return (double)clock() / CLOCKS_PER_SEC; }

int main(int n_arguments, char **arguments)
{
  static const struct { const char *name; stepper *step; } methods[] = {
    {"`free_rotor_step`", ours}, {"`free_rotor_step_compensated`", ours_compensated},
    {"Runge-Kutta, order 4", runge_kutta}, {"semi-implicit Euler (MuJoCo)", semi_implicit},
    {"implicit gyroscopic torque (Bullet)", bullet}};
  const long steps = n_arguments > 1 ? atol(arguments[1]) : 1000000;
  const double dt = n_arguments > 2 ? atof(arguments[2]) : 1e-3;
  const state_t start = {{OMEGA[0], OMEGA[1], OMEGA[2]}, {1.0, 0.0, 0.0, 0.0}, {0.0}};
  float moments[3];
  state_t exact = start, y;
  free_rotor rotor;
  double began;
  for (int i = 0; i < 3; i++) moments[i] = (float)MOMENTS[i];
  if (steps < 1 || free_rotor_prepare(&rotor, MOMENTS, start.omega, start.q) != FREE_ROTOR_OK
      || free_rotor_at(&rotor, (double)steps * dt, exact.omega, exact.q) != FREE_ROTOR_OK) {
    fprintf(stderr, "benchmark: STEPS %ld and DT %g are refused; allowed: at least 1 step, and fewer "
            "than 1e15 rad\n", steps, dt);
    return 2;
  }
  printf("| method | time per step, ns | error of omega, relative | error of attitude, rad | energy, "
         "relative | \\|L\\|, relative | direction of L, rad |\n");
  printf("| --- | ---: | ---: | ---: | ---: | ---: | ---: |\n");
  for (size_t i = 0; i < sizeof methods / sizeof *methods; i++) {
    y = start;
    began = now();
    for (long k = 0; k < steps; k++) methods[i].step(dt, &y);
    print_row(methods[i].name, now() - began, steps, &y, &exact, &start);
  }
  for (int compensated = 0; compensated < 2; compensated++) {
    float omega[3], q[4] = {1.0F, 0.0F, 0.0F, 0.0F}, rest[7] = {0.0F};
    const float step = (float)dt;
    for (int i = 0; i < 3; i++) omega[i] = (float)OMEGA[i];
    /* The time is that of the rounded step. */
    (void)free_rotor_at(&rotor, (double)steps * (double)step, exact.omega, exact.q);
    began = now();
    for (long k = 0; k < steps; k++)
      (void)free_rotor_step_compensatedf(moments, step, omega, q, compensated ? rest : NULL);
    began = now() - began;
    for (int i = 0; i < 3; i++) y.omega[i] = (double)omega[i];
    for (int i = 0; i < 4; i++) y.q[i] = (double)q[i];
    normalise(y.q);
    print_row(compensated ? "`free_rotor_step_compensatedf`" : "`free_rotor_stepf`", began, steps, &y,
              &exact, &start);
  }
  y = start;
  began = now();
  for (long k = 1; k <= steps; k++) (void)free_rotor_at(&rotor, (double)k * dt, y.omega, y.q);
  began = now() - began;
  (void)free_rotor_at(&rotor, (double)steps * dt, exact.omega, exact.q);
  print_row("`free_rotor_at`", began, steps, &y, &exact, &start);
  return 0;
}
