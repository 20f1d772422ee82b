/* Taylor series of all slots of a tape, order by order, and those of eight perturbations side by
   side. A term includes its power of the step. This is C because no Fortran compiler keeps eight
   sums in registers. Registers of fewer than eight numbers work too: the compiler divides them. */
#include <stdint.h>
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

/* The same at any address. */
typedef reg reg_anywhere __attribute__((aligned(8)));
typedef double row[SIDE_BY_SIDE];
#define ALWAYS_INLINE inline __attribute__((always_inline))

/* The Jacobian is computed at three nodes of a step, from as many terms as the least order has. */
enum { NODES = 3, TERMS_AMID = 8 };

/* Its columns, eight side by side: element [j / 8][i][j % 8] is that of rate i by unknown j. */
enum { BLOCKS = (MOST_UNKNOWNS + SIDE_BY_SIDE - 1) / SIDE_BY_SIDE };
typedef row matrix[BLOCKS][MOST_UNKNOWNS];

/* Sums of products of the terms of two slots, for as many pairs of slots as a register holds: all
   products of terms that are not 0 nor the newest are known before any operation of an order. */
enum { ABREAST = 4 };
typedef double abreast __attribute__((vector_size(8 * ABREAST)));
struct pairs {
  int x[ABREAST], y[ABREAST]; /* places of the slots in the terms */
  abreast of_x[TERMS_OF_PERTURBATION], of_y[TERMS_OF_PERTURBATION]; /* terms from 1 on */
};

/* The working storage. */
struct work {
  int n_pairs, n_slots;
  struct pairs *pairs;
  abreast *sums;
  row (*tangents)[NODES]; /* of each slot at each node: derivatives by the unknowns */
  abreast *middle; /* of each slot: values at the nodes */
};

static inline size_t rounded_up(size_t bytes) { return (bytes + 63) / 64 * 64; }

/* Return the size of the working storage, in numbers. An operation has at most two pairs. */
int64_t OF_LEVEL(size_of_work, LEVEL)(int n_operations, int n_slots)
{
  const size_t groups = (2 * (size_t)n_operations + ABREAST - 1) / ABREAST;
  const size_t of_slots = n_slots * (NODES * sizeof(row) + sizeof(abreast));
  return (rounded_up(sizeof(struct work)) + rounded_up(groups * sizeof(struct pairs))
          + rounded_up(groups * sizeof(abreast)) + rounded_up(of_slots)) / sizeof(double);
}

static void add_pair(const struct tape *tape, int x, int y)
{
  struct work *work = tape->work;
  struct pairs *pairs = work->pairs + work->n_pairs / ABREAST;
  pairs->x[work->n_pairs % ABREAST] = x * TERMS;
  pairs->y[work->n_pairs % ABREAST] = y * TERMS;
  work->n_pairs++;
}

/* Divide the working storage, and find the pairs of slots whose products are needed, in the order in
   which expand_tape needs them. */
void OF_LEVEL(begin_work, LEVEL)(const struct tape *tape, int n_slots)
{
  struct work *work = tape->work;
  const size_t groups = (2 * (size_t)tape->n_operations + ABREAST - 1) / ABREAST;
  char *at = (char *)work + rounded_up(sizeof *work);
  work->n_pairs = 0;
  work->n_slots = n_slots;
  work->pairs = (struct pairs *)at;
  at += rounded_up(groups * sizeof(struct pairs));
  work->sums = (abreast *)at;
  at += rounded_up(groups * sizeof(abreast));
  work->tangents = (row(*)[NODES])at;
  work->middle = (abreast *)(work->tangents + n_slots);
  memset(work->pairs, 0, groups * sizeof(struct pairs));
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    const int first = operation[1] - 1, second = operation[2] - 1, out = operation[3] - 1;
    switch (operation[0]) {
    case PRODUCT: add_pair(tape, first, second); break;
    case QUOTIENT: add_pair(tape, second, out); break;
    case SQRT: add_pair(tape, out, out); break;
    case EXP: add_pair(tape, out + 1, out); break;
    case SINE_COSINE:
      add_pair(tape, out + 2, out + 1);
      add_pair(tape, out + 2, out);
      break;
    case TANH:
      add_pair(tape, out + 2, out + 1);
      add_pair(tape, out, out);
      break;
    case LOG:
    case ATAN:
    case ASIN: add_pair(tape, out + 1, second); break;
    default: break;
    }
  }
}

