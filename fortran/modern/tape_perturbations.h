/* Perturbations of all slots of a tape, eight side by side. */
#ifndef TAPE_PERTURBATIONS_H
#define TAPE_PERTURBATIONS_H

#include "tape_groups.h"

typedef double perturbations[TERMS_OF_PERTURBATION][SIDE_BY_SIDE];
static inline perturbations *perturbations_of(const struct tape *tape) { return tape->v; }

void OF_LEVEL(sum_perturbations, LEVEL)(const struct tape *tape, int last, double factor,
                                        double (*sums)[SIDE_BY_SIDE]);

#endif
