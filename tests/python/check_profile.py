"""Tells the colour profile of GeoTIFFs as GDAL sees it, and what rio-cogeo says about them.

Standard input: [path]; standard output: for each file {"profile": base64 or null, "faults": [text]}.
"""

import json
import sys

import rasterio
from rio_cogeo.cogeo import cog_validate

answers = []
for path in json.load(sys.stdin):
    valid, errors, warnings = cog_validate(path, strict=True, quiet=True)
    faults = [] if valid else ["not a valid COG"]
    with rasterio.open(path) as dataset:
        profile = dataset.tags(ns="COLOR_PROFILE").get("SOURCE_ICC_PROFILE")
    answers.append({"profile": profile, "faults": faults + list(errors) + list(warnings)})
print(json.dumps(answers))
