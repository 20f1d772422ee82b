/* Taylor series of all slots of a tape, order by order, and those of eight perturbations side by
   side. A term includes its power of the step. This is C because no Fortran compiler keeps eight
   sums in registers. Registers of fewer than eight numbers work too: the compiler divides them. */
#include <string.h>

#include "tape.h"

enum { SIDE_BY_SIDE = 8, TERMS = 40, TERMS_OF_PERTURBATION = 29 };

typedef double lanes __attribute__((vector_size(8 * SIDE_BY_SIDE)));
typedef long long bits __attribute__((vector_size(8 * SIDE_BY_SIDE)));
typedef double series[TERMS];
typedef double perturbations[TERMS_OF_PERTURBATION][SIDE_BY_SIDE];

/* block_t of tape_series.f90. Where the derivative of unknown i depends on a parameter itself,
   combination forcings[i][lane] of the series is the partial derivative; 0 stands for none. */
struct block {
  struct tape tape;
  int forcings[MOST_UNKNOWNS][SIDE_BY_SIDE];
  int last_term;
  double sizes[SIDE_BY_SIDE];
};

enum { SMALL_TERMS = 3, MOST_TRIES = 60 }; /* last terms of derivatives that are small; cuts of a step */
#define SHORTER 0.7        /* factor of a cut */
#define MOST_CANCELLED 1e3 /* largest term over the size of a derivative */
static inline perturbations *perturbations_of(const struct tape *tape) { return tape->v; }

/* The same at any address. */
typedef lanes lanes_anywhere __attribute__((aligned(8)));

static inline lanes loaded(const double *from) { return *(const lanes_anywhere *)from; }

static inline void store(double *to, lanes x) { *(lanes_anywhere *)to = x; }

/* Return a mask of the first n numbers. */
static inline bits first_of(int n)
{
  static const long long ones[2 * SIDE_BY_SIDE] = {-1, -1, -1, -1, -1, -1, -1, -1};
  bits mask;
  n = n < 0 ? 0 : n < SIDE_BY_SIDE ? n : SIDE_BY_SIDE;
  memcpy(&mask, ones + SIDE_BY_SIDE - n, sizeof mask);
  return mask;
}

/* The terms of two factors, from term 1 on, that add_products takes: at most two registers. */
struct range {
  int k, registers;
  bits of_a[2], of_b[2];
};

static inline struct range range_of(int k, int order)
{
  const int last = k - 1 < order - k ? k - 1 : order - k; /* at most 14 */
  struct range range = {k, (last + SIDE_BY_SIDE - 1) / SIDE_BY_SIDE};
  for (int i = 0; i < 2; i++) {
    range.of_a[i] = first_of(k - 2 - i * SIDE_BY_SIDE);
    range.of_b[i] = first_of(k - 1 - i * SIDE_BY_SIDE);
  }
  return range;
}

/* Add to the terms of a sum, from term k on, all products of which one factor is term k - 1 and the
   other a term from 1 to k - 1 (relaxed multiplication: van der Hoeven 2002, section 4). Return term
   k, which then lacks the products with terms 0 alone. The factors were stored one order before:
   a load would have to wait for a store that it overlaps. */
static inline double add_products(double *sum, const double *a, const double *b, double sign,
                                  const struct range *range)
{
  const int k = range->k;
  const double x = sign * a[k - 1], y = sign * b[k - 1];
  double newest = 0.0;
  for (int i = 0; i < range->registers; i++) {
    const int from = 1 + i * SIDE_BY_SIDE;
    lanes u = (lanes)((bits)loaded(b + from) & range->of_b[i]);
    lanes v = (lanes)((bits)loaded(a + from) & range->of_a[i]);
    double *to = sum + k - 1 + from;
    lanes total = loaded(to) + (x * u + y * v);
    store(to, total);
    if (i == 0) newest = total[0];
  }
  return newest;
}

static inline double combined(const struct tape *tape, int n, int k, const series *a)
{
  double sum = k == 0 ? tape->constants[n] : 0.0;
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++)
    sum += tape->coefficients[i] * a[tape->slots[i] - 1][k];
  return sum;
}

/* Compute the terms of all slots below the order, and those of the unknowns up to it. Inputs are
   term 0 of all slots, and all terms of the time and of tables. */
