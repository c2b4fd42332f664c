"""Compares GeoTIFFs with what they should hold, as rasterio (GDAL) and rio-cogeo see them.

Standard input: {"files": [expectation]}; standard output: for each file a list of what is wrong with it. An expectation
is written by tests/cog.rs; its pixels stand in a raw little-endian file, height x width x channels.
"""

import json
import struct
import sys

import numpy as np
import rasterio
from rasterio.enums import ColorInterp, MaskFlags
from rio_cogeo.cogeo import cog_validate

COLOURS = {1: [ColorInterp.gray], 2: [ColorInterp.gray, ColorInterp.alpha],
           4: [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]}
COMPRESSION = {"deflate": "DEFLATE", "zstd": "ZSTD", "lzw": "LZW", "none": None}


def quads(a):
    """The four pixels under each pixel of the next level, and whether they exist: 4 x h/2 x w/2 x channels."""
    h, w, c = a.shape
    even = np.zeros((h + h % 2, w + w % 2, c), a.dtype)
    even[:h, :w] = a
    there = np.zeros((h + h % 2, w + w % 2), bool)
    there[:h, :w] = True
    corners = [(0, 0), (0, 1), (1, 0), (1, 1)]
    return (np.stack([even[y::2, x::2] for y, x in corners]),
            np.stack([there[y::2, x::2] for y, x in corners]))


def halved(a, kind):
    """The next overview level, by the rule of the contract."""
    parts, there = quads(a)
    if kind == "mosaic":
        defined = there & (parts[..., -1] != 0)
        n = defined.sum(0)
        total = np.where(defined[..., None], parts, 0).astype(np.int64).sum(0)
        divisor = np.maximum(n, 1)[..., None]
        mean = np.floor_divide(2 * total + divisor, 2 * divisor)
        mean[..., -1] = np.iinfo(a.dtype).max
        return np.where((n > 0)[..., None], mean, parts[0]).astype(a.dtype)
    if kind == "elevation":
        total, n = np.zeros(parts.shape[1:], np.float64), np.zeros(parts.shape[1:])
        for part, exists in zip(parts, there):
            number = exists[..., None] & ~np.isnan(part)
            total = total + np.where(number, part.astype(np.float64), 0.0)
            n = n + number
        return np.where(n > 0, total / np.maximum(n, 1), np.nan).astype(np.float32)
    return parts[0]


def bits(numbers):
    return [struct.pack("<d", v).hex() for v in numbers]


def check_pixels(e, faults):
    want = np.fromfile(e["raw"], np.dtype(e["dtype"]).newbyteorder("<"))
    want = want.reshape(e["height"], e["width"], e["channels"])
    levels = 0
    while True:
        options = {} if levels == 0 else {"overview_level": levels - 1}
        with rasterio.open(e["path"], **options) as d:
            got = np.moveaxis(d.read(), 0, -1)
            if got.shape != want.shape or got.dtype != want.dtype:
                faults.append(f"level {levels}: {got.shape} {got.dtype}, not {want.shape} {want.dtype}")
                return
            if not np.array_equal(got, want, equal_nan=e["dtype"] == "float32"):
                where = np.argwhere(got != want)
                faults.append(f"level {levels}: {len(where)} samples differ, the first at {where[0].tolist()}")
            if e["kind"] == "mosaic":
                mask = np.where(want[..., -1] != 0, 255, 0)
            elif e["kind"] == "elevation":
                mask = np.where(np.isnan(want[..., 0]), 0, 255)
            else:
                mask = np.where(want[..., 0] == e["nodata"], 0, 255)
            if not np.array_equal(d.dataset_mask(), mask):
                faults.append(f"level {levels}: the mask differs")
        if max(want.shape[:2]) <= min(e["tile_size"], 512):
            break
        want = halved(want, e["kind"])
        levels += 1
    with rasterio.open(e["path"]) as d:
        if len(d.overviews(1)) != levels:
            faults.append(f"{len(d.overviews(1))} overviews, not {levels}")


