/* Many bodies under one torque that depends on the state, one in each lane of a register: Taylor
   series with a step of its own for each body. When a body reaches its end, the next one takes its
   lane. The truncation error of each step is estimated, propagated to the end and subtracted there.
   A body whose error estimate is unreliable, or for which a step fails, is left to the single-body
   kernel. This is C because no Fortran compiler keeps eight sums in registers. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "../modern/tape.h"

/* One body in each number of a register. */
enum { SIDE_BY_SIDE = IN_REGISTER };
typedef reg lanes;
typedef reg_bits bits;

enum { LEAST_ORDER = 8, TERMS = LANE_TERMS, MOST_ORDER = TERMS - 1 };
enum { MANY = 3 };                            /* factors of a product that may not show early */
enum { FEW_TERMS = 5 };                       /* of values amid a step */
enum { CARRIED = 6 };                         /* terms of an exponential */
enum { PROBES = 3, VECTORS = PROBES + 1 };    /* perturbations; with the truncation error */
enum { MOST = MOST_UNKNOWNS };
enum { PARTS = 4 };                           /* of a step, as in tape_state.f90 */
/* Kinds of operations of numbers that are constant in a motion: a product with one, any other. */
enum { SCALED = -1, FIXED = -2 };
enum { MOST_TRIES = 40, MOST_STEPS = 20000 }; /* of a step; of a body */
enum { HALVINGS = 12 };                       /* of a step whose series do not converge */
enum { BETWEEN_LOOKS = 10000 };               /* steps between polls for an interrupt */

static const double TRUSTED = 0.4;     /* largest error that is subtracted, in tolerances */
static const double DOUBTED = 64.0;    /* amplification at which it is half of that */
static const double SURE = 0.1;        /* largest amplified rounding error, in tolerances */
static const double MOST_GROWTH = 1e3; /* largest amplification */
static const double ROUNDING = 0x1p-53;
static const double A_STEP = 3.0;      /* largest norm of an exponent that is taken at once */
static const double MOST_ANGLE = 5e3;  /* rad of a motion: longer ones need precise variations */
static const double ROUNDINGS = 4.0;   /* of an unknown that add up before they are amplified */
/* Factors on the subtracted error and on the last terms for the stated error, as in many_taylor. */
static const double WRONG = 2.0, UNSEEN = 0.1;
static const double SHARE = 0.15;      /* of the tolerance, for the truncation errors */
static const double RIDGE = 1.001;     /* makes the fit work for one pole or none */
static const double FAR = 1e60;        /* products of numbers from 1/FAR to FAR are finite */
static const double LEAST = 1e-290;
static const double SHORTER = 0.5;     /* least factor on a step that is not expanded again */
static const double LONGER = 4.0;      /* largest factor */
/* Largest difference of a derivative and that of its series at the end of a step, times the step,
   over order times local tolerance, and over the rounding errors. */
static const double MOST_DEFECT = 4.0;
static const double MOST_ROUNDING = 1e3;
static const double MOST_CANCELLED = 1e3; /* largest sum of the terms of a step, relative */
static const double WITHIN_CIRCLE = 0.9;  /* as in tape_plan.f90 */
static const double INVISIBLE = 100.0;    /* as in tape_powers.f90, and the next one too */
static const double PART_OF_ORDER = 0.6;
static const double MOST_OF_REACHED = 2.0; /* as in tape_state.f90 */
static const double NEAR_ZERO = 1e3; /* as MULTIPLE in tape_steady.f90 */

typedef lanes number, series[TERMS];

/* tape_bodies_t of tape.f90. */
struct bodies {
  struct tape tape;
  const int *table_starts;
  const double *breaks;
  const double (*pieces)[4];
  double tolerance;
  int n_slots, n_tables, n, n_times, interrupted;
  const double (*omega0)[3], (*attitude0)[4];
  const double *times;
  double (*omega)[3], (*attitude)[4];
  int8_t *status;
  double (*estimates)[2]; /* relative error, amplification; or NULL */
  int n_parameters, n_sets; /* sets of parameters: one, or one for each body */
  const double *parameters; /* of each set */
  int n_rows;    /* results of each body: one for each of its times, ordered away from 0 */
  int n_own;     /* own states of the user, after omega and the attitude */
  const double *own0, *own_sizes; /* of each body; least sizes to which their errors are relative */
  double *own;
};

/* An operation, whose operands and result are series. */
struct operation {
  int kind, combination;
  lanes *x, *y, *out;
};

/* What is known of the bodies that are being integrated. */
struct group {
  const struct bodies *all;
  int n, order;
  int n_body;                     /* unknowns without own states */
  int body[SIDE_BY_SIDE];         /* -1 for none */
  int row[SIDE_BY_SIDE];          /* the next result */
  bits steps, tries;
  series *a;                      /* terms of each slot */
  struct operation *operations;
  lanes **terms;                  /* series of each term of the combinations */
  lanes **factors;                /* of each term: a constant of the motion, or NULL */
  lanes *scaled;                  /* of each term: its coefficient, times the factor */
  const struct leaves *leaves;    /* compiled for these registers; or NULL */
  int n_active;                   /* operations whose terms are to be computed, in `operations` */
  int n_read, *read;              /* slots whose values amid the step are read, ascending */
  int *depends; /* of each slot: the unknowns on which it depends, as bits; the next is the time */
  double is_varying;              /* 1 if the Jacobian depends on the time, or 0 */
  lanes *middle, *noises;         /* of each slot: value amid the step, rounding error */
  lanes (*tangents)[MOST]; /* of each slot: derivatives by the unknowns */
  lanes y[MOST], low[MOST]; /* unknowns and their rounding errors */
  lanes error[MOST];     /* truncation error, propagated so far */
  lanes probes[PROBES][MOST]; /* perturbations since time 0 */
  lanes slope[MOST];     /* derivatives times the step at its end, by the last series */
  lanes weights[MOST];   /* make the unknowns comparable */
  lanes least[MOST];              /* sizes of own states, by the user */
  lanes sizes[MOST];              /* to which errors are relative; 0: not known yet */
  lanes end, t, t_low, rest, h, previous, scale, local, allowed, worst, noise;
  lanes growth;                   /* square of the amplification */
  bits is_first;                  /* before the first step */
  bits is_checked;                /* whether `slope` is compared with the derivatives */
  bits fails;                     /* left to the single-body kernel */
};

extern int interrupt_raised(void);
extern int fits_lanes(int64_t address);
extern double function_of(int kind, double x, double y, int saturates);

static inline lanes all_of(double x) { return (lanes){0.0} + x; }
static inline lanes select_of(bits mask, lanes a, lanes b)
{
  return (lanes)(((bits)a & mask) | ((bits)b & ~mask));
}
static inline lanes absolute(lanes x) { return (lanes)((bits)x & 0x7fffffffffffffffLL); }
static inline lanes size(lanes x) { return absolute(x); }
static inline lanes slope_of_root(lanes root) { return 0.5 / root; }
#define slope_at_root slope_of_root
#define OTHER_ROUNDINGS
#include "../modern/tape_noise.h"

