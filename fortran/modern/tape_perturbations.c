/* Taylor series of eight perturbations of the unknowns side by side, from the Jacobian at nodes of a
   step. This is C because no Fortran compiler keeps eight sums in registers. */
#include <math.h>
#include <string.h>

#include "tape_perturbations.h"

/* Terms of a perturbation that are first checked: most steps need them and the next one. */
enum { FIRST_CHECKED = 5, FIRST_OF_LONG = 8 };
#define DECAYED 1e-100 /* largest perturbation beside which the error counts */

/* The same at any address. */
typedef reg reg_anywhere __attribute__((aligned(8)));
#define ALWAYS_INLINE inline __attribute__((always_inline))

/* The Jacobian, eight columns side by side: [j / 8][i][j % 8] is that of rate i by unknown j. */
enum { BLOCKS = (MOST_UNKNOWNS + SIDE_BY_SIDE - 1) / SIDE_BY_SIDE };
typedef row matrix[BLOCKS][MOST_UNKNOWNS];

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
