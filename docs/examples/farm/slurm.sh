#!/bin/bash
# SPDX-License-Identifier: GPL-3.0-or-later
# A batch of the extension as a Slurm array, a part a task:
#
#   sbatch --array=1-8 docs/examples/farm/slurm.sh --style cube -i meshes -o cubic
#
# Flags are those of `batch` but --shard and --again. PROGRAM is what runs a batch: from a clone,
# PROGRAM="blender -b -P blender_scripts/batch.py --".
#
# A part that is killed is begun again where it was, here after a crash or for want of memory, by Slurm
# (--requeue) after a node's end or a preemption. Submitting the same array again does what is left.
#SBATCH --job-name=arapfields
#SBATCH --cpus-per-task=1
#SBATCH --requeue
#SBATCH --open-mode=append

program=${PROGRAM:-blender --command arapfields batch}
parts=${PARTS:-${SLURM_ARRAY_TASK_MAX:?submit with --array=1-N}}
export OMP_NUM_THREADS=${SLURM_CPUS_PER_TASK:-1}

for attempt in 1 2 3; do
  # PROGRAM is several words.
  # shellcheck disable=SC2086
  $program "$@" --shard "$SLURM_ARRAY_TASK_ID/$parts"
  code=$?
  # 128 and more: killed. 130: cancelled.
  if [ $code -lt 128 ] || [ $code -eq 130 ]; then break; fi
  echo "part $SLURM_ARRAY_TASK_ID ended with $code, attempt $attempt" >&2
done
exit $code
