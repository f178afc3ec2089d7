#!/usr/bin/env python3
"""Label statistics by an independent reader: labels_numpy.py CTSPLAT SOURCE_ROOT

pydicom and numpy read and count; segmentations, structure sets and NIfTI files, unusual ones too, are written
here on the series of testdata. Exit 77 where pydicom is missing; reports missing shared samples."""
import copy
import glob
import gzip
import json
import os
import shutil
import struct
import subprocess
import sys
import tempfile

try:
    import numpy as np
    import pydicom
    from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
    from pydicom.sequence import Sequence
    from pydicom.uid import generate_uid
except ImportError as missing:
    print(f'SKIP: {missing}')
    sys.exit(77)

CTSPLAT, ROOT = sys.argv[1:3]
SHARED = os.path.join(ROOT, '..', 'shared', 'data')
SEG, LABELMAP = '1.2.840.10008.5.1.4.1.1.66.4', '1.2.840.10008.5.1.4.1.1.66.7'
STRUCTURES = '1.2.840.10008.5.1.4.1.1.481.3'
random = np.random.default_rng(1)
failures, n_checks = [], 0


def check(name, good, text=''):
    global n_checks
    n_checks += 1
    if not good:
        failures.append(name)
        print(f'FAIL {name} {text}'.rstrip())


def info(path, *labels, names=None, quantity=None):
    options = (['--quantity', quantity] if quantity else []) + [word for label in labels for word in ('--labels', label)] + (['--label-names', names] if names else [])
    run = subprocess.run([CTSPLAT, 'info', '--json', path, *options], capture_output=True, text=True,
                         env={**os.environ, 'MALLOC_PERTURB_': '20'})
    return run.returncode, run.stderr, json.loads(run.stdout) if run.returncode == 0 else None


class Scan:
    """The slices of a folder, sorted along their normal."""

    def __init__(self, folder):
        files = [pydicom.dcmread(f, force=True) for f in glob.glob(os.path.join(folder, '**', '*'), recursive=True)
                 if os.path.isfile(f)]
        files = [d for d in files if d.get('Modality') == 'CT' and 'PixelData' in d and d.Rows > 1]
        cosines = np.array(files[0].ImageOrientationPatient, float)
        self.row, self.column = cosines[:3], cosines[3:]
        normal = np.cross(self.row, self.column)
        files.sort(key=lambda d: float(np.dot(normal, np.array(d.ImagePositionPatient, float))))
        self.folder, self.files, self.normal = folder, files, normal
        self.position = np.array([d.ImagePositionPatient for d in files], float)
        self.spacing = np.array(files[0].PixelSpacing, float)  # between rows, between columns
        self.at = self.position @ normal
        self.shape = (len(files), files[0].Rows, files[0].Columns)
        gaps = np.diff(self.at)
        self.thickness = np.empty(len(files))
        self.thickness[0], self.thickness[-1] = gaps[0], gaps[-1]
        self.thickness[1:-1] = (gaps[1:] + gaps[:-1]) / 2

    def hu(self):
        try:
            stored = np.stack([d.pixel_array for d in self.files]).astype(float)
        except Exception as e:  # a decoder that pydicom lacks
            print(f'SKIP: HU of {self.folder}: {e}')
            return None, None
        slope = np.array([float(d.RescaleSlope) for d in self.files])[:, None, None]
        intercept = np.array([float(d.RescaleIntercept) for d in self.files])[:, None, None]
        padding = np.zeros(self.shape, bool)
        for k, d in enumerate(self.files):
            if 'PixelPaddingValue' in d:
                low = high = d.PixelPaddingValue
                if 'PixelPaddingRangeLimit' in d:
                    low, high = sorted((low, d.PixelPaddingRangeLimit))
                padding[k] = (stored[k] >= low) & (stored[k] <= high)
        return stored * slope + intercept, padding


def parts(mask):
    """Connected by faces, edges or corners: a flood fill."""
    left = set(zip(*np.nonzero(mask)))
    n = 0
    while left:
        n += 1
        stack = [left.pop()]
        while stack:
            k, j, i = stack.pop()
            for dk in (-1, 0, 1):
                for dj in (-1, 0, 1):
                    for di in (-1, 0, 1):
                        if (k + dk, j + dj, i + di) in left:
                            left.remove((k + dk, j + dj, i + di))
                            stack.append((k + dk, j + dj, i + di))
    return n


def boxed(mask):
    """The box that holds all of a mask, as slices, and what is in it: organs are small beside their scan."""
    sides = [np.nonzero(mask.any(axis=axes))[0] for axes in ((1, 2), (0, 2), (0, 1))]
    box = tuple(slice(side[0], side[-1] + 1) if side.size else slice(0, 0) for side in sides)
    return box, mask[box].copy()


