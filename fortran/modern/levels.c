/* The hot modules are compiled once per instruction set; the best that this processor has is
   chosen when the library is loaded. Plain code runs everywhere. */
#include <stdint.h>

#define ARGUMENTS                                                                              \
  const void *problem, const double *omega, const double *tolerance, const double *effort,     \
      int n_times, const double *times, double *rows, int n_attitudes,                         \
      double *attitudes, int *n_rows, int *status, int64_t *steps, double *needed, double *found

#define QUICK_ARGUMENTS                                                                        \
  const void *problem, const double *omega, const double *tolerance, const double *effort,     \
      const double *t_end, int contest, double *result, int *status, int *steps,               \
      double *error

typedef void solver(ARGUMENTS);
typedef void quick_solver(QUICK_ARGUMENTS);
typedef void runner(void *ensemble);

solver taylor_solve_plain;
quick_solver quick_solve_plain;
runner run_lanes_plain;
#ifdef WITH_LEVELS
solver taylor_solve_avx2, taylor_solve_avx512;
quick_solver quick_solve_avx2, quick_solve_avx512;
runner run_lanes_avx2, run_lanes_avx512;
#endif

static solver *chosen = taylor_solve_plain;
static quick_solver *chosen_quick = quick_solve_plain;
static runner *chosen_lanes = run_lanes_plain;
static int level = 0; /* 0 plain, 1 AVX2 with FMA, 2 AVX-512 */

/* All of x86-64-v3 that a processor with AVX2 may lack, or that a virtual machine may hide. */
#define HAS_AVX2                                                                               \
  (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&                          \
   __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2"))
#define HAS_AVX512                                                                             \
  (HAS_AVX2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&      \
   __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&                 \
   __builtin_cpu_supports("avx512vl"))

/* Take a level, or the best below it that the processor has; return the one taken. */
int choose_level(int highest)
{
  chosen = taylor_solve_plain;
  chosen_quick = quick_solve_plain;
  chosen_lanes = run_lanes_plain;
  level = 0;
#ifdef WITH_LEVELS
  __builtin_cpu_init();
  if (highest >= 2 && HAS_AVX512) {
    chosen = taylor_solve_avx512;
    chosen_quick = quick_solve_avx512;
    chosen_lanes = run_lanes_avx512;
    level = 2;
  } else if (highest >= 1 && HAS_AVX2) {
    chosen = taylor_solve_avx2;
    chosen_quick = quick_solve_avx2;
    chosen_lanes = run_lanes_avx2;
    level = 1;
  }
#endif
  return level;
}

#ifdef WITH_LEVELS
__attribute__((constructor)) static void choose_best(void) { choose_level(2); }
#endif

void taylor_solve(ARGUMENTS)
{
  chosen(problem, omega, tolerance, effort, n_times, times, rows, n_attitudes, attitudes, n_rows, status, steps,
         needed, found);
}

void quick_solve(QUICK_ARGUMENTS)
{
  chosen_quick(problem, omega, tolerance, effort, t_end, contest, result, status, steps, error);
}

void run_lanes(void *ensemble) { chosen_lanes(ensemble); }
