/* Taylor series of all slots of a tape, order by order. A term includes its power of the step. This
   is C because no Fortran compiler keeps four sums in a register. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "tape_groups.h"

typedef double number;

/* Return the size of the working storage, in numbers. */
int64_t OF_LEVEL(size_of_work, LEVEL)(int n_unknowns, int n_operations, int n_products, int n_slots,
                                      int n_terms)
{
  struct work work;
  return divide_work(&work, NULL, n_unknowns, n_operations, n_products, n_slots, n_terms)
         / sizeof(double);
}

/* Divide the working storage, and find the groups of operations that are interpreted. */
void OF_LEVEL(begin_work, LEVEL)(const struct tape *tape, int n_slots)
{
  struct work *work = tape->work;
  const int n_operations = tape->n_operations, nothing = n_slots * TERMS;
  const int derivatives = tape->n_combinations - tape->n_unknowns;
  int numbers[ABREAST], out[ABREAST], count, n_products = 0;
  for (int n = 0; n < n_operations; n++) n_products += tape->operations[n][0] == PRODUCT;
  divide_work(work, tape->work, tape->n_unknowns, n_operations, n_products, n_slots,
              tape->starts[tape->n_combinations] - 1);
  work->n_items = work->n_products = work->n_pairs = work->n_groups = 0;
  work->n_slots = n_slots;
  if (tape->leaves) return;
  work->combinations[0].slots = work->slots;
  work->combinations[0].coefficients = work->coefficients;
  order_operations(tape, work);
  for (int i = 0; i < n_operations; i += count) {
    const int *const operation = tape->operations[work->ordered[i]], kind = kind_of(operation);
    struct item *item = work->items + work->n_items++;
    for (count = 1; kind != OF_OTHERS && count < ABREAST && i + count < n_operations; count++) {
      const int *next = tape->operations[work->ordered[i + count]];
      if (kind_of(next) != kind || work->levels[next[3] - 1] != work->levels[operation[3] - 1]) break;
    }
    *item = (struct item){recurrence_of(operation), work->ordered[i]};
    if (kind == OF_PRODUCTS) {
      struct pairs *group = work->products + work->n_products;
      *item = (struct item){PRODUCTS, work->n_products++};
      for (int lane = 0; lane < ABREAST; lane++) {
        const int *member = tape->operations[work->ordered[i + (lane < count ? lane : 0)]];
        group->x[lane] = (member[1] - 1) * TERMS;
        group->y[lane] = (member[2] - 1) * TERMS;
        group->out[lane] = lane < count ? (member[3] - 1) * TERMS : nothing;
      }
    } else if (kind == OF_COMBINATIONS && count > 1) {
      *item = (struct item){COMBINATIONS, work->n_groups};
      for (int lane = 0; lane < count; lane++) {
        const int *member = tape->operations[work->ordered[i + lane]];
        numbers[lane] = member[1] - 1;
        out[lane] = (member[3] - 1) * TERMS;
      }
      add_combinations(tape, work, count, numbers, out);
    } else
      add_pairs(work, operation);
  }
  for (int i = 0; i < tape->n_unknowns; i += count) {
    for (count = 0; count < ABREAST && i + count < tape->n_unknowns; count++) {
      numbers[count] = derivatives + i + count;
      out[count] = (FIRST_UNKNOWN + i + count) * TERMS;
    }
    add_combinations(tape, work, count, numbers, out);
  }
}

/* The operands of TERM_CASES. */
#define SUM(x, y) *sum++ /* of products of terms */
#define UNLESS(flag, x) ((flag) ? 0.0 : (x))
static inline double halved(double x, double root) { return x ? x / (2.0 * root) : 0.0; }

static inline abreast gathered(const double *terms, const int *at, int k)
{
  return (abreast){terms[at[0] + k], terms[at[1] + k], terms[at[2] + k], terms[at[3] + k]};
}

static inline void scatter(double *terms, const int *at, int k, abreast x)
{
  terms[at[0] + k] = x[0];
  terms[at[1] + k] = x[1];
  terms[at[2] + k] = x[2];
  terms[at[3] + k] = x[3];
}

/* Return the sums of x(j) y(k - j), j = 1 to k - 1. */
static inline abreast products_between(const struct pairs *pairs, int k)
{
  abreast one = {0.0}, two = {0.0};
  int j = 1;
  for (; j < k - 1; j += 2) {
    one += pairs->of_x[j] * pairs->of_y[k - j];
    two += pairs->of_x[j + 1] * pairs->of_y[k - j - 1];
  }
  if (j < k) one += pairs->of_x[j] * pairs->of_y[k - j];
  return one + two;
}

static inline void multiply(struct pairs *pairs, double *terms, int k)
{
  const abreast sum = products_between(pairs, k);
  const abreast x = gathered(terms, pairs->x, k), y = gathered(terms, pairs->y, k);
  pairs->of_x[k] = x;
  pairs->of_y[k] = y;
  scatter(terms, pairs->out, k, sum + (x * pairs->of_y[0] + pairs->of_x[0] * y));
}

static inline abreast combine(const struct combinations *group, const double *terms, int k)
{
  abreast sum = {0.0};
  for (int i = 0; i < group->n_terms; i++)
    sum += group->coefficients[i] * gathered(terms, group->slots[i], k);
  return sum;
}

static inline double combined(const struct tape *tape, int n, int k, const series *a)
{
  double sum = k == 0 ? tape->constants[n] : 0.0;
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++)
    sum += tape->coefficients[i] * a[tape->slots[i] - 1][k];
  return sum;
}