def touches_edge(box, shape):
    return any(side.stop > side.start and (side.start == 0 or side.stop == n) for side, n in zip(box, shape))


def compare(name, scan, found, masks, hu=True, count_parts=True):
    """masks: by number, whole or boxed."""
    masks = {number: mask if isinstance(mask, tuple) else boxed(mask) for number, mask in masks.items()}
    labels = {label['number']: label for label in found}
    check(f'{name}: which labels', sorted(labels) == sorted(masks), f'{sorted(labels)} {sorted(masks)}')
    values, padding = scan.hu() if hu else (None, None)
    area = scan.spacing[0] * scan.spacing[1]
    held = np.zeros(scan.shape, np.uint8)
    for box, mask in masks.values():
        held[box] += mask
    for number, (box, mask) in masks.items():
        label = labels.get(number)
        if not label:
            continue
        expected = {'voxels': int(mask.sum()), 'overlap': int((mask & (held[box] > 1)).sum()), 'empty': not mask.any(),
                    'touches_edge': touches_edge(box, scan.shape)}
        if count_parts:
            expected['parts'] = parts(mask)
        for key, value in expected.items():
            check(f'{name}: {number} {key}', label[key] == value, f'{label[key]} {value}')
        ml = (mask.sum(axis=(1, 2)) * area * scan.thickness[box[0]]).sum() / 1000
        check(f'{name}: {number} ml', abs(label['ml'] - ml) < 1e-9 + 1e-6 * ml, f'{label["ml"]} {ml}')
        if values is None:
            continue
        seen = values[box][mask & ~padding[box]]
        if seen.size == 0:
            check(f'{name}: {number} HU of none', label['hu_mean'] is None and label['hu_sd'] is None)
            continue
        check(f'{name}: {number} mean', abs(label['hu_mean'] - seen.mean()) < 1e-6, f'{label["hu_mean"]} {seen.mean()}')
        check(f'{name}: {number} sd', abs(label['hu_sd'] - seen.std()) < 1e-6, f'{label["hu_sd"]} {seen.std()}')


