#!/usr/bin/env bash
# Runs every fuzz target of tests/fuzz for some seconds (default 60) with an address sanitizer, from good files of every
# format; a crash, a hang of 10 s or 512 MiB of memory ends it, and its input is kept in target/fuzz/artifacts.
#   scripts/fuzz.sh [SECONDS] [TARGET …]
# Needs cargo-fuzz (cargo install --locked cargo-fuzz) and a nightly toolchain.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-60}
shift $(($# < 1 ? $# : 1))
targets=${*:-mesh points cameras photo project mesh_store photo_store photo_index part}
export CARGO_TARGET_DIR=$PWD/target/fuzz
seeds=target/fuzz/seeds
# The dependencies' versions are those of the crate.
[ -f tests/fuzz/Cargo.lock ] || cp Cargo.lock tests/fuzz/Cargo.lock
rm -rf "$seeds"
cargo +nightly run --quiet --release --manifest-path tests/fuzz/Cargo.toml --bin seeds "$seeds"
for target in $targets; do
  corpus=target/fuzz/corpus/$target
  mkdir -p "$corpus" "target/fuzz/artifacts/$target"
  cargo +nightly fuzz run --fuzz-dir tests/fuzz "$target" "$corpus" "$seeds/$target" -- \
    -max_total_time="$seconds" -timeout=10 -rss_limit_mb=512 -max_len=65536 -print_final_stats=1 \
    -artifact_prefix="target/fuzz/artifacts/$target/" 2>&1 |
    grep -E 'panicked|ERROR|SUMMARY|number_of_executed_units|peak_rss|DONE|artifact' || true
  rm -rf /dev/shm/groundel-fuzz-*
  if [ -n "$(ls "target/fuzz/artifacts/$target")" ]; then echo "$target: found something" >&2; exit 1; fi
done
