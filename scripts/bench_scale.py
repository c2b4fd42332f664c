#!/usr/bin/env python3
"""Runs the series of scripts/bench_scale.sh: bench_scale.py GROUNDEL FOLDER [SERIES …] [--small] [--cold]."""
import csv
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import threading

CAP = 1 << 30
# Disk of a step, bytes a face: the PLY file; the store; buckets and vertices while it is built.
PLY, STORE, BUILD = 25.1, 16.0, 12.0
# One façade of the street, metres: what `groundel demo --paper` draws, and the step to the next.
FACADE, STEP = (-0.02, -0.02, 7.42, 5.53), 7.7
AREA = (FACADE[2] - FACADE[0]) * (FACADE[3] - FACADE[1])
COLUMNS = (
    "series parameter threads faces photos mosaic_px mesh_seconds faces_per_second render_seconds total_seconds "
    "mpx_per_second peak_mib cap_mib work_peak_bytes output_bytes photo_px_needed photo_px_decoded "
    "forecast_memory_bytes forecast_temporary_bytes forecast_output_bytes forecast_seconds "
    "memory_ratio temporary_ratio output_ratio seconds_ratio"
).split()


class Bench:
    """Makes inputs, runs jobs and collects rows."""

    def __init__(self, groundel, folder, is_cold, minutes):
        self.minutes = minutes
        self.groundel, self.folder, self.is_cold = groundel, folder / "scale", is_cold
        self.rows, self.failed = [], False
        self.table, self.reports = folder / "scale.csv", folder / "scale.reports"

    def inputs(self, name, *flags):
        folder = self.folder / name
        if not (folder / "project.toml").exists() or not (folder / "complete").exists():
            shutil.rmtree(folder, ignore_errors=True)
            command = [self.groundel, "demo", folder, "--paper", "--inputs-only", "--quiet", *map(str, flags)]
            subprocess.run(command, check=True)
            (folder / "complete").touch()
        return folder

    def room(self, what, needed):
        """Whether the disk can hold `needed` bytes; says what is missing."""
        self.folder.mkdir(parents=True, exist_ok=True)
        free = shutil.disk_usage(self.folder).free
        if needed > 0.97 * free:
            print(f"SKIP {what}: needs {needed / 1e9:.0f} GB of disk, {free / 1e9:.0f} GB are free", flush=True)
        return needed <= 0.97 * free

    def time(self, what, minutes):
        """Whether a step is short enough; says how long it would take."""
        if minutes > self.minutes:
            print(f"SKIP {what}: would take some {minutes:.0f} minutes", flush=True)
        return minutes <= self.minutes

    def run(self, series, parameter, inputs, *flags, threads=None):
        """One job from raw files; its row."""
        work, out, report = inputs / "work", inputs / "out", inputs / "report.json"
        for old in (work, out):
            shutil.rmtree(old, ignore_errors=True)
        out.mkdir()
        if self.is_cold:
            os.sync()
            pathlib.Path("/proc/sys/vm/drop_caches").write_text("1")
        command = [self.groundel, "ortho", inputs / "project.toml", "--colour", "paper", "--memory", "1GiB", "--work", work]
        command += ["--out", out / "mosaic.tif", "--report", report, *map(str, flags)]
        command += ["--threads", str(threads)] if threads else []
        print(f"{series} {parameter}: groundel {' '.join(str(c) for c in command[1:])}", flush=True)
        with Watch(work) as watch, open(inputs / "log.txt", "w") as log:
            code = subprocess.run(command, stderr=log).returncode
        if code:
            print((inputs / "log.txt").read_text())
            raise SystemExit(2)
        self.reports.mkdir(parents=True, exist_ok=True)
        shutil.copy(report, self.reports / f"{series}.{parameter.replace(' ', '_')}.json")
        row = self.row(json.loads(report.read_text()), watch.peak)
        self.rows.append({"series": series, "parameter": parameter} | row)
        for old in (work, out):
            shutil.rmtree(old)
        self.save()
        print("  " + ", ".join(f"{k} {v}" for k, v in self.rows[-1].items() if v != "" and k != "series"), flush=True)
        return self.rows[-1]

    def row(self, report, work_peak):
        run = report["run"]
        seconds = {stage["name"]: stage["seconds"] for stage in run["stages"]}
        faces = sum(mesh["faces"] for mesh in report["inputs"]["meshes"])
        mesh, render = seconds["mesh store"], seconds["tiles"] + seconds["files"]
        output = sum(file["bytes"] for file in report["outputs"])
        pixels, forecast = run.get("photo_pixels") or {}, run.get("forecast") or {}
        measured = {"memory": run["peak_memory_bytes"], "temporary": work_peak, "output": output, "seconds": run["seconds"]}
        expected = {k: forecast.get(k if k == "seconds" else f"{k}_bytes", "") for k in measured}
        row = {
            "threads": run["threads"],
            "faces": faces,
            "photos": report["inputs"]["cameras"]["photos_used"],
            "mosaic_px": report["frame"]["width"] * report["frame"]["height"],
            "mesh_seconds": round(mesh, 3),
            "faces_per_second": round(faces / mesh),
            "render_seconds": round(render, 3),
            "total_seconds": round(run["seconds"], 3),
            "mpx_per_second": round(report["frame"]["width"] * report["frame"]["height"] / render / 1e6, 4),
            "peak_mib": round(run["peak_memory_bytes"] / 2**20),
            "cap_mib": run["memory_cap_bytes"] >> 20,
            "work_peak_bytes": work_peak,
            "output_bytes": output,
            "photo_px_needed": pixels.get("needed", ""),
            "photo_px_decoded": pixels.get("decoded", ""),
        }
        for k, unit in (("memory", "_bytes"), ("temporary", "_bytes"), ("output", "_bytes"), ("seconds", "")):
            row[f"forecast_{k}{unit}"] = round(expected[k], 2) if expected[k] != "" else ""
            row[f"{k}_ratio"] = round(measured[k] / expected[k], 3) if expected[k] else ""
        return {column: row[column] for column in COLUMNS if column in row}

    def save(self):
        """The table: what other runs of the script measured of other series stays."""
        kept = []
        if self.table.exists():
            with open(self.table) as f:
                done = {row["series"] for row in self.rows}
                kept = [row for row in csv.DictReader(f) if row["series"] not in done]
        with open(self.table, "w", newline="") as f:
            writer = csv.DictWriter(f, COLUMNS, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(kept + self.rows)

    def claim(self, text, value, limit, at_least=False):
        is_met = value >= limit if at_least else value <= limit
        self.failed |= not is_met
        print(f"{'PASS' if is_met else 'FAIL'} {text}: {value:.3g} ({'≥' if at_least else '≤'} {limit:g})", flush=True)

    def common_claims(self, rows):
        name = rows[0]["series"]
        self.claim(f"{name}: peak as a share of the cap", max(r["peak_mib"] / r["cap_mib"] for r in rows), 1.0)
        counted = [r for r in rows if r["photo_px_needed"]]
        if counted:
            worst = max(r["photo_px_decoded"] / r["photo_px_needed"] for r in counted)
            self.claim(f"{name}: photo pixels decoded for each that is needed", worst, 2.0)
        for what in ("memory", "temporary", "output", "seconds"):
            ratios = [r[f"{what}_ratio"] for r in rows if r[f"{what}_ratio"]]
            if ratios:
                worst = max(max(r, 1 / r) for r in ratios)
                self.claim(f"{name}: {what}, measured and forecast differ by a factor of", worst, 1.3)


class Watch:
    """The greatest size of a folder while something runs."""

    def __init__(self, folder):
        self.folder, self.peak, self.ended = folder, 0, threading.Event()

    def __enter__(self):
        self.thread = threading.Thread(target=self.look)
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.ended.set()
        self.thread.join()

    def look(self):
        while not self.ended.wait(0.2):
            self.peak = max(self.peak, size_of(self.folder))


def size_of(folder):
    size = 0
    for parent, _, files in os.walk(folder):
        for file in files:
            try:
                size += os.stat(os.path.join(parent, file)).st_size
            except FileNotFoundError:
                pass
    return size


def worst_growth(values):
    return max(values) / values[0]


def faces(bench, small):
    rows = []
    for count in (1, 10, 30) if small else (10, 100, 300, 1000):
        n = count * 10**6
        if not bench.room(f"faces {count} M", n * (PLY + STORE + BUILD)):
            continue
        inputs = bench.inputs(f"faces.{count}M", "--faces", n)
        rows.append(bench.run("faces", f"{count} M", inputs))
        shutil.rmtree(inputs)
    store = [r["mesh_seconds"] / r["faces"] for r in rows]
    total = [r["total_seconds"] / r["faces"] for r in rows]
    bench.claim("faces: growth of the store's time for a face", worst_growth(store), 1.3)
    bench.claim("faces: growth of the whole time for a face", worst_growth(total), 1.3)
    bench.common_claims(rows)


def facade(bench):
    return bench.inputs("facade", "--faces", 3_000_000, "--houses", 1, "--photos", 10)


def pixel_flags(gigapixels):
    return "--pixel-size", repr(math.sqrt(AREA / (gigapixels * 1e9))), "--force"


def mosaic(bench, small):
    inputs, rows = facade(bench), []
    for giga in (0.01, 0.1) if small else (0.1, 1, 10):
        what = f"mosaic {giga} gigapixels"
        minutes = giga * 1e3 / rows[-1]["mpx_per_second"] / 60 if rows else 0
        if bench.room(what, giga * 1e9 * 8 + 1e9) and bench.time(what, minutes):
            rows.append(bench.run("mosaic", f"{giga} Gpx", inputs, *pixel_flags(giga)))
    rates = [r["mpx_per_second"] for r in rows]
    bench.claim("mosaic: Mpx/s falls by", rates[0] / min(rates), 1.2)
    bench.common_claims(rows)


def threads(bench, small):
    inputs = facade(bench)
    rows = [
        bench.run("threads", str(n), inputs, *pixel_flags(0.01 if small else 0.1), threads=n) for n in (1, 2)
    ]
    gain = rows[0]["total_seconds"] / rows[1]["total_seconds"]
    bench.claim("threads: one against two", gain, 1.8, at_least=True)
    bench.common_claims(rows)


def photos(bench, small):
    houses, million = (4, 2) if small else (100, 30)
    inputs = bench.inputs("street", "--faces", million * 10**6, "--houses", houses)
    flags = lambda n: ["--pixel-size", "0.002", "--extent=" + ",".join(map(repr, extent(n)))]
    few = ["--include", "IMG_0000?.jpg", "--include", "IMG_00010.jpg"]
    some = ["--include", "IMG_000??.jpg", "--include", "IMG_00100.jpg"]
    sets = [(10, few), (40, [])] if small else [(10, few), (100, some), (1000, [])]
    same = [bench.run("photos", f"{n} for one façade", inputs, *flags(1), *chosen) for n, chosen in sets]
    grown = (1, 4) if small else (1, 10, 100)
    more = [bench.run("photos", f"{houses * 10} for {n} façades", inputs, *flags(n)) for n in grown[1:]]
    bench.claim("photos: growth of the time with photos that do not count", worst_growth([r["total_seconds"] for r in same]), 1.2)
    needed = [same[-1], *more]
    rates = [r["render_seconds"] / r["mosaic_px"] for r in needed]
    bench.claim("photos: growth of the rendering time for a pixel with the mosaic", worst_growth(rates), 1.2)
    bench.common_claims(same + more)
    shutil.rmtree(inputs)


def extent(houses):
    u0, v0, u1, v1 = FACADE
    return u0, v0, round(u1 + STEP * (houses - 1), 6), v1


SERIES = {"faces": faces, "mosaic": mosaic, "threads": threads, "photos": photos}


def main(groundel, folder, *words):
    minutes = [float(w.removeprefix("--minutes=")) for w in words if w.startswith("--minutes=")]
    options = {w for w in words if w.startswith("--") and not w.startswith("--minutes=")}
    chosen = [w for w in words if not w.startswith("--")] or list(SERIES)
    if options - {"--small", "--cold"} or any(name not in SERIES for name in chosen):
        raise SystemExit(f"usage: bench_scale.sh [{' | '.join(SERIES)} …] [--small] [--cold] [--minutes=N]")
    bench = Bench(pathlib.Path(groundel).resolve(), pathlib.Path(folder), "--cold" in options, *(minutes or [math.inf]))
    for name in chosen:
        SERIES[name](bench, "--small" in options)
    shutil.rmtree(bench.folder, ignore_errors=True)
    return 1 if bench.failed else 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
