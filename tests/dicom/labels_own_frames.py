#!/usr/bin/env python3
"""Labels of slices each of which has a frame of reference of its own: labels_own_frames.py CTSPLAT SOURCE_ROOT

They must name the slices. Exit 77 where numpy or pydicom is missing."""
import os
import sys
import tempfile

from labels_numpy import Dataset, ROOT, Scan, Sequence, blobs, check, compare, failures, info, pydicom, write_seg


def main():
    with tempfile.TemporaryDirectory() as work:
        source, folder = os.path.join(ROOT, 'testdata', 'phantom'), os.path.join(work, 'ct')
        os.mkdir(folder)
        for k, name in enumerate(sorted(os.listdir(source))):
            d = pydicom.dcmread(os.path.join(source, name))
            d.FrameOfReferenceUID = f'2.25.{k + 1}'
            d.save_as(os.path.join(folder, name))
        scan, path = Scan(folder), os.path.join(work, 'seg.dcm')
        masks = blobs(scan.shape)
        d = write_seg(path, scan, masks)
        code, err, _ = info(folder, path)
        check('names the series alone', code == 4 and "names none of the series' slices" in err, err)
        slice_named = Dataset()
        slice_named.ReferencedSOPInstanceUID = scan.files[3].SOPInstanceUID
        d.ReferencedSeriesSequence[0].ReferencedInstanceSequence = Sequence([slice_named])
        d.save_as(path, write_like_original=False)
        code, err, found = info(folder, path)
        check('names a slice', code == 0, err)
        if not code:
            compare('names a slice', scan, found['series'][0]['labels'], masks)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
