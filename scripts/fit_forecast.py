#!/usr/bin/env python3
"""Fits the costs of src/plan/forecast.rs to measured runs: fit_forecast.py REPORT.json …

The reports are those that scripts/bench_scale.sh leaves in target/bench/scale.reports, or any that `groundel ortho
--report` wrote on a quiet machine, from raw files. Prints the constants, and how far each report's stages are from what
they then forecast. The reference machine is the one whose reports are given: set REFERENCE_SECONDS of
src/cli/ortho/speed.rs times the printed speed first, so that it prints 1. Needs numpy (scripts/venv.sh)."""
import json
import sys

import numpy as np

reports = [json.load(open(path)) for path in sys.argv[1:]]
runs = [r["run"] for r in reports]
of = [r["forecast_of"] for r in runs]
seconds = [{s["name"]: s["seconds"] * r["forecast"]["speed"] for s in r["stages"]} for r in runs]
print(f"speed {np.median([r['forecast']['speed'] for r in runs]):.3f}")


def median(name, values):
    values = [v for v in values if v is not None]
    if values:
        print(f"{name}: {np.median(values):.3e}  ({min(values):.2e} to {max(values):.2e})")


def rate(stage, amount, threads=True):
    for s, d in zip(seconds, of):
        yield s[stage] * (d["threads"] if threads else 1) / d[amount] if d[amount] > 0 and stage in s else None


median("BUILT_FACE", rate("mesh store", "faces_to_build"))
for name, is_stored in (("PHOTO_PIXEL", False), ("INDEXED_PIXEL", True)):
    stored = [d["photo_store_bytes"] > 0 for d in of]
    both = zip(rate("photo store", "photo_pixels"), stored)
    median(name, [seconds for seconds, s in both if s == is_stored])
median("OUTPUT_BYTE", rate("files", "output_bytes", threads=False))

# The tiles: least squares of the relative error, no cost negative.
# Windows of photos that do not stay in memory are decoded meanwhile, more pixels than the samples cover.
DECODED = 1.25
names = ["SURFACE_PIXEL", "SAMPLE", "FACE", "FACE_VIEW", "SHOWN_FACE_VIEW", "WINDOW_PIXEL"]


def amounts(demand):
    w = demand["work"]
    shown = min(1.0, w["surface_pixels"] / max(1.0, w["faces"]))
    windows = DECODED * min(w["photo_pixels"], demand["photo_pixels"]) if demand["photo_store_bytes"] else 0.0
    return w["surface_pixels"], w["samples"], w["faces"], w["face_views"], w["face_views"] * shown, windows


work = np.array([amounts(d) for d in of])
took = np.array([s["tiles"] * d["threads"] for s, d in zip(seconds, of)])
a = work / took[:, None]
scale = np.abs(a).max(axis=0) + 1e-300
cost = np.zeros(len(names))
for _ in range(20_000):
    for k in range(len(names)):
        column = a[:, k] / scale[k]
        rest = 1 - a @ (cost / scale) + column * cost[k]
        cost[k] = max(0.0, column @ rest / (column @ column + 1e-300))
cost = cost / scale
for name, c in zip(names, cost):
    print(f"{name}: {c:.3e}")
for path, r, ratio in zip(sys.argv[1:], runs, a @ cost):
    print(f"{path}: tiles forecast at {ratio:.2f} of what they took; whole run {r['forecast']['seconds'] / r['seconds']:.2f}")