def check_tags(e, d, faults):
    def same(what, got, want):
        if got != want:
            faults.append(f"{what}: {got!r}, not {want!r}")

    same("dtypes", set(d.dtypes), {e["dtype"]})
    same("blocks", set(d.block_shapes), {(e["tile_size"],) * 2})
    structure = d.tags(ns="IMAGE_STRUCTURE")
    same("compression", structure.get("COMPRESSION"), COMPRESSION[e["compression"]])
    same("layout", structure.get("LAYOUT"), "COG")
    predictor = {"elevation": "3", "coverage": None}.get(e["kind"], "2")
    same("predictor", structure.get("PREDICTOR"), None if e["compression"] == "none" else predictor)
    palette = e["kind"] == "coverage"
    same("colours", list(d.colorinterp), [ColorInterp.palette] if palette else COLOURS[e["channels"]])
    if palette:
        has = d.colorinterp[0] == ColorInterp.palette
        same("palette", [d.colormap(1)[i][:3] for i in range(4)] if has else None,
             [(255, 0, 0), (0, 255, 0), (0, 0, 255), (128, 128, 128)])
    if e["kind"] == "mosaic":
        same("nodata", d.nodata, None)
        same("mask flags", d.mask_flag_enums[0], [MaskFlags.per_dataset, MaskFlags.alpha])
    else:
        same("nodata", repr(d.nodata), repr(float(e["nodata"] if e["nodata"] is not None else "nan")))
    tags = d.tags()
    for name, value in e["items"].items():
        same(f"item {name}", tags.get(name), value)
    same("pixel is area", tags.get("AREA_OR_POINT") if e["transform"] else "Area", "Area")
    same("software", tags.get("TIFFTAG_SOFTWARE", "").split(" ")[0], "groundel")
    same("time and host", [t for t in tags if t in ("TIFFTAG_DATETIME", "TIFFTAG_HOSTCOMPUTER")], [])
    same("units", d.units[0], "m" if e["kind"] == "elevation" else None)
    same("band", d.descriptions[-1], "alpha" if e["kind"] == "mosaic" else e["kind"])


def check_place(e, d, faults):
    def same(what, got, want):
        if got != want:
            faults.append(f"{what}: {got!r}, not {want!r}")

    if e["transform"] is None:
        same("transform", d.transform.is_identity, True)
        same("crs", d.crs, None)
        return
    u, v, size = (struct.unpack("<d", bytes.fromhex(b))[0] for b in e["transform"])
    same("transform", bits(d.transform.to_gdal()), bits([u, size, 0.0, v, 0.0, -size]))
    if e["epsg"] is not None:
        same("crs", d.crs.to_epsg(), e["epsg"])
        same("crs unit", d.crs.linear_units_factor[1] if d.crs.is_projected else None, 1.0)
    else:
        wkt = d.crs.to_wkt()
        same("local frame", wkt.startswith('LOCAL_CS["groundel plane frame",UNIT["metre",1'), True)
        same("crs kind", (d.crs.is_geographic, d.crs.is_projected), (False, False))


def check(e):
    faults = []
    check_pixels(e, faults)
    with rasterio.open(e["path"]) as d:
        check_tags(e, d, faults)
        check_place(e, d, faults)
    valid, errors, warnings = cog_validate(e["path"], strict=True, quiet=True)
    if not valid or errors or warnings:
        faults.append(f"rio cogeo validate: {errors} {warnings}")
    with open(e["path"], "rb") as f:
        if f.read(4) != (b"II\x2b\0" if e["big_tiff"] else b"II\x2a\0"):
            faults.append("BigTIFF where classic was expected, or the reverse")
    return [f"{e['path']}: {fault}" for fault in faults]


def main():
    files = json.load(sys.stdin)["files"]
    with rasterio.Env(GDAL_DISABLE_READDIR_ON_OPEN="EMPTY_DIR"):
        json.dump([check(e) for e in files], sys.stdout)


main()