static inline double size(double x) { return fabs(x); }
static inline double slope_at_root(double root) { return 0.5 / (root > 0x1p-1022 ? root : 0x1p-1022); }
#define OTHER_ROUNDINGS \
  case SELECT: e[o] = size(a[chosen(tape, operation)][0]) + e[chosen(tape, operation)]; break;
#include "tape_noise.h"

/* Compute the terms of all slots below the order, and those of the unknowns up to it. Inputs are
   term 0 of all slots, and all terms of the time and of tables. */
void OF_LEVEL(expand_tape, LEVEL)(const struct tape *tape, double h, int order)
{
  series *const a = tape->a;
  double *const terms = a[0];
  const struct work *work = tape->work;
  if (tape->leaves) {
    tape->leaves->expand(terms, tape->coefficients, tape->constants, (double *)work->unknowns, h, order);
    return;
  }
  const int derivatives = tape->n_combinations - tape->n_unknowns;
  const int n_sums = (work->n_pairs + ABREAST - 1) / ABREAST;
  const int n_groups = (tape->n_unknowns + ABREAST - 1) / ABREAST;
  const struct combinations *const rates = work->combinations + work->n_groups - n_groups;

  for (int i = 0; i < work->n_products; i++) {
    struct pairs *pairs = work->products + i;
    pairs->of_x[0] = gathered(terms, pairs->x, 0);
    pairs->of_y[0] = gathered(terms, pairs->y, 0);
  }
  for (int i = 0; i < tape->n_unknowns; i++)
    a[FIRST_UNKNOWN + i][1] = h * combined(tape, derivatives + i, 0, a);
  for (int i = 0; i < n_groups; i++) work->unknowns[i][1] = gathered(terms, rates[i].out, 1);
  for (int k = 1; k < order; k++) {
    /* Of the operations that are no products, all sums are known before the order begins. */
    for (int i = 0; i < n_sums; i++) {
      struct pairs *pairs = work->others + i;
      pairs->of_x[k - 1] = gathered(terms, pairs->x, k - 1);
      pairs->of_y[k - 1] = gathered(terms, pairs->y, k - 1);
      work->sums[i] = products_between(pairs, k);
    }
    const double *sum = (const double *)work->sums, whole = k, per_k = 1.0 / whole;
    for (const struct item *item = work->items; item < work->items + work->n_items; item++) {
      if (item->kind == PRODUCTS) {
        multiply(work->products + item->number, terms, k);
        continue;
      }
      if (item->kind == COMBINATIONS) {
        const struct combinations *group = work->combinations + item->number;
        scatter(terms, group->out, k, combine(group, terms, k));
        continue;
      }
      const int *operation = tape->operations[item->number];
      const double *const x = a[operation[1] - 1], *const y = a[operation[2] - 1];
      double *const o = a[operation[3] - 1], *const p = o + TERMS, *const q = p + TERMS;
      switch (item->kind) {
      case LINEAR: o[k] = combined(tape, operation[1] - 1, k, a); break;
      case SELECT: o[k] = a[chosen(tape, operation)][k]; break;
      TERM_CASES
      default: break; /* a table, or a switch */
      }
    }
    const abreast part = (abreast){0.0} + h / (k + 1);
    for (int i = 0; i < n_groups; i++) {
      work->unknowns[i][k + 1] = part * combine(rates + i, terms, k);
      scatter(terms, rates[i].out, k + 1, work->unknowns[i][k + 1]);
    }
  }
}

/* Compute term 0 of all slots and the rates, and return whether the leaves can. */
int OF_LEVEL(begin_values, LEVEL)(const struct tape *tape, double *rates)
{
  if (!tape->leaves || !tape->leaves->set_values) return 0;
  tape->leaves->set_values(tape->a, tape->coefficients, tape->constants, rates);
  return 1;
}

/* Bound the rounding errors of the rates. Those of the unknowns may be missing. */
void OF_LEVEL(bound_noise, LEVEL)(const struct tape *tape, int n_slots, double *of_slots,
                                  double *noise, const double *of_unknowns)
{
  if (tape->leaves && !of_unknowns) {
    tape->leaves->set_noise(tape->a, tape->coefficients, tape->constants, noise);
    return;
  }
  memset(of_slots, 0, n_slots * sizeof *of_slots);
  if (of_unknowns) memcpy(of_slots + FIRST_UNKNOWN, of_unknowns, tape->n_unknowns * sizeof *of_slots);
  bound_roundings(tape, tape->a, of_slots, noise);
}

/* For the part `factor` of the step, sum the terms of the unknowns from 1 on (`changes`), the terms
   of their derivatives times the step (`slopes`), and the absolute terms of these (`sizes`). */
void OF_LEVEL(sum_terms, LEVEL)(const struct tape *tape, int order, double factor, double *changes,
                                double *slopes, double *sizes)
{
  const struct work *work = tape->work;
  const abreast_bits magnitude = ~(abreast_bits)(-(abreast){0.0});
  for (int i = 0; i * ABREAST < tape->n_unknowns; i++) {
    abreast change = {0.0}, slope = {0.0}, size = {0.0};
    for (int k = order; k > 0; k--) {
      const abreast x = work->unknowns[i][k], rate = (double)k * x;
      change = factor * (change + x);
      slope = factor * (slope + rate);
      size = factor * (size + (abreast)((abreast_bits)rate & magnitude));
    }
    *(abreast_anywhere *)(changes + i * ABREAST) = change;
    *(abreast_anywhere *)(slopes + i * ABREAST) = slope;
    *(abreast_anywhere *)(sizes + i * ABREAST) = size;
  }
}
