"""What reading the inputs and writing the output of a job costs anyway, in seconds, by existing tools on two threads.

    floor.py FOLDER

Reads every byte of FOLDER/mesh.ply; decodes FOLDER/photos/*.jpg by libjpeg-turbo's djpeg, two at a time; writes the
pixels of FOLDER/mosaic.tif, taken into memory before, by GDAL as a Cloud Optimized GeoTIFF with the same compression,
predictor, tiles and overviews. Prints one JSON object: mesh, photos, mosaic, all.
"""

import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import rasterio
from rasterio.io import MemoryFile
from rasterio.shutil import copy

THREADS = 2


def timed(work):
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def read_mesh(folder):
    with open(folder / "mesh.ply", "rb", buffering=0) as mesh:
        buffer = bytearray(1 << 22)
        while mesh.readinto(buffer):
            pass


def decode_photos(folder):
    def decode(photo):
        subprocess.run(["djpeg", "-outfile", "/dev/null", photo], check=True)

    with ThreadPoolExecutor(THREADS) as pool:
        list(pool.map(decode, sorted((folder / "photos").glob("*.jpg"))))


def main():
    folder = Path(sys.argv[1])
    with rasterio.open(folder / "mosaic.tif") as mosaic:
        pixels, interpretation = mosaic.read(), mosaic.colorinterp
        profile = {k: mosaic.profile[k] for k in ("width", "height", "count", "dtype", "transform")}
    with rasterio.open("floor", "w", driver="MEM", **profile) as memory:
        memory.write(pixels)
        memory.colorinterp = interpretation
        options = {
            "driver": "COG",
            "COMPRESS": "DEFLATE",
            "PREDICTOR": "YES",
            "BLOCKSIZE": 512,
            "OVERVIEW_RESAMPLING": "AVERAGE",
            "NUM_THREADS": THREADS,
        }
        out = folder / "floor.tif"
        seconds = {
            "mesh": timed(lambda: read_mesh(folder)),
            "photos": timed(lambda: decode_photos(folder)),
            "mosaic": timed(lambda: copy(memory, out, **options)),
        }
    seconds["all"] = sum(seconds.values())
    seconds["bytes"] = out.stat().st_size
    out.unlink()
    print(json.dumps(seconds))


main()
