#!/usr/bin/env python3
"""Encodings of a series that few writers make: odd_encodings.py CTSPLAT SOURCE_ROOT

Of the phantom's slices files are made here, by pydicom or byte by byte; each gives the phantom's picture, or the message
that helps. Exit 77 where numpy or pydicom is missing."""
import copy
import os
import struct
import sys
import tempfile

from concatenations import write_part
from labels_numpy import ROOT, Scan, check, failures, pydicom
from nifti_volume import picture, run
from pydicom.encaps import encapsulate

COPIED = '1.2.840.10008.1.2.1.98'


def meta_in_implicit_vr(d, data, with_length):
    """A file without preamble: the meta header in implicit VR, then the data set as it is."""
    elements = b''
    for e in d.file_meta:
        if e.tag.group == 2 and e.tag.element:
            value = bytes(e.value) if e.VR == 'OB' else str(e.value).encode()
            value += b'\0' * (len(value) % 2)
            elements += struct.pack('<HHI', 2, e.tag.element, len(value)) + value
    if with_length:
        elements = struct.pack('<HHII', 2, 0, 4, len(elements)) + elements
    return elements + data[132 + 12 + d.file_meta[2, 0].value:]


def fragments(frames, n, table=True):
    """Each frame in n fragments of even length; a table of offsets if there is one."""
    items, offsets, at = b'', [], 0
    for frame in frames:
        offsets.append(at)
        step = (len(frame) // n + 2) // 2 * 2
        for i in range(n):
            part = frame[i * step:(i + 1) * step]
            items += struct.pack('<HHI', 0xfffe, 0xe000, len(part)) + part
            at += 8 + len(part)
    head = struct.pack(f'<{len(offsets)}I', *offsets) if table else b''
    return struct.pack('<HHI', 0xfffe, 0xe000, len(head)) + head + items + struct.pack('<HHI', 0xfffe, 0xe0dd, 0)


def write_copied(folder, slices, pixels):
    os.makedirs(folder)
    for k, original in enumerate(slices):
        d = copy.deepcopy(original)
        d.file_meta.TransferSyntaxUID = COPIED
        d.PixelData = pixels(d.PixelData)
        d['PixelData'].VR, d['PixelData'].is_undefined_length = 'OB', True
        d.save_as(os.path.join(folder, f'{k:03}.dcm'), write_like_original=False)


def test_meta(scan, expected, work):
    for name in 'explicit', 'implicit':
        source = Scan(os.path.join(ROOT, 'testdata', 'syntax', name))
        for with_length in True, False:
            folder = os.path.join(work, f'{name}{with_length}')
            os.makedirs(folder)
            for k, d in enumerate(source.files):
                with open(d.filename, 'rb') as f:
                    data = meta_in_implicit_vr(d, f.read(), with_length)
                with open(os.path.join(folder, str(k)), 'wb') as f:
                    f.write(data)
            found = picture(folder, work)
            check(f'meta header in implicit VR, {name} data set, length {with_length}',
                  found == picture(source.folder, work), found if isinstance(found, str) else '')


def test_copied(scan, expected, work):
    """Encapsulated Uncompressed Explicit VR Little Endian."""
    for name, pixels in {'by pydicom': lambda p: encapsulate([p]), 'one fragment': lambda p: fragments([p], 1),
                         'three fragments, no table': lambda p: fragments([p], 3, False)}.items():
        folder = os.path.join(work, name)
        write_copied(folder, scan.files, pixels)
        found = picture(folder, work)
        check(f'{name}: the same picture', found == expected, found if isinstance(found, str) else '')
    folder = os.path.join(work, 'short')
    write_copied(folder, scan.files, lambda p: fragments([p[:-2]], 1))
    done = run('render', folder, '-o', os.path.join(work, 'no.png'))
    check('too short: refused', done.returncode == 4 and 'needs 8192 bytes' in done.stderr, done.stderr)
    for n in 1, 2:
        folder = os.path.join(work, f'frames{n}')
        os.makedirs(folder)
        path = os.path.join(folder, 'enhanced.dcm')
        slices = [copy.deepcopy(d) for d in scan.files]
        write_part(path, slices, 0)
        expected = picture(folder, work)
        d = pydicom.dcmread(path)
        d.file_meta.TransferSyntaxUID = COPIED
        d.PixelData = fragments([s.PixelData for s in slices], n)
        d['PixelData'].VR, d['PixelData'].is_undefined_length = 'OB', True
        d.save_as(path, write_like_original=False)
        found = picture(folder, work)
        check(f'frames of {n} fragments: the same picture', found == expected, found if isinstance(found, str) else '')


def main():
    scan = Scan(os.path.join(ROOT, 'testdata', 'phantom'))
    with tempfile.TemporaryDirectory() as work:
        for test in test_meta, test_copied:
            test(scan, picture(scan.folder, work), work)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
