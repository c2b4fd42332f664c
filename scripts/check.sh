#!/usr/bin/env bash
# Everything that must be clean before a change is done.
#
#   scripts/check.sh         lint, then test
#   scripts/check.sh lint    formatting, clippy, documentation, dependencies and their licences, Windows
#   scripts/check.sh test    all tests (without the Python readers: see scripts/test.sh), benches compiled
#
# One cargo profile throughout, so that dependencies are compiled once; every warning is an error.
set -euo pipefail
cd "$(dirname "$0")/.."

lint() {
  cargo fmt --check
  cargo clippy --release --locked --all-targets -- -D warnings
  RUSTDOCFLAGS="-D warnings" cargo doc --release --locked --no-deps
  if cargo deny --version >/dev/null 2>&1; then
    cargo deny --locked --config .deny.toml check --hide-inclusion-graph bans licenses sources
  else
    echo "cargo-deny is not installed (cargo install --locked cargo-deny): .deny.toml was NOT checked" >&2
  fi
  local windows=x86_64-pc-windows-gnu
  if [ -d "$(rustc --print sysroot)/lib/rustlib/$windows/lib" ] && command -v x86_64-w64-mingw32-gcc >/dev/null; then
    RUSTFLAGS="-D warnings" cargo check --release --locked --target $windows
  else
    echo "rustup target $windows or gcc-mingw-w64-x86-64 is not installed: Windows was NOT checked" >&2
  fi
}

tests() {
  scripts/test.sh
  cargo bench --locked --no-run
}

case "${1:-all}" in
  lint) lint ;;
  test) tests ;;
  all) lint; tests ;;
  *) echo "usage: scripts/check.sh [lint|test]" >&2; exit 2 ;;
esac
