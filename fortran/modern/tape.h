/* The equations of motion as C reads them: tape_arrays_t of tape.f90. */
#ifndef TAPE_H
#define TAPE_H

#include <stdint.h>
/* Of immintrin.h two instructions are needed; to read it would take as long as to compile the rest. */
#if defined(__AVX512DQ__) && defined(__clang__)
#include <immintrin.h>
#endif

#include "cases.h"
#include "codes.h"

#define JOINED(name, level) name##_##level
#define OF_LEVEL(name, level) JOINED(name, level)

/* A register. The compiler would take comparisons of longer vectors apart, number by number. */
#if defined(__AVX512F__)
enum { IN_REGISTER = 8 };
#elif defined(__AVX__)
enum { IN_REGISTER = 4 };
#else
enum { IN_REGISTER = 2 };
#endif
typedef double reg __attribute__((vector_size(8 * IN_REGISTER)));
typedef long long reg_bits __attribute__((vector_size(8 * IN_REGISTER)));

/* Return whether a comparison holds for any number of a register. */
static inline int any(reg_bits mask)
{
#if defined(__AVX512DQ__) && defined(__clang__)
  return _mm512_movepi64_mask((__m512i)mask) != 0;
#elif defined(__AVX512DQ__)
  return __builtin_ia32_cvtq2mask512(mask) != 0;
#elif defined(__AVX__) && !defined(__AVX512F__)
  return __builtin_ia32_movmskpd256((reg)mask) != 0;
#else
  long long found = 0;
  for (int i = 0; i < IN_REGISTER; i++) found |= mask[i];
  return found != 0;
#endif
}

/* Return the larger number in each lane; the second if one is NaN. */
static inline reg larger(reg a, reg b)
{
#if defined(__AVX512DQ__) && defined(__clang__)
  return (reg)_mm512_max_pd((__m512d)a, (__m512d)b);
#elif defined(__AVX512DQ__)
  return __builtin_ia32_maxpd512_mask(a, b, a, -1, 4);
#elif defined(__AVX__) && !defined(__AVX512F__)
  return __builtin_ia32_maxpd256(a, b);
#else
  const reg_bits is_larger = a > b;
  return (reg)(((reg_bits)a & is_larger) | ((reg_bits)b & ~is_larger));
#endif
}
/* Return the smaller number in each lane; the second if one is NaN. */
static inline reg smaller(reg a, reg b) { return -larger(-a, -b); }

enum { WITH_ATTITUDE = 7 }; /* number of unknowns */
enum { FIRST_UNKNOWN = 1 }; /* the slot of omega's first component, from 0 */
enum { N_INPUTS = 8 };      /* time, omega and attitude; parameters follow */

/* Return the kind of an operation in cases.h. */
static inline int recurrence_of(const int *operation)
{
  return operation[0] == SINE_COSINE && operation[2] > 0 ? WAVE : operation[0];
}

/* Functions that were compiled for the operations of one tape, by pyharness/engine/system/leaves.py. Two
   arguments are the coefficients and constants of the combinations. */
struct leaves {
  /* As expand_tape of tape_terms.c; the last array is `unknowns` of its working storage. */
  void (*expand)(double *terms, const double *, const double *, double *unknowns, double h, int order);
  /* As set_columns of tape_perturbations.c, for all columns. `parts` is of four numbers, `nodes` 2 or 4. */
  void (*set_jacobian)(const double *terms, const double *, const double *, const double *parts,
                       int nodes, double h, double *jacobian);
  /* Term 0 of all slots, and the rates; or NULL, and the operations are interpreted. */
  void (*set_values)(double *terms, const double *, const double *, double *rates);
  /* As noise_of of tape_series.f90. */
  void (*set_noise)(const double *terms, const double *, const double *, double *noise);
  /* The same of tape_lanes.c, for registers of `width` numbers; or NULL. */
  void (*expand_lanes)(reg *terms, const double *, const double *, const reg *h, int order);
  void (*set_lane_jacobian)(const reg *terms, const double *, const double *, const reg *factor,
                            const reg *h, reg (*jacobian)[WITH_ATTITUDE]);
  void (*set_lane_values)(reg *terms, const double *, const double *);
  void (*set_lane_noise)(const reg *terms, const double *, const double *, reg *noise);
  intptr_t width;
};

/* Numbers of slots and combinations begin with 1. */
struct tape {
  int n_unknowns, n_operations, n_combinations;
  int has_attitude; /* perturbations: the unknowns are omega and the attitude, no others */
  const int (*operations)[4]; /* kind, two operands and result */
  const int *starts, *slots;
  const double *coefficients, *constants;
  void *a;    /* terms of each slot */
  void *v;    /* terms of the perturbations of each slot */
  void *work; /* working storage of expand_tape, and of perturb_tape by the Jacobian */
  const struct leaves *leaves; /* NULL: the operations are interpreted */
};

#endif
