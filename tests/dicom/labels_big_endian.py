#!/usr/bin/env python3
"""Segmentations in explicit VR big endian: labels_big_endian.py CTSPLAT SOURCE_ROOT

Each holds what the same one in little endian holds. Exit 77 where numpy or pydicom is missing."""
import os
import sys
import tempfile

from labels_numpy import (ROOT, Scan, blobs, check, compare, failures, info, np, numbers_of, pydicom,
                          write_seg)


def make_big(path, vr):
    """In place; vr: how the pixels are called, words of which are swapped."""
    d = pydicom.dcmread(path)
    d.walk(lambda data_set, element: element.value)  # nothing is left as it was stored
    raw = bytes(d.PixelData)
    if vr == 'OW':
        raw = np.frombuffer(raw + b'\0' * (len(raw) % 2), '<u2').byteswap().tobytes()
    d.add_new(0x7FE00010, vr, raw)
    d.file_meta.TransferSyntaxUID = '1.2.840.10008.1.2.2'
    d.is_little_endian, d.is_implicit_VR = False, False
    d.save_as(path, write_like_original=False)


def main():
    scan = Scan(os.path.join(ROOT, 'testdata', 'phantom'))
    masks = blobs(scan.shape)
    with tempfile.TemporaryDirectory() as work:
        path = os.path.join(work, 'seg.dcm')
        for name, more in {'bits': {}, 'fractions': {'kind': 'FRACTIONAL', 'bits': 8, 'MaximumFractionalValue': 200}}.items():
            for vr in ('OB', 'OW'):
                write_seg(path, scan, masks, **more)
                make_big(path, vr)
                code, err, found = info(scan.folder, path)
                check(f'{name}, {vr}: read', code == 0, err)
                if not code:
                    compare(f'{name}, {vr}', scan, found['series'][0]['labels'], masks)
        for bits in (8, 16):
            _, apart = numbers_of(masks, scan.shape)
            write_seg(path, scan, apart, kind='LABELMAP', bits=bits)
            make_big(path, 'OB' if bits == 8 else 'OW')
            code, err, found = info(scan.folder, path)
            check(f'label map of {bits} bits: read', code == 0, err)
            if not code:
                compare(f'label map of {bits} bits', scan, found['series'][0]['labels'], apart)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
