/* The equations of motion as C reads them: tape_arrays_t of tape.f90. */
#ifndef TAPE_H
#define TAPE_H

#include "codes.h"

#define JOINED(name, level) name##_##level
#define OF_LEVEL(name, level) JOINED(name, level)

enum { MOST_UNKNOWNS = 7 };
enum { FIRST_UNKNOWN = 1 }; /* the slot of omega's first component, from 0 */

/* Numbers of slots and combinations begin with 1. */
struct tape {
  int n_unknowns, n_operations, n_combinations;
  const int (*operations)[4]; /* kind, two operands and result */
  const int *starts, *slots;
  const double *coefficients, *constants;
  void *a;    /* terms of each slot */
  void *v;    /* terms of the perturbations of each slot */
  void *work; /* working storage of expand_tape, and of perturb_tape by the Jacobian */
};

#endif
