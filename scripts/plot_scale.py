#!/usr/bin/env python3
"""Plots the table of scripts/bench_scale.sh: plot_scale.py SCALE.csv SCALE.png. Needs matplotlib."""
import csv
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402  (the backend is chosen first)

table, picture = sys.argv[1:]
with open(table) as f:
    rows = list(csv.DictReader(f))
of = lambda series: [r for r in rows if r["series"] == series]
number = lambda rows, column, unit=1.0: [float(r[column]) / unit for r in rows]

figure, axes = plt.subplots(1, 3, figsize=(11, 3.4), layout="constrained")


def panel(axis, title, rows, x, unit, columns, y_label):
    axis.set_title(title, fontsize=10)
    axis.set_xlabel(unit[1], fontsize=9)
    axis.set_ylabel(y_label, fontsize=9)
    axis.set_xscale("log")
    for column, label, scale in columns:
        axis.plot(number(rows, x, unit[0]), number(rows, column, scale), "o-", label=label)
    axis.set_ylim(bottom=0)
    axis.grid(alpha=0.3)
    memory = axis.twinx()
    memory.plot(number(rows, x, unit[0]), number(rows, "peak_mib"), "s--", color="tab:red", alpha=0.6, label="peak memory")
    memory.axhline(float(rows[0]["cap_mib"]), color="tab:red", linewidth=0.8)
    memory.set_ylim(0, 1.1 * float(rows[0]["cap_mib"]))
    memory.set_ylabel("peak MiB (line: the cap)", fontsize=8, color="tab:red")
    axis.legend(fontsize=8, loc="lower left")


for axis, series in zip(axes, ("faces", "mosaic", "photos")):
    found = of(series)
    if not found:
        axis.set_axis_off()
        continue
    if series == "faces":
        for r in found:
            r["store"] = float(r["mesh_seconds"]) / float(r["faces"]) * 1e6
            r["all"] = float(r["total_seconds"]) / float(r["faces"]) * 1e6
        columns = [("store", "mesh store", 1), ("all", "whole job", 1)]
        panel(axis, "faces, one mosaic", found, "faces", (1e6, "million faces"), columns, "µs a face")
    elif series == "mosaic":
        columns = [("mpx_per_second", "rendered", 1)]
        panel(axis, "mosaic, fixed inputs", found, "mosaic_px", (1e9, "gigapixels"), columns, "Mpx/s")
    else:
        same = [r for r in found if r["mosaic_px"] == found[0]["mosaic_px"]]
        columns = [("total_seconds", "whole job", 1)]
        panel(axis, "photos of 24 Mpx, one mosaic", same, "photos", (1, "photos"), columns, "seconds")
figure.savefig(picture, dpi=90)
