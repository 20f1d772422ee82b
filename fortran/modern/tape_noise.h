/* Bounds of the rounding errors of the rates, in units of the rounding error of 1, by running error
   analysis of terms 0 (Higham 2002, section 3.3). `number` is the type of a term, `size` its absolute
   value, and OTHER_ROUNDINGS has cases that cases.h lacks. The time counts as exact. */

static number rounding_of(const struct tape *tape, int n, const series *a, const number *e)
{
  number sum = {0.0};
  for (int i = tape->starts[n] - 1; i < tape->starts[n + 1] - 1; i++) {
    const int slot = tape->slots[i] - 1;
    sum += fabs(tape->coefficients[i]) * (size(a[slot][0]) + e[slot]);
  }
  /* One term alone is rounded once, and the multiplication by 1 not at all. */
  if (tape->starts[n + 1] > tape->starts[n]) sum += fabs(tape->constants[n]);
  return sum;
}

/* Compute the bounds of all slots, of which those of the inputs are given, and of the rates. */
static void bound_roundings(const struct tape *tape, const series *a, number *e, number *rates)
{
  const number zero = {0.0};
  for (int n = 0; n < tape->n_operations; n++) {
    const int *operation = tape->operations[n], kind = recurrence_of(operation);
    const int x = operation[1] - 1, y = operation[2] - 1, o = operation[3] - 1, p = o + 1;
    switch (kind) {
    case LINEAR: e[o] = rounding_of(tape, x, a, e); break;
    OTHER_ROUNDINGS
    ROUNDING_CASES
    default: e[o] = zero; break; /* a switch */
    }
  }
  for (int i = 0; i < tape->n_unknowns; i++)
    rates[i] = rounding_of(tape, tape->n_combinations - tape->n_unknowns + i, a, e);
}
