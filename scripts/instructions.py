#!/usr/bin/env python3
"""Compares callgrind's counts with committed ones: instructions.py COUNTS FIGURES.json RUSTC [--renew]."""
import collections
import json
import re
import sys

MODULES = ["camera", "frame", "geom", "raster", "store::mesh", "store::photo", "surface", "visibility", "sample", "blend", "output"]
MORE, LESS, SHARE = 1.03, 0.90, 0.01


def module_of(function):
    """The module that a function is of: the first that its name names, an impl's type before its trait."""
    at = {m: function.find(f"groundel::{m}::") for m in MODULES}
    found = [m for m in MODULES if at[m] >= 0]
    return min(found, key=lambda m: at[m]) if found else None


def counts_of(path):
    """Instructions of each module's functions themselves, calls not counted; and of everything."""
    names, sums, all_of_it = {}, collections.Counter(), 0
    current, is_call = None, False
    with open(path, errors="replace") as f:
        for line in f:
            if line.startswith("fn="):
                number, name = re.match(r"fn=\((\d+)\)(?: (.*))?", line).groups()
                if name:
                    names[number] = module_of(name.strip())
                current = names.get(number)
            elif line.startswith("cfn="):
                number, name = re.match(r"cfn=\((\d+)\)(?: (.*))?", line).groups()
                if name:
                    names[number] = module_of(name.strip())
            elif line.startswith("calls="):
                is_call = True
            elif line[:1].isdigit() or line[:1] in "+-*":
                if not is_call:
                    instructions = int(line.split()[1])
                    all_of_it += instructions
                    if current:
                        sums[current] += instructions
                is_call = False
    return sums, all_of_it


counts, figures, rustc, *options = sys.argv[1:]
sums, all_of_it = counts_of(counts)
kept = {m: n for m, n in sorted(sums.items()) if n >= SHARE * sum(sums.values())}
if "--renew" in options:
    with open(figures, "w") as f:
        json.dump({"rustc": rustc, "instructions": kept}, f, indent=2)
        f.write("\n")
with open(figures) as f:
    wanted = json.load(f)
failed = False
for module, before in wanted["instructions"].items():
    now = sums[module]
    is_well = LESS <= now / before <= MORE
    failed |= not is_well
    print(f"{'ok  ' if is_well else 'FAIL'} {module:12} {now / 1e6:9.1f} M instructions, {100 * (now / before - 1):+.2f} %")
print(f"     {'everything':12} {all_of_it / 1e6:9.1f} M")
if failed and wanted["rustc"] != rustc:
    print(f"The figures are for {wanted['rustc']}, this is {rustc}: not held against it.")
elif failed:
    print("If that is meant: scripts/instructions.sh --renew")
sys.exit(1 if failed and wanted["rustc"] == rustc else 0)