static inline lanes each_of(double (*function)(double), lanes x)
{
  for (int i = 0; i < SIDE_BY_SIDE; i++) x[i] = function(x[i]);
  return x;
}

/* Return (allowed/last)**(1/order), to some percent: the bits of a positive number, read as an
   integer, are nearly its logarithm. */
static inline lanes ratio_of(int order, lanes allowed, lanes last)
{
  const bits difference = (bits)allowed - (bits)larger(last, all_of(LEAST));
  const lanes part = __builtin_convertvector(difference, lanes) * (1.0 / order);
  return (lanes)(__builtin_convertvector(part, bits) + (bits)all_of(1.0));
}

/* Return term 0 of a combination. */
static inline lanes combined_values(const struct group *g, int n)
{
  const struct tape *tape = &g->all->tape;
  lanes sum = all_of(tape->constants[n]);
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++)
    sum += tape->coefficients[i] * g->a[tape->slots[i] - 1][0];
  return sum;
}

/* Return term k of a combination, above 0. */
static inline lanes combined(const struct group *g, int n, int k)
{
  const struct tape *tape = &g->all->tape;
  lanes sum = {0.0};
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++)
    sum += g->scaled[i] * g->terms[i][k];
  return sum;
}

/* Return the piece of a table that holds just after the time t, or just before it. */
static int piece_at(const struct bodies *all, int table, double t, int forward)
{
  int low = all->table_starts[table], high = all->table_starts[table + 1];
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    const double start = all->breaks[middle - 1];
    if (start < t || (forward && start <= t)) low = middle;
    else high = middle;
  }
  return low - 1;
}

/* Return the first breakpoint of any table between t and the end; the end if there is none. */
static double next_break(const struct bodies *all, double t, double end)
{
  for (int n = 0; n < all->n_tables; n++) {
    const int place = piece_at(all, n, t, end > t);
    if (end > t && place + 1 < all->table_starts[n + 1] - 1) end = fmin(end, all->breaks[place + 1]);
    else if (end <= t && place > all->table_starts[n] - 1) end = fmax(end, all->breaks[place]);
  }
  return end;
}

static void set_table(struct group *g, int number, lanes *out)
{
  const struct bodies *all = g->all;
  for (int k = 0; k <= g->order; k++) out[k] = all_of(0.0);
  for (int i = 0; i < SIDE_BY_SIDE; i++) {
    const double h = g->h[i];
    const int n = piece_at(all, number, g->t[i], h > 0.0);
    const double *c = all->pieces[n], u = (g->t[i] - all->breaks[n]) + g->t_low[i];
    out[0][i] = c[0] + u * (c[1] + u * (c[2] + u * c[3]));
    out[1][i] = h * (c[1] + u * (2.0 * c[2] + 3.0 * u * c[3]));
    out[2][i] = h * h * (c[2] + 3.0 * u * c[3]);
    out[3][i] = h * h * h * c[3];
  }
}

/* Compute sine and cosine of frequency (t + t_low) for all lanes. */
static void set_wave(struct group *g, double frequency, lanes *sine, lanes *cosine)
{
  for (int i = 0; i < SIDE_BY_SIDE; i++) {
    const double angle = frequency * g->t[i];
    const double rest = fma(frequency, g->t[i], -angle) + frequency * g->t_low[i];
    const double s = sin(angle), c = cos(angle);
    (*sine)[i] = s + c * rest;
    (*cosine)[i] = c - s * rest;
  }
}

/* Compute term 0 of all slots, and all terms of the tables. */
static void set_values(struct group *g)
{
  const struct tape *tape = &g->all->tape;
  if (g->leaves && g->leaves->set_lane_values) {
    g->leaves->set_lane_values(*g->a, tape->coefficients, tape->constants);
    return;
  }
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    const lanes x = g->a[operation[1] - 1][0], y = g->a[operation[2] > 0 ? operation[2] - 1 : 0][0];
    series *out = g->a + operation[3] - 1;
    lanes grown, shrunk;
    switch (operation[0]) {
    case LINEAR: out[0][0] = combined_values(g, operation[1] - 1); break;
    case PRODUCT: out[0][0] = x * y; break;
    case QUOTIENT: out[0][0] = x / y; break;
    case SQRT: out[0][0] = each_of(sqrt, x); break;
    case EXP: out[0][0] = each_of(exp, x); break;
    case TANH:
      out[0][0] = each_of(tanh, x);
      /* The square of the tangent may be rounded to 1. */
      grown = each_of(exp, absolute(x));
      shrunk = 2.0 / (grown + 1.0 / grown);
      out[1][0] = shrunk * shrunk;
      break;
    case TABLE: set_table(g, operation[1] - 1, out[0]); break;
    default:
      for (int i = 0; i < SIDE_BY_SIDE; i++) out[0][0][i] = function_of(operation[0], x[i], y[i], 0);
      break;
    case SINE_COSINE:
      if (operation[2] > 0) {
        set_wave(g, tape->coefficients[tape->starts[operation[2] - 1] - 1], out[0], out[1]);
      } else {
        out[0][0] = each_of(sin, x);
        out[1][0] = each_of(cos, x);
      }
    }
  }
}

/* Return the sum of x(j) y(k - j) for j from `first` to `last`. */
static __attribute__((noinline)) lanes convolved(const lanes *x, const lanes *y, int k, int first, int last)
{
  lanes one = {0.0}, two = {0.0};
  int j = first;
  for (; j < last; j += 2) {
    one += x[j] * y[k - j];
    two += x[j + 1] * y[k - j - 1];
  }
  if (j == last) one += x[j] * y[k - j];
  return one + two;
}

/* Compute term k of a product. Every fourth term comes with the parts of the next three terms that
   are known already, which saves most of the loads. */
