/* Polynomials at the nodes of a step side by side, in registers. */
#include <string.h>

#include "tape.h"

enum { REGISTERS = AT_ONCE / IN_REGISTER, FITTING = 12 / REGISTERS, TOGETHER = FITTING < 4 ? FITTING : 4 };

/* Compute the sums of `count` unknowns, whose additions need not wait for each other. */
static inline __attribute__((always_inline)) void add(const int count, const double *terms, int to_next_term,
                                                      int to_next, int order, const reg *x, reg *sums)
{
  reg sum[TOGETHER][REGISTERS] = {{{0.0}}};
  for (int k = order; k > 0; k--) {
#pragma GCC unroll 4
    for (int i = 0; i < count; i++) {
      const double term = terms[k * to_next_term + i * to_next];
#pragma GCC unroll 12
      for (int j = 0; j < REGISTERS; j++) sum[i][j] = sum[i][j] * x[j] + term;
    }
  }
#pragma GCC unroll 4
  for (int i = 0; i < count; i++) {
#pragma GCC unroll 12
    for (int j = 0; j < REGISTERS; j++) sums[i * REGISTERS + j] = sum[i][j] * x[j];
  }
}

/* Compute the sums of terms of n unknowns from the first power on. The terms of an unknown are
   `to_next_term` numbers apart, the unknowns `to_next`. */
void OF_LEVEL(sum_at_nodes, LEVEL)(const double *terms, int size, int to_next_term, int to_next, int n,
                                   int order, const double *parts, double *sums)
{
  reg x[REGISTERS], found[TOGETHER * REGISTERS];
  memcpy(x, parts, sizeof x);
  for (int i = 0, count; i < n; i += count) {
    count = n - i < TOGETHER ? n - i : TOGETHER;
    const double *own = terms + i * to_next;
    if (count == 1) add(1, own, to_next_term, to_next, order, x, found);
    else if (TOGETHER > 1 && count == 2) add(2, own, to_next_term, to_next, order, x, found);
    else if (TOGETHER > 2 && count == 3) add(3, own, to_next_term, to_next, order, x, found);
    else if (TOGETHER > 3) add(4, own, to_next_term, to_next, order, x, found);
    memcpy(sums + i * AT_ONCE, found, count * REGISTERS * sizeof(reg));
  }
}
