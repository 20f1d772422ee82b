/* Polynomials at the nodes of a step, and between them, side by side in registers. */
#include <stddef.h>
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

/* Return which polynomial has a time, `guess` if that is right. */
static int piece_of(const double *edges, int pieces, double time, int guess)
{
  int low = 0, high = pieces;
  if (time >= edges[guess] && time < edges[guess + 1]) return guess;
  while (high - low > 1) {
    const int middle = (low + high) / 2;
    if (time >= edges[middle]) low = middle;
    else high = middle;
  }
  return low;
}

/* Compute m components at n times from polynomials through Chebyshev points, one between each two
   `edges`, by the barycentric formula (Trefethen 2013, Approximation Theory and Approximation
   Practice, chapter 5). */
void OF_LEVEL(read_pieces, LEVEL)(int pieces, const double *edges, const double *points, int m,
                                  const double *values, int n, const double *times, double *states)
{
  int piece = 0;
  for (int begin = 0; begin < n; begin += IN_REGISTER) {
    const double *own[IN_REGISTER];
    const int count = n - begin < IN_REGISTER ? n - begin : IN_REGISTER;
    const reg one = (reg){0.0} + 1.0;
    reg x = {0.0}, total = {0.0}, weights[AT_ONCE + 1];
    reg_bits at = {0};
    for (int lane = 0; lane < IN_REGISTER; lane++) {
      const double time = times[begin + (lane < count ? lane : 0)];
      piece = piece_of(edges, pieces, time, piece);
      const double low = edges[piece], high = edges[piece + 1];
      x[lane] = ((time - low) - (high - time)) / (high - low);
      own[lane] = values + (ptrdiff_t)piece * (AT_ONCE + 1) * m;
    }
    for (int j = 0; j <= AT_ONCE; j++) {
      const double half = j == 0 || j == AT_ONCE ? 0.5 : 1.0;
      const reg apart = x - points[j];
      const reg_bits is_at_point = apart == (reg){0.0};
      /* The formula fails at the points, where the values are known. */
      total += weights[j] = (j % 2 ? -half : half) / (apart - (reg)(is_at_point & (reg_bits)one));
      at |= is_at_point;
    }
    for (int i = 0; i < m; i++) {
      reg sum = {0.0};
      for (int j = 0; j <= AT_ONCE; j++) {
        reg value;
        for (int lane = 0; lane < IN_REGISTER; lane++) value[lane] = own[lane][j * m + i];
        sum += weights[j] * value;
      }
      sum /= total;
      for (int lane = 0; lane < count; lane++) states[(begin + lane) * (ptrdiff_t)m + i] = sum[lane];
    }
    for (int lane = 0; lane < count; lane++)
      for (int j = 0; at[lane] && j <= AT_ONCE; j++)
        if (x[lane] == points[j])
          memcpy(states + (begin + lane) * (ptrdiff_t)m, own[lane] + j * m, m * sizeof *states);
  }
}
