#!/usr/bin/env bash
# Makes the Python environment of the tests: the independent readers (rasterio = GDAL, rio-cogeo, numpy, ezdxf) and
# Dask, in target/venv, unless it is there, and prints the path of its python.
set -euo pipefail
cd "$(dirname "$0")/.."

venv=target/venv
stamp="$venv/groundel-packages"
# Every package is pinned, those that these ask for too.
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
cloudpickle==3.1.3
dask==2026.8.0
distributed==2026.8.0
fsspec==2026.9.0
importlib_metadata==10.2.0
Jinja2==3.1.6
lazy-importer==0.1.0
locket==1.0.0
MarkupSafe==3.0.4
msgpack==1.2.4
packaging==26.4
partd==1.4.2
psutil==7.2.2
PyYAML==6.0.4
sortedcontainers==2.4.0
tblib==3.2.2
toolz==1.2.0
tornado==6.6.1
zict==3.0.0
zipp==4.1.2
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
  "$venv/bin/python" -c "import rasterio, rio_cogeo.cogeo, numpy, ezdxf, distributed" >&2
  printf '%s\n' "$packages" > "$stamp"
fi
printf '%s\n' "$PWD/$venv/bin/python"
