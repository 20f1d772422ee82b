/* Roots of a recorded event function: simple ones, well apart from each other and from the ends of
   the solution. Where anything else may be, the search ends without a result, and event_roots.py,
   whose rules and names these are, searches instead. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "event_function.h"

enum { TAIL = 3, MOST_DIVISIONS = 50, POLISHES = 3, NEWTON_STEPS = 80 };

/* Return the sum of the magnitudes of all coefficients but the first. */
static double rest_of(const line *c)
{
  double sum = 0.0;
  for (int k = 1; k < NODES; k++) sum += fabs(c->x[k]);
  return sum;
}

static int has_no_root(const struct search *s, const line *c)
{
  return fabs(c->x[0]) > s->settings[MARGIN] * rest_of(c);
}

static line derivative(const line *c)
{
  line d = everywhere(0.0);
  for (int k = NODES - 2; k >= 0; k--)
    d.x[k] = (k + 2 < NODES ? d.x[k + 2] : 0.0) + 2 * (k + 1) * c->x[k + 1];
  d.x[0] *= 0.5;
  return d;
}

/* Return the polynomial's value, by Clenshaw's recurrence. */
static double read(const line *c, double x)
{
  double next = 0.0, after = 0.0;
  for (int k = NODES - 1; k > 0; k--) {
    const double sum = 2.0 * x * next - after + c->x[k];
    after = next;
    next = sum;
  }
  return x * next - after + c->x[0];
}

/* Return the root between two points, where the sign changes to `sign`, by Newton's method. */
static double bracketed(const struct search *s, const line *c, const line *d, double low, double high,
                        int sign)
{
  double x = 0.5 * (low + high);
  for (int n = 0; n < NEWTON_STEPS; n++) {
    const double value = read(c, x);
    if (sign * value > 0.0) high = x;
    else low = x;
    double next = x - value / read(d, x);
    const int is_inside = next >= low && next <= high;
    if (!is_inside) next = 0.5 * (low + high);
    const double moved = fabs(next - x);
    x = next;
    if (moved <= (is_inside ? s->settings[SHORT] : 2e-16)) break;
  }
  return x;
}

/* Keep a root at x, from -1 to 1 between two times. */
static int keep(struct search *s, double x, int change, double low, double high)
{
  struct event_search *given = s->given;
  const double part = 0.5 * (low + high) + 0.5 * (high - low) * x;
  const double half = 0.5 * s->high - 0.5 * s->low;
  const double time = 0.5 * s->low + 0.5 * s->high + half * part;
  if (given->n_roots >= given->most) return 0;
  double *root = given->roots[given->n_roots++];
  root[0] = fmin(fmax(time, s->low), s->high);
  root[1] = change;
  root[2] = read(&s->slope, part) / half;
  root[3] = fmax(s->noise, s->near);
  return root[2] * change > 0.0;
}

/* Keep all roots of a part of the piece, from `low` to `high` within -1 to 1. */
static int isolate(struct search *s, const line *c, double low, double high, double first, double last,
                   int depth)
{
  const double rest = rest_of(c);
  const int is_change = (first < 0.0) != (last < 0.0), sign = last < 0.0 ? -1 : 1;
  if (!is_change && fabs(c->x[0]) > rest + s->near) return 1;
  if (fabs(c->x[0]) + rest <= s->least || depth == MOST_DIVISIONS) return 0;
  const line d = derivative(c);
  if (has_no_root(s, &d))
    return !is_change || keep(s, bracketed(s, c, &d, -1.0, 1.0, sign), sign, low, high);
  const line second = derivative(&d);
  if (has_no_root(s, &second)) {
    const double before = read(&d, -1.0), after = read(&d, 1.0);
    const int has_extremum = (before < 0.0) != (after < 0.0);
    const double x = has_extremum ? bracketed(s, &d, &second, -1.0, 1.0, after < 0.0 ? -1 : 1) : 1.0;
    const double value = has_extremum ? read(c, x) : last;
    /* An extremum near 0, here or at an end, may be a double root. */
    if (fmin(fabs(value), fmin(fabs(first), fabs(last))) <= s->settings[MUCH] * s->near) return 0;
    if (is_change) {
      const int is_left = (value < 0.0) == (last < 0.0);
      const double root = is_left ? bracketed(s, c, &d, -1.0, x, sign) : bracketed(s, c, &d, x, 1.0, sign);
      return keep(s, root, sign, low, high);
    }
    if ((value < 0.0) == (first < 0.0)) return 1;
    return keep(s, bracketed(s, c, &d, -1.0, x, -sign), -sign, low, high) &&
           keep(s, bracketed(s, c, &d, x, 1.0, sign), sign, low, high);
  }
  const double middle = 0.5 * (low + high), centre = read(c, 0.0);
  const line before = applied(NODES, s->left, c->x, 1), after = applied(NODES, s->right, c->x, 1);
  return isolate(s, &before, low, middle, first, centre, depth + 1) &&
         isolate(s, &after, middle, high, centre, last, depth + 1);
}

