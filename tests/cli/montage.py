"""A montage's tiles are pictures by themselves: montage.py MONTAGE COLUMNS TILE... compares them pixel by pixel; a tile
"-" is passed over. The rest of the montage is black. montage.py text PNG KEY prints a text of a file;
montage.py letter PNG PNG compares the uppermost rows, where letters stand."""
import os
import struct
import sys

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), '..', 'e2e'))
from pictures import read_png  # noqa: E402

if sys.argv[1] == 'text':
    data, at = open(sys.argv[2], 'rb').read(), 8
    while at < len(data):
        n, kind = struct.unpack('>I4s', data[at:at + 8])
        key, _, text = data[at + 8:at + 8 + n].partition(b'\0')
        if kind == b'tEXt' and key == sys.argv[3].encode():
            print(text.decode())
        at += 12 + n
    sys.exit()
if sys.argv[1] == 'letter':
    letters, both = (read_png(name)[:13] for name in sys.argv[2:])
    assert np.array_equal(letters, both), 'the caption crosses the letter at the upper edge'
    sys.exit()
whole, columns = read_png(sys.argv[1]), int(sys.argv[2])
for i, name in enumerate(sys.argv[3:]):
    if name == '-':
        continue
    tile = read_png(name)
    height, width = tile.shape[:2]
    top, left = i // columns * height, i % columns * width
    part = whole[top:top + height, left:left + width]
    assert part.shape[:2] == tile.shape[:2], f'{name}: expected {tile.shape} at {left},{top}, the montage is {whole.shape}'
    assert np.array_equal(part, np.broadcast_to(tile, part.shape)), f'{name}: {np.sum(part != tile)} samples differ'
    whole[top:top + height, left:left + width] = 0
assert '-' in sys.argv or not whole.any(), 'the rest of the montage is not black'
