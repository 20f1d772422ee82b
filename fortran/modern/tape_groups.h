/* Operations of a tape in groups that are computed side by side, and the working storage of
   tape_terms.c and tape_perturbations.c: products, or linear combinations, none of which needs the
   result of another one. */
#ifndef TAPE_GROUPS_H
#define TAPE_GROUPS_H

#include <stddef.h>
#include <string.h>

#include "tape.h"

enum { SIDE_BY_SIDE = 8, TERMS = SERIES_LENGTH, TERMS_OF_PERTURBATION = PERTURBATION_LENGTH };
typedef double row[SIDE_BY_SIDE], series[TERMS];

/* The Jacobian is computed at two or four nodes of a step, from as many terms as the least order has. */
enum { FEW_NODES = 2, NODES = 4, TERMS_AMID = 16 };
typedef double nodal __attribute__((vector_size(8 * NODES)));
typedef long long nodal_bits __attribute__((vector_size(8 * NODES)));

/* Terms of several slots abreast. */
enum { ABREAST = 4 };
typedef double abreast __attribute__((vector_size(8 * ABREAST)));
typedef long long abreast_bits __attribute__((vector_size(8 * ABREAST)));
typedef abreast abreast_anywhere __attribute__((aligned(8)));
typedef int places[ABREAST]; /* of slots in the terms */

/* Pairs of slots whose terms are multiplied. */
struct pairs {
  places x, y, out; /* `out`, the results, of products alone */
  abreast of_x[TERMS_OF_PERTURBATION], of_y[TERMS_OF_PERTURBATION]; /* terms */
};

/* Linear combinations. A missing term is 0 times another one. */
struct combinations {
  int n_terms;
  places out, *slots;
  abreast *coefficients;
};

/* Up to four products or combinations, of which none needs another, or one operation. */
enum { PRODUCTS = -1, COMBINATIONS = -2 };
struct item {
  int kind, number; /* of the group, or of the operation */
};

/* The working storage. */
struct work {
  int n_items, n_products, n_pairs, n_groups, n_slots;
  struct item *items; /* in the order of their execution */
  struct pairs *products, *others;
  struct combinations *combinations; /* the derivatives of the unknowns come last */
  places *slots;          /* of the combinations */
  abreast *coefficients;
  abreast *sums;          /* of the products of `others` */
  abreast (*unknowns)[TERMS_OF_PERTURBATION]; /* their terms, in the groups of `combinations` */
  row (*tangents)[NODES]; /* of each slot at each node: derivatives by the unknowns */
  nodal *middle;          /* of each slot: values at the nodes */
  int *levels;            /* of each slot: the length of the longest way from the unknowns */
  int *ordered;           /* operations in the order of their levels */
  int *begins;            /* of the operations of a kind and level among them */
};

/* Return the slot that SELECT chooses: the only one of its combination, or of the next one. */
static inline int chosen(const struct tape *tape, const int *operation)
{
  const series *const a = tape->a;
  const int combination = operation[2] - 1 + (a[operation[1] - 1][0] == 0.0);
  return tape->slots[tape->starts[combination] - 1] - 1;
}

/* Kinds of operations that are ordered. */
enum { OF_PRODUCTS, OF_COMBINATIONS, OF_OTHERS, N_KINDS };

static void *taken(char **at, size_t count, size_t size)
{
  char *const begin = *at;
  *at += (count * size + 63) / 64 * 64;
  return begin;
}

/* Divide the working storage, and return its size in bytes. An operation has at most two pairs, and a
   group at most as many terms as its members. */
static size_t divide_work(struct work *work, char *begin, int n_unknowns, int n_operations,
                          int n_products, int n_slots, int n_terms)
{
  const size_t n = n_operations, n_groups = (n_unknowns + ABREAST - 1) / ABREAST;
  const size_t n_sums = (2 * (n - n_products) + ABREAST - 1) / ABREAST;
  char *at = begin;
  taken(&at, 1, sizeof *work);
  work->items = taken(&at, n, sizeof *work->items);
  work->products = taken(&at, n_products, sizeof *work->products);
  work->others = taken(&at, n_sums, sizeof *work->others);
  /* Each group is followed by another, where its terms end. */
  work->combinations = taken(&at, n + n_groups + 1, sizeof *work->combinations);
  work->slots = taken(&at, n_terms, sizeof *work->slots);
  work->coefficients = taken(&at, n_terms, sizeof *work->coefficients);
  work->sums = taken(&at, n_sums, sizeof *work->sums);
  work->unknowns = taken(&at, n_groups, sizeof *work->unknowns);
  work->tangents = taken(&at, n_slots, sizeof *work->tangents);
  work->middle = taken(&at, n_slots, sizeof *work->middle);
  work->levels = taken(&at, n_slots, sizeof *work->levels);
  work->ordered = taken(&at, n, sizeof *work->ordered);
  work->begins = taken(&at, N_KINDS * (n + 1) + 1, sizeof *work->begins);
  return at - begin;
}

