#!/usr/bin/env python3
"""Small label files from which fuzzing starts: make_labels.py FOLDER. For a series of 10 slices of 28 x 24 voxels of
8 x 9 x 9.5 mm whose first one lies at 0, 0, 0."""
import gzip
import os
import struct
import sys

COLUMNS, ROWS, LONG = 28, 24, (b'OB', b'OW', b'SQ', b'UN')
folder = sys.argv[1]


def element(tag, vr, value):
    if isinstance(value, str):
        value = value.encode()
        value += (b'\0' if vr == b'UI' else b' ') * (len(value) % 2)
    elif isinstance(value, int):
        value = struct.pack('<H', value)
    head = struct.pack('<HH', tag >> 16, tag & 0xFFFF) + vr
    return head + (struct.pack('<HI', 0, len(value)) if vr in LONG else struct.pack('<H', len(value))) + value


def sequence(tag, items, open_ended=False):
    body = b''.join(struct.pack('<HHI', 0xFFFE, 0xE000, len(item)) + item for item in items)
    if not open_ended:
        return element(tag, b'SQ', body)
    head = struct.pack('<HH', tag >> 16, tag & 0xFFFF) + b'SQ' + struct.pack('<HI', 0, 0xFFFFFFFF)
    body = b''.join(struct.pack('<HHI', 0xFFFE, 0xE000, 0xFFFFFFFF) + item + struct.pack('<HHI', 0xFFFE, 0xE00D, 0)
                    for item in items)
    return head + body + struct.pack('<HHI', 0xFFFE, 0xE0DD, 0)


def write(name, class_uid, *elements):
    meta = element(0x00020002, b'UI', class_uid) + element(0x00020010, b'UI', '1.2.840.10008.1.2.1')
    meta = element(0x00020000, b'UL', struct.pack('<I', len(meta))) + meta
    data = element(0x00080016, b'UI', class_uid) + element(0x00080018, b'UI', '2.25.1') + b''.join(elements)
    with open(os.path.join(folder, name), 'wb') as f:
        f.write(b'\0' * 128 + b'DICM' + meta + data)


def frames(places):
    shared = (sequence(0x00209116, [element(0x00200037, b'DS', '1\\0\\0\\0\\1\\0')]) +
              sequence(0x00289110, [element(0x00280030, b'DS', '9\\8')]))
    items = []
    for segment, k in places:
        item = sequence(0x00209113, [element(0x00200032, b'DS', f'0\\0\\{9.5 * k}')])
        if segment:
            item += sequence(0x0062000A, [element(0x0062000B, b'US', segment)])
        items.append(item)
    return sequence(0x52009229, [shared]) + sequence(0x52009230, items, True)


def segmentation(name, kind, bits, places, pixels, extra=b''):
    segments = [element(0x00620004, b'US', n) + element(0x00620005, b'LO', f'part {n}') for n in (1, 2)]
    write(name, '1.2.840.10008.5.1.4.1.1.66.7' if kind == 'LABELMAP' else '1.2.840.10008.5.1.4.1.1.66.4',
          element(0x00280008, b'IS', str(len(places))), element(0x00280010, b'US', ROWS),
          element(0x00280011, b'US', COLUMNS), element(0x00280100, b'US', bits), element(0x00280101, b'US', bits),
          element(0x00620001, b'CS', kind), sequence(0x00620002, segments), extra, frames(places),
          element(0x7FE00010, b'OB', pixels + b'\0' * (len(pixels) % 2)))


def structure():
    square, keyhole = '9\\9\\{0}\\90.5\\9\\{0}\\90.5\\80\\{0}\\9\\80\\{0}', '40\\40\\{0}\\60\\40\\{0}\\60\\60\\{0}'
    contours = [element(0x30060042, b'CS', 'CLOSED_PLANAR') + element(0x30060050, b'DS', shape.format(z))
                for z in (9.5, 20, 38) for shape in (square, keyhole)]
    contours.append(element(0x30060042, b'CS', 'POINT') + element(0x30060050, b'DS', '1\\2\\3'))
    return (sequence(0x30060020, [element(0x30060022, b'IS', '3') + element(0x30060026, b'LO', 'outline')]) +
            sequence(0x30060039, [sequence(0x30060040, contours) + element(0x30060084, b'IS', '3')], True) +
            sequence(0x30060080, [element(0x30060084, b'IS', '3') + element(0x300600A4, b'CS', 'EXTERNAL')]))


def nifti(name, second, opened):
    planes = 3
    head = bytearray(540 if second else 348)
    extension = b'' if second else struct.pack('<ii', 48, 30) + b'<a><Label Key="1">one</Label></a>'.ljust(40, b'\0')
    offset = len(head) + 4 + len(extension)
    if second:
        struct.pack_into('<i8shh8q', head, 0, 540, b'n+2\0\r\n\x1a\n', 16, 32, 3, COLUMNS, ROWS, planes, 1, 1, 1, 1)
        struct.pack_into('<8d', head, 104, 1, 8, 9, 9.5, 0, 0, 0, 0)
        struct.pack_into('<qdd', head, 168, offset, 1, 0)
        struct.pack_into('<2i6d', head, 344, 1, 0, 0, 0, 1, 0, 0, 9.5)
    else:
        struct.pack_into('<i', head, 0, 348)
        struct.pack_into('<8h', head, 40, 3, COLUMNS, ROWS, planes, 1, 1, 1, 1)
        struct.pack_into('<hh', head, 70, 2, 8)
        struct.pack_into('<8f', head, 76, 1, 8, 9, 9.5, 0, 0, 0, 0)
        struct.pack_into('<f', head, 108, offset)
        struct.pack_into('<hh', head, 252, 0, 2)
        struct.pack_into('<12f', head, 280, -8, 0, 0, 0, 0, -9, 0, 0, 0, 0, 9.5, 0)
        head[344:348] = b'n+1\0'
    numbers = [i // 5 % 3 for i in range(COLUMNS * ROWS * planes)]
    voxels = struct.pack(f'<{len(numbers)}f', *numbers) if second else bytes(numbers)
    data = bytes(head) + (b'\1\0\0\0' if extension else b'\0' * 4) + extension + voxels
    with opened(os.path.join(folder, name)) as f:
        f.write(data)


n_pixels = COLUMNS * ROWS
segmentation('binary', 'BINARY', 1, [(1, 3), (2, 1), (1, 2)], bytes(0xF0 | i % 16 for i in range(n_pixels * 3 // 8)))
segmentation('fractional', 'FRACTIONAL', 8, [(2, 1)], bytes(i % 201 for i in range(n_pixels)),
             element(0x0062000E, b'US', 200))
segmentation('labelmap', 'LABELMAP', 8, [(0, 0), (0, 9)], bytes(i // 7 % 4 for i in range(2 * n_pixels)),
             element(0x00280120, b'US', 3))
write('structures', '1.2.840.10008.5.1.4.1.1.481.3', structure())
nifti('first', False, lambda path: open(path, 'wb'))
nifti('second', True, lambda path: gzip.GzipFile(path, 'wb', 0, mtime=0))
