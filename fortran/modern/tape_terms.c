/* Taylor series of all slots of a tape, order by order, and those of eight perturbations side by
   side. A term includes its power of the step. This is C because no Fortran compiler keeps eight
   sums in registers. Registers of fewer than eight numbers work too: the compiler divides them. */
#include <math.h>
#include <stdint.h>
#include <string.h>

#include "tape_groups.h"

typedef double lanes __attribute__((vector_size(8 * SIDE_BY_SIDE)));
typedef long long bits __attribute__((vector_size(8 * SIDE_BY_SIDE)));
typedef double number, series[TERMS];
typedef double perturbations[TERMS_OF_PERTURBATION][SIDE_BY_SIDE];

/* block_t of tape_series.f90. Where the derivative of unknown i depends on a parameter itself,
   combination forcings[i][lane] of the series is the partial derivative; 0 stands for none. */
struct block {
  struct tape tape;
  int forcings[MOST_UNKNOWNS][SIDE_BY_SIDE];
  int last_term;
  double sizes[SIDE_BY_SIDE];
};

/* Terms of a perturbation that are first checked: most steps need them and the next one. */
enum { FIRST_CHECKED = 5, FIRST_OF_LONG = 8 };
enum { SMALL_TERMS = 3, MOST_TRIES = 60 }; /* last terms of derivatives that are small; cuts of a step */
#define SHORTER 0.7        /* factor of a cut */
#define DECAYED 1e-100     /* largest perturbation beside which the error counts */
#define MOST_CANCELLED 1e3 /* largest term over the size of a derivative */
static inline perturbations *perturbations_of(const struct tape *tape) { return tape->v; }

/* The same at any address. */
typedef lanes lanes_anywhere __attribute__((aligned(8)));

static inline lanes loaded(const double *from) { return *(const lanes_anywhere *)from; }

static inline void store(double *to, lanes x) { *(lanes_anywhere *)to = x; }

/* The same at any address. */
typedef reg reg_anywhere __attribute__((aligned(8)));
#define ALWAYS_INLINE inline __attribute__((always_inline))

/* The Jacobian, eight columns side by side: [j / 8][i][j % 8] is that of rate i by unknown j. */
enum { BLOCKS = (MOST_UNKNOWNS + SIDE_BY_SIDE - 1) / SIDE_BY_SIDE };
typedef row matrix[BLOCKS][MOST_UNKNOWNS];

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

