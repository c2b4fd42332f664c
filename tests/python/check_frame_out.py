"""Tells where GeoTIFFs and world files place their pixels as GDAL sees it, and what their tags say of paper.

Standard input: [{"path", "world_file": path or null, "ground": [x, y] or null}]; standard output: for each
{"transform": [a, b, c, d, e, f], "epsg", "index": [column, row] of the ground point or null, "resolution": [x, y, unit],
"overview_resolutions": [[x, y, unit]], "by_world_file": [a, b, c, d, e, f] or null, "faults": [text]}. A world file is
read beside a picture that has no georeference of its own.
"""

import json
import pathlib
import shutil
import sys
import tempfile

import numpy
import rasterio
from rio_cogeo.cogeo import cog_validate

PAPER = ["TIFFTAG_XRESOLUTION", "TIFFTAG_YRESOLUTION", "TIFFTAG_RESOLUTIONUNIT"]


def paper(dataset):
    return [dataset.tags().get(key) for key in PAPER]


def by_world_file(path, width, height):
    with tempfile.TemporaryDirectory() as folder:
        bare = pathlib.Path(folder) / "bare.tif"
        profile = {"driver": "GTiff", "width": width, "height": height, "count": 1, "dtype": "uint8"}
        with rasterio.open(bare, "w", **profile) as dataset:
            dataset.write(numpy.zeros((1, height, width), "uint8"))
        shutil.copy(path, bare.with_suffix(".tfw"))
        with rasterio.open(bare) as dataset:
            return list(dataset.transform)[:6]


answers = []
for asked in json.load(sys.stdin):
    valid, errors, warnings = cog_validate(asked["path"], strict=True, quiet=True)
    answer = {"faults": ([] if valid else ["not a valid COG"]) + list(errors) + list(warnings)}
    with rasterio.open(asked["path"]) as dataset:
        answer["transform"] = list(dataset.transform)[:6]
        answer["epsg"] = dataset.crs.to_epsg() if dataset.crs else None
        answer["resolution"] = paper(dataset)
        answer["index"] = None
        if asked["ground"]:
            answer["index"] = list(~dataset.transform * tuple(asked["ground"]))
        size = (dataset.width, dataset.height)
        overviews = len(dataset.overviews(1))
    answer["overview_resolutions"] = []
    for directory in range(2, overviews + 2):
        with rasterio.open(f"GTIFF_DIR:{directory}:{asked['path']}") as dataset:
            answer["overview_resolutions"].append(paper(dataset))
    answer["by_world_file"] = by_world_file(asked["world_file"], *size) if asked["world_file"] else None
    answers.append(answer)
print(json.dumps(answers))
