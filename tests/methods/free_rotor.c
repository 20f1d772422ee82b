/* Calls of free_rotor.h for tests/methods/test_free_rotor.py: as a library, batches of scenes; as a
   program with the arguments INPUTS SEED, the functions on arbitrary bit patterns. With the argument
   `binary64` or `binary32` the program reads scenes of eleven binary64 numbers (moments, omega,
   attitude, time) and writes eight for each (omega, attitude, status). */
#include "free_rotor.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define BATCH(name, type, rotor_t, prepare, at, step)                                                \
  void name(int n, const type *moments, const type *omegas, const type *attitudes, const type *times, \
            type *states, int *statuses);                                                            \
  void name(int n, const type *moments, const type *omegas, const type *attitudes, const type *times, \
            type *states, int *statuses)                                                             \
  {                                                                                                  \
    rotor_t rotor;                                                                                   \
    for (int i = 0; i < n; i++) {                                                                    \
      statuses[i] = prepare(&rotor, moments + 3 * i, omegas + 3 * i, attitudes + 4 * i);             \
      if (statuses[i] == FREE_ROTOR_OK)                                                              \
        statuses[i] = at(&rotor, times[i], states + 7 * i, states + 7 * i + 3);                      \
    }                                                                                                \
  }                                                                                                  \
  int name##_steps(int n, const type *moments, type dt, type *state, type *rest);                   \
  int name##_steps(int n, const type *moments, type dt, type *state, type *rest)                    \
  {                                                                                                  \
    int status = FREE_ROTOR_OK;                                                                      \
    for (int i = 0; i < n && status == FREE_ROTOR_OK; i++)                                           \
      status = step(moments, dt, state, state + 3, rest);                                           \
    return status;                                                                                   \
  }

BATCH(batch, double, free_rotor, free_rotor_prepare, free_rotor_at, free_rotor_step_compensated)
BATCH(batchf, float, free_rotorf, free_rotor_preparef, free_rotor_atf, free_rotor_step_compensatedf)

static uint64_t seed;

/* xorshift64* */
static uint64_t draw(void)
{
  seed ^= seed >> 12;
  seed ^= seed << 25;
  seed ^= seed >> 27;
  return seed * 0x2545F4914F6CDD1DU;
}

/* Every result after FREE_ROTOR_OK is finite and the quaternion has norm 1; after any other code the
   results are as before. */
#define TRIAL(name, type, word, rotor_t, prepare, at, step, slack)                                   \
  static int name(long long number, long long counts[5])                                             \
  {                                                                                                  \
    static const type special[] = {0, 1, -1, 2, 3, (type)1e-30, (type)1e30, (type)0.1};              \
    type x[11], state[7], before[7], norm, rest[7] = {0};                                           \
    rotor_t rotor;                                                                                   \
    int status, kind, i;                                                                             \
    for (i = 0; i < 11; i++) {                                                                       \
      word bits = (word)(draw() >> (64 - 8 * sizeof(word)));                                         \
      const uint64_t how = draw() >> 56;                                                             \
      memcpy(&x[i], &bits, sizeof bits);                                                             \
      if (how < 96) x[i] = (type)((double)(draw() >> 12) * 0x1p-51 - 1.0);                           \
      if (how >= 96 && how < 128) x[i] = special[how % 8];                                           \
      if (how >= 128 && how < 144 && i > 0) x[i] = x[i - 1];                                         \
      if (how >= 144 && how < 160 && i > 0) x[i] = x[i - 1] * (type)(1.0 + (double)(how % 4) * 1e-7); \
      if (i < 3 && how < 250) x[i] = (type)fabs((double)x[i]);                                       \
    }                                                                                                \
    for (kind = 0; kind < 3; kind++) {                                                               \
      memcpy(state, x + 3, sizeof state);                                                            \
      memcpy(before, state, sizeof state);                                                           \
      if (kind == 0) {                                                                               \
        status = prepare(&rotor, x, x + 3, x + 6);                                                   \
        if (status != at(&rotor, x[10], state, state + 3) && status != FREE_ROTOR_OK) return 1;      \
        if (status == FREE_ROTOR_OK) status = at(&rotor, x[10], state, state + 3);                   \
      } else {                                                                                       \
        status = step(x, x[10], state, state + 3, kind == 1 ? NULL : rest);                         \
      }                                                                                              \
      counts[status]++;                                                                              \
      if (status != FREE_ROTOR_OK) {                                                                 \
        if (memcmp(state, before, sizeof state) == 0) continue;                                      \
        fprintf(stderr, "%lld " #name " %d: changed after status %d\n", number, kind, status);       \
        return 1;                                                                                    \
      }                                                                                              \
      norm = state[3] * state[3] + state[4] * state[4] + state[5] * state[5] + state[6] * state[6];  \
      for (i = 0; i < 7; i++) status |= !isfinite(state[i]) || !isfinite(rest[i]);                  \
      if (status || !(fabs((double)norm - 1.0) <= slack)) {                                          \
        fprintf(stderr, "%lld " #name " %d: not finite, or |q|**2 - 1 = %g\n", number, kind,          \
                (double)norm - 1.0);                                                                 \
        for (i = 0; i < 11; i++) fprintf(stderr, "%.17g ", (double)x[i]);                            \
        fprintf(stderr, "\n");                                                                       \
        return 1;                                                                                    \
      }                                                                                              \
    }                                                                                                \
    return 0;                                                                                        \
  }

TRIAL(trial, double, uint64_t, free_rotor, free_rotor_prepare, free_rotor_at,
      free_rotor_step_compensated, 1e-14)
TRIAL(trialf, float, uint32_t, free_rotorf, free_rotor_preparef, free_rotor_atf,
      free_rotor_step_compensatedf, 4e-6)

static int solve_scenes(bool wide)
{
  double scene[11], found[8];
  while (fread(scene, sizeof scene, 1, stdin) == 1) {
    float narrow[11], narrow_found[7] = {0.0F};
    int status, i;
    for (i = 0; i < 11; i++) narrow[i] = (float)scene[i];
    for (i = 0; i < 7; i++) found[i] = 0.0;
    if (wide)
      batch(1, scene, scene + 3, scene + 6, scene + 10, found, &status);
    else
      batchf(1, narrow, narrow + 3, narrow + 6, narrow + 10, narrow_found, &status);
    for (i = 0; i < 7 && !wide; i++) found[i] = (double)narrow_found[i];
    found[7] = status;
    if (fwrite(found, sizeof found, 1, stdout) != 1) return 1;
  }
  return 0;
}

int main(int n_arguments, char **arguments)
{
  if (n_arguments > 1 && strncmp(arguments[1], "binary", 6) == 0)
    return solve_scenes(strcmp(arguments[1], "binary64") == 0);
  const long long n = n_arguments > 1 ? atoll(arguments[1]) : 10000;
  long long counts[5] = {0};
  seed = n_arguments > 2 ? (uint64_t)atoll(arguments[2]) : 1982;
  for (long long i = 0; i < n; i++)
    if (trial(i, counts) || trialf(i, counts)) return 1;
  printf("%lld inputs; statuses:", n);
  for (int i = 0; i < 5; i++) printf(" %lld", counts[i]);
  printf("\n");
  return 0;
}
