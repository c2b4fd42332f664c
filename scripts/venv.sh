#!/usr/bin/env bash
# Makes the Python environment with the independent readers that the tests use (rasterio = GDAL, rio-cogeo, numpy,
# ezdxf) in target/venv, unless it is there, and prints the path of its python.
set -euo pipefail
cd "$(dirname "$0")/.."

venv=target/venv
stamp="$venv/groundel-packages"
# Every package is pinned, those that these four ask for too.
packages="affine==3.0.1
annotated-types==0.8.0
attrs==26.1.0
certifi==2026.10.18
click==8.5.1
click-plugins==1.1.1.2
cligj==0.7.2
ezdxf==1.4.5
fonttools==4.68.0
morecantile==7.1.0
numpy==2.4.6
pydantic==2.14.3
pydantic_core==2.50.4
pyparsing==3.3.3
pyproj==3.7.2
rasterio==1.4.4
rio-cogeo==7.0.4
typing-inspection==0.4.5
typing_extensions==4.16.0"

mkdir -p target
# One at a time: test binaries may start together. The kernel drops the lock when the script ends.
exec 9> target/venv.lock
if command -v flock >/dev/null; then flock 9; fi
if [ "$(cat "$stamp" 2>/dev/null)" != "$packages" ]; then
  rm -rf "$venv"
  python3 -m venv "$venv" >&2
  # shellcheck disable=SC2086 # a word for each package
  "$venv/bin/pip" install --quiet --disable-pip-version-check --only-binary :all: --no-deps $packages >&2
  "$venv/bin/python" -c "import rasterio, rio_cogeo.cogeo, numpy, ezdxf" >&2
  printf '%s\n' "$packages" > "$stamp"
fi
printf '%s\n' "$PWD/$venv/bin/python"
