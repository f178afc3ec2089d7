#!/usr/bin/env python3
"""Every voxel against an independent reader: hu_pydicom.py VOLUME_DUMP SOURCE_ROOT

pydicom reads the slices, this file masks, rescales, sorts and positions them by the standard's definitions. Exit
77 where pydicom is missing; reports missing shared samples or a missing second decoder."""
import glob
import os
import subprocess
import sys
import tempfile

try:
    import numpy as np
    import pydicom
except ImportError as missing:
    print(f'SKIP: {missing}')
    sys.exit(77)

DUMP, ROOT = sys.argv[1:3]
SHARED = os.path.join(ROOT, '..', 'shared', 'data')
CT = '1.2.840.10008.5.1.4.1.1.2'
failures = []


def check(name, good, text=''):
    print(f'{"ok  " if good else "FAIL"} {name} {text}'.rstrip())
    if not good:
        failures.append(name)


def dump(path, *options):
    """The output of volume_dump and its grey levels, or None and the refusal."""
    with tempfile.NamedTemporaryFile() as raw:
        run = subprocess.run([DUMP, path, '--raw', raw.name, *options], capture_output=True, text=True)
        if run.returncode:
            return None, run.stderr
        facts = {}
        for line in run.stdout.splitlines():
            words = line.split()
            facts.setdefault(words[0], words[1:])
        nx, ny, nz = map(int, facts['dims'])
        return facts, np.fromfile(raw.name, '<u2').reshape(nz, ny, nx)


def encapsulated(d):
    syntax = d.file_meta.TransferSyntaxUID
    return syntax.is_compressed and not syntax.is_deflated


def stored_values(d):
    """PS3.5 8.1.1: the bits below HighBit, sign-extended from BitsStored; and where they are padding."""
    if encapsulated(d):
        words = d.pixel_array.astype(np.int64) & 0xFFFF
    else:
        dtype = np.dtype('u1' if d.BitsAllocated == 8 else 'u2').newbyteorder('<' if d.is_little_endian else '>')
        words = np.frombuffer(d.PixelData, dtype, d.Rows * d.Columns).astype(np.int64).reshape(d.Rows, d.Columns)
    value = (words >> (d.HighBit + 1 - d.BitsStored)) & ((1 << d.BitsStored) - 1)
    if d.PixelRepresentation == 1:
        value = np.where(value >> (d.BitsStored - 1), value - (1 << d.BitsStored), value)
    padding = np.zeros(value.shape, bool)
    if 'PixelPaddingValue' in d:
        ends = [d.PixelPaddingValue, d.get('PixelPaddingRangeLimit', d.PixelPaddingValue)]
        if d.PixelRepresentation == 1:
            ends = [e - 65536 if e > 32767 else e for e in ends]
        padding = (value >= min(ends)) & (value <= max(ends))
    return value, padding


def read_series(files):
    """Slices in order of position: header, HU, padding."""
    slices = []
    for f in files:
        try:
            d = pydicom.dcmread(f)
        except Exception:
            continue
        if d.get('SOPClassUID') != CT or 'LOCALIZER' in d.get('ImageType', []):
            continue
        if encapsulated(d) and d.file_meta.TransferSyntaxUID != pydicom.uid.RLELossless:
            d = decoded(f)
            if d is None:
                return None
        value, padding = stored_values(d)
        slices.append((d, value * float(d.RescaleSlope) + float(d.RescaleIntercept), padding))
    row, column = np.array(slices[0][0].ImageOrientationPatient, float).reshape(2, 3)
    normal = np.cross(row, column)
    slices.sort(key=lambda s: normal @ np.array(s[0].ImagePositionPatient, float))
    return slices


def expected_grey(slices, step):
    return [np.where(p, 0, np.clip(np.floor((hu + 1024) / step + 0.5), 0, 65535)).astype('u2') for _, hu, p in slices]


def check_geometry(name, facts, slices):
    first, last = slices[0][0], slices[-1][0]
    row, column = np.array(first.ImageOrientationPatient, float).reshape(2, 3)
    origin, end = (np.array(d.ImagePositionPatient, float) for d in (first, last))
    nz = int(facts['dims'][2])
    wanted = {'origin': origin, 'step0': row * float(first.PixelSpacing[1]),
              'step1': column * float(first.PixelSpacing[0]), 'step2': (end - origin) / (nz - 1)}
    off = max(np.abs(np.array(facts[k], float) - v).max() for k, v in wanted.items())
    check(f'{name}: place', off < 1e-5, f'off by {off:.2g} mm')


