#!/usr/bin/env python3
"""PNG previews of a mosaic and its layers, beside them: preview.py FILE.tif …

Colour is shown over white, elevation as shaded grey levels, faces as hashed colours, counts and photo indices
stretched, the palette layer with its own colours. Needs rasterio and numpy (scripts/venv.sh)."""
import pathlib
import sys

import numpy as np
import rasterio


def picture(path):
    with rasterio.open(path) as f:
        data = f.read()
        if f.count in (2, 4):  # grey or RGB with alpha, over white
            colour = data[:-1].astype(float) / np.iinfo(data.dtype).max
            colour = np.where(data[-1:] > 0, colour, 1.0)
            return np.repeat(colour, 3, axis=0) if len(colour) == 1 else colour
        band = data[0]
        known = np.ones(band.shape, bool) if f.nodata is None else (~np.isnan(band) if np.isnan(f.nodata) else band != f.nodata)
        if f.colorinterp[0] == rasterio.enums.ColorInterp.palette:
            table = np.array([f.colormap(1).get(i, (0, 0, 0, 0))[:3] for i in range(256)]) / 255.0
            colour = table[band].transpose(2, 0, 1)
        elif band.dtype == np.uint32:
            h = band.astype(np.uint64) * np.uint64(2654435761) % np.uint64(1 << 24)
            colour = np.stack([(h >> np.uint64(s)) % np.uint64(256) for s in (0, 8, 16)]) / 255.0
        else:
            value = band.astype(float)
            low, high = (np.percentile(value[known], [1, 99]) if known.any() else (0, 1))
            grey = np.clip((value - low) / max(high - low, 1e-12), 0, 1)
            if band.dtype == np.float32:
                dy, dx = np.gradient(value)
                shade = np.clip(0.5 + (dx + dy) / (4 * abs(f.transform.a)), 0, 1)
                grey = 0.4 * grey + 0.6 * np.nan_to_num(shade)
            colour = np.repeat(grey[None], 3, axis=0)
        return np.where(known, colour, 1.0)


for name in map(pathlib.Path, sys.argv[1:]):
    pixels = (np.nan_to_num(picture(name)) * 255 + 0.5).astype(np.uint8)
    out = name.with_suffix(".png")
    profile = dict(driver="PNG", width=pixels.shape[2], height=pixels.shape[1], count=3, dtype="uint8")
    with rasterio.open(out, "w", **profile) as f:
        f.write(pixels)
    out.with_suffix(".png.aux.xml").unlink(missing_ok=True)
    print(out)