def blobs(shape, n=3):
    """Overlapping boxes with specks, one label that is empty."""
    masks = {}
    for number in range(1, n + 1):
        mask = np.zeros(shape, bool)
        low = [int(random.integers(0, max(1, s // 2))) for s in shape]
        high = [int(random.integers(lo + 1, s + 1)) for lo, s in zip(low, shape)]
        mask[low[0]:high[0], low[1]:high[1], low[2]:high[2]] = True
        mask &= random.random(shape) < 0.9
        masks[number] = mask
    masks[n + 1] = np.zeros(shape, bool)
    return masks


def base(scan, class_uid, **more):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = class_uid, generate_uid()
    meta.TransferSyntaxUID = more.pop('syntax', '1.2.840.10008.1.2.1')
    d = FileDataset(None, {}, file_meta=meta, preamble=b'\0' * 128)
    d.is_little_endian, d.is_implicit_VR = True, meta.TransferSyntaxUID == '1.2.840.10008.1.2'
    ct = scan.files[0]
    d.SOPClassUID, d.SOPInstanceUID = class_uid, meta.MediaStorageSOPInstanceUID
    for key in ('PatientID', 'StudyInstanceUID', 'FrameOfReferenceUID'):
        if key in ct:
            setattr(d, key, getattr(ct, key))
    reference = Dataset()
    reference.SeriesInstanceUID = ct.SeriesInstanceUID
    d.ReferencedSeriesSequence = Sequence([reference])
    d.SeriesInstanceUID, d.Modality = generate_uid(), 'SEG'
    for key, value in more.items():
        setattr(d, key, value)
    return d


def segment(number):
    s = Dataset()
    s.SegmentNumber, s.SegmentLabel = number, f'segment {number}'
    return s


def geometry(scan):
    shared = Dataset()
    orientation, measures = Dataset(), Dataset()
    orientation.ImageOrientationPatient = [float(f'{x:.12g}') for x in (*scan.row, *scan.column)]
    measures.PixelSpacing = [float(f'{x:.12g}') for x in scan.spacing]
    shared.PlaneOrientationSequence, shared.PixelMeasuresSequence = Sequence([orientation]), Sequence([measures])
    return shared


def frame(position, number=None):
    f, place = Dataset(), Dataset()
    place.ImagePositionPatient = list(position)
    f.PlanePositionSequence = Sequence([place])
    if number is not None:
        identification = Dataset()
        identification.ReferencedSegmentNumber = number
        f.SegmentIdentificationSequence = Sequence([identification])
    return f


def write_seg(path, scan, masks, kind='BINARY', bits=1, keep_empty=False, **more):
    d = base(scan, LABELMAP if kind == 'LABELMAP' else SEG, SegmentationType=kind, **more)
    d.Rows, d.Columns = scan.shape[1:]
    d.SegmentSequence = Sequence([segment(n) for n in masks])
    d.SharedFunctionalGroupsSequence = Sequence([geometry(scan)])
    d.SamplesPerPixel, d.PhotometricInterpretation, d.PixelRepresentation = 1, 'MONOCHROME2', 0
    d.BitsAllocated = d.BitsStored = bits
    d.HighBit = bits - 1
    frames, pixels = [], []
    if kind == 'LABELMAP':
        for k in range(scan.shape[0]):
            plane = np.zeros(scan.shape[1:], np.uint16)
            for number, mask in masks.items():
                plane[mask[k]] = number
            if 'PixelPaddingValue' in d and not plane.any():
                plane[:] = d.PixelPaddingValue
            frames.append(frame(scan.position[k]))
            pixels.append(plane)
    else:
        for number, mask in masks.items():
            for k in range(scan.shape[0]):
                if keep_empty or mask[k].any():
                    frames.append(frame(scan.position[k], number))
                    pixels.append(mask[k])
    order = random.permutation(len(frames))
    frames, pixels = [frames[i] for i in order], np.stack([pixels[i] for i in order])
    d.NumberOfFrames = len(frames)
    d.PerFrameFunctionalGroupsSequence = Sequence(frames)
    if bits == 1:
        data = np.packbits(pixels.astype(np.uint8).ravel(), bitorder='little').tobytes()
    elif kind == 'FRACTIONAL':
        data = np.where(pixels, random.integers(100, 201, pixels.shape),
                        random.integers(0, 100, pixels.shape)).astype(np.uint8).tobytes()
    else:
        data = pixels.astype(f'<u{bits // 8}').tobytes()
    d.PixelData = data + b'\0' * (len(data) % 2)
    d['PixelData'].VR = 'OB' if bits <= 8 else 'OW'
    d.save_as(path, write_like_original=False)
    return d


def affine(scan):
    """Voxel (i, j, k) to RAS, of a stack that is even."""
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1] = scan.row * scan.spacing[1], scan.column * scan.spacing[0]
    matrix[:3, 2] = (scan.position[-1] - scan.position[0]) / (scan.shape[0] - 1)
    matrix[:3, 3] = scan.position[0]
    return np.diag([-1, -1, 1, 1]) @ matrix


def write_nifti(path, volume, matrix, code=4, version=1, big=False, qform=False, slope=0.0, intercept=0.0,
                extension=b'', dims=None, form=True):
    """volume[i, j, k]; code: the datatype's."""
    kinds = {2: 'u1', 4: 'i2', 8: 'i4', 16: 'f4', 64: 'f8', 256: 'i1', 512: 'u2', 768: 'u4', 1024: 'i8', 1280: 'u8'}
    e = '>' if big else '<'
    dims = dims or volume.shape
    spacing = np.linalg.norm(matrix[:3, :3], axis=0)
    quaternion, handed = (0, 0, 0), 1
    if qform:
        rotation = matrix[:3, :3] / spacing
        if np.linalg.det(rotation) < 0:
            handed, rotation = -1, rotation * [1, 1, -1]
        quaternion = to_quaternion(rotation)
    block = struct.pack(e + 'ii', (8 + len(extension) + 15) // 16 * 16, 30) + extension if extension else b''
    block += b'\0' * (-len(block) % 16)
    head = bytearray(348 if version == 1 else 540)
    offset = len(head) + 4 + len(block)
    codes = (1, 0) if qform else (0, 2 if form else 0)
    if version == 1:
        struct.pack_into(e + 'i', head, 0, 348)
        struct.pack_into(e + '8h', head, 40, 3, *dims, 1, 1, 1, 1)
        struct.pack_into(e + '2h', head, 70, code, np.dtype(kinds[code]).itemsize * 8)
        struct.pack_into(e + '8f', head, 76, handed, *spacing, 0, 0, 0, 0)
        struct.pack_into(e + '3f', head, 108, offset, slope, intercept)
        head[123] = 2
        struct.pack_into(e + '2h', head, 252, *codes)
        struct.pack_into(e + '6f', head, 256, *quaternion, *matrix[:3, 3])
        struct.pack_into(e + '12f', head, 280, *matrix[:3].ravel())
        head[344:348] = b'n+1\0'
    else:
        struct.pack_into(e + 'i', head, 0, 540)
        head[4:12] = b'n+2\0\r\n\x1a\n'
        struct.pack_into(e + '2h', head, 12, code, np.dtype(kinds[code]).itemsize * 8)
        struct.pack_into(e + '8q', head, 16, 3, *dims, 1, 1, 1, 1)
        struct.pack_into(e + '8d', head, 104, handed, *spacing, 0, 0, 0, 0)
        struct.pack_into(e + 'qdd', head, 168, offset, slope, intercept)
        struct.pack_into(e + '2i', head, 344, *codes)
        struct.pack_into(e + '6d', head, 352, *quaternion, *matrix[:3, 3])
        struct.pack_into(e + '12d', head, 400, *matrix[:3].ravel())
        struct.pack_into(e + 'i', head, 500, 2)
    data = bytes(head) + (b'\1\0\0\0' if block else b'\0' * 4) + block
    data += np.asarray(volume).astype(e + kinds[code]).tobytes(order='F')
    with (gzip.open if path.endswith('.gz') else open)(path, 'wb') as f:
        f.write(data)


def to_quaternion(r):
    a = np.sqrt(max(0, 1 + np.trace(r))) / 2
    if a > 0.1:
        return (r[2, 1] - r[1, 2]) / (4 * a), (r[0, 2] - r[2, 0]) / (4 * a), (r[1, 0] - r[0, 1]) / (4 * a)
    w, v = np.linalg.eigh((r + r.T) / 2)
    axis = v[:, np.argmax(w)]
    return tuple(axis * np.sqrt(1 - a * a))


def numbers_of(masks, shape):
    volume = np.zeros(shape, int)
    for number, mask in masks.items():
        volume[mask] = number
    return volume, {n: volume == n for n in masks if (volume == n).any()}


def inside(polygons, columns, rows):
    """Even-odd of all polygons, pixels as points."""
    x, y = np.meshgrid(np.arange(columns, dtype=float), np.arange(rows, dtype=float))
    result = np.zeros((rows, columns), bool)
    for polygon in polygons:
        for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0)):
            if y0 != y1:
                crosses = (y0 > y) != (y1 > y)
                result ^= crosses & (x < (x1 - x0) * (y - y0) / (y1 - y0) + x0)
    return result


def write_structures(path, scan, structures, **more):
    """structures: by number, lists of (slice, offset along the normal in slices, type, polygon in pixels)."""
    d = base(scan, STRUCTURES, Modality='RTSTRUCT', **more)
    rois, contours = [], []
    for number, items in structures.items():
        roi, contour = Dataset(), Dataset()
        roi.ROINumber, roi.ROIName = number, f'roi {number}'
        contour.ReferencedROINumber = number
        contour.ContourSequence = Sequence([])
        for k, offset, kind, polygon in items:
            c = Dataset()
            points = (scan.position[k] + offset * scan.normal * scan.thickness[k] +
                      polygon[:, :1] * scan.row * scan.spacing[1] + polygon[:, 1:] * scan.column * scan.spacing[0])
            c.ContourGeometricType, c.NumberOfContourPoints = kind, len(points)
            c.ContourData = [f'{x:.9f}'[:16] for x in points.ravel()]
            contour.ContourSequence.append(c)
        rois.append(roi)
        contours.append(contour)
    d.StructureSetROISequence, d.ROIContourSequence = Sequence(rois), Sequence(contours)
    d.save_as(path, write_like_original=False)
    return d


def test_segmentations(scan, work):
    masks = blobs(scan.shape)
    path = os.path.join(work, 'seg.dcm')
    for name, more in (('binary', {}), ('binary, implicit', {'syntax': '1.2.840.10008.1.2'}),
                       ('binary, empty frames', {'keep_empty': True}), ('binary, deflated', {'syntax': '1.2.840.10008.1.2.1.99'}),
                       ('bytes', {'bits': 8}),
                       ('fractional', {'kind': 'FRACTIONAL', 'bits': 8, 'MaximumFractionalValue': 200})):
        write_seg(path, scan, masks, **more)
        code, text, found = info(scan.folder, path)
        check(f'{scan.folder}: {name} is read', code == 0, text)
        if code == 0:
            compare(f'{scan.folder}: {name}', scan, found['series'][0]['labels'], masks)
    volume, apart = numbers_of(masks, scan.shape)
    for bits, more in ((8, {}), (16, {}), (8, {'PixelPaddingValue': 77})):
        write_seg(path, scan, {n: volume == n for n in masks}, kind='LABELMAP', bits=bits, **more)
        code, text, found = info(scan.folder, path)
        check(f'{scan.folder}: label map of {bits} bits is read', code == 0, text)
        if code == 0:
            compare(f'{scan.folder}: label map', scan, found['series'][0]['labels'],
                    {n: volume == n for n in masks})
    del apart


def test_nifti(scan, work):
    volume, masks = numbers_of(blobs(scan.shape), scan.shape)
    ijk, matrix = volume.transpose(2, 1, 0), affine(scan)
    tilted = abs(np.dot(matrix[:3, 2], np.cross(matrix[:3, 0], matrix[:3, 1]))) < \
        0.999 * np.prod(np.linalg.norm(matrix[:3, :3], axis=0))
    flip = matrix @ np.array([[-1, 0, 0, ijk.shape[0] - 1], [0, -1, 0, ijk.shape[1] - 1], [0, 0, 1, 0], [0, 0, 0, 1]])
    turned = matrix[:, [2, 0, 1, 3]]
    cases = {'int16': {}, 'gzip': {'ending': '.nii.gz'}, 'big-endian': {'big': True}, 'second': {'version': 2},
             'second, big-endian': {'version': 2, 'big': True}, 'slope NaN': {'slope': float('nan')},
             'flipped': {'volume': ijk[::-1, ::-1], 'matrix': flip},
             'axes turned': {'volume': ijk.transpose(2, 0, 1), 'matrix': turned}}
    cases.update({f'datatype {code}': {'code': code} for code in (2, 8, 16, 64, 256, 512, 768, 1024, 1280)})
    if not tilted:
        cases['qform'] = {'qform': True}
    for name, case in cases.items():
        path = os.path.join(work, 'map' + case.pop('ending', '.nii'))
        write_nifti(path, case.pop('volume', ijk), case.pop('matrix', matrix), **case)
        code, text, found = info(scan.folder, path)
        check(f'{scan.folder}: NIfTI {name} is read', code == 0, text)
        if code == 0:
            compare(f'{scan.folder}: NIfTI {name}', scan, found['series'][0]['labels'], masks, hu=False,
                    count_parts=False)


def test_names(scan, work):
    volume, _ = numbers_of(blobs(scan.shape), scan.shape)
    ijk, matrix = volume.transpose(2, 1, 0), affine(scan)
    path, names = os.path.join(work, 'map.nii.gz'), os.path.join(work, 'names')

    def named(*options, **more):
        code, text, found = info(scan.folder, path, **more)
        return [label['name'] for label in found['series'][0]['labels']] if code == 0 else text

    write_nifti(path, ijk, matrix)
    numbers = [n for n in (1, 2, 3) if (volume == n).any()]
    check('names: none', named() == [f'label {n}' for n in numbers], named())
    for text in ('{"1": "one", "2": "two", "3": "three"}', '{"labels": {"background": 0, "one": 1, "two": 2, "three": 3}}',
                 '# ITK-SNAP\n1 255 0 0 1 1 1 "one"\n2 0 255 0 1 1 1 "two"\n3 0 0 255 0.5 1 1 "three"\n'):
        with open(names, 'w') as f:
            f.write(text)
        check(f'names: {text}', named(names=names) == [['one', 'two', 'three'][n - 1] for n in numbers],
              str(named(names=names)))
    xml = (b'<?xml version="1.0"?><CaretExtension><LabelTable><Label Key="1" Red="1"><![CDATA[one]]></Label>'
           b'<Label Key="2">two</Label><Label Key="3">three</Label></LabelTable></CaretExtension>')
    write_nifti(path, ijk, matrix, extension=xml)
    check('names: Caret', named() == [['one', 'two', 'three'][n - 1] for n in numbers], str(named()))
    folder = os.path.join(work, 'masks')
    os.makedirs(folder)
    for n, stem in ((1, 'liver'), (2, 'spleen'), (4, 'kidney_left')):
        write_nifti(os.path.join(folder, stem + '.nii.gz'), volume.transpose(2, 1, 0) == n, matrix, code=2)
    code, text, found = info(scan.folder, folder)
    got = [(label['name'], label['voxels']) for label in found['series'][0]['labels']] if code == 0 else text
    check('a folder of masks', got == [('kidney_left', 0), ('liver', int((volume == 1).sum())),
                                       ('spleen', int((volume == 2).sum()))], str(got))


def test_places(scan, work):
    """Masks that are shifted, mirrored, partly or wholly outside cause a warning or a refusal."""
    folder, matrix = os.path.join(work, 'places'), affine(scan)
    os.makedirs(folder)

    def codes(masks, move=np.eye(4)):
        for name in os.listdir(folder):
            os.remove(os.path.join(folder, name))
        for name, mask in masks.items():
            write_nifti(os.path.join(folder, name + '.nii.gz'), mask.transpose(2, 1, 0), move @ matrix, code=2)
        code, text, found = info(scan.folder, folder)
        return [f['code'] for f in found['series'][0]['findings'] if f['code'].startswith('label_')] if code == 0 else text

    body = scan.hu()[0] > -300
    lost = np.roll(body, scan.shape[2] // 2, axis=2)
    check('places: right', codes({'head': body}) == [], codes({'head': body}))
    check('places: shifted', codes({'head': lost}) == ['label_in_air'], codes({'head': lost}))
    check('places: what may hold air', codes({'lung': lost, 'airway': lost}) == [])
    far = np.eye(4)
    far[0, 3] = 0.7 * scan.shape[2] * scan.spacing[1]
    check('places: mostly outside', 'label_outside' in codes({'head': body}, far), codes({'head': body}, far))
    far[0, 3] *= 3
    check('places: outside', 'does not meet' in codes({'head': body}, far), codes({'head': body}, far))
    # LPS rises to the patient's left.
    left = np.zeros(scan.shape, bool)
    left[:, :, (np.arange(scan.shape[2]) > scan.shape[2] // 2) == (scan.row[0] > 0)] = True
    kidneys = {'kidney_left': body & left, 'kidney_right': body & ~left}
    changed = {'kidney_left': body & ~left, 'kidney_right': body & left}
    check('places: left is left', codes(kidneys) == [], codes(kidneys))
    check('places: left is right', codes(changed) == ['label_mirrored'], codes(changed))
    changed.update({f'{name} of rib {n}': mask for n in (1, 2) for name, mask in
                    (('Left', kidneys['kidney_left']), ('Right', kidneys['kidney_right']))})
    check('places: one pair alone', codes(changed) == [], codes(changed))


def test_batch(scan, work):
    """--labels auto in a batch: each series gets the segmentation of its study, from another folder or a zip file."""
    archive, expected = os.path.join(work, 'archive'), {}
    for i in range(3):
        folder = os.path.join(archive, str(i), 'ct')
        os.makedirs(folder)
        for k, d in enumerate(scan.files):
            d = copy.deepcopy(d)
            d.StudyInstanceUID, d.SeriesInstanceUID, d.SOPInstanceUID = f'2.25.1{i}', f'2.25.2{i}', f'2.25.3{i}.{k}'
            d.FrameOfReferenceUID, d.file_meta.MediaStorageSOPInstanceUID = f'2.25.4{i}', d.SOPInstanceUID
            d.save_as(os.path.join(folder, f'{k}.dcm'))
        mask = blobs(scan.shape)[1]
        if i < 2:
            write_seg(os.path.join(archive, str(i), 'seg.dcm'), Scan(folder), {1: mask})
        expected[f'2.25.2{i}'] = [int(mask.sum())] if i < 2 else []
    packed = shutil.make_archive(os.path.join(work, 'packed'), 'zip', archive)
    for path in (archive, packed):
        out = os.path.join(work, 'out-' + os.path.basename(path))
        run = subprocess.run([CTSPLAT, 'batch', path, '-O', out, '--presets', 'skin', '--size', '32x32', '--labels',
                              'auto'], capture_output=True, text=True)
        with open(os.path.join(out, 'batch.jsonl')) as f:
            lines = [json.loads(line) for line in f]
        found = {line['series_uid']: [label['voxels'] for label in line.get('labels', [])] for line in lines}
        check(f'batch: auto in {os.path.basename(path)}', run.returncode == 0 and found == expected,
              f'{run.stderr} {found} {expected}')


def test_structures(scan, work):
    if scan.shape[1] < 16:
        return
    rows, columns = scan.shape[1:]
    outer = np.array([[2.2, 2.3], [columns - 3.6, 3.1], [columns - 4.2, rows - 3.3], [3.4, rows - 2.7]])
    hole = np.array([[5.5, 5.4], [8.6, 5.7], [8.1, 9.3], [5.2, 8.8]])
    keyhole = np.concatenate([outer, outer[:1], hole[::-1], hole[-1:]])
    ks = range(1, scan.shape[0] - 1)
    structures = {1: [(k, 0, 'CLOSED_PLANAR', outer) for k in ks],
                  2: [(k, 0.2, 'CLOSED_PLANAR', p) for k in ks for p in (outer, hole)],
                  3: [(k, 0, 'CLOSEDPLANAR_XOR', p) for k in ks for p in (hole, outer)],
                  4: [(k, 0, 'CLOSED_PLANAR', keyhole) for k in ks],
                  5: [(1, 0, 'POINT', hole[:1]), (1, 0, 'OPEN_PLANAR', hole)]}
    path = os.path.join(work, 'structures.dcm')
    write_structures(path, scan, structures)
    code, text, found = info(scan.folder, path)
    check(f'{scan.folder}: structures are read', code == 0, text)
    if code:
        return
    masks = {}
    for number, items in structures.items():
        masks[number] = np.zeros(scan.shape, bool)
        for k in ks:
            masks[number][k] = inside([p for at, _, kind, p in items if at == k and kind.startswith('CLOSED')], columns,
                                      rows)
    compare(f'{scan.folder}: structures', scan, found['series'][0]['labels'], masks)


def test_refusals(scan, work):
    masks = blobs(scan.shape)
    path = os.path.join(work, 'bad.dcm')

    def refused(name, expected, *words):
        code, text, _ = info(scan.folder, path)
        check(f'refused: {name}', code == expected and text.count('error:') == 1 and all(w in text for w in words),
              f'{code} {text}')

    def seg(change, **more):
        d = write_seg(path, scan, masks, **more)
        change(d)
        d.save_as(path, write_like_original=False)

    def foreign(d):
        d.FrameOfReferenceUID = generate_uid()
        del d.ReferencedSeriesSequence

    seg(lambda d: setattr(d, 'PatientID', 'SOMEBODY ELSE'))
    refused('another patient', 4, 'another patient')
    if 'FrameOfReferenceUID' in scan.files[0]:
        seg(foreign)
        refused('another space', 4, 'Frame of Reference')
    seg(lambda d: setattr(d, 'SegmentationType', 'MAYBE'))
    refused('a type that is none', 3, 'SegmentationType')
    seg(lambda d: None, kind='FRACTIONAL', bits=8)
    refused('fractions without a maximum', 3, 'MaximumFractionalValue')
    seg(lambda d: setattr(d, 'MaximumFractionalValue', 150), kind='FRACTIONAL', bits=8)
    refused('a fraction above the maximum', 4, 'MaximumFractionalValue')
    seg(lambda d: setattr(d.PerFrameFunctionalGroupsSequence[0].SegmentIdentificationSequence[0],
                          'ReferencedSegmentNumber', 9))
    refused('a frame of no segment', 3, 'segment')
    seg(lambda d: setattr(d, 'NumberOfFrames', 2000000))
    refused('too many frames', 3)
    seg(lambda d: setattr(d, 'NumberOfFrames', 1 + int(d.NumberOfFrames)))
    refused('more frames than pixels', 3, 'cut short')

    def far(d):
        for f in d.PerFrameFunctionalGroupsSequence:
            f.PlanePositionSequence[0].ImagePositionPatient = [1e4, 1e4, 1e4]

    seg(far)
    refused('another place', 4, 'does not meet')
    write_seg(path, scan, masks)
    with open(path, 'rb') as f:
        whole = f.read()
    for n in (200, len(whole) // 2, len(whole) - 40):
        with open(path, 'wb') as f:
            f.write(whole[:n])
        refused(f'cut after {n} bytes', 3)
    if scan.shape[1] >= 16:
        slanted = np.array([[2.0, 2.0], [9.0, 2.0], [9.0, 9.0]])
        write_structures(path, scan, {1: [(1, 0, 'CLOSED_PLANAR', slanted)]})
        d = pydicom.dcmread(path)
        data = [float(x) for x in d.ROIContourSequence[0].ContourSequence[0].ContourData]
        data[:3] = [f'{x:.6f}' for x in np.array(data[:3]) + 3 * scan.thickness[0] * scan.normal]
        d.ROIContourSequence[0].ContourSequence[0].ContourData = data
        d.save_as(path, write_like_original=False)
        refused('a slanted contour', 4, 'parallel')
    path = os.path.join(work, 'bad.nii.gz')
    ijk, matrix = masks[1].transpose(2, 1, 0).astype(int), affine(scan)
    for name, expected, volume, more in (
            ('dims of nothing', 3, ijk, {'dims': (0, *ijk.shape[1:])}),
            ('more voxels than there are', 3, ijk, {'dims': (30000, *ijk.shape[1:])}),
            ('a negative dim', 3, ijk, {'dims': (-4, *ijk.shape[1:])}), ('half numbers', 4, ijk * 0.5, {'code': 16}),
            ('negative numbers', 4, -ijk, {})):
        write_nifti(path, volume, matrix, **more)
        refused(name, expected)
    write_nifti(path, ijk, matrix)
    with open(path, 'rb') as f:
        whole = f.read()
    with open(path, 'wb') as f:
        f.write(whole[:len(whole) * 2 // 3])
    refused('a gzip stream cut short', 3, 'cut short')
    path = os.path.join(work, 'mask.nrrd')
    with open(path, 'w') as f:
        f.write('NRRD0004\n')
    refused('NRRD', 3, '.nii.gz')
    path = os.path.join(work, 'none')
    refused('no file', 3)


def read_frames(d):
    """Of a DICOM segmentation, by segment and position."""
    try:
        pixels = d.pixel_array.reshape(int(d.NumberOfFrames), d.Rows, d.Columns)
    except Exception:  # a class that this pydicom does not know
        pixels = np.frombuffer(d.PixelData, np.uint8)[:int(d.NumberOfFrames) * d.Rows * d.Columns]
        pixels = pixels.reshape(int(d.NumberOfFrames), d.Rows, d.Columns)
    for f, plane in zip(d.PerFrameFunctionalGroupsSequence, pixels):
        number = f.SegmentIdentificationSequence[0].ReferencedSegmentNumber if 'SegmentIdentificationSequence' in f else None
        yield number, np.array(f.PlanePositionSequence[0].ImagePositionPatient, float), plane


def shared_segmentation(folder, name, source=None):
    scan = Scan(folder)
    masks = {}
    d = pydicom.dcmread(os.path.join(folder, source or name))
    for s in d.SegmentSequence:
        if s.SegmentNumber:
            masks[s.SegmentNumber] = np.zeros(scan.shape, bool)
    for number, position, plane in read_frames(d):
        k = int(np.argmin(np.abs(scan.at - position @ scan.normal)))
        for n, mask in masks.items():
            mask[k] |= plane == n if number is None else (plane > 0) & (number == n)
    code, text, found = info(folder, os.path.join(folder, name))
    check(f'{folder} {name} is read', code == 0, text)
    if code == 0:
        labelled = [s for s in found['series'] if 'labels' in s]
        compare(f'{folder} {name}', scan, labelled[0]['labels'], masks, count_parts=False)


def shared_structures(folder, name):
    scan = Scan(folder)
    d = pydicom.dcmread(os.path.join(folder, name))
    masks = {r.ROINumber: np.zeros(scan.shape, bool) for r in d.StructureSetROISequence}
    for r in d.ROIContourSequence:
        planes = {}
        for c in r.get('ContourSequence', []):
            points = np.array(c.ContourData, float).reshape(-1, 3)
            k = int(np.argmin(np.abs(scan.at - points[0] @ scan.normal)))
            offset = points - scan.position[k]
            planes.setdefault(k, []).append(np.stack([offset @ scan.row / scan.spacing[1],
                                                      offset @ scan.column / scan.spacing[0]], axis=1))
        for k, polygons in planes.items():
            masks[r.ReferencedROINumber][k] = inside(polygons, scan.shape[2], scan.shape[1])
    code, text, found = info(folder, os.path.join(folder, name))
    check(f'{folder} {name} is read', code == 0, text)
    if code == 0:
        compare(f'{folder} {name}', scan, found['series'][0]['labels'], masks)


def shared_nifti(folder, path):
    scan = Scan(folder)
    with gzip.open(path) as f:
        data = f.read()
    dims, (code,) = struct.unpack('<8h', data[40:56]), struct.unpack('<h', data[70:72])
    kind = {2: 'u1', 4: '<i2', 512: '<u2', 16: '<f4', 64: '<f8'}[code]
    offset = int(struct.unpack('<f', data[108:112])[0])
    volume = np.frombuffer(data, kind, dims[1] * dims[2] * dims[3], offset).reshape(dims[3], dims[2], dims[1])
    matrix = np.array(struct.unpack('<12f', data[280:328])).reshape(3, 4)
    lps = np.diag([-1, -1, 1]) @ matrix
    rotation = np.linalg.inv(lps[:, :3])
    origin = rotation @ (scan.position[0] - lps[:, 3])
    steps = [rotation @ (scan.row * scan.spacing[1]), rotation @ (scan.column * scan.spacing[0])]
    j, i = np.meshgrid(*(np.arange(n) for n in scan.shape[1:]), indexing='ij')
    numbers = np.empty(scan.shape, kind)
    for k in range(scan.shape[0]):
        shift = rotation @ (scan.position[k] - scan.position[0])
        at = [np.rint(origin[a] + i * steps[0][a] + j * steps[1][a] + shift[a]).astype(int) for a in range(3)]
        numbers[k] = volume[at[2], at[1], at[0]]
    masks = {int(n): boxed(numbers == n) for n in np.unique(numbers) if n}
    code, text, found = info(folder, path)
    check(f'{path} is read', code == 0, text)
    if code == 0:
        compare(path, scan, found['series'][0]['labels'], masks, count_parts=False)


def main():
    for name in ('oblique', 'feet-first', 'tilted', 'uneven'):
        scan = Scan(os.path.join(ROOT, 'testdata', 'geometry', name))
        with tempfile.TemporaryDirectory() as work:
            test_segmentations(scan, work)
            test_structures(scan, work)
            if name != 'uneven':
                test_nifti(scan, work)
            if name == 'feet-first':
                test_names(scan, work)
                test_places(scan, work)
                test_batch(scan, work)
                test_refusals(scan, work)
    folder = os.path.join(SHARED, 'labels')
    if os.path.isdir(folder):
        for name in ('liver', 'liver_rle', 'liver_deflate', 'liver_j2k'):
            shared_segmentation(os.path.join(folder, 'liver'), name + '.dcm', 'liver.dcm')
        for name in ('binary', 'labelmap'):
            shared_segmentation(os.path.join(folder, 'labelmap'), name + '.dcm')
        shared_structures(os.path.join(folder, 'two-slices'), 'rtstruct.dcm')
        shared_nifti(os.path.join(SHARED, 'body-j2k'), os.path.join(folder, 'body-j2k', '31-organs.nii.gz'))
    else:
        print('SKIP: the shared samples are not here')
    print(f'{n_checks} checks, {len(failures)} failures')
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
