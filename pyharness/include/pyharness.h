/* Prepared solvers of pyharness in C: solutions without a call of Python.

   The attribute `capsule` of a solver that pyharness.prepare returns is a capsule with the name
   PYHARNESS_SOLVER. PyCapsule_GetPointer returns the address of its pyharness_solver, which stays
   valid as long as the capsule. The folder of this file is pyharness.get_include(); nothing is
   linked. Threads may share a solver. */
#ifndef PYHARNESS_H
#define PYHARNESS_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>

/* The name of the capsule, which ends with the version of this interface. */
#define PYHARNESS_SOLVER "pyharness.solver.1"

/* How a solution ended. There is a state after COMPLETE and SENSITIVE alone; otherwise it is NaN.
   After INTERRUPTED a Python exception is set, by Ctrl-C. */
enum {
  PYHARNESS_COMPLETE = 0,
  PYHARNESS_OVERFLOW = 2,
  PYHARNESS_REFUSED = 3,
  PYHARNESS_GAVE_UP = 4,
  PYHARNESS_INTERRUPTED = 5,
  PYHARNESS_SENSITIVE = 6
};

/* A prepared solver. Its numbers describe a scene, a method and a tolerance; `first` is a closed
   form that is tried before, or NULL. A state has `width` numbers: omega (rad/s), and if there are
   seven, a unit quaternion from body to space, scalar first. */
typedef struct {
  void (*kernel)(const double *numbers, const int *n_numbers, const double *start,
                 const double *t_end, double *state, int *status, int64_t *steps, double *found);
  const double *numbers, *first;
  int n_numbers, n_first, width;
} pyharness_solver;

/* Compute the state at the time t_end (s) from the state `start` at time 0, and return how the
   solution ended. `error` becomes the estimated error, relative to the largest |omega|, or NaN if it
   is unknown; it may be NULL. Negative times are allowed. */
static inline int pyharness_solve(const pyharness_solver *solver, const double *start, double t_end,
                                  double *state, double *error)
{
  int status = PYHARNESS_REFUSED;
  int64_t steps;
  double found[3];
  if (solver->first != NULL)
    solver->kernel(solver->first, &solver->n_first, start, &t_end, state, &status, &steps, found);
  if (status != PYHARNESS_COMPLETE)
    solver->kernel(solver->numbers, &solver->n_numbers, start, &t_end, state, &status, &steps,
                   found);
  if (error != NULL) *error = found[0] < 0.0 ? NAN : found[0];
  return status;
}

#endif
