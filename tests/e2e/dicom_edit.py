"""Changes attributes of DICOM files in place: dicom_edit.py FILE... -- GGGG,EEEE,VR=VALUE...

Explicit VR little endian, as testdata/phantom; VALUE may use {k}, the file's index from 0, in a Python expression
between braces; without =VALUE the attribute is removed."""
import math
import struct
import sys

LONG = (b'OB', b'OW', b'OF', b'SQ', b'UN', b'UT')


def elements(data):
    """[tag, VR, value] of the meta header and the data set; the last one may be PixelData."""
    at, found = 132, []
    while at < len(data):
        tag, vr = struct.unpack_from('<HH', data, at), data[at + 4:at + 6]
        if vr in LONG:
            n, at = struct.unpack_from('<I', data, at + 8)[0], at + 12
        else:
            n, at = struct.unpack_from('<H', data, at + 6)[0], at + 8
        if n == 0xffffffff:
            n = len(data) - at
        found.append([tag, vr, data[at:at + n]])
        at += n
    return found


def joined(found):
    out = b''
    for (group, element), vr, value in found:
        out += struct.pack('<HH', group, element) + vr
        out += struct.pack('<HI', 0, len(value)) if vr in LONG else struct.pack('<H', len(value))
        out += value
    return out


def value_of(text, vr, k):
    while '{' in text:
        before, rest = text.split('{', 1)
        inside, after = rest.split('}', 1)
        text = before + str(eval(inside, {'k': k, 'math': math})) + after
    if vr in (b'US', b'SS'):
        return struct.pack('<H' if vr == b'US' else '<h', int(text))
    if vr in (b'FL', b'FD'):
        return struct.pack('<f' if vr == b'FL' else '<d', float(text))
    raw = text.encode('latin-1')
    return raw + (b'\0' if vr == b'UI' else b' ') * (len(raw) % 2)


def edit(path, changes, k):
    data = open(path, 'rb').read()
    found = elements(data)
    for change in changes:
        what, has_value, text = change.partition('=')
        group, element, vr = what.split(',')
        tag = int(group, 16), int(element, 16)
        found = [e for e in found if e[0] != tag]
        if has_value:
            found.append([tag, vr.encode(), value_of(text, vr.encode(), k)])
    found.sort(key=lambda e: e[0])
    open(path, 'wb').write(data[:132] + joined(found))


split = sys.argv.index('--')
for place, name in enumerate(sys.argv[1:split]):
    edit(name, sys.argv[split + 1:], place)
