#!/usr/bin/env bash
# Runs the Slurm recipe for real: slurmctld, two slurmd and munged on this machine, without systemd; a job of 12 batches on
# them, one node killed on the way, the rest submitted again; and compares the mosaic with that of one process.
#   scripts/cluster/slurm_here.sh [FOLDER]
# Needs root and Debian's slurmctld, slurmd, slurm-client and munge. Not part of the tests: nodes count as lost after 20 s, and
# Slurm waits two minutes before it runs their batches again.
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=${1:-$(mktemp -d)}
mkdir -p "$folder"/{state,log,spool}
cargo build --release --locked --quiet
export GROUNDEL=$PWD/target/release/groundel SLURM_CONF=$folder/slurm.conf
host=$(hostname -s)
cat > "$SLURM_CONF" <<C
ClusterName=here
SlurmctldHost=$host(127.0.0.1)
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
DefMemPerCPU=500
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool/%n
SlurmctldPidFile=$folder/ctld.pid
SlurmdPidFile=$folder/%n.pid
SlurmctldLogFile=$folder/log/ctld.log
SlurmdLogFile=$folder/log/%n.log
SlurmctldPort=16817
SlurmdTimeout=20
ReturnToService=2
JobRequeue=1
JobAcctGatherType=jobacct_gather/linux
JobAcctGatherFrequency=task=2
JobAcctGatherParams=OverMemoryKill,NoShared
MpiDefault=none
SwitchType=switch/none
AccountingStorageType=accounting_storage/none
NodeName=n[1-2] NodeHostname=$host NodeAddr=127.0.0.1 Port=[17001-17002] CPUs=1 RealMemory=4000 State=UNKNOWN
PartitionName=p Nodes=n[1-2] Default=YES MaxTime=INFINITE State=UP
C
stop() {
  scancel --user root 2>/dev/null || true
  for pid in "$folder"/n1.pid "$folder"/n2.pid "$folder"/ctld.pid; do [ ! -s "$pid" ] || kill "$(cat "$pid")" 2>/dev/null || true; done
  [ -z "${munge:-}" ] || kill "$munge" 2>/dev/null || true
}
trap stop EXIT
if [ ! -S /run/munge/munge.socket.2 ]; then
  mkdir -p /run/munge && chown munge: /run/munge
  [ -s /etc/munge/munge.key ] || mungekey --create
  chown munge: /etc/munge/munge.key
  runuser -u munge -- munged --foreground & munge=$!
  until munge -n >/dev/null 2>&1; do sleep 0.2; done
fi
slurmctld
for node in n1 n2; do mkdir -p "$folder/spool/$node"; slurmd -N "$node"; done
until [ "$(sinfo --noheader --states=idle --format=%D | paste -sd+ | bc)" = 2 ]; do sleep 1; done
sinfo
"$GROUNDEL" demo --inputs-only --quiet "$folder/demo"
"$GROUNDEL" ortho "$folder/demo/project.toml" --quiet --tile-size 128 --pixel-size 0.001 --out "$folder/one.tif" --work "$folder/work"
"$GROUNDEL" plan "$folder/demo/project.toml" --quiet --tile-size 128 --pixel-size 0.001 --batches 12 --job "$folder/job"
started=$SECONDS
scripts/cluster/slurm_submit.sh "$folder/job" 512MiB --cpus-per-task=1
until [ "$("$GROUNDEL" render "$folder/job" --missing | wc -l)" -le 9 ]; do sleep 0.5; done
echo "$((SECONDS - started)) s: killing node n2 with $("$GROUNDEL" render "$folder/job" --missing | wc -l) batches missing"
kill -9 "$(cat "$folder/n2.pid")"
pkill -9 -f "slurmstepd.*" || true
while [ -n "$(squeue --noheader --states=running,pending --format=%i)" ] && [ $((SECONDS - started)) -lt 400 ]; do
  sleep 5
  squeue --format="%i %T %r %N %S" --noheader | sed "s/^/$((SECONDS - started)) s: /"
done
missing=$("$GROUNDEL" render "$folder/job" --missing | paste -sd,)
echo "$((SECONDS - started)) s: the array has ended; missing: ${missing:-none}"
if [ -n "$missing" ]; then
  scripts/cluster/slurm_submit.sh "$folder/job" 512MiB --cpus-per-task=1
  while [ -n "$(squeue --noheader --format=%i)" ]; do sleep 1; done
fi
"$GROUNDEL" assemble "$folder/job" --quiet --out "$folder/cluster.tif"
cmp "$folder/one.tif" "$folder/cluster.tif" && echo "the same bytes"
