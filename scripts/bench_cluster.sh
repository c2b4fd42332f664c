#!/usr/bin/env bash
# A job of the paper's size on Dask workers of this machine: time with 1, 2 and 4 workers of one thread, what one batch reads
# and writes with cold file caches, and assembling beside copying the same bytes.
#   scripts/bench_cluster.sh [BATCHES] [FOLDER]
# Emptying the file caches needs root; without it the bytes read are those that the caches did not hold.
set -euo pipefail
cd "$(dirname "$0")/.."
batches=${1:-24}
folder=${2:-target/bench/paper}
cargo build --release --locked --quiet
python=$(scripts/venv.sh)
groundel=$PWD/target/release/groundel
[ -s "$folder/project.toml" ] || "$groundel" demo --paper --inputs-only --quiet "$folder"
job=$folder/cluster.job
rm -rf "$job"
start=$(date +%s.%N)
"$groundel" plan "$folder/project.toml" --quiet --memory 1GiB --batches "$batches" --job "$job"
echo "plan: $(echo "$(date +%s.%N) - $start" | bc) s, stores of $(du -sm "$job/stores" | cut -f1) MB"
for workers in 1 2 4; do
  rm -rf "$job/parts"
  start=$(date +%s.%N)
  "$python" scripts/cluster/dask_render.py "$job" --groundel "$groundel" --workers "$workers" --memory 512MiB > /dev/null 2>&1
  echo "$workers workers: $(echo "$(date +%s.%N) - $start" | bc) s"
done
rm -rf "$job/parts"
"$python" - "$groundel" "$job" "$batches" <<'P'
import os, statistics, subprocess, sys

groundel, job, batches = sys.argv[1], sys.argv[2], int(sys.argv[3])
read, wrote, seconds = [], [], []
for batch in range(batches):
    subprocess.run("sync; echo 3 > /proc/sys/vm/drop_caches", shell=True, stderr=subprocess.DEVNULL)
    command = [groundel, "render", job, "--batch", str(batch), "--threads", "1", "--memory", "512MiB", "--quiet"]
    child = subprocess.Popen(command)
    os.waitid(os.P_PID, child.pid, os.WEXITED | os.WNOWAIT)
    with open(f"/proc/{child.pid}/io") as f:
        io = dict(line.split(": ") for line in f.read().splitlines())
    with open(f"/proc/{child.pid}/stat") as f:
        fields = f.read().rsplit(")", 1)[1].split()
    child.wait()
    read.append(int(io["read_bytes"]) / 1e6)
    wrote.append(int(io["write_bytes"]) / 1e6)
    seconds.append((int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK"))
median = statistics.median
print(f"a batch, median (most): reads {median(read):.1f} ({max(read):.1f}) MB, writes {median(wrote):.2f} ({max(wrote):.2f}) MB, "
      f"{median(seconds):.2f} ({max(seconds):.2f}) s of processor")
P
for _ in 1 2 3; do
  sync
  start=$(date +%s.%N)
  "$groundel" assemble "$job" --quiet --out "$folder/cluster.tif"
  middle=$(date +%s.%N)
  cp "$folder/cluster.tif" "$folder/copy.tif" && sync "$folder/copy.tif"
  end=$(date +%s.%N)
  echo "assemble: $(echo "$middle - $start" | bc) s; copy and sync of its $(stat -c %s "$folder/cluster.tif") bytes: $(echo "$end - $middle" | bc) s"
done
rm -rf "$job" "$folder/copy.tif" "$folder"/cluster.*
