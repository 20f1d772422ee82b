/* The choice of the instruction set. The performance-critical modules are compiled once per
   instruction set, and the best one that this processor has is chosen when the library is loaded.
   Plain code runs on every processor. */
#include <stddef.h>
#include <stdint.h>

#include "ready_keys.h"
#include "tape.h"

typedef void solver(const void *problem, const void *request, void *solution);
typedef void quick_solver(const void *problem, const void *request, int contest, void *solution);
typedef void free_solver(const void *bodies, int n, double *omega, int8_t *status);
typedef void series_solver(const void *bodies, int n, double *omega, int8_t *status, int *interrupted);
typedef void fixed_solver(const void *bodies, int method, int n, double *omega, int8_t *status,
                          int *interrupted);
typedef void frame_finder(int n, const double *matrices, int m, const double *vectors,
                          double *numbers, double *axes, double *components, int *status);
typedef void runner(void *ensemble);
typedef void event_searcher(const void *tape, void *search);
typedef void reader(int pieces, const double *edges, const double *points, int m, const double *values,
                    int n, const double *times, double *states);

#define DECLARED(level, number, width)                                                         \
  solver taylor_solve_##level;                                                                 \
  quick_solver quick_solve_##level;                                                            \
  free_solver solve_many_free_##level;                                                         \
  series_solver solve_many_taylor_##level;                                                     \
  fixed_solver solve_many_fixed_##level;                                                       \
  frame_finder find_frames_##level;                                                            \
  runner run_lanes_##level;                                                                    \
  runner solve_tape_bodies_##level;                                                            \
  solver solve_tape_##level;                                                                   \
  solver step_tape_##level;                                                                    \
  solver vary_solution_##level;                                                                \
  event_searcher search_events_##level;                                                        \
  reader read_pieces_##level;                                                                  \
  extern const struct leaves ready_leaves_##level[];
#define TAKEN(level, number, width)                                                            \
  {taylor_solve_##level,       quick_solve_##level,      solve_many_free_##level,              \
   solve_many_taylor_##level,  solve_many_fixed_##level, run_lanes_##level,                    \
   solve_tape_##level,         step_tape_##level,        vary_solution_##level,                \
   solve_tape_bodies_##level,  read_pieces_##level,      ready_leaves_##level,                 \
   find_frames_##level,        search_events_##level,    number, width},

/* The levels that are compiled, and the width of their registers. The build for one processor has
   one of them. */
#ifdef WITH_plain
#define PLAIN(DO) DO(plain, 0, IN_REGISTER)
#else
#define PLAIN(DO)
#endif
#ifdef WITH_avx2
#define AVX2(DO) DO(avx2, 1, 4)
#else
#define AVX2(DO)
#endif
#ifdef WITH_avx512
#define AVX512(DO) DO(avx512, 2, 8)
#else
#define AVX512(DO)
#endif
#define EACH_LEVEL(DO) PLAIN(DO) AVX2(DO) AVX512(DO)

EACH_LEVEL(DECLARED)
#if defined(WITH_plain) && (defined(WITH_avx2) || defined(WITH_avx512))
/* They would take 90 kB of a wheel, for x86-64 processors before 2013. */
#define ready_leaves_plain NULL
#endif

static struct {
  solver *taylor;
  quick_solver *quick;
  free_solver *free;
  series_solver *series;
  fixed_solver *fixed;
  runner *lanes;
  solver *tape;
  solver *step;
  solver *vary;
  runner *bodies;
  reader *pieces;
  const struct leaves *leaves; /* of ready torques, in the order of ready_keys */
  frame_finder *frames;
  event_searcher *events;
  int level;                   /* 0 plain, 1 AVX2 with FMA, 2 AVX-512 */
  int width;                   /* numbers in a register */
} chosen, known[] = {EACH_LEVEL(TAKEN)};

#if defined(WITH_avx2) || defined(WITH_avx512)
/* All features of x86-64-v3 that a processor with AVX2 may lack, or a virtual machine may hide. */
#define HAS_AVX2                                                                               \
  (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&                          \
   __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2"))
#define HAS_AVX512                                                                             \
  (HAS_AVX2 && __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") &&      \
   __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&                 \
   __builtin_cpu_supports("avx512vl"))
static int level_here(void)
{
  __builtin_cpu_init();
  return HAS_AVX512 ? 2 : HAS_AVX2 ? 1 : 0;
}
#else
static int level_here(void) { return 0; }
#endif

/* Choose a level, or the best below it that is compiled and the processor has, or else the lowest.
   Return the level that was chosen, or -1 if the processor lacks it. -1 changes nothing. */
int choose_level(int highest)
{
  const int here = level_here();
  if (highest >= 0) chosen = known[0];
  for (size_t i = 0; highest >= 0 && i < sizeof known / sizeof *known; i++)
    if (known[i].level <= highest && known[i].level <= here) chosen = known[i];
  return chosen.level <= here ? chosen.level : -1;
}

__attribute__((constructor)) static void choose_best(void) { choose_level(2); }

void taylor_solve(const void *problem, const void *request, void *solution)
{
  chosen.taylor(problem, request, solution);
}

void quick_solve(const void *problem, const void *request, int contest, void *solution)
{
  chosen.quick(problem, request, contest, solution);
}

void find_frames(int n, const double *matrices, int m, const double *vectors, double *numbers,
                 double *axes, double *components, int *status)
{
  chosen.frames(n, matrices, m, vectors, numbers, axes, components, status);
}

void many_free(const void *bodies, int n, double *omega, int8_t *status)
{
  chosen.free(bodies, n, omega, status);
}

void many_taylor(const void *bodies, int n, double *omega, int8_t *status, int *interrupted)
{
  chosen.series(bodies, n, omega, status, interrupted);
}

void many_fixed(const void *bodies, int method, int n, double *omega, int8_t *status, int *interrupted)
{
  chosen.fixed(bodies, method, n, omega, status, interrupted);
}

void tape_solve(const void *tape, const void *request, void *solution)
{
  chosen.tape(tape, request, solution);
}

void tape_step(const void *tape, const void *request, void *step)
{
  chosen.step(tape, request, step);
}

void tape_variation(const void *tape, const void *request, void *variation)
{
  chosen.vary(tape, request, variation);
}

void tape_bodies(void *bodies) { chosen.bodies(bodies); }

void read_pieces(int pieces, const double *edges, const double *points, int m, const double *values,
                 int n, const double *times, double *states)
{
  chosen.pieces(pieces, edges, points, m, values, n, times, states);
}

void search_events(const void *tape, void *search) { chosen.events(tape, search); }

enum { LEAST_ADDRESS = 4096 };

/* Return the number, from 1, of the compiled operations of a ready torque; 0 for others. */
int64_t ready_leaves(int64_t key)
{
  for (int64_t i = 0; chosen.leaves && i < (int64_t)(sizeof ready_keys / sizeof *ready_keys); i++)
    if (ready_keys[i] == key) return i + 1;
  return 0;
}

/* Return the compiled operations of a ready torque, by its number, or at an address. */
const void *leaves_at(int64_t number)
{
  if (number <= 0 || number >= LEAST_ADDRESS) return (const void *)(intptr_t)number;
  return chosen.leaves ? chosen.leaves + number - 1 : NULL;
}

/* Return whether the leaves at an address are for bodies in the registers of this level. */
int fits_lanes(int64_t address)
{
  const struct leaves *leaves = leaves_at(address);
  return leaves != NULL && leaves->expand_lanes != NULL && leaves->width == chosen.width;
}

void run_lanes(void *ensemble) { chosen.lanes(ensemble); }
