"""Writes TIFF photos with rasterio (GDAL, libtiff) and their samples as raw little-endian files.

Standard input: {"folder": path, "cases": [{"name", "dtype", "bands", "size": [width, height], "options": {...}}]};
for each case NAME.tif and NAME.raw (height x width x bands, as GDAL reads the file back) are written. With "icc", the
file named there becomes the photo's profile. Standard output: {}.
"""

import json
import pathlib
import sys

import numpy as np
import rasterio

job = json.load(sys.stdin)
folder = pathlib.Path(job["folder"])
for case in job["cases"]:
    width, height = case["size"]
    dtype = np.dtype(case["dtype"])
    y, x, c = np.mgrid[:height, :width, :case["bands"]]
    # Smooth, so that JPEG keeps it, with every byte in use.
    wave = np.sin(x / 17.0 + c) * np.cos(y / 23.0) * 0.45 + 0.5
    array = (wave * np.iinfo(dtype).max).astype(dtype)
    path = folder / (case["name"] + ".tif")
    profile = {"driver": "GTiff", "width": width, "height": height, "count": case["bands"], "dtype": dtype,
               **case["options"]}
    with rasterio.open(path, "w", **profile) as out:
        out.write(np.moveaxis(array, -1, 0))
    with rasterio.open(path) as back:
        read = np.moveaxis(back.read(), 0, -1)
    read.astype(dtype.newbyteorder("<")).tofile(folder / (case["name"] + ".raw"))
print("{}")