/* Compute the noise of the piece, at three of its nodes. */
static int find_noise(struct search *s, double size)
{
  double value, noise, rounding;
  s->noise = 0.0;
  for (int k = 5; k < NODES; k += 11) {
    const double time = 0.5 * s->low + 0.5 * s->high + (0.5 * s->high - 0.5 * s->low) * s->points.x[k];
    if (!value_at(s, time, &value, &noise, &rounding)) return 0;
    s->noise = fmax(s->noise, noise);
  }
  s->noise += s->settings[ROUNDING] * size;
  return 1;
}

/* Return whether the function is far from 0 at an end of the solution, or at time 0. */
static int is_far(struct search *s, double time, double size)
{
  double value, noise, rounding;
  if (!value_at(s, time, &value, &noise, &rounding)) return 0;
  return fabs(value) > s->settings[MUCH] * (noise + rounding + s->settings[ROUNDING] * size);
}

/* Keep the roots in a piece; `first` is the function's value at its beginning, and then at its end. */
static int search_piece(struct search *s, double *first)
{
  const struct event_search *given = s->given;
  const double *constant = s->settings;
  line values, c;
  s->low = given->edges[s->piece];
  s->high = given->edges[s->piece + 1];
  if (!fit(s, &values, &c)) return 0;
  double largest = 0.0, tail = 0.0;
  for (int j = 0; j < NODES; j++) largest = fmax(largest, fabs(values.x[j]));
  for (int k = NODES - TAIL; k < NODES; k++) tail = fmax(tail, fabs(c.x[k]));
  const double rest = rest_of(&c), size = s->found[s->piece] = fabs(c.x[0]) + rest;
  const double before = s->piece ? *first : values.x[0], last = *first = values.x[NODES - 1];
  if (tail > constant[LAST] * largest) return 0;
  if ((s->piece == 0 || s->low == 0.0) && !is_far(s, s->low, size)) return 0;
  if (s->piece == given->n_pieces - 1 && !is_far(s, s->high, size)) return 0;
  if (fmin(fabs(before), fabs(last)) <= constant[MUCH] * constant[ROUNDING] * size) return 0;
  const int is_change = (before < 0.0) != (last < 0.0);
  if (!is_change && fabs(c.x[0]) > constant[FIT_ERROR] * size + rest) return 1;
  if (!find_noise(s, size) || fmin(fabs(before), fabs(last)) <= constant[MUCH] * s->noise) return 0;
  s->near = fmax(s->noise, constant[FIT_ERROR] * size);
  s->least = fmax(s->noise / 16.0, 1e-15 * size);
  s->slope = derivative(&c);
  return isolate(s, &c, -1.0, 1.0, before, last, 0);
}

/* Return whether no piece that is small beside others is 0 within its error. */
static int are_distinct(struct search *s)
{
  double largest = 0.0;
  line values, c;
  for (int k = 0; k < s->given->n_pieces; k++) largest = fmax(largest, s->found[k]);
  for (s->piece = 0; s->piece < s->given->n_pieces; s->piece++) {
    const double size = s->found[s->piece];
    if (size > largest / s->settings[MUCH]) continue;
    s->low = s->given->edges[s->piece];
    s->high = s->given->edges[s->piece + 1];
    if (!fit(s, &values, &c) || !find_noise(s, size) || size <= s->settings[MUCH] * s->noise) return 0;
  }
  return 1;
}

static double spacing(double x) { return nextafter(fabs(x), INFINITY) - fabs(x); }

/* Move a root to where the function itself changes its sign, and beyond in the direction of the
   integration, between two bounds. */
static int polish(struct search *s, double *root, double lowest, double highest)
{
  const struct event_search *given = s->given;
  const double first = given->edges[0], end = given->edges[given->n_pieces], change = root[1];
  const int is_before = root[0] < 0.0;
  double time = root[0], slope = root[2], value, low, high, width, before, after;
  if (!value_at(s, time, &value, NULL, NULL)) return 0;
  for (int n = 0; n < POLISHES && fabs(value / slope) > spacing(time); n++) {
    const double trial = fmin(fmax(time - value / slope, first), end);
    double other;
    if (!value_at(s, trial, &other, NULL, NULL)) return 0;
    if (fabs(other) >= fabs(value)) break;
    time = trial;
    value = other;
  }
  const int is_short = value * (is_before ? -change : change) < 0.0;
  const double length = given->edges[s->piece + 1] - given->edges[s->piece];
  const double exact = s->settings[EXACT] * (spacing(time) + spacing(length));
  for (width = exact;; width *= s->settings[WIDER]) {
    low = fmax(time - width, lowest);
    high = fmin(time + width, highest);
    if (!value_at(s, low, &before, NULL, NULL) || !value_at(s, high, &after, NULL, NULL)) return 0;
    if (before * change < 0.0 && after * change > 0.0) break;
    if (low == lowest && high == highest) return 0;
  }
  while (width > exact || is_short) {
    const double middle = 0.5 * low + 0.5 * high;
    if (!(middle > low && middle < high)) break;
    if (!value_at(s, middle, &value, NULL, NULL)) return 0;
    value *= change;
    if (value > 0.0 || (value == 0.0 && !is_before)) high = middle;
    else low = middle;
    time = is_before ? low : high;
  }
  root[0] = time;
  return 1;
}

