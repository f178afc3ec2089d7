#!/usr/bin/env python3
"""Time of pictures of a loaded head: serve_speed.py CTSPLAT PHANTOM RAW2CT [FOLDER]

512 x 512 pixels from random views, one client and four at once; FOLDER: another series instead of the phantom of
512 x 512 x 324 voxels, which needs 400 MB in the temporary folder."""
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ThreadPoolExecutor

from server import Server

ctsplat, phantom, raw2ct, *folder = sys.argv[1:]
N = 60


def path_of(series, k, words):
    chance = random.Random(k)
    return f'/series/{series}/picture.jpg?size=512x512&view={chance.uniform(0, 360):.1f},{chance.uniform(-60, 60):.1f}&{words}'


def measure(server, series, what, words, clients, n):
    def one(k):
        start = time.monotonic()
        server.get(path_of(series, k, words))
        return (time.monotonic() - start) * 1000

    with ThreadPoolExecutor(clients) as pool:
        times = sorted(pool.map(one, range(n)))
    print(f'{what:34} median {times[n // 2]:6.0f} ms   p95 {times[int(0.95 * n)]:6.0f} ms', flush=True)


with tempfile.TemporaryDirectory() as work:
    if not folder:
        folder = [os.path.join(work, 'head')]
        subprocess.run([os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'bench', 'head_series.sh'), phantom,
                        raw2ct, folder[0]], check=True)
    os.chdir(work)
    with Server(ctsplat, folder[0]) as whole:
        name = whole.series()[0]['id']
        begin = time.monotonic()
        _, headers, _ = whole.ask(path_of(name, 0, 'max-error=8'))
        print(f'{"first picture, with reading":34} {(time.monotonic() - begin) * 1000:13.0f} ms')
        measure(whole, name, 'draft, one client', 'max-error=8', 1, N)
        scene = json.loads(headers['Ctsplat-Scene'])
        centre = ','.join(f'{mm:.3f}' for mm in scene['centre'])
        given = f"max-error=8&mm-per-pixel={scene['mm_per_pixel']:.6g}&centre={centre}"
        measure(whole, name, 'draft, one client, scale given', given, 1, N)
        measure(whole, name, 'draft, four clients', 'max-error=8', 4, 2 * N)
        measure(whole, name, 'full, one client', '', 1, N // 6)