static inline abreast gathered(const double *terms, const int *places, int k)
{
  return (abreast){terms[places[0] + k], terms[places[1] + k], terms[places[2] + k],
                   terms[places[3] + k]};
}

/* Compute for each pair the sum of x(j) y(k - j), j = 1 to k - 1. The newest terms are not loaded
   again: a load would have to wait for their store. */
static inline void add_products(const struct work *work, const double *terms, int k)
{
  for (int i = 0; i * ABREAST < work->n_pairs; i++) {
    struct pairs *pairs = work->pairs + i;
    const abreast x = gathered(terms, pairs->x, k - 1), y = gathered(terms, pairs->y, k - 1);
    pairs->of_x[k - 1] = x;
    pairs->of_y[k - 1] = y;
    abreast one = x * (k > 2 ? pairs->of_y[1] : y), two = {0.0};
    if (k > 2) two = pairs->of_x[1] * y;
    int j = 2;
    for (; j < k - 2; j += 2) {
      one += pairs->of_x[j] * pairs->of_y[k - j];
      two += pairs->of_x[j + 1] * pairs->of_y[k - j - 1];
    }
    if (j < k - 1) one += pairs->of_x[j] * pairs->of_y[k - j];
    work->sums[i] = one + two;
  }
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

/* Compute the terms of all slots below the order, and those of the unknowns up to it. Inputs are
   term 0 of all slots, and all terms of the time and of tables. */
void OF_LEVEL(expand_tape, LEVEL)(const struct tape *tape, double h, int order)
{
  series *const a = tape->a;
  const struct work *work = tape->work;
  const int derivatives = tape->n_combinations - tape->n_unknowns;

  memset(work->sums, 0, (work->n_pairs + ABREAST - 1) / ABREAST * sizeof(abreast));
  for (int k = 0; k < order; k++) {
    const double *sum = (const double *)work->sums;
    if (k > 1) add_products(work, a[0], k);
    for (int n = 0; k > 0 && n < tape->n_operations; n++) {
      const int *operation = tape->operations[n];
      const double *x = a[operation[1] - 1], *y = a[operation[2] - 1];
      double *out = a[operation[3] - 1], *angle;
      switch (operation[0]) {
      case LINEAR: out[k] = combined(tape, operation[1] - 1, k, a); break;
      case PRODUCT: out[k] = *sum++ + (x[k] * y[0] + x[0] * y[k]); break;
      case QUOTIENT: out[k] = (x[k] - *sum++ - y[k] * out[0]) / y[0]; break;
      case SQRT:
        /* A norm is constant at rest. */
        out[k] = x[k] - *sum++;
        if (out[k]) out[k] /= 2.0 * out[0];
        break;
      case EXP:
        /* The second slot has k times the terms of the argument. It is constant, because it is
           large, where term 0 of that slot says so. */
        angle = out + TERMS;
        angle[k] = angle[0] ? 0.0 : k * x[k];
        out[k] = (*sum++ + angle[k] * out[0]) / k;
        break;
      case SINE_COSINE:
        angle = out + 2 * TERMS;
        angle[k] = k * x[k];
        out[k] = (*sum++ + angle[k] * out[TERMS]) / k;
        out[TERMS + k] = -(*sum++ + angle[k] * out[0]) / k;
        break;
      case TANH:
        /* The second slot is 1 minus the square, the derivative. */
        angle = out + 2 * TERMS;
        angle[k] = k * x[k];
        out[k] = (*sum++ + angle[k] * out[TERMS]) / k;
        out[TERMS + k] = -*sum++ - 2.0 * out[k] * out[0];
        break;
      case LOG:
      case ATAN:
      case ASIN:
        angle = out + TERMS;
        angle[k] = k * x[k];
        out[k] = (*sum++ + angle[k] * y[0]) / k;
        break;
      case SELECT: out[k] = a[chosen(tape, operation)][k]; break;
      default: /* a table, or a switch */
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

/* Compute term k of eight perturbations of all slots, and add the part that depends on them to term
   k + 1 of those of the unknowns. */
static void perturb(const struct tape *tape, double h, int k)
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
      x = convolved_many(v[first], a[second], v[second], a[first], k);
      x += loaded(v[first][k]) * a[second][0] + loaded(v[second][k]) * a[first][0];
      break;
    case QUOTIENT:
      x = convolved_many(v[second], a[out], v[out], a[second], k);
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
    case LOG:
    case ATAN:
    case ASIN:
      x = convolved_one(v[first], a[second], k) + loaded(v[first][k]) * a[second][0];
      break;
    case SELECT: x = loaded(v[chosen(tape, operation)][k]); break;
    case SINE_COSINE:
      x = convolved_one(v[first], a[out], k) + loaded(v[first][k]) * a[out][0];
      store(v[out + 1][k], -x);
      x = convolved_one(v[first], a[out + 1], k) + loaded(v[first][k]) * a[out + 1][0];
      break;
    default: /* a table or a switch, which have no perturbation */
      x = (lanes){0.0};
      break;
    }
    store(v[out][k], x);
  }
  for (int i = 0; i < tape->n_unknowns; i++) {
    double *to = v[FIRST_UNKNOWN + i][k + 1];
    x = h / (k + 1) * perturbed(tape, derivatives + i, k, (const perturbations *)v);
    store(to, loaded(to) + x);
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

/* Return the largest term k of the first perturbations, whose units may be 0. */
static inline double largest(const struct tape *tape, int k, const double *weights,
                             const double *units, int count)
{
  const reg_bits magnitude = ~(reg_bits)(-(reg){0.0});
  double found = 0.0;
  for (int p = 0; p < count; p += IN_REGISTER) {
    reg most = {0.0};
    for (int i = 0; i < tape->n_unknowns; i++) {
      const reg term = *(const reg *)(perturbations_of(tape)[FIRST_UNKNOWN + i][k] + p);
      const reg x = weights[i] * (reg)((reg_bits)term & magnitude);
      const reg_bits is_larger = x > most;
      most = (reg)(((reg_bits)x & is_larger) | ((reg_bits)most & ~is_larger));
    }
    most *= *(const reg_anywhere *)(units + p);
    /* A unit of 0 makes an infinite term NaN, which does not count. */
    double lanes[IN_REGISTER];
    const reg_bits counts = most > (reg){0.0};
    *(reg_anywhere *)lanes = (reg)((reg_bits)most & counts);
    for (int half = IN_REGISTER / 2; half > 0; half /= 2)
      for (int lane = 0; lane < half; lane++)
        if (lanes[lane + half] > lanes[lane]) lanes[lane] = lanes[lane + half];
    if (lanes[0] > found) found = lanes[0];
  }
  return found;
}

/* Compute the derivatives of the rates by some unknowns, from `first_column` on, at so many `nodes`, the
   `parts` of the step, times the step: element [i][j] of each matrix is that of rate i by unknown j. */
static ALWAYS_INLINE void set_columns(const struct tape *tape, const int nodes, const int first_column,
                                      const int columns, double h, abreast parts, row *jacobian[])
{
  const series *const a = tape->a;
  const struct work *work = tape->work;
  abreast *const m = work->middle;
  row(*const v)[NODES] = work->tangents;
  const int derivatives = tape->n_combinations - tape->n_unknowns;

  for (int n = 0; n < work->n_slots; n++) {
    abreast sum = (abreast){0.0} + a[n][TERMS_AMID - 1];
    for (int k = TERMS_AMID - 2; k >= 0; k--) sum = a[n][k] + parts * sum;
    m[n] = sum;
  }
  memset(v, 0, (FIRST_UNKNOWN + tape->n_unknowns) * sizeof *v);
  for (int j = 0; j < columns && first_column + j < tape->n_unknowns; j++)
    for (int d = 0; d < nodes; d++) v[FIRST_UNKNOWN + first_column + j][d][j] = 1.0;
  for (int n = 0; n < tape->n_operations + tape->n_unknowns; n++) {
    const int is_rate = n >= tape->n_operations;
    const int *operation = tape->operations[is_rate ? 0 : n];
    const int first = operation[1] - 1, second = operation[2] - 1, out = operation[3] - 1;
    if (is_rate || operation[0] == LINEAR) {
      const int c = is_rate ? derivatives + n - tape->n_operations : first;
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
    /* The derivatives of the first slot by the operands, and of the second by the first operand. */
    abreast by_first = {0.0}, by_second = {0.0}, of_second = {0.0};
    int from = first, other = 0, has_second = 0;
    switch (operation[0]) {
    case PRODUCT: by_first = m[second], by_second = m[first], other = second; break;
    case QUOTIENT:
      by_first = 1.0 / m[second], by_second = -m[out] * by_first, other = second;
      break;
    case SQRT:
      for (int d = 0; d < nodes; d++) by_first[d] = m[out][d] ? 0.5 / m[out][d] : 0.0;
      break;
    case EXP: by_first = m[out]; break;
    case SINE_COSINE: by_first = m[out + 1], of_second = -m[out], has_second = 1; break;
    case TANH: by_first = m[out + 1], of_second = -2.0 * m[out] * by_first, has_second = 1; break;
    case LOG:
    case ATAN:
    case ASIN: by_first = m[second]; break;
    case SELECT: by_first = (abreast){0.0} + 1.0, from = chosen(tape, operation); break;
    default: from = 0; break; /* a table depends on the time alone, and a switch is constant */
    }
    for (int d = 0; d < nodes; d++) {
      for (int p = 0; p < columns; p += IN_REGISTER) {
        const reg x = *(reg *)(v[from][d] + p);
        *(reg *)(v[out][d] + p) = by_first[d] * x + by_second[d] * *(reg *)(v[other][d] + p);
        if (has_second) *(reg *)(v[out + 1][d] + p) = of_second[d] * x;
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
    if (column == 0) set_columns(tape, 1, j, SIDE_BY_SIDE, 1.0, (abreast){0.0}, only);
    gradient[j] = work->tangents[slot - 1][0][column];
  }
}

/* Compute term k + 1 of the perturbations of the unknowns, with the Jacobian as a polynomial of the
   part of the step. */
static ALWAYS_INLINE void perturb_with(const int n, const int columns, perturbations *v,
                                       const matrix *jacobian, int k)
{
  const double part = 1.0 / (k + 1);
  const int degree = k < NODES - 1 ? k : NODES - 1;
  for (int i = 0; i < n; i++) {
    for (int p = 0; p < columns; p += IN_REGISTER) {
      reg sum = {0.0}, other = {0.0};
      for (int j = 0; j < n; j++)
        sum += jacobian[0][j / SIDE_BY_SIDE][i][j % SIDE_BY_SIDE] * *(reg *)(v[j][k] + p);
      for (int d = 1; d <= degree; d++)
        for (int j = 0; j < n; j++)
          other += jacobian[d][j / SIDE_BY_SIDE][i][j % SIDE_BY_SIDE] * *(reg *)(v[j][k - d] + p);
      *(reg *)(v[i][k + 1] + p) = part * (sum + other);
    }
  }
}

/* Compute one block of columns of the Jacobian as a polynomial of the part of the step, through its
   values at the nodes of Gauss: the error of the perturbations is of order 2 NODES + 1. */
static ALWAYS_INLINE void set_block(const struct tape *tape, const int block, const int columns,
                                    double h, double factor, matrix *jacobian)
{
  const double distance = 0.38729833462074170 * factor, middle = 0.5 * factor;
  const double per_slope = 0.5 / distance, per_curve = 0.5 / (distance * distance);
  const abreast parts = {middle - distance, middle, middle + distance};
  row *to[NODES] = {jacobian[0][block], jacobian[1][block], jacobian[2][block]};
  set_columns(tape, NODES, block * SIDE_BY_SIDE, columns, h, parts, to);
  for (int i = 0; i < tape->n_unknowns; i++) {
    for (int p = 0; p < columns; p += IN_REGISTER) {
      reg *const before = (reg *)(to[0][i] + p), *const amid = (reg *)(to[1][i] + p);
      reg *const after = (reg *)(to[2][i] + p);
      const reg slope = per_slope * (*after - *before);
      const reg curve = per_curve * ((*after - *amid) + (*before - *amid));
      *before = *amid - middle * (slope - middle * curve);
      *amid = slope - 2.0 * middle * curve;
      *after = curve;
    }
  }
}

static void set_later_blocks(const struct tape *tape, double h, double factor, matrix *jacobian)
{
  for (int block = 1; block * SIDE_BY_SIDE < tape->n_unknowns; block++)
    set_block(tape, block, SIDE_BY_SIDE, h, factor, jacobian);
}

/* Expand eight perturbations, from number `number` on, whose values are terms 0 of the unknowns, to as
   many terms as they need for the part `factor` of the step, and return the number of the last term.
   `is_short` says that all terms do not suffice. `tolerance` is the largest relative size of a term
   that is left out. */
int OF_LEVEL(perturb_tape, LEVEL)(const struct tape *tape, int number, double h, int order,
                                  double factor, const double *weights, double tolerance,
                                  int *is_short)
{
  matrix jacobian[NODES] __attribute__((aligned(64)));
  perturbations *const v = (perturbations *)tape->v + FIRST_UNKNOWN;
  const int n = tape->n_unknowns;
  /* Perturbation n was a unit of unknown n when it began. The error, perturbation 0, does not count,
     because it may be zero. */
  double units[SIDE_BY_SIDE] = {0.0};
  const int count = n + 1 - number < SIDE_BY_SIDE ? n + 1 - number : SIDE_BY_SIDE;
  for (int i = number ? 0 : 1; i < count; i++) {
    /* The weight of an own state that stays 0 is 0. */
    const double weight = weights[number + i - 1];
    units[i] = weight > 0.0 ? 1.0 / weight : 0.0;
  }
  const double first = largest(tape, 0, weights, units, count);
  double before = first, power = 1.0;
  int k = 0;
  if (n == 3) set_block(tape, 0, 4, h, factor, jacobian);
  else set_block(tape, 0, SIDE_BY_SIDE, h, factor, jacobian);
  if (n > SIDE_BY_SIDE) set_later_blocks(tape, h, factor, jacobian);
  do {
    if (n == 3) perturb_with(3, 4, v, jacobian, k++);
    else if (n == WITH_ATTITUDE) perturb_with(WITH_ATTITUDE, SIDE_BY_SIDE, v, jacobian, k++);
    else perturb_with(n, SIDE_BY_SIDE, v, jacobian, k++);
    power *= factor;
    const double size = power * largest(tape, k, weights, units, count);
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
    if (k > 0) perturb(tape, h, k - 1);
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
    const row *terms = perturbations_of(tape)[FIRST_UNKNOWN + i];
    for (int p = 0; p < SIDE_BY_SIDE; p += IN_REGISTER) {
      reg sum = *(const reg *)(terms[last] + p);
      for (int k = last - 1; k >= 0; k--) sum = factor * sum + *(const reg *)(terms[k] + p);
      *(reg_anywhere *)(sums[i] + p) = sum;
    }
  }
}