static inline void multiply(lanes *out, const lanes *x, const lanes *y, int k)
{
  const int late = k % 4;
  if (k < 4) {
    out[k] = convolved(x, y, k, 0, k);
  } else if (late > 0) {
    lanes sum = out[k];
    for (int i = 0; i < late; i++) sum += x[k - i] * y[i] + y[k - i] * x[i];
    out[k] = sum;
  } else {
    lanes a = {0.0}, b = {0.0}, c = {0.0}, d = {0.0}, a2 = {0.0}, b2 = {0.0}, c2 = {0.0}, d2 = {0.0};
    lanes y1 = {0.0}, y2 = {0.0}, y3 = {0.0};
    int j = 0;
    for (; j < k; j += 4) {
      const lanes u0 = y[k - j], u1 = y[k - j - 1], u2 = y[k - j - 2], u3 = y[k - j - 3];
      a += x[j] * u0, b += x[j] * y1, c += x[j] * y2, d += x[j] * y3;
      a2 += x[j + 1] * u1, b2 += x[j + 1] * u0, c2 += x[j + 1] * y1, d2 += x[j + 1] * y2;
      a += x[j + 2] * u2, b += x[j + 2] * u1, c += x[j + 2] * u0, d += x[j + 2] * y1;
      a2 += x[j + 3] * u3, b2 += x[j + 3] * u2, c2 += x[j + 3] * u1, d2 += x[j + 3] * u0;
      y1 = u3, y2 = u2, y3 = u1;
    }
    out[k] = (a + a2) + x[k] * y[0];
    out[k + 1] = (b + b2) + x[k] * y1;
    out[k + 2] = (c + c2) + x[k] * y2;
    out[k + 3] = (d + d2) + x[k] * y3;
  }
}

/* The operands of TERM_CASES. An exponential is never constant here. */
#define SUM(x, y) convolved(x, y, k, 1, k - 1)
#define UNLESS(flag, x) (x)
#define halved(x, root) ((x) / (2.0 * (root)))

/* Compute the terms of all slots, and those of the unknowns up to the order. */
static void expand(struct group *g)
{
  const struct tape *tape = &g->all->tape;
  const int derivatives = tape->n_combinations - g->n;
  if (g->leaves) {
    g->leaves->expand_lanes(*g->a, tape->coefficients, tape->constants, &g->h, g->order);
    return;
  }
  const struct operation *const end = g->operations + g->n_active;
  for (int k = 0; k < g->order; k++) {
    const double whole = k, per_k = 1.0 / whole;
    for (const struct operation *each = g->operations; k > 0 && each < end; each++) {
      const lanes *const x = each->x, *const y = each->y;
      lanes *const o = each->out, *const p = o + TERMS, *const q = p + TERMS;
      switch (each->kind) {
      case LINEAR: o[k] = combined(g, each->combination, k); break;
      case PRODUCT: multiply(o, x, y, k); break;
      case SCALED: o[k] = x[0] * y[k]; break;
      TERM_CASES
      default: break; /* a table */
      }
    }
    const lanes part = g->h / (k + 1.0);
    for (int i = 0; i < g->n; i++)
      g->a[FIRST_UNKNOWN + i][k + 1] =
          part * (k == 0 ? combined_values(g, derivatives + i) : combined(g, derivatives + i, k));
  }
}

/* Reduce the factor until a slot changes by at most `most` in the circle of the step. */
static lanes limited(const struct group *g, const lanes *slot, lanes most, lanes factor)
{
  for (int n = 0; n < HALVINGS; n++) {
    lanes change = {0.0};
    for (int k = g->order - 1; k > 0; k--) change = factor * (change + absolute(slot[k]));
    const bits fits = change <= most;
    if (!any(~fits)) break;
    factor = select_of(fits, factor, factor * larger(all_of(SHORTER), most / change));
  }
  return factor;
}

/* Reduce the factor on the step so that the series of functions converge, as in tape_plan.f90. */
static lanes converged(const struct group *g, lanes factor)
{
  const struct tape *tape = &g->all->tape;
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    const lanes *x = g->a[operation[1] - 1], *y = g->a[operation[2] > 0 ? operation[2] - 1 : 0];
    const double order = g->order;
    switch (operation[0]) {
    case EXP: factor = limited(g, x, larger(all_of(0.5 * order), -x[0] - INVISIBLE), factor); break;
    case TANH:
      factor = limited(g, x, larger(all_of(0.25 * order), absolute(x[0]) - 0.5 * INVISIBLE), factor);
      break;
    case QUOTIENT: factor = limited(g, y, WITHIN_CIRCLE * absolute(y[0]), factor); break;
    case SQRT: factor = limited(g, x, WITHIN_CIRCLE * x[0], factor); break;
    default: break;
    }
  }
  return factor;
}

/* Return bounds of the rounding errors of the derivatives. */
static void set_noise(struct group *g, lanes *noise)
{
  const struct tape *tape = &g->all->tape;
  if (g->leaves) {
    g->leaves->set_lane_noise(*g->a, tape->coefficients, tape->constants, noise);
    return;
  }
  for (int i = 0; i < FIRST_UNKNOWN + g->n; i++) g->noises[i] = all_of(0.0);
  bound_roundings(tape, (const series *)g->a, g->noises, noise);
}

/* Find the series of the operands and results of all operations, and of all terms of combinations. */
static void find_series(struct group *g)
{
  const struct tape *tape = &g->all->tape;
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    g->operations[n] = (struct operation){
        recurrence_of(operation), operation[1] - 1, g->a[operation[1] - 1],
        g->a[operation[2] > 0 ? operation[2] - 1 : 0], g->a[operation[3] - 1]};
  }
  for (int i = 0; i < tape->starts[tape->n_combinations] - 1; i++) {
    g->terms[i] = g->a[tape->slots[i] - 1];
    g->factors[i] = NULL;
    g->scaled[i] = all_of(tape->coefficients[i]);
  }
}

/* Find the unknowns on which each slot depends, and whether it depends on the time. */
static void find_dependences(struct group *g)
{
  const struct tape *tape = &g->all->tape;
  const int of_time = 1 << g->n;
  g->depends[0] = of_time;
  for (int i = 0; i < g->n; i++) g->depends[FIRST_UNKNOWN + i] = 1 << i;
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    int *out = g->depends + operation[3] - 1;
    if (operation[0] == TABLE) *out = of_time;
    if (operation[0] == TABLE) continue;
    if (operation[0] == LINEAR) {
      for (int i = tape->starts[operation[1] - 1] - 1; i < tape->starts[operation[1]] - 1; i++)
        *out |= g->depends[tape->slots[i] - 1];
      continue;
    }
    *out = g->depends[operation[1] - 1];
    if (operation[0] == PRODUCT || operation[0] == QUOTIENT) *out |= g->depends[operation[2] - 1];
    if (operation[0] == SINE_COSINE || operation[0] == TANH) out[1] = *out;
    if (*out > of_time) g->is_varying = 1.0;
  }
}

/* Return whether a slot is an operand of an operation that is no combination. */
static int is_operand(const struct tape *tape, int slot)
{
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    if (operation[0] == LINEAR || operation[0] == TABLE) continue;
    if (operation[1] == slot || (operation[0] != SINE_COSINE && operation[2] == slot)) return 1;
  }
  return 0;
}

