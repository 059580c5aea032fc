#!/bin/bash
# Makes a study as a job array, a shard in each task, and merges the shards: sbatch --array=1-100 slurm_study.sh STUDY.toml FOLDER
# FOLDER is one that all nodes share. A task that was ended goes on where it was: submit the same array again.
#SBATCH --job-name=wetclutch
#SBATCH --cpus-per-task=2
#SBATCH --mem=1G
#SBATCH --time=01:00:00
set -euo pipefail

study=$1 folder=$2
shard=$SLURM_ARRAY_TASK_ID shards=$SLURM_ARRAY_TASK_COUNT
wetclutch study "$study" --shard "$shard/$shards" --threads "${SLURM_CPUS_PER_TASK:-1}" --resume -o "$folder/shard-$shard"

# The last task to end merges: a shard is complete when its table has its name.
complete() { find "$folder"/shard-*/runs.csv 2>/dev/null | wc -l; }
if [ "$(complete)" -eq "$shards" ] && mkdir "$folder/merging" 2>/dev/null; then
  wetclutch merge "$study" "$folder"/shard-* -o "$folder/whole"
fi