/* Return the slot that SELECT chooses: the only one of its combination, or of the next one. */
static int chosen(const struct tape *tape, const int *operation)
{
  const series *const a = tape->a;
  const int combination = operation[2] - 1 + (a[operation[1] - 1][0] == 0.0);
  return tape->slots[tape->starts[combination] - 1] - 1;
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

/* Return the largest term k of each perturbation of the unknowns, with weights that make the unknowns
   comparable. `units` makes the perturbations comparable. */
static inline lanes largest_terms(const struct tape *tape, int k, const double *weights, lanes units)
{
  const bits magnitude = ~(bits)(-(lanes){0.0});
  lanes most = {0.0};
  for (int i = 0; i < tape->n_unknowns; i++) {
    const lanes x = (lanes)((bits)loaded(perturbations_of(tape)[FIRST_UNKNOWN + i][k]) & magnitude);
    most = larger_lanes(most, weights[i] * units * x);
  }
  return most;
}

/* Return the sizes of terms k of the perturbations from lane p on: weighted sums over unknowns. */
static inline reg sizes_of(const struct tape *tape, int k, const double *weights, int p)
{
  const reg_bits magnitude = ~(reg_bits)(-(reg){0.0});
  reg sum = {0.0}, others = {0.0};
  for (int i = 0; i < tape->n_unknowns; i++) {
    const reg term = *(const reg *)(perturbations_of(tape)[FIRST_UNKNOWN + i][k] + p);
    const reg next = sum + weights[i] * (reg)((reg_bits)term & magnitude);
    sum = others, others = next;
  }
  return sum + others;
}

/* Return whether terms k are small; a perturbation without a limit does not count. */
static inline int are_small(const struct tape *tape, int k, const double *weights, double power,
                            const double *limits, int count)
{
  for (int p = 0; p < count; p += IN_REGISTER)
    if (any(power * sizes_of(tape, k, weights, p) > *(const reg_anywhere *)(limits + p))) return 0;
  return 1;
}

/* Return a series at the nodes, the `parts` of the step. */
static inline nodal summed(const double *terms, nodal parts)
{
  const nodal squares = parts * parts;
  nodal even = {0.0}, odd = {0.0};
  for (int k = TERMS_AMID - 2; k >= 0; k -= 2) {
    even = terms[k] + squares * even;
    odd = terms[k + 1] + squares * odd;
  }
  return even + parts * odd;
}

/* The slope of a root of 0, such as a norm at rest, is 0; division by 1 sets no flag. */
static inline nodal slope_of_root(nodal root)
{
  const nodal_bits is_zero = root == 0.0;
  const nodal one = (nodal){0.0} + 1.0, slope = 0.5 / (root + (nodal)((nodal_bits)one & is_zero));
  return (nodal)((nodal_bits)slope & ~is_zero);
}

/* Compute the derivatives of the rates by some unknowns, from `first_column` on, at so many `nodes`, the
   `parts` of the step, times the step: element [i][j] of each matrix is that of rate i by unknown j. */
static ALWAYS_INLINE void set_columns(const struct tape *tape, const int nodes, const int first_column,
                                      const int columns, double h, nodal parts, row *jacobian[])
{
  const series *const a = tape->a;
  const struct work *work = tape->work;
  nodal *const m = work->middle;
  row(*const v)[NODES] = work->tangents;
  const int derivatives = tape->n_combinations - tape->n_unknowns;

  for (int n = 0; n < FIRST_UNKNOWN + tape->n_unknowns; n++) m[n] = summed(a[n], parts);
  memset(v, 0, (FIRST_UNKNOWN + tape->n_unknowns) * sizeof *v);
  for (int j = 0; j < columns && first_column + j < tape->n_unknowns; j++)
    for (int d = 0; d < nodes; d++) v[FIRST_UNKNOWN + first_column + j][d][j] = 1.0;
  for (int n = 0; n < tape->n_operations + tape->n_unknowns; n++) {
    const int is_rate = n >= tape->n_operations;
    const int *operation = tape->operations[is_rate ? 0 : n];
    const int first = operation[1] - 1, out = operation[3] - 1;
    if (is_rate || operation[0] == LINEAR) {
      const int c = is_rate ? derivatives + n - tape->n_operations : first;
      if (!is_rate) {
        m[out] = (nodal){0.0} + tape->constants[c];
        for (int i = tape->starts[c] - 1; i < tape->starts[c + 1] - 1; i++)
          m[out] += tape->coefficients[i] * m[tape->slots[i] - 1];
      }
      for (int p = 0; p < columns; p += IN_REGISTER) {
        reg sums[NODES] = {{0.0}};
        for (int i = tape->starts[c] - 1; i < tape->starts[c + 1] - 1; i++)
          for (int d = 0; d < nodes; d++)
            sums[d] += tape->coefficients[i] * *(reg *)(v[tape->slots[i] - 1][d] + p);
        for (int d = 0; d < nodes; d++)
          *(reg *)((is_rate ? jacobian[d][n - tape->n_operations] : v[out][d]) + p) =
              is_rate ? h * sums[d] : sums[d];
      }
      continue;
    }
    const int kind = recurrence_of(operation), o = out, p = o + 1, y = operation[2] - 1;
    const int other = HAS_OWN_VALUE(kind) ? y : 0;
    int x = kind == SELECT ? chosen(tape, operation) : first;
    nodal by_x = {0.0}, by_y = {0.0}, second_by_x = {0.0};
    if (!HAS_OWN_VALUE(kind)) m[o] = summed(a[o], parts);
    if (READS_SECOND(kind)) m[p] = summed(a[p], parts);
    switch (kind) {
    case SELECT: by_x = (nodal){0.0} + 1.0; break;
    SLOPE_CASES
    default: x = 0; break; /* a table depends on the time alone, and a switch is constant */
    }
    for (int d = 0; d < nodes; d++) {
      for (int lane = 0; lane < columns; lane += IN_REGISTER) {
        const reg of_x = *(reg *)(v[x][d] + lane), of_y = *(reg *)(v[other][d] + lane);
        *(reg *)(v[o][d] + lane) = by_x[d] * of_x + by_y[d] * of_y;
        if (READS_SECOND(kind)) *(reg *)(v[p][d] + lane) = second_by_x[d] * of_x;
      }
    }
  }
}

/* Compute the derivatives of term 0 of a slot by the unknowns. */
void OF_LEVEL(slot_gradient, LEVEL)(const struct tape *tape, int slot, double *gradient)
{
  const struct work *work = tape->work;
  row jacobian[MOST_UNKNOWNS] __attribute__((aligned(64)));
  row *only[] = {jacobian};
  for (int j = 0; j < tape->n_unknowns; j++) {
    const int column = j % SIDE_BY_SIDE;
    if (column == 0) set_columns(tape, 1, j, SIDE_BY_SIDE, 1.0, (nodal){0.0}, only);
    gradient[j] = work->tangents[slot - 1][0][column];
  }
}

/* Compute term k + 1 of the perturbations of the unknowns, with the Jacobian as a polynomial of the
   part of the step. */
static ALWAYS_INLINE void perturb_with(const int n, const int nodes, perturbations *v,
                                       const matrix *jacobian, int k)
{
  const double part = 1.0 / (k + 1);
  const int degree = k < nodes - 1 ? k : nodes - 1;
  for (int p = 0; p < SIDE_BY_SIDE; p += IN_REGISTER) {
    reg sums[MOST_UNKNOWNS];
#pragma GCC unroll 7
    for (int i = 0; i < n; i++) sums[i] = (reg){0.0};
    for (int d = 0; d <= degree; d++) {
#pragma GCC unroll 7
      for (int j = 0; j < n; j++) {
        const reg x = *(const reg *)(v[j][k - d] + p);
#pragma GCC unroll 7
        for (int i = 0; i < n; i++)
          sums[i] += jacobian[d][j / SIDE_BY_SIDE][i][j % SIDE_BY_SIDE] * x;
      }
    }
#pragma GCC unroll 7
    for (int i = 0; i < n; i++) *(reg *)(v[i][k + 1] + p) = part * sums[i];
  }
}

/* The same for omega alone: a shorter register suffices, and only the sums of the newest term wait for
   it. */
static ALWAYS_INLINE void perturb_omega(const int nodes, perturbations *v, const matrix *jacobian, int k)
{
  const double part = 1.0 / (k + 1);
  const int degree = k < nodes - 1 ? k : nodes - 1;
  abreast newest[3], others[3] = {{0.0}};
#pragma GCC unroll 4
  for (int d = 1; d <= degree; d++) {
#pragma GCC unroll 3
    for (int j = 0; j < 3; j++) {
      const abreast x = *(const abreast *)v[j][k - d];
#pragma GCC unroll 3
      for (int i = 0; i < 3; i++) others[i] += jacobian[d][0][i][j] * x;
    }
  }
#pragma GCC unroll 3
  for (int i = 0; i < 3; i++) {
    newest[i] = others[i];
#pragma GCC unroll 3
    for (int j = 0; j < 3; j++) newest[i] += jacobian[0][0][i][j] * *(const abreast *)v[j][k];
    *(abreast *)v[i][k + 1] = part * newest[i];
  }
}

/* The same for omega and the attitude, whose perturbation is a rotation q (e, p) of the attitude q: as
   q' = q omega / 2, e is constant and p' = p x omega + (perturbation of omega) / 2. Row 3 of the
   Jacobian is omega, times the step; the other rows are derivatives of the rates of omega. */
static ALWAYS_INLINE void perturb_attitude(const int nodes, perturbations *v, const matrix *jacobian,
                                           double h, int k)
{
  const double part = 1.0 / (k + 1);
  const int degree = k < nodes - 1 ? k : nodes - 1;
  for (int p = 0; p < SIDE_BY_SIDE; p += IN_REGISTER) {
    reg sums[WITH_ATTITUDE] = {{0.0}};
#pragma GCC unroll 3
    for (int i = 0; i < 3; i++) sums[4 + i] = 0.5 * h * *(const reg *)(v[i][k] + p);
    for (int d = 0; d <= degree; d++) {
      const row *const at = jacobian[d][0];
      const reg x = *(const reg *)(v[4][k - d] + p), y = *(const reg *)(v[5][k - d] + p);
      const reg z = *(const reg *)(v[6][k - d] + p);
#pragma GCC unroll 7
      for (int j = 0; j < WITH_ATTITUDE; j++) {
        if (j == 3 && d < k) continue;
        const reg of_j = *(const reg *)(v[j][k - d] + p);
#pragma GCC unroll 3
        for (int i = 0; i < 3; i++) sums[i] += at[i][j] * of_j;
      }
      sums[4] += at[3][2] * y - at[3][1] * z;
      sums[5] += at[3][0] * z - at[3][2] * x;
      sums[6] += at[3][1] * x - at[3][0] * y;
    }
#pragma GCC unroll 7
    for (int i = 0; i < WITH_ATTITUDE; i++) *(reg *)(v[i][k + 1] + p) = part * sums[i];
  }
}

/* The nodes of Gauss on (0, 1), and the coefficients of a polynomial through its values there. */
static const nodal few_parts = {0.21132486540518712, 0.78867513459481288};
static const double few_weights[][FEW_NODES] = {
    {1.3660254037844386, -0.36602540378443865}, {-1.7320508075688773, 1.7320508075688773}};
static const nodal many_parts = {
    0.069431844202973712, 0.33000947820757187, 0.66999052179242813, 0.93056815579702629};
static const double many_weights[][NODES] = {
    {1.526788125457266, -0.8136324494869271, 0.40076152031165046, -0.11391719628198993},
    {-8.546023607872197, 13.807166925689968, -7.4170704214626396, 2.155927103644868},
    {14.325858354171903, -31.388222363446072, 24.998125859219108, -7.935761849944937},
    {-7.420540068038947, 18.795449407555054, -18.795449407555054, 7.420540068038947}};

/* Compute one block of columns of the Jacobian, times the step, at so many `parts` of the step. */
static ALWAYS_INLINE void set_at(const struct tape *tape, const int block, const int columns,
                                 const int nodes, double h, nodal parts, matrix *jacobian)
{
  row *to[] = {jacobian[0][block], jacobian[1][block], jacobian[2][block], jacobian[3][block]};
  if (!tape->leaves) set_columns(tape, nodes, block * SIDE_BY_SIDE, columns, h, parts, to);
  else if (block == 0)
    tape->leaves->set_jacobian(tape->a, tape->coefficients, tape->constants, (const double *)&parts,
                               nodes, h, jacobian[0][0][0]);
}

/* Compute the Jacobian, times the step, at four parts of the step. */
static __attribute__((noinline)) void set_at_nodes(const struct tape *tape, double h,
                                                   const nodal *parts, matrix *jacobian)
{
  if (tape->n_unknowns == 3) set_at(tape, 0, 4, NODES, h, *parts, jacobian);
  else
    for (int block = 0; block * SIDE_BY_SIDE < tape->n_unknowns; block++)
      set_at(tape, block, SIDE_BY_SIDE, NODES, h, *parts, jacobian);
}

void OF_LEVEL(jacobian_at, LEVEL)(const struct tape *tape, double h, const double *parts,
                                  matrix *result)
{
  matrix jacobian[NODES] __attribute__((aligned(64)));
  const nodal at = {parts[0], parts[1], parts[2], parts[3]};
  set_at_nodes(tape, h, &at, jacobian);
  memcpy(result, jacobian, sizeof jacobian);
}

/* Replace one block of columns of the Jacobian at the nodes of Gauss by a polynomial of the part of the
   step: the error of the perturbations is of order 2 nodes + 1. */
static ALWAYS_INLINE void fit_block(const int n_rows, const int block, const int columns,
                                    const int nodes, double factor, matrix *jacobian)
{
  const int is_few = nodes == FEW_NODES;
  row *to[] = {jacobian[0][block], jacobian[1][block], jacobian[2][block], jacobian[3][block]};
  const double per_factor = 1.0 / factor;
  for (int i = 0; i < n_rows; i++) {
    for (int p = 0; p < columns; p += IN_REGISTER) {
      reg values[NODES];
      double power = 1.0;
#pragma GCC unroll 4
      for (int d = 0; d < nodes; d++) values[d] = *(reg *)(to[d][i] + p);
#pragma GCC unroll 4
      for (int k = 0; k < nodes; k++, power *= per_factor) {
        reg sum = {0.0};
#pragma GCC unroll 4
        for (int d = 0; d < nodes; d++)
          sum += (is_few ? few_weights[k][d] : many_weights[k][d]) * values[d];
        *(reg *)(to[k][i] + p) = power * sum;
      }
    }
  }
}

/* Change a Jacobian to the variables of perturb_attitude: the derivatives by the attitude q are taken
   by e and p. */
static ALWAYS_INLINE void change_variables(const struct tape *tape, const int nodes, nodal parts,
                                           matrix *jacobian)
{
  const series *const a = (const series *)tape->a + FIRST_UNKNOWN + 3;
  const nodal w = summed(a[0], parts), x = summed(a[1], parts), y = summed(a[2], parts);
  const nodal z = summed(a[3], parts);
  for (int d = 0; d < nodes; d++) {
    row *const at = jacobian[d][0];
    const abreast by_w = {w[d], -x[d], -y[d], -z[d]}, by_x = {x[d], w[d], -z[d], y[d]};
    const abreast by_y = {y[d], z[d], w[d], -x[d]}, by_z = {z[d], -y[d], x[d], w[d]};
    /* The rates of x, y and z by w are halves of omega. */
    for (int i = 0; i < 3; i++) at[3][i] = 2.0 * at[4 + i][3];
    for (int i = 0; i < 3; i++)
      *(abreast_anywhere *)(at[i] + 3) =
          at[i][3] * by_w + at[i][4] * by_x + at[i][5] * by_y + at[i][6] * by_z;
  }
}

static ALWAYS_INLINE void set_blocks(const struct tape *tape, const int nodes, double h,
                                     double factor, matrix *jacobian)
{
  const nodal parts = factor * (nodes == FEW_NODES ? few_parts : many_parts);
  const int n = tape->n_unknowns;
  if (nodes == NODES) set_at_nodes(tape, h, &parts, jacobian);
  else if (n == 3) set_at(tape, 0, 4, nodes, h, parts, jacobian);
  else
    for (int block = 0; block * SIDE_BY_SIDE < n; block++)
      set_at(tape, block, SIDE_BY_SIDE, nodes, h, parts, jacobian);
  if (n == 3) fit_block(3, 0, 4, nodes, factor, jacobian);
  else if (tape->has_attitude) {
    change_variables(tape, nodes, parts, jacobian);
    fit_block(4, 0, SIDE_BY_SIDE, nodes, factor, jacobian);
  } else
    for (int block = 0; block * SIDE_BY_SIDE < n; block++)
      fit_block(n, block, SIDE_BY_SIDE, nodes, factor, jacobian);
}

static ALWAYS_INLINE void perturb_all(const struct tape *tape, const int nodes, perturbations *v,
                                      const matrix *jacobian, double h, int k)
{
  if (tape->n_unknowns == 3) perturb_omega(nodes, v, jacobian, k);
  else if (tape->has_attitude) perturb_attitude(nodes, v, jacobian, h, k);
  else perturb_with(tape->n_unknowns, nodes, v, jacobian, k);
}

/* Expand eight perturbations, from number `number` on, to as many terms as the part `factor` of the
   step needs. Term 0 of the unknowns is an input. Return the number of the last term, negative if
   all terms do not suffice. `is_long` says that there are many steps; `tolerance` is the largest
   relative size of a term that is left out. */
int OF_LEVEL(perturb_tape, LEVEL)(const struct tape *tape, int number, double h, int order,
                                  double factor, const double *weights, double tolerance, int is_long)
{
  matrix jacobian[NODES] __attribute__((aligned(64)));
  perturbations *const v = (perturbations *)tape->v + FIRST_UNKNOWN;
  const int n = tape->n_unknowns;
  /* Perturbation n was a unit of unknown n when it began. The error, perturbation 0, may be zero, and
     counts where the others have decayed. */
  const int count = n + 1 - number < SIDE_BY_SIDE ? n + 1 - number : SIDE_BY_SIDE;
  double limits[SIDE_BY_SIDE], first = 0.0, power = 1.0;
  for (int p = 0; p < count; p += IN_REGISTER)
    *(reg_anywhere *)(limits + p) = sizes_of(tape, 0, weights, p);
  const double of_error = number == 0 && count > 0 ? limits[0] : 0.0;
  for (int i = number ? 0 : 1; i < count; i++) {
    const double weight = weights[number + i - 1];
    if (weight > 0.0 && limits[i] > first * weight) first = limits[i] / weight;
  }
  for (int i = 0; i < SIDE_BY_SIDE; i++) {
    /* The weight of an own state that stays 0 is 0. */
    const double weight = i >= count || number + i == 0 ? 0.0 : weights[number + i - 1];
    limits[i] = weight > 0.0 ? tolerance * first * weight : HUGE_VAL;
  }
  if (of_error > 0.0 && first < DECAYED) limits[0] = tolerance * of_error;
  int k = 0, was_small, is_small = 0, is_short;
  if (is_long) set_blocks(tape, NODES, h, factor, jacobian);
  else set_blocks(tape, FEW_NODES, h, factor, jacobian);
  do {
    if (is_long) perturb_all(tape, NODES, v, jacobian, h, k++);
    else perturb_all(tape, FEW_NODES, v, jacobian, h, k++);
    power *= factor;
    was_small = is_small;
    is_small = k >= (is_long ? FIRST_OF_LONG : FIRST_CHECKED) && are_small(tape, k, weights, power, limits, count);
    /* Every other term may be zero. */
    is_short = !(is_small && was_small);
  } while (is_short && k < order);
  return is_short ? -k : k;
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

/* Sum the terms of the perturbations of each unknown up to `last` for the part `factor` of the
   step. */
void OF_LEVEL(sum_perturbations, LEVEL)(const struct tape *tape, int last, double factor,
                                        double (*sums)[SIDE_BY_SIDE])
{
  for (int i = 0; i < tape->n_unknowns; i++) {
    const row *terms = perturbations_of(tape)[FIRST_UNKNOWN + i];
    for (int p = 0; p < SIDE_BY_SIDE; p += IN_REGISTER) {
      reg sum = *(const reg *)(terms[last] + p);
      for (int k = last - 1; k >= 0; k--) sum = factor * sum + *(const reg *)(terms[k] + p);
      *(reg_anywhere *)(sums[i] + p) = sum;
    }
  }
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
    beyond[j] = larger_lanes(beyond[j + 1], powers[j] * largest_terms(tape, j, weights, one));
  for (;; k++) {
    if (k > 0) perturb(tape, h, k - 1);
    sizes[k] = largest_terms(tape, k, weights, one);
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