void OF_LEVEL(expand_tape, LEVEL)(const struct tape *tape, double h, int order)
{
  series *const a = tape->a;
  const int derivatives = tape->n_combinations - tape->n_unknowns;

  for (int n = 0; n < tape->n_operations; n++) {
    double *out = a[tape->operations[n][3] - 1];
    if (tape->operations[n][0] == TABLE) continue;
    /* Terms beyond the order are zeroed too: sums in the other places of a register must not grow
       from step to step. */
    memset(out + 1, 0, (TERMS - 1) * sizeof *out);
    if (tape->operations[n][0] == SINE_COSINE || tape->operations[n][0] == TANH)
      memset(out + TERMS + 1, 0, (TERMS - 1) * sizeof *out);
  }
  for (int k = 0; k < order; k++) {
    const struct range range = range_of(k, order);
    for (int n = 0; k > 0 && n < tape->n_operations; n++) {
      const int *operation = tape->operations[n];
      const double *x = a[operation[1] - 1], *y = a[operation[2] - 1];
      double *out = a[operation[3] - 1], *angle, sum;
      switch (operation[0]) {
      case LINEAR:
        out[k] = combined(tape, operation[1] - 1, k, a);
        break;
      case PRODUCT:
        out[k] = add_products(out, x, y, 1.0, &range) + (x[k] * y[0] + x[0] * y[k]);
        break;
      case QUOTIENT:
        sum = add_products(out, y, out, -1.0, &range);
        out[k] = (x[k] + sum - y[k] * out[0]) / y[0];
        break;
      case SQRT:
        out[k] = (x[k] + add_products(out, out, out, -1.0, &range)) / (2.0 * out[0]);
        break;
      case EXP:
        /* The second slot has k times the terms of the argument. */
        angle = out + TERMS;
        if (angle[0]) break; /* It is constant, because it is large. */
        angle[k] = k * x[k];
        out[k] = (add_products(out, angle, out, 1.0, &range) + angle[k] * out[0]) / k;
        break;
      case SINE_COSINE:
        angle = out + 2 * TERMS;
        angle[k] = k * x[k];
        sum = add_products(out, angle, out + TERMS, 1.0, &range);
        out[TERMS + k] = (add_products(out + TERMS, angle, out, -1.0, &range) - angle[k] * out[0]) / k;
        out[k] = (sum + angle[k] * out[TERMS]) / k;
        break;
      case TANH:
        /* The second slot is 1 minus the square, the derivative. */
        angle = out + 2 * TERMS;
        angle[k] = k * x[k];
        out[k] = (add_products(out, angle, out + TERMS, 1.0, &range) + angle[k] * out[TERMS]) / k;
        out[TERMS + k] = add_products(out + TERMS, out, out, -1.0, &range) - 2.0 * out[k] * out[0];
        break;
      default: /* a table */
        break;
      }
    }
    for (int i = 0; i < tape->n_unknowns; i++)
      a[FIRST_UNKNOWN + i][k + 1] = h / (k + 1) * combined(tape, derivatives + i, k, a);
  }
}

/* Return the sum of the products of the terms of perturbations with those of a series, for two of
   each. The newest term of the perturbations is left to the caller, who adds it last: the sum of
   the others need not wait for it. */
static inline lanes convolved(const double (*v)[SIDE_BY_SIDE], const double *a,
                              const double (*w)[SIDE_BY_SIDE], const double *b, int k)
{
  lanes first = {0.0}, second = {0.0};
  for (int j = 0; j < k; j++) {
    first += loaded(v[j]) * a[k - j];
    second += loaded(w[j]) * b[k - j];
  }
  return first + second;
}

/* Return the same sum of many terms, in four parts that need not wait for each other. */
static inline lanes convolved_many(const double (*v)[SIDE_BY_SIDE], const double *a,
                                   const double (*w)[SIDE_BY_SIDE], const double *b, int k)
{
  lanes first = {0.0}, second = {0.0}, third = {0.0}, fourth = {0.0};
  int j = 0;
  for (; j + 1 < k; j += 2) {
    first += loaded(v[j]) * a[k - j];
    second += loaded(w[j]) * b[k - j];
    third += loaded(v[j + 1]) * a[k - j - 1];
    fourth += loaded(w[j + 1]) * b[k - j - 1];
  }
  if (j < k) first += loaded(v[j]) * a[k - j], second += loaded(w[j]) * b[k - j];
  return (first + second) + (third + fourth);
}

/* Return the same sum for one of each. */
static inline lanes convolved_one(const double (*v)[SIDE_BY_SIDE], const double *a, int k)
{
  const int half = k / 2;
  lanes sum = convolved(v, a + (k - half), v + half, a + k % 2, half);
  return k % 2 ? sum + loaded(v[k - 1]) * a[1] : sum;
}

static inline lanes perturbed(const struct tape *tape, int n, int k, const perturbations *v)
{
  lanes sum = {0.0};
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++)
    sum += tape->coefficients[i] * loaded(v[tape->slots[i] - 1][k]);
  return sum;
}

