#!/usr/bin/env python3
"""Label files that were drawn wrongly in silence: label_rules.py CTSPLAT SOURCE_ROOT

Structure sets with equal numbers, other frames of reference, slanted and overlapping contours; segmentations whose frames
begin at bytes, that name another series, or have a palette. Exit 77 where numpy or pydicom is missing."""
import copy
import os
import subprocess
import sys
import tempfile

from labels_numpy import (CTSPLAT, ROOT, Dataset, Scan, Sequence, check, failures, generate_uid, info, inside, np, write_seg,
                          write_structures)

# Transparent, so that labels within the head are visible.
GLASS = '{"name": "glass", "points": [{"hu": -200, "rgb": [1, 1, 1], "opacity": 0.01}]}'
FOREIGN = '2.25.4711'


def square(low, high):
    return np.array([[low[0], low[1]], [high[0], low[1]], [high[0], high[1]], [low[0], high[1]]], float)


def drawn(scan, path, name, expected, *said):
    """expected: voxels by name; said: what the findings have; none: there are no new ones."""
    code, text, found = info(scan.folder, path)
    if code:
        check(name, False, text)
        return
    series = found['series'][0]
    got = [(label['name'], label['voxels']) for label in series['labels']]
    check(f'{name}: voxels', got == expected, f'expected {expected}, actual {got}')
    texts = [f['text'] for f in series['findings'] if f['code'].startswith('label_') and f['code'] != 'label_in_air']
    check(f'{name}: findings', bool(texts) == bool(said) and all(w in str(texts) for w in said), f'expected {said}, actual {texts}')


def refused(scan, path, name, *said):
    code, text, found = info(scan.folder, path)
    check(f'{name}: refused', code in (3, 4) and text.count('error:') == 1 and all(w in text for w in said),
          f'expected {said}, actual {code} {text}{found["series"][0]["labels"] if found else ""}')


def shown(scan, path, names):
    run = subprocess.run([CTSPLAT, 'render', scan.folder, '--labels', path, '--show', names, '--size', '8x8', '-o', '-',
                          '--format', 'png'], capture_output=True)
    return run.returncode, run.stderr.decode()


def count(scan, *polygons):
    return int(inside(polygons, *scan.shape[:0:-1]).sum())


def test_numbers(scan, path):
    heart, tumour = square((1.5, 1.5), (8.5, 8.5)), square((10.5, 10.5), (12.5, 13.5))
    d = write_structures(path, scan, {1: [(1, 0, 'CLOSED_PLANAR', heart)], 2: [(1, 0, 'CLOSED_PLANAR', tumour)],
                                      3: [(2, 0, 'CLOSED_PLANAR', heart)]})
    for item in (d.StructureSetROISequence[2], d.ROIContourSequence[2]):
        setattr(item, 'ROINumber' if 'ROINumber' in item else 'ReferencedROINumber', 2)
    d.ROIContourSequence[2].ContourSequence = []
    d.ROIContourSequence[0], d.ROIContourSequence[1] = d.ROIContourSequence[1], d.ROIContourSequence[0]
    d.save_as(path)
    drawn(scan, path, 'equal numbers', [('roi 1', 49), ('roi 2', 6), ('roi 3', 0)])
    del d.ROIContourSequence[2]
    d.save_as(path)
    refused(scan, path, 'equal numbers, one list', 'roi 2', 'roi 3', 'ROINumber')


def with_frames(scan, path, frames, listed):
    """Structures of these frames of reference; listed: those of the set, each with the series or not."""
    d = write_structures(path, scan, {n + 1: [(1, 0, 'CLOSED_PLANAR', square((1.5, 1.5), (3.5 + n, 3.5)))]
                                      for n in range(len(frames))})
    for roi, uid in zip(d.StructureSetROISequence, frames):
        roi.ReferencedFrameOfReferenceUID = uid
    d.ReferencedFrameOfReferenceSequence = []
    for uid, names in listed:
        frame, study, series = Dataset(), Dataset(), Dataset()
        series.SeriesInstanceUID = scan.files[0].SeriesInstanceUID if names else generate_uid()
        study.RTReferencedSeriesSequence = Sequence([series])
        frame.FrameOfReferenceUID, frame.RTReferencedStudySequence = uid, Sequence([study])
        d.ReferencedFrameOfReferenceSequence.append(frame)
    d.save_as(path)
    return d