/* Mark operations of constants, whose further terms are 0. */
static void find_constants(struct group *g)
{
  const struct tape *tape = &g->all->tape;
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    struct operation *each = g->operations + n;
    if (g->depends[operation[3] - 1] == 0) each->kind = FIXED;
    if (each->kind != PRODUCT) continue;
    const int is_swapped = g->depends[operation[2] - 1] == 0;
    if (!is_swapped && g->depends[operation[1] - 1] != 0) continue;
    each->kind = SCALED;
    if (is_swapped) each->x = g->a[operation[2] - 1], each->y = g->a[operation[1] - 1];
  }
  for (int n = 0; n < tape->n_operations; n++) {
    const int out = tape->operations[n][3];
    struct operation *each = g->operations + n;
    if (each->kind != SCALED || is_operand(tape, out)) continue;
    /* Combinations alone have it as a term: they multiply by the constant themselves. */
    each->kind = FIXED;
    for (int i = 0; i < tape->starts[tape->n_combinations] - 1; i++)
      if (tape->slots[i] == out) g->terms[i] = each->y, g->factors[i] = each->x;
  }
  for (int n = 0; n < tape->n_operations; n++)
    if (g->operations[n].kind != FIXED) g->operations[g->n_active++] = g->operations[n];
}

/* Find the slots whose values amid the step are read, but for those of products and quotients, which
   follow from others. */
static void find_read(struct group *g)
{
  const struct tape *tape = &g->all->tape;
  for (int slot = 0; slot < g->all->n_slots; slot++) {
    int is_read = is_operand(tape, slot + 1);
    for (int n = 0; n < tape->n_operations; n++) {
      const int kind = recurrence_of(tape->operations[n]), out = tape->operations[n][3] - 1;
      if (kind == PRODUCT || kind == QUOTIENT) is_read &= out != slot;
      else if (kind != LINEAR && kind != TABLE) is_read |= out == slot || out + 1 == slot;
    }
    if (is_read) g->read[g->n_read++] = slot;
  }
}

/* Return the derivative of a combination by an unknown. */
static lanes perturbed(const struct group *g, int n, int j)
{
  const struct tape *tape = &g->all->tape;
  lanes sum = {0.0};
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++)
    sum += tape->coefficients[i] * g->tangents[tape->slots[i] - 1][j];
  return sum;
}

/* Compute the derivatives of the rates by the unknowns amid the step, times the step. */
static void set_jacobian(struct group *g, lanes factor, lanes jacobian[][MOST])
{
  const struct tape *tape = &g->all->tape;
  const lanes half = 0.5 * factor, step = factor * g->h;
  if (g->leaves) {
    lanes found[WITH_ATTITUDE][WITH_ATTITUDE];
    g->leaves->set_lane_jacobian(*g->a, tape->coefficients, tape->constants, &half, &step, found);
    for (int i = 0; i < g->n; i++)
      for (int j = 0; j < g->n; j++) jacobian[i][j] = found[i][j];
    return;
  }
  lanes *const m = g->middle, (*const v)[MOST] = g->tangents;
  for (int i = 0; i < g->n_read; i++) {
    const int n = g->read[i];
    lanes sum = {0.0};
    /* The order is above the number of these terms. */
    for (int k = FEW_TERMS - 1; k > 0 && g->depends[n]; k--) sum = half * (sum + g->a[n][k]);
    m[n] = g->a[n][0] + sum;
  }
  for (int j = 0; j < g->n; j++) v[FIRST_UNKNOWN + j][j] = all_of(1.0);
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n], kind = recurrence_of(operation);
    const int x = operation[1] - 1, y = operation[2] - 1, o = operation[3] - 1, p = o + 1;
    const int other = HAS_OWN_VALUE(kind) ? y : 0;
    lanes by_x = {0.0}, by_y = {0.0}, second_by_x = {0.0};
    switch (kind) {
    case LINEAR:
      for (int j = 0; j < g->n; j++) v[o][j] = perturbed(g, x, j);
      continue;
    SLOPE_CASES
    default: break; /* a table */
    }
    for (int j = 0; j < g->n; j++) {
      /* A slope that does not count may be infinite. */
      if (!(g->depends[o] >> j & 1)) continue;
      v[o][j] = by_x * v[x][j] + by_y * v[other][j];
      if (READS_SECOND(kind)) v[p][j] = second_by_x * v[x][j];
    }
  }
  for (int i = 0; i < g->n; i++)
    for (int j = 0; j < g->n; j++)
      jacobian[i][j] = step * perturbed(g, tape->n_combinations - g->n + i, j);
}

static lanes power_of(lanes x, int exponent)
{
  lanes power = all_of(1.0);
  for (; exponent > 0; exponent /= 2, x *= x)
    if (exponent % 2) power *= x;
  return power;
}

/* Return the truncation error of each unknown, as estimate_truncation in tape_error.f90. */
static void set_truncation(const struct group *g, lanes factor, lanes *left)
{
  const int order = g->order;
  lanes uu = {0.0}, vv = {0.0}, uv = {0.0}, ux = {0.0}, vx = {0.0};
  const lanes power = power_of(factor, order - 3), per_local = 1.0 / g->local;
  const lanes second = power * factor, third = second * factor, fourth = third * factor;
  for (int i = 0; i < g->n; i++) {
    const lanes *a = g->a[FIRST_UNKNOWN + i] + order, weight = g->weights[i] * per_local;
    const lanes x1 = weight * power * a[-3], x2 = weight * second * a[-2];
    const lanes x3 = weight * third * a[-1], x4 = weight * fourth * a[0];
    uu += x3 * x3 + x2 * x2;
    vv += x2 * x2 + x1 * x1;
    uv += x3 * x2 + x2 * x1;
    ux += x3 * x4 + x2 * x3;
    vx += x2 * x4 + x1 * x3;
  }
  uu *= RIDGE;
  vv *= RIDGE;
  lanes p = vv * ux - uv * vx, q = uv * ux - uu * vx;
  lanes determinant = larger((uu * vv - uv * uv - p) + q, absolute(p - q));
  /* A series that converges has no poles within the step, or nearly within. */
  determinant = larger(larger(determinant, absolute(q)), all_of(LEAST));
  determinant = 1.0 / determinant;
  p = (p - q) * determinant;
  q = q * determinant;
  for (int i = 0; i < g->n; i++) {
    const lanes *a = g->a[FIRST_UNKNOWN + i] + order;
    left[i] = p * (a[0] * fourth) - q * (a[-1] * third);
  }
}

