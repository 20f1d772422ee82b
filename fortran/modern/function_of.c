/* Functions of C's library whose Taylor series follow from their derivative: see recurrences.py. */
#include <math.h>

#include "cases.h"
#include "codes.h"

/* Return the value at x, where the derivative is y. If it `saturates`, other numbers may replace
   exponentials in y. */
double function_of(int kind, double x, double y, int saturates)
{
  switch (kind) {
  FUNCTION_CASES
  }
  return NAN;
}