/* Polish all roots, if the function is far from 0 between each two. */
static int finish(struct search *s)
{
  const struct event_search *given = s->given;
  double lowest = given->edges[0];
  s->piece = 0;
  for (int k = 0; k < given->n_roots; k++) {
    double *root = given->roots[k], highest = given->edges[given->n_pieces], value;
    if (k + 1 < given->n_roots) {
      highest = 0.5 * root[0] + 0.5 * root[4];
      if (!(root[0] < highest && highest < root[4])) return 0;
      if (!value_at(s, highest, &value, NULL, NULL)) return 0;
      if (fabs(value) <= s->settings[MUCH] * fmax(root[3], root[7])) return 0;
      if (root[1] == root[5]) return 0;
    }
    while (root[0] > given->edges[s->piece + 1]) s->piece++;
    if (!polish(s, root, lowest, highest)) return 0;
    lowest = highest;
  }
  return 1;
}

/* Compute the largest sizes of the unknowns between time 0 and each piece. */
static void find_sizes(struct search *s)
{
  const struct event_search *given = s->given;
  const int m = given->m, own = m - given->n_own;
  int begin = 0;
  while (begin < given->n_pieces && given->edges[begin] < 0.0) begin++;
  for (int side = -1; side <= 1; side += 2) {
    double largest[MOST_UNKNOWNS] = {0.0};
    for (int k = side > 0 ? begin : begin - 1; k >= 0 && k < given->n_pieces; k += side) {
      const double *values = given->values + (size_t)k * (AT_ONCE + 1) * m;
      double *sizes = s->sizes + (size_t)k * m;
      for (int j = 0; j <= AT_ONCE; j++)
        for (int i = 0; i < m; i++) largest[i] = fmax(largest[i], fabs(values[j * m + i]));
      for (int i = 0; i < m; i++) sizes[i] = i < own ? 1.0 : largest[i];
      for (int i = 0; i < 3; i++) sizes[i] = fmax(fmax(largest[0], largest[1]), largest[2]);
    }
  }
}

static void mark_used(struct search *s)
{
  const struct tape *tape = s->tape;
  const int n_inputs = 1 + s->given->m;
  for (int n = 0; n < tape->n_operations; n++)
    for (int i = 1; i < 3; i++) {
      const int *operation = tape->operations[n], slot = operation[i] - 1;
      const int is_slot = operation[0] != LINEAR && (i == 1 || HAS_OWN_VALUE(operation[0]));
      if (is_slot && slot < n_inputs) s->is_used[slot] = 1;
    }
  for (int i = 0; i < tape->starts[tape->n_combinations] - 1; i++)
    if (tape->slots[i] <= n_inputs) s->is_used[tape->slots[i] - 1] = 1;
  char *attitude = s->is_used + FIRST_UNKNOWN + 3;
  const int is_used = attitude[0] || attitude[1] || attitude[2] || attitude[3];
  if (s->given->m - s->given->n_own > 3) memset(attitude, is_used, 4);
}

void OF_LEVEL(search_events, LEVEL)(const struct tape *tape, struct event_search *given)
{
  struct search *s = aligned_alloc(sizeof(reg), (sizeof *s + sizeof(reg) - 1) / sizeof(reg) * sizeof(reg));
  const size_t numbers = (size_t)given->n_pieces * (given->m + 1);
  given->n_roots = 0;
  int is_clear = s != NULL;
  if (is_clear) {
    memset(s, 0, sizeof *s);
    s->tape = tape;
    s->given = given;
    s->settings = given->settings;
    s->slots = aligned_alloc(sizeof(reg), given->n_slots * sizeof(line));
    s->sizes = malloc(numbers * sizeof(double));
    is_clear = s->slots && s->sizes;
  }
  if (is_clear) {
    s->found = s->sizes + (size_t)given->n_pieces * given->m;
    memset(s->slots, 0, given->n_slots * sizeof(line));
    take(AT_ONCE + 1, given->refining, s->refining);
    take(NODES, given->to_coefficients, s->to_coefficients);
    take(NODES, given->left, s->left);
    take(NODES, given->right, s->right);
    take(1, given->points + AT_ONCE + 1, &s->points);
    find_sizes(s);
    mark_used(s);
    double first = 0.0;
    for (s->piece = 0; is_clear && s->piece < given->n_pieces; s->piece++) is_clear = search_piece(s, &first);
    is_clear = is_clear && are_distinct(s) && finish(s);
  }
  if (!is_clear) given->n_roots = -1;
  if (s) free(s->slots), free(s->sizes);
  free(s);
}