/* Replace vectors by the products of the exponential of a matrix and each vector. */
static inline __attribute__((always_inline)) void carry_of(const int n,
                                                           lanes matrix[][MOST],
                                                           lanes vectors[][MOST])
{
  lanes sums[VECTORS][MOST], next[VECTORS][MOST];
#pragma GCC unroll 4
  for (int v = 0; v < VECTORS; v++)
#pragma GCC unroll 7
    for (int i = 0; i < n; i++) sums[v][i] = vectors[v][i];
  for (int k = CARRIED; k > 0; k--) {
    const double part = 1.0 / k;
#pragma GCC unroll 7
    for (int i = 0; i < n; i++) {
      lanes a = {0.0}, b = {0.0}, c = {0.0}, d = {0.0};
#pragma GCC unroll 7
      for (int j = 0; j < n; j++) {
        const lanes element = matrix[i][j];
        a += element * sums[0][j];
        b += element * sums[1][j];
        c += element * sums[2][j];
        d += element * sums[3][j];
      }
      next[0][i] = vectors[0][i] + part * a;
      next[1][i] = vectors[1][i] + part * b;
      next[2][i] = vectors[2][i] + part * c;
      next[3][i] = vectors[3][i] + part * d;
    }
#pragma GCC unroll 4
    for (int v = 0; v < VECTORS; v++)
#pragma GCC unroll 7
      for (int i = 0; i < n; i++) sums[v][i] = next[v][i];
  }
#pragma GCC unroll 4
  for (int v = 0; v < VECTORS; v++)
#pragma GCC unroll 7
    for (int i = 0; i < n; i++) vectors[v][i] = sums[v][i];
}

static void carry(int n, lanes matrix[][MOST],
                                            lanes vectors[][MOST])
{
  if (n == 3) carry_of(3, matrix, vectors);
  else if (n == WITH_ATTITUDE) carry_of(WITH_ATTITUDE, matrix, vectors);
  else carry_of(n, matrix, vectors);
}

/* Set the time, the unknowns and term 0 of all slots. */
static void set_start(struct group *g)
{
  g->a[0][0] = g->t;
  g->a[0][1] = g->h;
  for (int i = 0; i < g->n; i++) g->a[FIRST_UNKNOWN + i][0] = g->y[i];
  set_values(g);
  if (g->all->n_parameters == 0) return;
  const struct tape *tape = &g->all->tape;
  for (int i = 0; i < tape->starts[tape->n_combinations] - 1; i++)
    if (g->factors[i] != NULL) g->scaled[i] = tape->coefficients[i] * *g->factors[i];
}

/* Compare the derivatives with those that the last series had at its end. */
static void check_derivatives(struct group *g)
{
  const int derivatives = g->all->tape.n_combinations - g->n;
  for (int i = 0; i < g->n; i++) {
    const lanes found = g->previous * combined_values(g, derivatives + i);
    const lanes defect = g->weights[i] * absolute(found - g->slope[i]);
    /* NaN is not allowed. */
    g->fails |= g->is_checked & ~(defect <= g->allowed);
    const lanes least = defect * (1.0 / (g->order + 1));
    g->worst = select_of(g->is_checked, larger(g->worst, least), g->worst);
  }
}

/* Return the step, as a factor on the one that was tried, so that it ends at the next stop. */
static lanes ended(const struct group *g, lanes factor, bits *arrives, bits *at_end, lanes *stop)
{
  lanes to_stop = g->rest;
  *stop = g->end;
  for (int i = 0; i < SIDE_BY_SIDE && g->all->n_tables > 0; i++) {
    (*stop)[i] = next_break(g->all, g->t[i], g->end[i]);
    if ((*stop)[i] != g->end[i]) to_stop[i] = ((*stop)[i] - g->t[i]) - g->t_low[i];
  }
  const lanes step = absolute(factor * g->h), whole = to_stop / g->h;
  *arrives = absolute(to_stop) <= step * (1.0 + 1e-3);
  *at_end = *arrives & (*stop == g->end);
  factor = select_of(absolute(to_stop) < 2.0 * step, 0.5 * whole, factor);
  return select_of(*arrives, whole, factor);
}

/* Sum the terms of some unknowns from 1 on, those of their derivatives times the step, and the
   absolute values of the latter. */
static inline __attribute__((always_inline)) void sum_up(const struct group *g, const int first,
                                                         const int count, lanes factor, lanes *change,
                                                         lanes *slope, lanes *size)
{
  lanes sums[4] = {{0.0}}, of_slopes[4] = {{0.0}}, of_sizes[4] = {{0.0}};
  for (int k = g->order; k > 0; k--) {
#pragma GCC unroll 4
    for (int i = 0; i < count; i++) {
      const lanes term = g->a[FIRST_UNKNOWN + first + i][k], weighted = (double)k * term;
      sums[i] = factor * sums[i] + term;
      of_slopes[i] = factor * of_slopes[i] + weighted;
      of_sizes[i] = factor * of_sizes[i] + absolute(weighted);
    }
  }
#pragma GCC unroll 4
  for (int i = 0; i < count; i++) {
    change[first + i] = factor * sums[i];
    slope[first + i] = factor * of_slopes[i];
    size[first + i] = absolute(factor * of_sizes[i]);
  }
}

/* Return a component of perturbation j at time 0, relative to the size of the unknown. */
static double sign_of(const struct group *g, int j, int unknown)
{
  const double even = 1.0 / sqrt(g->n);
  return g->n == PROBES ? unknown == j : (unknown + 1) >> j & 1 ? -even : even;
}

/* The beginning of a step. */
struct start {
  lanes t, t_low, h; /* with the step that was tried */
  lanes error[MOST], low[MOST];
};

/* Return the largest value of an unknown that begins at 0, in a part of the step. */
static lanes reached_size(const struct group *g, int unknown, lanes factor)
{
  lanes most = {0.0};
  for (int i = 1; i <= PARTS; i++) {
    const lanes part = factor * ((double)i / PARTS);
    lanes sum = {0.0};
    for (int k = g->order; k > 0; k--) sum = part * (sum + g->a[FIRST_UNKNOWN + unknown][k]);
    most = larger(most, absolute(sum));
  }
  return most;
}

/* Set unknown sizes of own states to those that the first step may reach; return the lanes. */
static bits guess_sizes(struct group *g)
{
  bits found = {0};
  for (int i = g->n_body; i < g->n; i++) {
    const bits is_unknown = g->is_first & (absolute(g->y[i]) == 0.0) & (g->least[i - g->n_body] == 0.0);
    if (!any(is_unknown)) continue;
    const lanes guess = larger(reached_size(g, i, all_of(1.0)), all_of(LEAST));
    g->sizes[i] = select_of(is_unknown, guess, g->sizes[i]);
    /* The state may stay at 0: the single-body kernel decides to what its errors are relative. */
    g->fails |= is_unknown & ~((guess >= 1.0 / FAR) & (guess <= FAR));
    g->weights[i] = select_of(is_unknown, 1.0 / guess, g->weights[i]);
    for (int j = 0; j < PROBES; j++) {
      const lanes probe = sign_of(g, j, i) * guess;
      g->probes[j][i] = select_of(is_unknown, probe, g->probes[j][i]);
    }
    found |= is_unknown;
  }
  return found;
}

