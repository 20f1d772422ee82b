#!/bin/sh
# Solve a sweep with a Dask cluster in one Slurm job: a scheduler, and a worker for each task.
#SBATCH --ntasks=64
set -eu
address=tcp://$(hostname):8786
dask scheduler --host "$(hostname)" --port 8786 --no-dashboard &
scheduler=$!
srun dask worker "$address" --nthreads 1 --no-dashboard &
trap 'kill $scheduler; wait' EXIT # the workers end with their scheduler
python -c "from distributed import Client; Client('$address', timeout=120).wait_for_workers(1)"
pyharness sweep sweep.toml --out sweep.zarr --executor dask --scheduler "$address"
