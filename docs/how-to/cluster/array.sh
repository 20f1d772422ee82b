#!/bin/sh
# Solve one part of a sweep in each task of a Slurm array.
# A task that was killed is started again, and computes only what is missing.
#SBATCH --array=0-9
#SBATCH --ntasks=1
#SBATCH --requeue
set -eu
part=$SLURM_ARRAY_TASK_ID
sed "s/PART/$part/" parts.toml.in > "part-$part.toml"
pyharness sweep "part-$part.toml" --out "part-$part.zarr"