def test_frames(scan, path):
    own = scan.files[0].FrameOfReferenceUID
    for name, listed in (('first', ((own, True), (FOREIGN, False))), ('second', ((FOREIGN, False), (own, True))),
                         ('alone', ((own, True),)), ('copied', ((own, True), (FOREIGN, True))), ('unlisted', ())):
        with_frames(scan, path, (own, FOREIGN), listed)
        drawn(scan, path, f'frames: own {name}', [('roi 1', 4)], 'roi 2 is left out', FOREIGN)
        for names, status in (('roi 2', 4), ('ROI*2', 4), ('roi 2,rest', 0), ('roi 1,roi 2', 0), ('roi 1', 0), ('2', 4),
                              ('roi 2,roi 7', 2)):
            code, text = shown(scan, path, names)
            check(f'frames: own {name}: --show {names}', code == status and (code != 4 or FOREIGN in text),
                  f'expected {status}, actual {code} {text}')
    with_frames(scan, path, (FOREIGN,), ((own, True), (FOREIGN, False)))
    refused(scan, path, 'frames: another alone', 'roi 1', FOREIGN)
    with_frames(scan, path, (FOREIGN, '2.25.4712'), ((FOREIGN, True), ('2.25.4712', False)))
    drawn(scan, path, 'frames: named', [('roi 1', 4)], 'but it names the series', 'roi 2 is left out')
    with_frames(scan, path, (FOREIGN,), ((FOREIGN, True),))
    drawn(scan, path, 'frames: one, invented', [('roi 1', 4)], FOREIGN, 'names the series')
    with_frames(scan, path, (own,), ((own, True),))
    drawn(scan, path, 'frames: own', [('roi 1', 4)])


def test_slanted(scan, path):
    flat = square((1.5, 1.5), (4.5, 4.5))
    d = write_structures(path, scan, {n: [(1, 0, 'CLOSED_PLANAR', flat)] for n in (1, 2)})
    corners = [scan.position[k] + 3 * scan.row * scan.spacing[1] + j * scan.column * scan.spacing[0]
               for k, j in ((0, 2), (0, 6), (2, 6), (2, 2))]
    d.ROIContourSequence[1].ContourSequence[0].ContourData = [f'{x:.6f}' for x in np.ravel(corners)]
    d.save_as(path)
    drawn(scan, path, 'sagittal planes', [('roi 1', 9)], 'roi 2 is left out', 'not parallel')
    code, text = shown(scan, path, 'roi 2')
    check('sagittal planes: alone', code == 4 and 'not parallel' in text, f'{code} {text}')


def test_overlaps(scan, path):
    a, b, hole = square((1.5, 1.5), (8.5, 8.5)), square((5.5, 4.5), (12.5, 6.5)), square((2.5, 2.5), (4.5, 7.5))
    c, d = square((1.5, 1.5), (8.5, 8.5)), square((5.5, 1.5), (12.5, 8.5))  # edges on one line
    island, touching = square((2.6, 3.5), (3.5, 5.5)), square((1.5, 3.5), (4.5, 5.5))
    union = 49 + 14 - 6
    cases = {'crossing': ((a, b), union), 'crossing, turned': ((b[::-1], a), union), 'cross': ((a, square((0.5, 3.5), (12.5, 4.5))), 49 + 5),
             'edges on one line': ((c, d), 77), 'twice': ((a, a), 49), 'thrice': ((a, a, a), 49),
             'twice, from another corner': ((a, np.roll(a, 1, axis=0)[::-1]), 49), 'twice, closed': ((a, np.vstack((a, a[:1]))), 49),
             'twice, rounded': ((a, a + 0.001 * np.array([[1, -1], [-1, 1], [1, 1], [-1, -1]])), 49), 'nested': ((a, hole), 49 - 10),
             'nested, twice each': ((a, hole, hole, a), 39), 'hole at the edge': ((a, touching), 49 - 6),
             'crossing with a hole': ((a, hole, b), union - 10), 'island in a hole': ((hole, island, a), 39 + 2),
             'side by side': ((a, square((8.5, 1.5), (9.5, 8.5))), 56), 'apart': ((a, square((9.5, 1.5), (10.5, 8.5))), 56),
             'a voxel, twice': ((square((2.8, 2.8), (3.2, 3.2)),) * 2, 1)}
    for name, (polygons, expected) in cases.items():
        write_structures(path, scan, {1: [(1, 0, 'CLOSED_PLANAR', p) for p in polygons]})
        drawn(scan, path, f'contours: {name}', [('roi 1', expected)])
    for name, polygons in (('crossing', (a, b)), ('nested', (a, hole))):
        write_structures(path, scan, {1: [(1, 0, 'CLOSEDPLANAR_XOR', p) for p in polygons]})
        drawn(scan, path, f'contours, XOR: {name}', [('roi 1', count(scan, *polygons))])