/* Return the lanes whose guesses are much larger than what the first step reaches. */
static bits is_too_large(struct group *g, bits is_guessed, lanes factor)
{
  bits found = {0};
  for (int i = g->n_body; i < g->n; i++) {
    const bits is_own = is_guessed & (absolute(g->y[i]) == 0.0) & (g->least[i - g->n_body] == 0.0);
    const lanes reached = reached_size(g, i, factor);
    found |= is_own & (factor < 1.0) & (g->sizes[i] > MOST_OF_REACHED * reached);
    g->sizes[i] = select_of(is_own, larger(reached, all_of(LEAST)), g->sizes[i]);
  }
  return found;
}

/* Return the estimated error of a lane's body so far. */
static double error_of(const struct group *g, int lane, double growth, double blurred)
{
  return WRONG * g->worst[lane] + UNSEEN * growth * g->local[lane] + ROUNDINGS * blurred;
}

/* Store a body's unknowns and estimates as its next result. */
static void put_row(struct group *g, int lane, const double *z)
{
  const struct bodies *all = g->all;
  const size_t row = g->body[lane] * (size_t)all->n_rows + g->row[lane]++;
  const double growth = sqrt(g->growth[lane]);
  const double blurred = ROUNDING * growth * (1.0 + sqrt(g->noise[lane]));
  double square = 0.0;
  for (int i = 3; i < g->n_body; i++) square += z[i] * z[i];
  for (int i = 0; i < 3; i++) all->omega[row][i] = z[i];
  for (int i = 3; i < g->n_body; i++) all->attitude[row][i - 3] = z[i] / sqrt(square);
  for (int i = 0; i < all->n_own; i++) all->own[row + i * (size_t)all->n * all->n_rows] = z[g->n_body + i];
  if (all->estimates == NULL) return;
  all->estimates[row][0] = error_of(g, lane, growth, blurred);
  all->estimates[row][1] = growth;
}

static const double *times_of(const struct bodies *all, int body)
{
  return all->times + (all->n_times == 1 ? 0 : body * (size_t)all->n_rows);
}

/* Store the results of a lane's body at times within its last step, by the series. */
static void put_rows(struct group *g, int lane, const struct start *start, const lanes *left,
                     double factor)
{
  const double *times = times_of(g->all, g->body[lane]);
  double z[MOST];
  while (g->row[lane] < g->all->n_rows - 1 && fabs(times[g->row[lane]]) <= fabs(g->t[lane])) {
    const double passed = (times[g->row[lane]] - start->t[lane]) - start->t_low[lane];
    const double part = passed / start->h[lane], share = part / factor;
    const double unseen = pow(share, g->order + 1);
    for (int i = 0; i < g->n; i++) {
      const lanes *a = g->a[FIRST_UNKNOWN + i];
      double sum = 0.0, error = start->error[i][lane];
      for (int k = g->order; k > 0; k--) sum = part * (sum + a[k][lane]);
      error += share * (g->error[i][lane] + left[i][lane] - error) - unseen * left[i][lane];
      z[i] = a[0][lane] + (sum + (start->low[i][lane] - error));
    }
    put_row(g, lane, z);
  }
}

/* Take a step in each lane, or shorten the step that the lane tries next. */
static void step(struct group *g)
{
  const int n = g->n, order = g->order;
  lanes jacobian[MOST][MOST], left[MOST], noise[MOST], change[MOST], slope[MOST], size[MOST];
  struct start start = {g->t, g->t_low, g->h};
  bits is_guessed = {0};
  lanes last = {0.0}, total = {0.0}, norm = {0.0}, stop;
  bits arrives, at_end;

  expand(g);
  if (any(g->is_first)) is_guessed = guess_sizes(g);
  for (int k = order - 2; k <= order; k++) {
    for (int i = 0; i < n; i++) {
      const lanes term = g->weights[i] * absolute(g->a[FIRST_UNKNOWN + i][k]);
      last = larger(last, term);
      total += term;
    }
  }
  const bits is_finite = total <= 1.0 / LEAST;
  lanes factor = smaller(ratio_of(order, g->local, last), all_of(LONGER));
  if (any(g->is_first)) {
    /* The local tolerance for the expected number of steps, as in tape_plan.f90. */
    const lanes way = 0.12 * absolute(g->rest / (factor * g->h));
    lanes local = SHARE * g->all->tolerance / (8.0 + way + way * (way / 14.0));
    local = larger(local, all_of(1e-18));
    g->local = select_of(g->is_first, local, g->local);
    factor = smaller(ratio_of(order, g->local, last), all_of(LONGER));
  }
  factor = converged(g, factor);
  set_jacobian(g, factor, jacobian);
  for (int j = 0; j < n; j++) size[j] = j < 3 ? g->scale : j < g->n_body ? all_of(0.5) : g->sizes[j];
  for (int i = 0; i < n; i++) {
    lanes row = {0.0};
    for (int j = 0; j < n; j++) row += absolute(jacobian[i][j]) * size[j];
    norm = larger(norm, g->weights[i] * row);
  }
  const lanes tried = factor;
  factor = select_of(norm > A_STEP, factor * (A_STEP / norm), factor);
  bits accepted = is_finite & (factor >= SHORTER) & (norm <= 1.0 / LEAST);
  const lanes shorter = select_of(is_finite & (factor > 0.01), factor, all_of(0.01)) * g->h;
  factor = ended(g, factor, &arrives, &at_end, &stop);
  const lanes h = factor * g->h;
  set_noise(g, noise);
  lanes reached = g->scale, terms = {0.0}, own = {0.0}, turned = {0.0}, rounded = all_of(1.0), noises = {0.0};
  sum_up(g, 0, 3, factor, change, slope, size);
  if (g->n_body == WITH_ATTITUDE) sum_up(g, 3, 4, factor, change, slope, size);
  for (int i = g->n_body; i < n; i++) sum_up(g, i, 1, factor, change, slope, size);
  if (any(is_guessed)) accepted &= ~is_too_large(g, is_guessed, factor);
  for (int i = 0; i < n; i++) {
    if (i < 3) {
      reached = larger(reached, absolute(g->y[i] + change[i]));
      terms = larger(terms, size[i]);
    } else if (i < g->n_body) {
      turned += 2.0 * size[i];
    } else {
      own = larger(own, g->weights[i] * size[i]);
    }
    /* Perturbations of an unknown that stays near 0 change where its terms do not show it: see
       tape_steady.f90. */
    const lanes near = NEAR_ZERO * g->local * g->is_varying;
    g->fails |= accepted & (g->weights[i] * (absolute(g->y[i]) + size[i]) < near);
    const lanes each = g->weights[i] * noise[i] * absolute(h);
    rounded = larger(rounded, g->weights[i] * size[i] + each);
    noises += each * each;
  }
  /* Large terms that cancel are rounded. */
  const double most = fmax(MOST_CANCELLED, g->all->tolerance / (2.0 * ROUNDING));
  g->fails |= accepted & ~(larger(larger(terms / reached, turned), own) <= most);
  set_truncation(g, factor, left);
  for (int i = 0; i < n; i++)
    for (int j = 0; j < n; j++) jacobian[i][j] *= factor / tried;
  lanes vectors[VECTORS][MOST], worst = {0.0}, growth = {0.0};
  lanes *const error = vectors[PROBES];
  for (int i = 0; i < n; i++) {
    for (int j = 0; j < PROBES; j++) vectors[j][i] = g->probes[j][i];
    error[i] = g->error[i];
  }
  carry(n, jacobian, vectors);
  for (int j = 0; j < PROBES; j++) {
    for (int i = 0; i < n; i++) {
      const lanes each = g->weights[i] * vectors[j][i];
      g->probes[j][i] = select_of(accepted, vectors[j][i], g->probes[j][i]);
      growth += each * each;
    }
  }
  /* As in tape_growth.f90: nearly the largest singular value, and 1 for a rotation. */
  growth = growth * ((double)n / PROBES) + (1.0 - n);
  g->fails |= accepted & ~(growth <= MOST_GROWTH * MOST_GROWTH);
  for (int i = 0; i < n; i++) {
    start.error[i] = g->error[i];
    start.low[i] = g->low[i];
    error[i] -= left[i];
    worst += g->weights[i] * absolute(error[i]);
    g->error[i] = select_of(accepted, error[i], g->error[i]);
    const lanes changed = change[i] + g->low[i], sum = g->y[i] + changed, part = sum - g->y[i];
    const lanes low = (g->y[i] - (sum - part)) + (changed - part);
    g->y[i] = select_of(accepted, sum, g->y[i]);
    g->low[i] = select_of(accepted, low, g->low[i]);
    g->slope[i] = select_of(accepted, slope[i], g->slope[i]);
    g->fails |= accepted & ~(absolute(sum) <= FAR);
  }
  g->worst = select_of(accepted, larger(g->worst, worst), g->worst);
  g->growth = select_of(accepted, larger(g->growth, growth), g->growth);
  g->noise = select_of(accepted, g->noise + noises, g->noise);
  const lanes allowed = MOST_DEFECT * order * g->local + MOST_ROUNDING * 2.0 * ROUNDING * rounded;
  g->allowed = select_of(accepted, allowed, g->allowed);
  g->previous = select_of(accepted, h, g->previous);
  g->scale = select_of(accepted, reached, g->scale);
  g->weights[0] = g->weights[1] = g->weights[2] = 1.0 / g->scale;
  for (int i = g->n_body; i < n; i++) {
    g->sizes[i] = select_of(accepted, larger(g->sizes[i], absolute(g->y[i])), g->sizes[i]);
    g->weights[i] = select_of(accepted, 1.0 / g->sizes[i], g->weights[i]);
  }
  /* The time at a stop is exact. */
  const lanes moved = h + g->t_low, later = g->t + moved, part = later - g->t;
  const lanes later_low = (g->t - (later - part)) + (moved - part);
  const bits here = accepted & arrives, onward = accepted & ~arrives;
  g->t = select_of(here, stop, select_of(onward, later, g->t));
  g->t_low = select_of(here, all_of(0.0), select_of(onward, later_low, g->t_low));
  g->rest = select_of(accepted & at_end, all_of(0.0), (g->end - g->t) - g->t_low);
  g->h = select_of(accepted, h, shorter);
  g->is_first &= ~accepted;
  /* The derivatives may jump at a breakpoint. */
  g->is_checked = g->all->n_tables > 0 ? accepted & ~arrives : accepted;
  g->steps -= accepted;
  g->tries = (g->tries + 1) & ~accepted;
  g->fails |= (g->tries > MOST_TRIES) | (g->steps > MOST_STEPS);
  for (int i = 0; i < SIDE_BY_SIDE && g->all->n_rows > 1; i++)
    if (accepted[i] && g->body[i] >= 0) put_rows(g, i, &start, left, factor[i]);
}

