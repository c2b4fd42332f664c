#!/usr/bin/env bash
# One task of a Slurm job array: renders the batch whose number is the task's. Submitted by slurm_submit.sh, which sets
# JOB, MEMORY and GROUNDEL.
#
# Slurm starts a task again when its node is lost (--requeue), but not when it fails; what may be tried again (exit code 4, or
# a death by a signal) is put back into the queue here, TRIES times at most.
#SBATCH --job-name=groundel
#SBATCH --requeue
#SBATCH --open-mode=append
set -u
batch=$SLURM_ARRAY_TASK_ID
"${GROUNDEL:-groundel}" render "$JOB" --batch "$batch" --memory "$MEMORY" \
  --threads "${SLURM_CPUS_PER_TASK:-1}" --parent $$ --quiet
code=$?
case $code in
  0 | 2 | 3) ;;
  *)
    if [ "${SLURM_RESTART_COUNT:-0}" -lt $((${TRIES:-3} - 1)) ]; then
      echo "batch $batch: exit code $code, once more" >&2
      scontrol requeue "${SLURM_ARRAY_JOB_ID}_$batch" && exit 0
    fi
    echo "batch $batch: exit code $code, tried ${TRIES:-3} times" >&2
    ;;
esac
exit "$code"