def check_series(path):
    name = os.path.relpath(path, os.path.join(ROOT, '..'))
    slices = read_series([f for f in glob.glob(path + '/**/*', recursive=True) if os.path.isfile(f)])
    if slices is None:
        print(f'SKIP {name}: no second decoder (gdcmconv)')
        return
    facts, grey = dump(path)
    if facts is None:
        check(name, False, grey)
        return
    step = float(facts['hu'][3])
    wanted = expected_grey(slices, step)
    top = max(hu[~p].max() for _, hu, p in slices)
    low = min(hu[~p].min() for _, hu, p in slices)
    check(f'{name}: HU range', float(facts['hu'][5]) == low and float(facts['hu'][7]) == top, f'{low} {top}')
    check_geometry(name, facts, slices)
    if len(grey) == len(slices):
        worst = max(int(np.abs(g.astype(int) - w).max()) for g, w in zip(grey, wanted))
        check(f'{name}: {len(slices)} slices, every voxel', worst == 0, f'off by {worst}')
        return
    # Resampled: linear between the slices around each layer, to the rounding of one grey level.
    normal = np.cross(*np.array(slices[0][0].ImageOrientationPatient, float).reshape(2, 3))
    at = np.array([normal @ np.array(d.ImagePositionPatient, float) for d, _, _ in slices])
    worst = 0
    for k, g in enumerate(grey):
        z = at[0] + (at[-1] - at[0]) * k / (len(grey) - 1)
        a = min(int(np.searchsorted(at, z, 'right')) - 1, len(at) - 2)
        t = min(max((z - at[a]) / (at[a + 1] - at[a]), 0), 1)
        worst = max(worst, np.abs(g - (wanted[a] * (1 - t) + wanted[a + 1] * t)).max())
    check(f'{name}: {len(grey)} layers between {len(slices)} slices', worst <= 0.51, f'off by {worst:.3f}')


def two_slices(source, folder):
    """A one-slice file twice, a millimetre apart, its pixels untouched."""
    for k in range(2):
        d = pydicom.dcmread(source)
        d.SOPInstanceUID = d.file_meta.MediaStorageSOPInstanceUID = f'2.25.{1000 + k}'
        p = [float(x) for x in d.ImagePositionPatient]
        d.ImagePositionPatient = [p[0], p[1], p[2] + k]
        d.save_as(os.path.join(folder, f'{k}.dcm'))


def decoded(source):
    """The slice as a decoder that is not ours gives it: pydicom, else gdcmconv; None without one."""
    d = pydicom.dcmread(source)
    if not encapsulated(d):
        return d
    with tempfile.TemporaryDirectory() as work:
        out = os.path.join(work, 'raw.dcm')
        try:
            if subprocess.run(['gdcmconv', '--raw', source, out], capture_output=True).returncode:
                return None
        except FileNotFoundError:
            return None
        return pydicom.dcmread(out)


def check_syntaxes(folder):
    for source in sorted(glob.glob(folder + '/*.dcm')):
        syntax = pydicom.dcmread(source, stop_before_pixels=True).file_meta.TransferSyntaxUID
        with tempfile.TemporaryDirectory() as work:
            two_slices(source, work)
            facts, grey = dump(work)
        if facts is None:
            check(syntax, False, grey)
            continue
        d = decoded(source)
        if d is None:
            print(f'SKIP {syntax}: no second decoder (gdcmconv)')
            continue
        value, padding = stored_values(d)
        hu = value * float(d.RescaleSlope) + float(d.RescaleIntercept)
        wanted = expected_grey([(d, hu, padding)], float(facts['hu'][3]))[0]
        worst = max(int(np.abs(g.astype(int) - wanted).max()) for g in grey)
        check(f'{syntax}: every voxel', worst == 0, f'off by {worst}, step {facts["hu"][3]}')


def main():
    for path in sorted(glob.glob(os.path.join(ROOT, 'testdata', 'pixels', '*'))):
        check_series(path)
    for name in ('implicit', 'explicit', 'big', 'deflated', 'rle'):
        check_series(os.path.join(ROOT, 'testdata', 'syntax', name))
    for name in ('oblique', 'feet-first', 'far-origin', 'tilted', 'uneven'):
        check_series(os.path.join(ROOT, 'testdata', 'geometry', name))
    if os.path.isdir(SHARED):
        check_series(os.path.join(SHARED, 'head-phantom', 'S2020'))
        check_series(os.path.join(SHARED, 'head-tilt-ge'))
        check_series(os.path.join(SHARED, 'odd', 'coronal-anisotropic'))
        check_syntaxes(os.path.join(SHARED, 'odd', 'one-slice-16-syntaxes'))
    else:
        print('SKIP: the shared samples are not here')
    sys.exit(1 if failures else 0)


main()