/* Set the inputs of the tape that are parameters, and return whether they are finite. */
static int set_parameters(struct group *g, int lane, int set)
{
  const int n = g->all->n_parameters, first = g->n < N_INPUTS ? N_INPUTS : FIRST_UNKNOWN + g->n;
  double sum = 0.0;
  for (int i = 0; i < n; i++) {
    const double value = g->all->parameters[set * (size_t)n + i];
    g->a[first + i][0][lane] = value;
    sum += fabs(value);
  }
  return sum <= FAR;
}

/* Put body number `body` into a lane, and return whether this kernel takes it. */
static int put_in(struct group *g, int lane, int body)
{
  const struct bodies *all = g->all;
  const double *omega = all->omega0[body], *times = times_of(all, body);
  const double end = times[all->n_rows - 1];
  double own[MOST];
  const double scale = fmax(fabs(omega[0]), fmax(fabs(omega[1]), fabs(omega[2])));
  double sum = fabs(omega[0]) + fabs(omega[1]) + fabs(omega[2]);
  for (int i = 3; i < g->n_body; i++) sum += fabs(all->attitude0[body][i - 3]);
  for (int i = 0; i < all->n_own; i++) {
    own[i] = all->own0[body + i * (size_t)all->n];
    sum += fabs(own[i]);
  }
  /* A sum, because a maximum may lose a NaN. */
  if (!(sum <= FAR && scale >= 1.0 / FAR && fabs(end) <= FAR && fabs(end) >= 1.0 / FAR)) return 0;
  if (!(scale * fabs(end) <= MOST_ANGLE)) return 0;
  if (!set_parameters(g, lane, all->n_sets == 1 ? 0 : body)) return 0;
  for (int i = 0; i < g->n; i++) {
    const int k = i - g->n_body;
    g->y[i][lane] = i < 3 ? omega[i] : k < 0 ? all->attitude0[body][i - 3] : own[k];
    g->weights[i][lane] = i < 3 ? 1.0 / scale : 2.0;
    if (k >= 0) g->least[k][lane] = all->own_sizes[k];
    if (k >= 0) g->sizes[i][lane] = fmax(fabs(own[k]), all->own_sizes[k]);
    if (k >= 0) g->weights[i][lane] = g->sizes[i][lane] > 0.0 ? 1.0 / g->sizes[i][lane] : 0.0;
    g->low[i][lane] = g->error[i][lane] = g->slope[i][lane] = 0.0;
    for (int j = 0; j < PROBES; j++) {
      g->probes[j][i][lane] = g->weights[i][lane] > 0.0 ? sign_of(g, j, i) / g->weights[i][lane] : 0.0;
    }
  }
  g->t[lane] = g->t_low[lane] = g->worst[lane] = g->noise[lane] = g->allowed[lane] = 0.0;
  g->end[lane] = g->rest[lane] = end;
  g->h[lane] = copysign(fmin(fabs(end), 1.0 / scale), end);
  g->scale[lane] = scale;
  g->growth[lane] = 1.0;
  g->local[lane] = 0.125 * all->tolerance;
  g->is_first[lane] = -1;
  g->is_checked[lane] = g->fails[lane] = 0;
  g->steps[lane] = g->tries[lane] = 0;
  g->body[lane] = body;
  g->row[lane] = 0;
  while (g->row[lane] < all->n_rows - 1 && times[g->row[lane]] == 0.0) {
    double z[MOST];
    for (int i = 0; i < g->n; i++) z[i] = g->y[i][lane];
    put_row(g, lane, z);
  }
  return 1;
}