static int level_of_combination(const struct tape *tape, int n, const int *levels)
{
  int level = 0;
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++)
    if (levels[tape->slots[i] - 1] > level) level = levels[tape->slots[i] - 1];
  return level;
}

static inline int kind_of(const int *operation)
{
  return operation[0] == PRODUCT ? OF_PRODUCTS : operation[0] == LINEAR ? OF_COMBINATIONS : OF_OTHERS;
}

/* Order the operations by their levels and, on a level, by their kinds. */
static void order_operations(const struct tape *tape, struct work *work)
{
  const int n_operations = tape->n_operations;
  int *const levels = work->levels, *const begins = work->begins;
  memset(levels, 0, work->n_slots * sizeof *levels);
  memset(begins, 0, (N_KINDS * (n_operations + 1) + 1) * sizeof *begins);
  for (int n = 0; n < n_operations; n++) {
    const int *operation = tape->operations[n];
    const int first = operation[1] - 1, second = operation[2] - 1, out = operation[3] - 1;
    int level = 0, other = 0;
    switch (operation[0]) {
    case TABLE: break;
    case LINEAR: level = level_of_combination(tape, first, levels); break;
    case SELECT:
      level = level_of_combination(tape, second, levels);
      other = level_of_combination(tape, second + 1, levels);
      break;
    case PRODUCT:
    case QUOTIENT:
    case EXPM1:
    case EXP2: other = levels[second]; /* fall through */
    default: level = levels[first]; break;
    }
    if (other > level) level = other;
    /* An operation may have several slots. */
    for (int slot = out; slot < out + 3 && slot < work->n_slots; slot++) levels[slot] = level + 1;
    begins[N_KINDS * level + kind_of(operation) + 1]++;
  }
  for (int i = 0; i < N_KINDS * n_operations; i++) begins[i + 1] += begins[i];
  for (int n = 0; n < n_operations; n++) {
    const int *operation = tape->operations[n];
    const int level = levels[operation[3] - 1] - 1;
    work->ordered[begins[N_KINDS * level + kind_of(operation)]++] = n;
  }
}

static void add_pair(struct work *work, int x, int y)
{
  struct pairs *pairs = work->others + work->n_pairs / ABREAST;
  if (work->n_pairs % ABREAST == 0) memset(pairs, 0, 3 * sizeof(places));
  pairs->x[work->n_pairs % ABREAST] = x * TERMS;
  pairs->y[work->n_pairs % ABREAST] = y * TERMS;
  work->n_pairs++;
}

/* Add the pairs of slots whose products an operation needs. */
static void add_pairs(struct work *work, const int *operation)
{
  const int y = operation[2] - 1, o = operation[3] - 1, p = o + 1, q = p + 1;
  switch (recurrence_of(operation)) {
  PAIR_CASES
  default: break;
  }
}

/* Add a group of combinations, whose numbers and places are those of its members. */
static void add_combinations(const struct tape *tape, struct work *work, int count,
                             const int *numbers, const int *out)
{
  struct combinations *group = work->combinations + work->n_groups++;
  group->n_terms = 0;
  for (int lane = 0; lane < ABREAST; lane++) {
    const int n = numbers[lane < count ? lane : 0], begin = tape->starts[n] - 1;
    const int n_terms = lane < count ? tape->starts[n + 1] - 1 - begin : 0;
    group->out[lane] = lane < count ? out[lane] : work->n_slots * TERMS;
    for (; group->n_terms < n_terms; group->n_terms++) {
      memset(group->slots[group->n_terms], 0, sizeof(places));
      group->coefficients[group->n_terms] = (abreast){0.0};
    }
    for (int i = 0; i < n_terms; i++) {
      group->slots[i][lane] = (tape->slots[begin + i] - 1) * TERMS;
      group->coefficients[i][lane] = tape->coefficients[begin + i];
    }
  }
  group[1].slots = group->slots + group->n_terms;
  group[1].coefficients = group->coefficients + group->n_terms;
}

#endif
