#!/usr/bin/env bash
# Runs a command in a memory control group of its own, without swap, and says on standard error what the group held
# at most (page cache included, which the kernel takes back when it must).
#   scripts/in_cgroup.sh BYTES COMMAND …
# Exit code 125 if no group can be made here, else the command's: 137 if the kernel killed it.
set -euo pipefail
bytes=$1
shift
name=groundel-$$
if [ -d /sys/fs/cgroup/memory ]; then # version 1
  group=/sys/fs/cgroup/memory/$name
  limit=memory.limit_in_bytes swap=memory.memsw.limit_in_bytes peak=memory.max_usage_in_bytes no_swap=$bytes
elif grep -qw memory /sys/fs/cgroup/cgroup.controllers 2>/dev/null; then # version 2
  group=/sys/fs/cgroup/$name
  limit=memory.max swap=memory.swap.max peak=memory.peak no_swap=0
  { echo +memory > /sys/fs/cgroup/cgroup.subtree_control; } 2>/dev/null || true
else
  echo "in_cgroup.sh: this machine has no memory control groups" >&2
  exit 125
fi
mkdir "$group" || exit 125
trap 'rmdir "$group"' EXIT
echo "$bytes" > "$group/$limit" || exit 125
{ echo "$no_swap" > "$group/$swap"; } 2>/dev/null || [ "$(awk '/SwapTotal/ {print $2}' /proc/meminfo)" = 0 ] || exit 125
code=0
# The shell enters the group and becomes the command.
sh -c 'echo $$ > "$0/cgroup.procs" && exec "$@"' "$group" "$@" || code=$?
[ ! -r "$group/$peak" ] || echo "in_cgroup.sh: the group held at most $(($(cat "$group/$peak") / 1048576)) MiB" >&2
exit "$code"
