/* Taylor series of the derivatives of all slots with respect to eight parameters side by side, by the
   recurrences of the operations. Registers of fewer than eight numbers work too: the compiler
   divides them. */
#include <string.h>

#include "tape_perturbations.h"

typedef double lanes __attribute__((vector_size(8 * SIDE_BY_SIDE)));
typedef long long bits __attribute__((vector_size(8 * SIDE_BY_SIDE)));

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

/* The same at any address. */
typedef lanes lanes_anywhere __attribute__((aligned(8)));

static inline lanes loaded(const double *from) { return *(const lanes_anywhere *)from; }

static inline void store(double *to, lanes x) { *(lanes_anywhere *)to = x; }

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

/* Compute term k of eight perturbations of all slots, and add the part that depends on them to term
   k + 1 of those of the unknowns. */
static void perturb(const struct tape *tape, double h, int k)
{
  const series *const a = (const series *)tape->a;
  perturbations *const v = tape->v;
  const int derivatives = tape->n_combinations - tape->n_unknowns;

  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n], kind = operation[0];
    const int first = operation[1] - 1, y = operation[2] - 1, o = operation[3] - 1, p = o + 1;
    lanes x = {0.0};
    int slope = -1; /* the slot whose series is the derivative by the operand */
    switch (kind) {
    case LINEAR: x = perturbed(tape, first, k, (const perturbations *)v); break;
    case PRODUCT:
      x = convolved_many(v[first], a[y], v[y], a[first], k);
      x += loaded(v[first][k]) * a[y][0] + loaded(v[y][k]) * a[first][0];
      break;
    case QUOTIENT:
      x = convolved_many(v[y], a[o], v[o], a[y], k);
      x = (loaded(v[first][k]) - loaded(v[y][k]) * a[o][0] - x) / a[y][0];
      break;
    case SQRT:
      x = (0.5 * loaded(v[first][k]) - convolved_one(v[o], a[o], k)) / a[o][0];
      break;
    case SELECT: x = loaded(v[chosen(tape, operation)][k]); break;
    SLOPE_SERIES_CASES
    default: break; /* a table or a switch, which have no perturbation */
    }
    if (slope >= 0) x = convolved_one(v[first], a[slope], k) + loaded(v[first][k]) * a[slope][0];
    if (kind == SINE_COSINE)
      store(v[p][k], -convolved_one(v[first], a[o], k) - loaded(v[first][k]) * a[o][0]);
    store(v[o][k], x);
  }
  for (int i = 0; i < tape->n_unknowns; i++) {
    double *to = v[FIRST_UNKNOWN + i][k + 1];
    const lanes x = perturbed(tape, derivatives + i, k, (const perturbations *)v);
    store(to, loaded(to) + h / (k + 1) * x);
  }
}

/* Return the larger of two numbers in each lane; NaN in the second is not lost. */
static inline lanes larger_lanes(lanes first, lanes second)
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

/* Return the largest term k of each derivative of the unknowns, with weights that make the unknowns
   comparable. */
static inline lanes largest_terms(const struct tape *tape, int k, const double *weights)
{
  const bits magnitude = ~(bits)(-(lanes){0.0});
  lanes most = {0.0};
  for (int i = 0; i < tape->n_unknowns; i++) {
    const lanes x = (lanes)((bits)loaded(perturbations_of(tape)[FIRST_UNKNOWN + i][k]) & magnitude);
    most = larger_lanes(most, weights[i] * x);
  }
  return most;
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

/* Return the magnitudes of derivatives that were 0 so far, at the part `factor` of the step. */
static lanes reached(const struct tape *tape, int last, double factor, const double *weights,
                     lanes size)
{
  const bits begins = size == (lanes){0.0}, magnitude = ~(bits)(-(lanes){0.0});
  double sums[MOST_UNKNOWNS][SIDE_BY_SIDE];
  lanes most = {0.0};
  OF_LEVEL(sum_perturbations, LEVEL)(tape, last, factor, sums);
  for (int i = 0; i < tape->n_unknowns; i++)
    most = larger_lanes(most, weights[i] * (lanes)((bits)loaded(sums[i]) & magnitude));
  return (lanes)((bits)most & begins);
}

/* Return whether the terms up to `last` suffice for the part `factor` of the step: whether the last
   ones are small, and none is much larger than the derivative itself, `size` or `end`. */
static int suffice(const lanes *terms, int last, double factor, lanes size, lanes end,
                   double tolerance)
{
  lanes largest = {0.0}, tail = {0.0};
  double power = 1.0;
  for (int k = 0; k <= last; k++, power *= factor) {
    const lanes term = power * terms[k];
    size = begun(size, term);
    largest = larger_lanes(largest, term);
    if (k > last - SMALL_TERMS) tail = larger_lanes(tail, term);
  }
  /* The first other term of a derivative that was 0 may be a rounding error. */
  size = larger_lanes(size, end);
  return all_below(tail, tolerance * size) && all_below(largest, MOST_CANCELLED * size);
}

/* Compute the terms of eight derivatives of the unknowns with respect to parameters, whose terms 0 are
   inputs, to as many as they need for the part `factor` of the step. Return the factor, reduced until
   the terms suffice; 0 if they are not finite. */
double OF_LEVEL(vary_tape, LEVEL)(struct block *block, double h, int order, double factor,
                                  const double *weights, double tolerance)
{
  const struct tape *tape = &block->tape;
  const lanes zero = {0.0};
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
    beyond[j] = larger_lanes(beyond[j + 1], powers[j] * largest_terms(tape, j, weights));
  for (;; k++) {
    if (k > 0) perturb(tape, h, k - 1);
    sizes[k] = largest_terms(tape, k, weights);
    const lanes term = powers[k] * sizes[k];
    size = begun(size, term);
    /* One or two terms may be zero between others. */
    small = all_below(larger_lanes(term, beyond[k + 1]), tolerance * size) ? small + 1 : 0;
    if (small == SMALL_TERMS || k == order) break;
  }
  block->last_term = k;
  size = loaded(block->sizes);
  while (!suffice(sizes, k, factor, size, reached(tape, k, factor, weights, size), tolerance)) {
    if (++tries > MOST_TRIES) return 0.0;
    factor *= SHORTER;
  }
  return factor;
}