/* Compute term k of eight perturbations of all slots, and term k + 1 of those of the unknowns. Where
   they are forced, the terms of the unknowns have a part of their own already. */
static inline __attribute__((always_inline)) void perturb(const struct tape *tape, double h, int k,
                                                          int is_forced)
{
  const series *const a = (const series *)tape->a;
  perturbations *const v = tape->v;
  const int derivatives = tape->n_combinations - tape->n_unknowns;
  lanes x;

  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    const int first = operation[1] - 1, second = operation[2] - 1, out = operation[3] - 1;
    switch (operation[0]) {
    case LINEAR:
      x = perturbed(tape, first, k, (const perturbations *)v);
      break;
    case PRODUCT:
      x = is_forced ? convolved_many(v[first], a[second], v[second], a[first], k)
                    : convolved(v[first], a[second], v[second], a[first], k);
      x += loaded(v[first][k]) * a[second][0] + loaded(v[second][k]) * a[first][0];
      break;
    case QUOTIENT:
      x = is_forced ? convolved_many(v[second], a[out], v[out], a[second], k)
                    : convolved(v[second], a[out], v[out], a[second], k);
      x = (loaded(v[first][k]) - loaded(v[second][k]) * a[out][0] - x) / a[second][0];
      break;
    case SQRT:
      x = (0.5 * loaded(v[first][k]) - convolved_one(v[out], a[out], k)) / a[out][0];
      break;
    case EXP:
      x = convolved_one(v[first], a[out], k) + loaded(v[first][k]) * a[out][0];
      break;
    case TANH:
      x = convolved_one(v[first], a[out + 1], k) + loaded(v[first][k]) * a[out + 1][0];
      break;
    case SINE_COSINE:
      x = convolved_one(v[first], a[out], k) + loaded(v[first][k]) * a[out][0];
      store(v[out + 1][k], -x);
      x = convolved_one(v[first], a[out + 1], k) + loaded(v[first][k]) * a[out + 1][0];
      break;
    default: /* a table, which has no perturbation */
      x = (lanes){0.0};
      break;
    }
    store(v[out][k], x);
  }
  for (int i = 0; i < tape->n_unknowns; i++) {
    double *to = v[FIRST_UNKNOWN + i][k + 1];
    x = h / (k + 1) * perturbed(tape, derivatives + i, k, (const perturbations *)v);
    store(to, is_forced ? loaded(to) + x : x);
  }
}

/* Return the larger of two numbers in each lane; NaN in the second is not lost. */
static inline lanes larger(lanes first, lanes second)
{
  const bits is_smaller = second <= first;
  return (lanes)(((bits)first & is_smaller) | ((bits)second & ~is_smaller));
}

static inline int all_below(lanes x, lanes limit)
{
  const bits is_below = x <= limit;
  long long all = -1;
  for (int lane = 0; lane < SIDE_BY_SIDE; lane++) all &= is_below[lane];
  return all != 0;
}

/* Return the largest term k of each perturbation of the unknowns, with weights that make the unknowns
   comparable. `units` makes the perturbations comparable. */
static inline lanes largest_terms(const struct tape *tape, int k, const double *weights, lanes units)
{
  const bits magnitude = ~(bits)(-(lanes){0.0});
  lanes most = {0.0};
  for (int i = 0; i < tape->n_unknowns; i++) {
    const lanes x = (lanes)((bits)loaded(perturbations_of(tape)[FIRST_UNKNOWN + i][k]) & magnitude);
    most = larger(most, weights[i] * units * x);
  }
  return most;
}

/* Return the largest term k of all perturbations but the error. */
static inline double largest(const struct tape *tape, int k, const double *weights, lanes units)
{
  const lanes most = largest_terms(tape, k, weights, units);
  double found = 0.0;
  for (int lane = 1; lane < SIDE_BY_SIDE; lane++)
    if (most[lane] > found) found = most[lane];
  return found;
}

/* Expand the perturbations, whose values are terms 0 of the unknowns, to as many terms as they need
   for the part `factor` of the step, and return the number of the last term. `is_short` says that
   all terms do not suffice. `tolerance` is the largest relative size of a term that is left out. */
int OF_LEVEL(perturb_tape, LEVEL)(const struct tape *tape, double h, int order, double factor,
                                  const double *weights, double tolerance, int *is_short)
{
  /* Perturbation n was a unit of unknown n when it began. The error, perturbation 0, does not count,
     because it may be zero. */
  lanes units = {0.0};
  for (int i = 0; i < tape->n_unknowns; i++) units[i + 1] = 1.0 / weights[i];
  const double first = largest(tape, 0, weights, units);
  double before = first, power = 1.0;
  int k = 0;
  do {
    perturb(tape, h, k++, 0);
    power *= factor;
    const double size = power * largest(tape, k, weights, units);
    /* Every other term may be zero. */
    *is_short = !(size <= tolerance * first && before <= tolerance * first);
    before = size;
  } while (*is_short && k < order);
  return k;
}

