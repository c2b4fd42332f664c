"""How even and how sharp mosaics are: steps across changes of the set of photos, and fine contrast.

  target/venv/bin/python scripts/colour.py REFERENCE.tif MOSAIC.tif …

Each mosaic needs its layers `count` and `elevation` beside it; places where the surface is steeper than 60 degrees do not
count, since there the scene has edges of its own. A step is the signed difference of the means of three pixels on both sides
of a place where `count` changes, averaged over cells of 48 pixels, so that the scene's own edges cancel; the control is the
same 12 pixels aside, where it does not change. Fine contrast is what a mean over 5 x 5 pixels takes away: the part of
the reference's, made of the heaviest photo of each pixel alone, that the mosaic keeps (the slope of a regression, so that
noise and false edges do not count), the median of cells of 48 pixels that more than two photos see in all mosaics.
"""
import sys

import numpy as np
import rasterio

CELL, ASIDE = 48, 12


def load(path):
    bands = rasterio.open(path).read().astype("f4")
    grey = bands[:-1].mean(0)
    count = rasterio.open(path.replace(".tif", ".count.tif")).read(1)
    elevation = rasterio.open(path.replace(".tif", ".elevation.tif"))
    return grey, count, elevation.read(1) / elevation.transform.a


def step(grey, count, elevation):
    """Mean step at changes and at the control, grey levels."""
    known = (count > 0) & (count < 255)
    found = []
    for axis in (0, 1):
        g, n, k, z = (a if axis else a.T for a in (grey, count.astype("i4"), known, elevation))
        width = g.shape[1]
        before, after = (sum(g[:, d : width - 6 + d] for d in ds) / 3 for ds in ((0, 1, 2), (3, 4, 5)))
        valid = np.logical_and.reduce([k[:, d : width - 6 + d] for d in range(6)])
        heights = np.stack([z[:, d : width - 6 + d] for d in range(6)])
        valid &= np.abs(np.diff(heights, axis=0)).max(0) < 1.7
        change = np.sign(n[:, 3 : width - 3] - n[:, 2 : width - 4]) * valid
        is_changed = change != 0
        aside = np.zeros_like(change)
        aside[:, ASIDE:] = change[:, :-ASIDE]
        near = np.zeros_like(is_changed)
        for d in range(-3, 4):
            near |= np.roll(is_changed, d, 1)
        aside = aside * valid * ~near
        difference = after - before
        for signs in (change, aside):
            h, w = (side // CELL * CELL for side in signs.shape)
            cells = lambda a: a[:h, :w].reshape(h // CELL, CELL, w // CELL, CELL).sum((1, 3))
            pixels = cells(np.abs(signs))
            means = cells(signs * difference) / np.maximum(pixels, 1)
            found.append(np.abs(means[pixels >= 12]))
    at, control = np.concatenate(found[0::2]), np.concatenate(found[1::2])
    return at.mean(), control.mean()


def fine(grey):
    """What a mean over 5 x 5 pixels takes away."""
    sums = np.pad(grey, 3).cumsum(0).cumsum(1)
    mean = (sums[5:-1, 5:-1] - sums[:-6, 5:-1] - sums[5:-1, :-6] + sums[:-6, :-6]) / 25
    return grey - mean


mosaics = [(path, *load(path)) for path in sys.argv[1:]]
both = np.logical_and.reduce([(count > 2) & (count < 255) for _, _, count, _ in mosaics])
h, w = (side // CELL * CELL for side in both.shape)
cells = lambda a: a[:h, :w].reshape(h // CELL, CELL, w // CELL, CELL).swapaxes(1, 2).reshape(-1, CELL * CELL)
whole = cells(both).all(1)
details = lambda grey: (lambda of: of - of.mean(1, keepdims=True))(cells(fine(grey))[whole])
reference = details(mosaics[0][1])
energy = (reference**2).sum(1)
for path, grey, count, elevation in mosaics:
    at, control = step(grey, count, elevation)
    contrast = np.median((details(grey) * reference).sum(1) / np.maximum(energy, 1e-3))
    print(f"{path}: step {at:.2f}, control {control:.2f}: ratio {at / control:.2f}; fine contrast {contrast:.2f}")
