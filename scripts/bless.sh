#!/usr/bin/env bash
# Renews the golden files under tests/golden/ from what the code makes now, and shows what changed.
# Look at every changed picture before committing it: this is the only way to renew them.
set -euo pipefail
cd "$(dirname "$0")/.."

GROUNDEL_BLESS=1 cargo test --release --locked --test ortho golden "$@"
GROUNDEL_BLESS=1 cargo test --release --locked --test messages
git status --short tests/golden
