#!/usr/bin/env bash
# Submits the batches of a job that are not rendered yet as one Slurm job array; nothing else is needed than Slurm and a
# folder that all nodes see. After it has ended, the same call submits what is missing then, if anything is.
#   scripts/cluster/slurm_submit.sh JOB MEMORY [sbatch options …]      for example: … /scratch/job 2GiB --cpus-per-task=4
# MEMORY is that of groundel; Slurm is asked for a little more, for the shell. Arrays longer than the cluster allows
# (MaxArraySize) are refused by Slurm: plan fewer batches.
set -euo pipefail
job=$(cd "$1" && pwd) memory=$2
shift 2
groundel=${GROUNDEL:-groundel}
missing=$("$groundel" render "$job" --missing | paste -sd,)
if [ -z "$missing" ]; then
  echo "all batches are rendered: $groundel assemble $job --out OUT.tif"
  exit 0
fi
bytes=$(numfmt --from=auto "${memory%B}")
export JOB=$job MEMORY=$memory GROUNDEL=$groundel TRIES=${TRIES:-3}
sbatch --array="$missing" --mem="$((bytes / 1048576 + 64))M" --output="$job/slurm-%a.log" \
  --export=ALL "$@" "$(dirname "$0")/slurm_batch.sh"
