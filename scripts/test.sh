#!/usr/bin/env bash
# The test command: all tests, among them those that read the mosaics back through GDAL (rasterio) and
# rio-cogeo. The first run makes a Python environment for these readers in target/venv.
# Arguments go to `cargo test`, for example: scripts/test.sh --test cli
set -euo pipefail
cd "$(dirname "$0")/.."

scripts/venv.sh
cargo test --release --locked "$@"
