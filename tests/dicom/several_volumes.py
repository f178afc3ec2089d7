#!/usr/bin/env python3
"""Series whose slices belong to several volumes, by an attribute: several_volumes.py CTSPLAT SOURCE_ROOT

Of the phantom's slices series are made; each volume is the picture of its slices alone. Exit 77 where numpy or pydicom
is missing."""
import copy
import json
import os
import sys
import tempfile

from concatenations import frame_of, item, write_part
from labels_numpy import ROOT, Scan, Sequence, check, failures, generate_uid
from nifti_volume import picture, run

AT_PLACE = 'several slices with different pixels lie at one position'


def two_scans(step, first_mm, n_thin=40, without=()):
    """Of 48 slices: n_thin of 1 mm, the others of 5 mm, `step` apart from first_mm on."""
    return (lambda k: 1 if k < n_thin else 5,
            lambda k: None if k in without else float(k) if k < n_thin else first_mm + step * (k - n_thin))


# Thickness and position (None: not there) of slice k; the slices of the volumes, or the refusal; a warning's code.
THICKNESSES = {
    'in turn': (lambda k: (1, 5)[k % 2], None, [24, 24], None),
    'three in turn': (lambda k: (0.6, 1.5, 5)[k % 3], None, [16, 16, 16], None),
    'numbered on at other places': (*two_scans(5, 0.4), [40, 8], None),
    'ranges that overlap in part': (*two_scans(5, 20.5, 30), [30, 18], None),
    'thin ones around a thick one': (*two_scans(5, -98.6, 4), [44, 4], None),
    'thin ones within one gap': (*two_scans(5, -101.5, 4), [44, 4], None),
    'two thick ones as blocks': (lambda k: 7 if k in (20, 40) else 4, lambda k: 4. * k + 3 * (k > 20) + 3 * (k > 40), [48], None),
    'a slice is missing': (*two_scans(5, 0.4, without=[17]), [39, 8], 'missing_slices'),
    'one after the other': (lambda k: 4 if k < 24 else 7, None, [48], None),
    'a block within another': (lambda k: 5 if 10 < k < 20 else 4, None, [48], None),
    'blocks in turn': (lambda k: (4, 7)[k // 6 % 2], None, [48], None),
    'within 10 %': (lambda k: (4.5, 4.9)[k % 2], None, [48], None),
    'one is not known': (lambda k: None if k == 7 else (1, 5)[k % 2], None, [48], None),
    'a few are wrong': (lambda k: 3 if k in (5, 20, 33) else 4.5, None, [48], None),
    'without order': (lambda k: (4, 7)[k * k % 7 > 2], None, [48], None),
    'at the same positions': (*two_scans(5, 0.0), AT_PLACE, None),
}


def write(folder, slices, change):
    """change(d, k) of copies; False: left out."""
    os.makedirs(folder)
    for k, original in enumerate(slices):
        d = copy.deepcopy(original)
        d.SOPInstanceUID = d.file_meta.MediaStorageSOPInstanceUID = generate_uid()
        if change(d, k) is not False:
            d.save_as(os.path.join(folder, f'{k:03}.dcm'), write_like_original=False)


def series_of(folder):
    done = run('info', folder, '--json')
    return json.loads(done.stdout)['series']


def expect(name, folder, expected, warning=None, by=None):
    found = series_of(folder)
    if isinstance(expected, str):
        return check(f'{name}: refused', len(found) == 1 and expected in json.dumps(found[0]), json.dumps(found))
    codes = {d['code'] for s in found for d in s['findings']}
    several = {'several_volumes', 'acquisitions_parted'} if len(expected) > 1 else set()
    several |= {'two_slices'} if 2 in expected else set()
    check(f'{name}: volumes', sorted((s['slices'] for s in found), reverse=True) == sorted(expected, reverse=True) and
          all(s['renderable'] for s in found), json.dumps(found))
    check(f'{name}: warnings', codes - {'unequal_spacing', 'slice_off_neighbours', 'order_conflict'} == several | ({warning} if warning else set()), str(codes))
    check(f'{name}: numbers of slices', ('of unequal numbers of slices' in json.dumps(found)) == (len(set(expected)) > 1), json.dumps(found))
    check(f'{name}: attribute', not by or all(by in json.dumps(s) for s in found), json.dumps(found))


def test_thickness(scan, work):
    for n, (name, (thickness, position, expected, warning)) in enumerate(THICKNESSES.items()):
        def change(d, k, only=None):
            at = position(k) if position else 4.5 * k
            if at is None or (only is not None and thickness(k) != only):
                return False
            d.SliceThickness, d.ImagePositionPatient = thickness(k), [-100, -100, at]
            return True
        folder = os.path.join(work, f'thickness{n}')
        write(folder, scan.files, change)
        expect(name, folder, expected, warning, 'SliceThickness (0018,0050)' if len(expected) in (2, 3) else None)
        if n < 3:
            for p, only in enumerate(sorted({thickness(k) for k in range(48)})):
                write(f'{folder}-{p}', scan.files, lambda d, k: change(d, k, only))
                uid = scan.files[0].SeriesInstanceUID
                check(f'{name}: picture {p + 1}', picture(folder, work, '--series', f'{uid}#{p + 1}') ==
                      picture(f'{folder}-{p}', work), '')


def test_many(scan, work):
    """Two slices of each of 70 phases."""
    ways = {'AcquisitionNumber': lambda p: p, 'ConvolutionKernel': lambda p: f'K{p}'}
    for keyword, value in ways.items():
        def change(d, k):
            d.AcquisitionNumber = 1
            d.RescaleIntercept, d.ImagePositionPatient = -1024 + k // 2, [-100, -100, 4.5 * (k % 2)]
            setattr(d, keyword, value(k // 2))
        folder = os.path.join(work, keyword)
        write(folder, scan.files[20:22] * 70, change)
        expect(f'70 of {keyword}', folder, [2] * 70, by=keyword)


def test_phases(scan, work):
    """Percentages of the cardiac cycle: a number of VR FL, in slices and in frames."""
    percent = (40, 75, 110)
    slices = [copy.deepcopy(d) for d in scan.files[20:28] * 3]
    for k, d in enumerate(slices):
        d.NominalPercentageOfCardiacPhase, d.RescaleIntercept = percent[k // 8], -1024 + 100 * (k // 8)
    for name, syntax in ('explicit', '1.2.840.10008.1.2.1'), ('implicit', '1.2.840.10008.1.2'):
        def change(d, k):
            d.file_meta.TransferSyntaxUID, d.is_implicit_VR = syntax, name == 'implicit'
        write(os.path.join(work, name), slices, change)
        expect(f'phases, {name} VR', os.path.join(work, name), [8] * 3, by='NominalPercentageOfCardiacPhase')
    frames = [frame_of(d, 1 + k % 8) for k, d in enumerate(slices)]
    for k, frame in enumerate(frames):
        frame.CardiacSynchronizationSequence = item(NominalPercentageOfCardiacPhase=percent[k // 8])
    os.makedirs(os.path.join(work, 'frames'))
    write_part(os.path.join(work, 'frames', '1.dcm'), slices, 0, PerFrameFunctionalGroupsSequence=Sequence(frames))
    expect('phases of frames', os.path.join(work, 'frames'), [8] * 3, by='NominalPercentageOfCardiacPhase')


def test_kernels(scan, work):
    """Two kernels at nearly the same positions, and in turn."""
    for offset_mm in 0.01, 2.25:
        def change(d, k):
            d.ConvolutionKernel = 'SHARP' if k < 24 else 'SOFT'
            d.RescaleIntercept, d.ImagePositionPatient = -1024 + k // 24, [-100, -100, 4.5 * (k % 24) + offset_mm * (k // 24)]
        folder = os.path.join(work, f'kernel{offset_mm}')
        write(folder, scan.files[:24] * 2, change)
        expect(f'kernels {offset_mm} mm beside each other', folder, [24, 24], by='ConvolutionKernel')
    done = run('render', folder, '--size', '16x16', '-o', os.path.join(work, 'first.png'))
    check('the first of equal volumes', done.returncode == 0 and 'the first by modality' in done.stderr and
          '#2 ' in done.stderr and 'another volume of the same series' in done.stderr, done.stderr)


def main():
    scan = Scan(os.path.join(ROOT, 'testdata', 'phantom'))
    with tempfile.TemporaryDirectory() as work:
        for test in test_thickness, test_many, test_phases, test_kernels:
            test(scan, work)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