/* Take the last result of a lane's body, or leave the body to the single-body kernel. */
static void take_out(struct group *g, int lane)
{
  const struct bodies *all = g->all;
  const int body = g->body[lane];
  const double growth = sqrt(g->growth[lane]), trusted = TRUSTED / (1.0 + growth / DOUBTED);
  const double blurred = ROUNDING * growth * (1.0 + sqrt(g->noise[lane]));
  double z[MOST];
  if (!g->fails[lane] && g->worst[lane] <= trusted * all->tolerance
      && blurred <= SURE * all->tolerance) {
    for (int i = 0; i < g->n; i++) z[i] = g->y[i][lane] + (g->low[i][lane] - g->error[i][lane]);
    put_row(g, lane, z);
    for (int i = 0; i < all->n_rows; i++) all->status[body * (size_t)all->n_rows + i] = COMPLETE;
  }
  g->body[lane] = -1;
}

/* Put a motion that never ends into an empty lane: its numbers are finite. */
static void clear(struct group *g, int lane)
{
  for (int i = 0; i < g->n; i++) {
    g->weights[i][lane] = g->sizes[i][lane] = 1.0;
    g->y[i][lane] = i == 3;
  }
  g->fails[lane] = -1;
  g->body[lane] = -1;
  if (g->all->n_sets > 0) set_parameters(g, lane, 0);
}

/* Return the largest number of factors of a product. */
static int most_factors(const struct tape *tape, int *factors)
{
  int most = 1;
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    int *out = factors + operation[3] - 1;
    if (operation[0] == PRODUCT) {
      *out = factors[operation[1] - 1] + factors[operation[2] - 1];
      if (*out > MOST_ORDER) *out = MOST_ORDER;
    } else if (operation[0] == LINEAR) {
      for (int i = tape->starts[operation[1] - 1] - 1; i < tape->starts[operation[1]] - 1; i++)
        if (factors[tape->slots[i] - 1] > *out) *out = factors[tape->slots[i] - 1];
    }
    if (*out > most) most = *out;
  }
  return most;
}

/* Return the order of the series; 0 if none suffices. */
static int order_for(const struct bodies *all, int *factors)
{
  /* Measured: a lower order has shorter steps, whose other work costs more. */
  int order = 1 + (int)ceil(-0.7 * log(all->tolerance / 20.0)), least = LEAST_ORDER;
  /* A step would have to end at a switch in one lane and not in others. */
  for (int n = 0; n < all->tape.n_operations; n++)
    if (all->tape.operations[n][0] == SWITCH || all->tape.operations[n][0] == FLOOR) return 0;
  /* Parameters are constant in a motion. */
  const int last = all->tape.n_unknowns < N_INPUTS ? N_INPUTS : FIRST_UNKNOWN + all->tape.n_unknowns;
  for (int i = 0; i < all->n_slots; i++) factors[i] = i < last || i >= last + all->n_parameters;
  const int most = most_factors(&all->tape, factors);
  /* A product of many factors may not show in its first terms: see tape_powers.f90. */
  if (most >= MANY) least = (int)ceil(2 * most / PART_OF_ORDER);
  if (least > MOST_ORDER) return 0;
  if (order > MOST_ORDER) order = MOST_ORDER;
  return order > least ? order : least;
}

/* Compute omega of each body at its time, and its attitude. Its status becomes COMPLETE, or remains
   NEEDS_FALLBACK if it is left to the single-body kernel. */
void OF_LEVEL(solve_tape_bodies, LEVEL)(struct bodies *all)
{
  struct group g;
  const size_t of_slot = TERMS + 2 + MOST, n_slots = all->n_slots;
  const int n = all->tape.n_operations, n_terms = all->tape.starts[all->tape.n_combinations] - 1;
  lanes *memory = aligned_alloc(sizeof(lanes), (n_slots * of_slot + n_terms) * sizeof(lanes));
  int next = 0, active = 0, unseen = 0;

  all->interrupted = 0;
  memset(&g, 0, sizeof g);
  g.depends = calloc(n_slots, sizeof *g.depends);
  g.operations = malloc(n * sizeof *g.operations + 2 * n_terms * sizeof *g.terms
                        + n_slots * sizeof *g.read);
  if (memory != NULL && g.depends != NULL && g.operations != NULL) g.order = order_for(all, g.depends);
  if (g.order == 0) {
    free(memory);
    free(g.depends);
    free(g.operations);
    return;
  }
  memset(g.depends, 0, n_slots * sizeof *g.depends);
  memset(memory, 0, (n_slots * of_slot + n_terms) * sizeof(lanes));
  g.all = all;
  g.n = all->tape.n_unknowns;
  g.n_body = g.n - all->n_own;
  g.leaves = fits_lanes((intptr_t)all->tape.leaves) ? all->tape.leaves : NULL;
  g.a = (series *)memory;
  g.middle = memory + n_slots * TERMS;
  g.noises = g.middle + n_slots;
  g.tangents = (lanes(*)[MOST])(g.noises + n_slots);
  g.scaled = memory + n_slots * of_slot;
  g.terms = (lanes **)(g.operations + n);
  g.factors = g.terms + n_terms;
  g.read = (int *)(g.factors + n_terms);
  find_series(&g);
  find_dependences(&g);
  find_constants(&g);
  find_read(&g);
  for (int i = 0; i < SIDE_BY_SIDE; i++) clear(&g, i);
  g.h = g.previous = g.scale = g.local = all_of(1.0);
  for (;;) {
    int is_new = 0;
    if (active > 0) {
      set_start(&g);
      check_derivatives(&g);
    }
    for (int i = 0; i < SIDE_BY_SIDE; i++) {
      if (g.body[i] >= 0 && !g.fails[i] && g.rest[i] != 0.0) continue;
      if (g.body[i] >= 0) {
        take_out(&g, i);
        active--;
      }
      while (next < all->n && !put_in(&g, i, next)) next++;
      if (next < all->n) {
        next++;
        active++;
        is_new = 1;
      } else {
        clear(&g, i);
      }
    }
    if (active == 0) break;
    if (is_new) set_start(&g);
    step(&g);
    if (++unseen >= BETWEEN_LOOKS) {
      unseen = 0;
      all->interrupted = interrupt_raised();
      if (all->interrupted) break;
    }
  }
  free(memory);
  free(g.depends);
  free(g.operations);
}
