"""Reads 8- and 16-bit PNG files without a picture library, so that tests are independent of ctsplat's code."""
import struct
import sys
import zlib

import numpy as np

CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}


def unfilter(raw, height, stride, bpp):
    rows = np.zeros((height, stride), np.uint8)
    above = np.zeros(stride, np.uint8)
    for y in range(height):
        kind = raw[y * (stride + 1)]
        line = np.frombuffer(raw, np.uint8, stride, y * (stride + 1) + 1).copy()
        if kind == 1:
            for c in range(bpp):
                line[c::bpp] = np.cumsum(line[c::bpp], dtype=np.uint64).astype(np.uint8)
        elif kind == 2:
            line += above
        elif kind in (3, 4):
            out = line.tolist()
            up = above.tolist()
            for i in range(stride):
                a = out[i - bpp] if i >= bpp else 0
                b, c = up[i], up[i - bpp] if i >= bpp else 0
                if kind == 3:
                    guess = (a + b) // 2
                else:
                    pa, pb, pc = abs(b - c), abs(a - c), abs(a + b - 2 * c)
                    guess = a if pa <= pb and pa <= pc else b if pb <= pc else c
                out[i] = (out[i] + guess) & 255
            line = np.array(out, np.uint8)
        rows[y] = above = line
    return rows


def read_png(path):
    """height x width x channels, 0..1."""
    with open(path, 'rb') as f:
        data = f.read()
    assert data[:8] == b'\x89PNG\r\n\x1a\n', path + ' is no PNG'
    at, idat, head = 8, b'', None
    while at < len(data):
        n, kind = struct.unpack('>I4s', data[at:at + 8])
        body = data[at + 8:at + 8 + n]
        assert zlib.crc32(kind + body) == struct.unpack('>I', data[at + 8 + n:at + 12 + n])[0], 'checksum'
        if kind == b'IHDR':
            head = struct.unpack('>IIBBBBB', body)
        elif kind == b'IDAT':
            idat += body
        at += 12 + n
    width, height, depth, colour, _, _, interlace = head
    assert interlace == 0 and depth in (8, 16)
    channels = CHANNELS[colour]
    bpp = channels * depth // 8
    rows = unfilter(zlib.decompress(idat), height, width * bpp, bpp)
    pixels = rows.reshape(height, -1).view('>u2' if depth == 16 else np.uint8)
    return pixels.reshape(height, width, channels) / float(2 ** depth - 1)


def check(condition, text):
    if not condition:
        sys.exit('FAILED: ' + text)


class View:
    """Projects patient coordinates (LPS, mm, about the volume's centre) to pixels (ctsplat(1), PICTURES)."""

    def __init__(self, picture, azimuth, elevation, mm_per_pixel):
        a, e = np.radians(azimuth), np.radians(elevation)
        self.picture = picture
        self.height, self.width = picture.shape[:2]
        self.mm = mm_per_pixel
        self.right = np.array([np.cos(a), np.sin(a), 0])
        self.up = np.array([-np.sin(a) * np.sin(e), np.cos(a) * np.sin(e), np.cos(e)])

    def pixel(self, *lps):
        u, v = np.dot(self.right, lps), np.dot(self.up, lps)
        return u / self.mm + self.width / 2 - 0.5, self.height / 2 - v / self.mm - 0.5

    def at(self, *lps):
        """The pixel nearest to a point."""
        x, y = self.pixel(*lps)
        return self.picture[int(round(y)), int(round(x))]
