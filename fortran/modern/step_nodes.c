/* Polynomials at the nodes of a step side by side, in registers. */
#include <string.h>

#include "tape.h"

enum { REGISTERS = AT_ONCE / IN_REGISTER };

/* Compute the sums of terms, which are `stride` numbers apart, from the first power on. */
void OF_LEVEL(sum_at_nodes, LEVEL)(const double *terms, int stride, int order, const double *parts,
                                   double *sums)
{
  reg x[REGISTERS], sum[REGISTERS];
  memcpy(x, parts, sizeof x);
  memset(sum, 0, sizeof sum);
  for (int k = order - 1; k >= 0; k--) {
#pragma GCC unroll 12
    for (int i = 0; i < REGISTERS; i++) sum[i] = (sum[i] + terms[k * stride]) * x[i];
  }
  memcpy(sums, sum, sizeof sum);
}
