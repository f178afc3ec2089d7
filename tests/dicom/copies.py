#!/usr/bin/env python3
"""A series beside its lossless copies in one folder: copies.py CTSPLAT SOURCE_ROOT

The phantom's slices and copies of them in other encodings, under UIDs before and after theirs: the volume is the
phantom's, and segmentations of either fit. Exit 77 where numpy or pydicom is missing."""
import copy
import json
import os
import shutil
import subprocess
import sys
import tempfile

from labels_numpy import CTSPLAT, ROOT, check, failures, np, pydicom
from nifti_volume import run

N_SLICES = 12 # of the middle


def rescaled(d, slope, intercept):
    """The same HU by another slope and intercept, unsigned."""
    hu = np.maximum(d.pixel_array.astype(int), -1024)
    d.PixelData = np.rint((hu - intercept) / slope).astype('<u2').tobytes()
    d.PixelRepresentation, d.RescaleSlope, d.RescaleIntercept = 0, slope, intercept


def with_padding(d, named):
    """Corners of -2000, which is padding only where it is named."""
    words = d.pixel_array.copy()
    words[:8, :8] = -2000
    d.PixelData = words.tobytes()
    if named:
        d.add_new(0x00280120, 'SS', -2000)


def packed(*tool):
    def change(path):
        if shutil.which(tool[0]):
            subprocess.run([*tool, path, path + '.new'], check=True)
            os.replace(path + '.new', path)
    return change


# Changes of the original, of the copy, and of the copy's file.
KINDS = {
    'intercept': (None, lambda d: rescaled(d, 1, -1024), None),
    'slope': (None, lambda d: rescaled(d, 0.25, -2048), None),
    'padding': (lambda d: with_padding(d, True), lambda d: with_padding(d, False), None),
    'rle': (None, None, packed('dcmcrle')),
    'jpeg-ls': (None, None, packed('dcmcjpls')),
    'jpeg-2000': (None, None, packed('gdcmconv', '--j2k')),
    'rle and slope': (None, lambda d: rescaled(d, 0.5, -1024), packed('dcmcrle')),
}


def write(folder, slices, change, pack, uid=None):
    """Returns the UIDs. uid(k): of the k-th slice."""
    os.makedirs(folder, exist_ok=True)
    for k, original in enumerate(slices):
        d = copy.deepcopy(original)
        if change:
            change(d)
        if uid:
            d.SOPInstanceUID = d.file_meta.MediaStorageSOPInstanceUID = uid(k)
        path = os.path.join(folder, f'{"copy" if uid else "slice"}{k}.dcm')
        d.save_as(path)
        if pack:
            pack(path)


def copy_uid(k):
    return f'2.{1 if k % 2 else 9}.{k}' # before and after the originals' 2.25...


def series_of(*words):
    done = run('info', *words, '--json')
    return json.loads(done.stdout)['series'] if done.returncode == 0 else [{'fault': done.stderr}]


def picture_of(folder):
    out = folder + '.png'
    done = None if os.path.exists(out) else run('render', folder, '--size', '32x32', '--mode', 'average', '-o', out)
    check(f'render {folder}', not done or done.returncode == 0, done and done.stderr)
    return open(out, 'rb').read() if os.path.exists(out) else None


def test_kind(kind, slices, work):
    first, second, pack = KINDS[kind]
    alone, both = os.path.join(work, 'padded' if first else 'plain'), os.path.join(work, kind, 'both')
    write(both, slices, first, None)
    write(both, slices, second, pack, copy_uid)
    found = series_of(both)
    check(f'{kind}: one series of {N_SLICES} slices', [s.get('slices') for s in found] == [N_SLICES], found)
    texts = [f['text'] for f in found[0].get('findings', []) if f['code'] == 'copies_dropped']
    check(f'{kind}: copies are counted', len(texts) == 1 and texts[0].startswith(f'{N_SLICES} slices'), found)
    if not os.path.exists(alone):
        write(alone, slices, first, None)
    check(f'{kind}: the picture is the one without copies', picture_of(both) == picture_of(alone) != None)


def test_labels(slices, work):
    """A segmentation of another frame of reference that names slices: the ones that stay, or the ones that do not."""
    both = os.path.join(work, 'labels', 'both')
    write(both, slices, None, None)
    write(both, slices, lambda d: rescaled(d, 1, -1024), None, copy_uid)
    kinds = {'originals': ([s.SOPInstanceUID for s in slices], True),
             'copies': ([copy_uid(k) for k in range(len(slices))], True), 'strangers': (['2.7.1'], False)}
    for kind, (uids, fits) in kinds.items():
        for uid in uids[:2]: # of which one stays and one does not
            d = pydicom.dcmread(os.path.join(ROOT, 'testdata/fuzz/labels/binary'))
            named, series = pydicom.Dataset(), pydicom.Dataset()
            named.ReferencedSOPInstanceUID = uid
            series.ReferencedInstanceSequence = pydicom.Sequence([named])
            d.ReferencedSeriesSequence = pydicom.Sequence([series])
            d.FrameOfReferenceUID = '2.7.2'
            path = os.path.join(work, 'labels', kind)
            d.save_as(path)
            found = series_of(both, '--labels', path)
            check(f'labels of {kind}: fit', ('labels' in found[0]) == fits, (uid, found))


def test_no_copy(slices, work):
    """One HU more in one pixel of each slice is another picture."""
    def brighter(d):
        rescaled(d, 1, -1024)
        words = np.frombuffer(d.PixelData, '<u2').copy()
        words[2000] += 1
        d.PixelData = words.tobytes()
    folder = os.path.join(work, 'others')
    write(folder, slices, None, None)
    write(folder, slices, brighter, None, copy_uid)
    found = series_of(folder)
    check('other pixels: refused', not found[0].get('renderable', True) and 'lie at one position' in json.dumps(found), found)


def main():
    folder = os.path.join(ROOT, 'testdata/phantom')
    slices = [pydicom.dcmread(os.path.join(folder, name)) for name in sorted(os.listdir(folder))[18:18 + N_SLICES]]
    with tempfile.TemporaryDirectory() as work:
        for kind in KINDS:
            test_kind(kind, slices, work)
        test_labels(slices, work)
        test_no_copy(slices, work)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
