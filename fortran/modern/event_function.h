/* An event function in the polynomials of a solution, at nodes and at single times. */
#ifndef EVENT_FUNCTION_H
#define EVENT_FUNCTION_H

#include "tape.h"

enum { NODES = 2 * AT_ONCE + 1, LINES = (NODES + IN_REGISTER - 1) / IN_REGISTER };
enum { WIDTH = LINES * IN_REGISTER };

/* Numbers at the nodes of a polynomial, or its coefficients. */
typedef union {
  reg r[LINES];
  double x[WIDTH];
} line;

struct event_search {
  int n_pieces, m, n_own, n_slots;
  int most, n_roots;    /* n_roots is -1 if the search ended without a result */
  const double *edges;  /* s */
  const double *values; /* (m, AT_ONCE + 1, n_pieces): unknowns at Chebyshev points */
  const double *points; /* AT_ONCE + 1, then NODES */
  const double *refining, *to_coefficients, *left, *right; /* matrices, column by column */
  const double *settings; /* the constants below, in this order */
  double (*roots)[4];     /* time (s), sign after the change, slope, noise */
};

enum { STATE_ERROR, LAST, FIT_ERROR, ROUNDING, SHIFT, MUCH, MARGIN, SHORT, EXACT, WIDER };

struct search {
  const struct tape *tape;
  struct event_search *given;
  const double *settings;
  line refining[AT_ONCE + 1], to_coefficients[NODES], left[NODES], right[NODES], points;
  line *slots;
  double *sizes; /* (m, n_pieces): those relative to which the state's errors are measured */
  double *found; /* (n_pieces): bounds of the polynomials */
  char is_used[N_INPUTS + MOST_UNKNOWNS];
  int piece;     /* of the roots */
  double low, high, noise, near, least;
  line slope;    /* coefficients of the derivative on the piece */
};

double function_of(int kind, double x, double y, int saturates);
void OF_LEVEL(read_pieces, LEVEL)(int pieces, const double *edges, const double *points, int m,
                                  const double *values, int n, const double *times, double *states);

static void take(int columns, const double *matrix, line *into)
{
  for (int k = 0; k < columns; k++)
    for (int j = 0; j < WIDTH; j++) into[k].x[j] = matrix[k * NODES + (j < NODES ? j : NODES - 1)];
}

static line applied(int columns, const line *matrix, const double *numbers, int apart)
{
  line sum = {{{0.0}}};
  for (int k = 0; k < columns; k++)
    for (int j = 0; j < LINES; j++) sum.r[j] += numbers[k * apart] * matrix[k].r[j];
  return sum;
}

static line everywhere(double number)
{
  line all;
  for (int j = 0; j < LINES; j++) all.r[j] = (reg){0.0} + number;
  return all;
}

/* Compute a linear combination in the first registers of its terms. */
static inline __attribute__((always_inline)) void combine(const struct tape *tape, int n, const line *slots,
                                                          const int registers, line *sum)
{
  for (int j = 0; j < registers; j++) sum->r[j] = (reg){0.0} + tape->constants[n - 1];
  for (int i = tape->starts[n - 1] - 1; i < tape->starts[n] - 1; i++)
    for (int j = 0; j < registers; j++) sum->r[j] += tape->coefficients[i] * slots[tape->slots[i] - 1].r[j];
}

#define AT_EACH(expression) \
  for (int j = 0; j < registers * IN_REGISTER; j++) out->x[j] = expression

/* Compute the function in the first registers of the inputs, if its operations are known here, and
   return whether it is finite. */