/* Add the terms of combination n of the series, times h, to the next terms of one derivative. */
static void force(const struct tape *tape, int n, double h, int order, double (*to)[SIDE_BY_SIDE])
{
  series sum = {tape->constants[n]};
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++) {
    const double coefficient = tape->coefficients[i], *from = ((series *)tape->a)[tape->slots[i] - 1];
    for (int k = 0; k < order; k++) sum[k] += coefficient * from[k];
  }
  for (int k = 0; k < order; k++) to[k + 1][0] = h / (k + 1) * sum[k];
}

/* Return the size of derivatives, the largest so far, or where they were 0 their first other term. */
static inline lanes begun(lanes size, lanes term)
{
  const bits begins = size == (lanes){0.0};
  return (lanes)(((bits)term & begins) | ((bits)size & ~begins));
}

/* Return whether the terms up to `last` suffice for the part `factor` of the step: whether the last
   ones are small, and none is much larger than the derivative itself. */
static int suffice(const lanes *terms, int last, double factor, lanes size, double tolerance)
{
  lanes largest = {0.0}, tail = {0.0};
  double power = 1.0;
  for (int k = 0; k <= last; k++, power *= factor) {
    const lanes term = power * terms[k];
    size = begun(size, term);
    largest = larger(largest, term);
    if (k > last - SMALL_TERMS) tail = larger(tail, term);
  }
  return all_below(tail, tolerance * size) && all_below(largest, MOST_CANCELLED * size);
}

/* Compute the terms of eight derivatives of the unknowns with respect to parameters, whose terms 0 are
   inputs, to as many as they need for the part `factor` of the step. Return the factor, reduced until
   the terms suffice; 0 if they are not finite. */
double OF_LEVEL(vary_tape, LEVEL)(struct block *block, double h, int order, double factor,
                                  const double *weights, double tolerance)
{
  const struct tape *tape = &block->tape;
  const lanes zero = {0.0}, one = zero + 1.0;
  lanes size = loaded(block->sizes), sizes[TERMS_OF_PERTURBATION];
  lanes beyond[TERMS_OF_PERTURBATION + 1];
  double powers[TERMS_OF_PERTURBATION];
  int k = 0, small = 0, tries = 0;
  powers[0] = 1.0;
  for (int j = 1; j <= order; j++) powers[j] = factor * powers[j - 1];
  for (int i = 0; i < tape->n_unknowns; i++) {
    double(*terms)[SIDE_BY_SIDE] = perturbations_of(tape)[FIRST_UNKNOWN + i];
    memset(terms[1], 0, order * sizeof terms[1]);
    for (int lane = 0; lane < SIDE_BY_SIDE; lane++)
      if (block->forcings[i][lane])
        force(tape, block->forcings[i][lane] - 1, h, order,
              (double(*)[SIDE_BY_SIDE])(terms[0] + lane));
  }
  /* The largest part of any later term that does not depend on the derivatives. */
  beyond[order + 1] = zero;
  for (int j = order; j > 0; j--)
    beyond[j] = larger(beyond[j + 1], powers[j] * largest_terms(tape, j, weights, one));
  for (;; k++) {
    if (k > 0) perturb(tape, h, k - 1, 1);
    sizes[k] = largest_terms(tape, k, weights, one);
    const lanes term = powers[k] * sizes[k];
    size = begun(size, term);
    /* One or two terms may be zero between others. */
    small = all_below(larger(term, beyond[k + 1]), tolerance * size) ? small + 1 : 0;
    if (small == SMALL_TERMS || k == order) break;
  }
  block->last_term = k;
  while (!suffice(sizes, k, factor, loaded(block->sizes), tolerance)) {
    if (++tries > MOST_TRIES) return 0.0;
    factor *= SHORTER;
  }
  return factor;
}

/* Sum the terms of the perturbations of each unknown up to `last` for the part `factor` of the
   step. */
void OF_LEVEL(sum_perturbations, LEVEL)(const struct tape *tape, int last, double factor,
                                        double (*sums)[SIDE_BY_SIDE])
{
  for (int i = 0; i < tape->n_unknowns; i++) {
    lanes sum = loaded(perturbations_of(tape)[FIRST_UNKNOWN + i][last]);
    for (int k = last - 1; k >= 0; k--) sum = factor * sum + loaded(perturbations_of(tape)[FIRST_UNKNOWN + i][k]);
    store(sums[i], sum);
  }
}