def test_layouts(scan, path):
    """Frames of bits that are no multiple of 8."""
    small = copy.copy(scan)

    def bits(groups):
        return b''.join(np.packbits(np.concatenate([masks[n][k].ravel() for n, k in group]), bitorder='little').tobytes()
                        for group in groups)

    def write(data):
        d = write_seg(path, small, masks, keep_empty=True)
        d.PerFrameFunctionalGroupsSequence = Sequence(
            sorted(d.PerFrameFunctionalGroupsSequence, key=lambda f: (
                f.SegmentIdentificationSequence[0].ReferencedSegmentNumber,
                np.dot(f.PlanePositionSequence[0].ImagePositionPatient, scan.normal))))
        d.PixelData = data + b'\0' * (len(data) % 2)
        d.save_as(path)

    # With 7 frames of 7 bits to a segment, each layout but the standard's takes 21 bytes.
    for small.shape in ((scan.shape[0], 7, 9), (7, 1, 7)):
        masks = {n: np.random.default_rng(n).random(small.shape) < 0.3 for n in (1, 2, 3)}
        expected = [(f'segment {n}', int(m.sum())) for n, m in masks.items()]
        planes = [(n, k) for n in masks for k in range(small.shape[0])]
        for name, groups in (('packed', [planes]), ('each frame at a byte', [[p] for p in planes]),
                             ('each segment at a byte', [[p for p in planes if p[0] == n] for n in masks])):
            write(bits(groups))
            if small.shape[1] > 1 or name == 'packed':
                drawn(scan, path, f'layout: {name}', expected)
            else:
                refused(scan, path, f'layout: {name}, or another', 'ambiguous')
        write(bits([planes]) + b'\0' * 20)
        refused(scan, path, 'layout: unknown', 'ambiguous')


def test_series(scan, path):
    masks = {1: np.zeros(scan.shape, bool)}
    masks[1][1, 2:5, 2:5] = True
    for make in (lambda: write_seg(path, scan, masks),
                 lambda: write_structures(path, scan, {1: [(1, 0, 'CLOSED_PLANAR', square((1.5, 1.5), (4.5, 4.5)))]})):
        for name, said in (('own', None), ('other', 'names another series'), ('none', 'names no series'), ('slice', None),
                           ('other slice', 'names another series'), ('study', 'names no series')):
            d = make()
            what, items = d.Modality, d.ReferencedSeriesSequence
            label = 'segment 1' if what == 'SEG' else 'roi 1'
            d.FrameOfReferenceUID = ''
            reference = Dataset()
            reference.ReferencedSOPClassUID = '1.2.840.10008.5.1.4.1.1.2' if name != 'study' else '1.2.840.10008.3.1.2.3.1'
            reference.ReferencedSOPInstanceUID = scan.files[1].SOPInstanceUID if name == 'slice' else generate_uid()
            if name == 'other':
                items[0].SeriesInstanceUID = generate_uid()
            elif name != 'own':
                del d.ReferencedSeriesSequence
                if name != 'none':
                    d.SourceImageSequence = [reference]
            d.save_as(path)
            if name.startswith('other'):
                refused(scan, path, f'{what} without frame of reference, {name}', said)
            else:
                drawn(scan, path, f'{what} without frame of reference, {name}', [(label, 9)], *([said] if said else []))


def pictures_equal(scan, path, *lists):
    made = []
    for words in lists:
        run = subprocess.run([CTSPLAT, 'render', scan.folder, '--labels', path, '--size', '32x32', '-o', '-', '--format', 'png', '-p', GLASS,
                              *words], capture_output=True)
        made.append(run.stdout or run.stderr)
    return all(p == made[0] for p in made)


def test_palette(scan, path):
    masks = {n: np.zeros(scan.shape, bool) for n in (1, 2)}
    masks[1][20:28, 20:40, 20:30] = masks[2][20:28, 20:40, 32:40] = True
    colours = {0: (0, 0, 0), 1: (255, 0, 0), 2: (0, 128, 255)}
    asked = ['--label', '1=#ff0000', '--label', '2=#0080ff']
    for bits, first, words in ((16, 0, True), (8, 0, False), (8, 1, True), (8, 1, False)):
        d = write_seg(path, scan, masks, kind='LABELMAP', bits=8)
        d.PhotometricInterpretation = 'PALETTE COLOR'
        for c, name in enumerate(('Red', 'Green', 'Blue')):
            entries = [colours[n][c] * (257 if bits == 16 else 1) for n in colours if n >= first]
            setattr(d, name + 'PaletteColorLookupTableDescriptor', [len(entries), first, bits])
            data = np.array(entries, '<u2' if words else 'u1').tobytes()
            setattr(d, name + 'PaletteColorLookupTableData', data + b'\0' * (len(data) % 2))
        d.save_as(path)
        name = f'palette of {bits} bits from {first} on'
        check(name, pictures_equal(scan, path, ['--label-colours'], asked) and
              not pictures_equal(scan, path, ['--label-colours'], []), 'the pictures differ')
    for segment in d.SegmentSequence:
        segment.RecommendedDisplayCIELabValue = [65535, 32896, 32896]
    d.save_as(path)
    check('palette: CIELab comes first', not pictures_equal(scan, path, ['--label-colours'], asked), 'the palette is taken')


def main():
    scan = Scan(os.path.join(ROOT, 'testdata/phantom'))
    for test in (test_numbers, test_frames, test_slanted, test_overlaps, test_layouts, test_series, test_palette):
        with tempfile.TemporaryDirectory() as work:
            test(scan, os.path.join(work, 'labels.dcm'))
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