static inline __attribute__((always_inline)) int evaluate_in(struct search *s, const int registers, line *value)
{
  const struct tape *tape = s->tape;
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n];
    const line *first = s->slots + operation[1] - 1, *second = s->slots + operation[2] - 1;
    line *out = s->slots + operation[3] - 1;
    switch (operation[0]) {
    case LINEAR: combine(tape, operation[1], s->slots, registers, out); break;
    case PRODUCT:
      for (int j = 0; j < registers; j++) out->r[j] = first->r[j] * second->r[j];
      break;
    case QUOTIENT:
      for (int j = 0; j < registers; j++) out->r[j] = first->r[j] / second->r[j];
      break;
    case SQRT: AT_EACH(sqrt(first->x[j])); break;
    case EXP: AT_EACH(exp(first->x[j])); break;
    case TANH: AT_EACH(tanh(first->x[j])); break;
    case SINE_COSINE:
      AT_EACH(sin(first->x[j]));
      out++;
      AT_EACH(cos(first->x[j]));
      break;
    case TABLE: case SWITCH: case FLOOR: case SELECT: return 0;
    default: AT_EACH(function_of(operation[0], first->x[j], second->x[j], 0));
    }
  }
  combine(tape, tape->n_combinations, s->slots, registers, value);
  reg sum = {0.0};
  for (int j = 0; j < registers; j++) sum += 0.0 * value->r[j];
  for (int lane = 0; lane < IN_REGISTER; lane++)
    if (sum[lane] != 0.0) return 0;
  return 1;
}

static int evaluate(struct search *s, int registers, line *value)
{
  return registers == 1 ? evaluate_in(s, 1, value) : evaluate_in(s, registers, value);
}

/* Divide the quaternion by its norm. */
static void normalise(struct search *s, int registers)
{
  line *q = s->slots + FIRST_UNKNOWN + 3;
  if (s->given->m - s->given->n_own <= 3 || !s->is_used[FIRST_UNKNOWN + 3]) return;
  for (int j = 0; j < registers; j++) {
    reg sum = {0.0};
    for (int i = 0; i < 4; i++) sum += q[i].r[j] * q[i].r[j];
    reg norm;
    for (int lane = 0; lane < IN_REGISTER; lane++) norm[lane] = sqrt(sum[lane]);
    for (int i = 0; i < 4; i++) q[i].r[j] /= norm;
  }
}

/* Compute the function at a time, and unless `noise` is NULL its error, and that due to rounding
   alone, from lanes in which an argument is changed. */
static int value_at(struct search *s, double time, double *value, double *noise, double *rounding)
{
  const struct event_search *given = s->given;
  const double *c = s->settings, shift = c[SHIFT];
  double state[MOST_UNKNOWNS];
  line found;
  OF_LEVEL(read_pieces, LEVEL)(given->n_pieces, given->edges, given->points, given->m, given->values,
                               1, &time, state);
  s->slots[0] = everywhere(time);
  for (int i = 0; i < given->m; i++) s->slots[FIRST_UNKNOWN + i] = everywhere(state[i]);
  const int registers = noise ? (given->m + 2 + IN_REGISTER - 1) / IN_REGISTER : 1;
  normalise(s, registers);
  if (noise) {
    s->slots[0].x[1] += shift * fabs(time);
    for (int i = 0; i < given->m; i++)
      s->slots[FIRST_UNKNOWN + i].x[2 + i] += shift * s->sizes[s->piece * given->m + i];
  }
  if (!evaluate(s, registers, &found)) return 0;
  *value = found.x[0];
  if (!noise) return 1;
  *noise = *rounding = 0.0;
  for (int i = 1; i < given->m + 2; i++) {
    const double change = fabs(found.x[i] - found.x[0]) / shift;
    *noise += change * (i == 1 ? c[ROUNDING] : c[STATE_ERROR]);
    *rounding += change * c[ROUNDING];
  }
  return 1;
}

/* Compute the function at the nodes of the piece, and the polynomial's coefficients. */
static int fit(struct search *s, line *values, line *c)
{
  const struct event_search *given = s->given;
  const double middle = 0.5 * s->low + 0.5 * s->high, half = 0.5 * s->high - 0.5 * s->low;
  const double *own = given->values + (size_t)s->piece * (AT_ONCE + 1) * given->m;
  for (int j = 0; j < LINES; j++) s->slots[0].r[j] = middle + half * s->points.r[j];
  s->slots[0].x[0] = s->low;
  s->slots[0].x[NODES - 1] = s->high;
  for (int i = 0; i < given->m; i++)
    if (s->is_used[FIRST_UNKNOWN + i])
      s->slots[FIRST_UNKNOWN + i] = applied(AT_ONCE + 1, s->refining, own + i, given->m);
  normalise(s, LINES);
  if (!evaluate(s, LINES, values)) return 0;
  *c = applied(NODES, s->to_coefficients, values->x, 1);
  return 1;
}

#endif
