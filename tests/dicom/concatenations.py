#!/usr/bin/env python3
"""Enhanced CT cut into the objects of a concatenation: concatenations.py CTSPLAT SOURCE_ROOT

Of the phantom such objects are made here; where parts are missing they are named. Exit 77 where numpy or pydicom is
missing."""
import os
import sys
import tempfile

from labels_numpy import Dataset, FileDataset, FileMetaDataset, ROOT, Scan, Sequence, check, failures, generate_uid
from nifti_volume import picture, run

ENHANCED = '1.2.840.10008.5.1.4.1.1.2.1'


def item(**more):
    d = Dataset()
    for key, value in more.items():
        setattr(d, key, value)
    return Sequence([d])


def frame_of(ct, number):
    d = Dataset()
    d.PlanePositionSequence = item(ImagePositionPatient=ct.ImagePositionPatient)
    d.PlaneOrientationSequence = item(ImageOrientationPatient=ct.ImageOrientationPatient)
    d.PixelMeasuresSequence = item(PixelSpacing=ct.PixelSpacing, SliceThickness=ct.SliceThickness)
    d.PixelValueTransformationSequence = item(RescaleSlope=ct.RescaleSlope, RescaleIntercept=ct.RescaleIntercept,
                                              RescaleType='HU')
    d.FrameContentSequence = item(StackID='1', InStackPositionNumber=number)
    return d


def write_part(path, slices, first, **more):
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = ENHANCED, generate_uid()
    meta.TransferSyntaxUID = '1.2.840.10008.1.2.1'
    d = FileDataset(None, {}, file_meta=meta, preamble=b'\0' * 128)
    d.is_little_endian, d.is_implicit_VR = True, False
    ct = slices[0]
    d.SOPClassUID, d.SOPInstanceUID, d.Modality = ENHANCED, meta.MediaStorageSOPInstanceUID, 'CT'
    for key in ('PatientID', 'StudyInstanceUID', 'FrameOfReferenceUID', 'Rows', 'Columns', 'BitsAllocated', 'BitsStored',
                'HighBit', 'PixelRepresentation', 'SamplesPerPixel', 'PhotometricInterpretation'):
        setattr(d, key, getattr(ct, key))
    d.SeriesInstanceUID, d.ImageType = '2.25.7', ['ORIGINAL', 'PRIMARY', 'AXIAL', 'NONE']
    d.NumberOfFrames, d.InstanceNumber = len(slices), 1
    d.SharedFunctionalGroupsSequence = Sequence([Dataset()])
    d.PerFrameFunctionalGroupsSequence = Sequence([frame_of(s, first + 1 + k) for k, s in enumerate(slices)])
    for key, value in more.items():
        setattr(d, key, value)
    d.PixelData = b''.join(s.PixelData for s in slices)
    d['PixelData'].VR = 'OW'
    d.save_as(path, write_like_original=False)


def write(folder, slices, cuts, parts, total=True, numbers=True, offsets=True):
    """The parts (from 1) of what is cut before these frames."""
    os.makedirs(folder)
    bounds = [0, *cuts, len(slices)]
    for p in parts:
        more = {'ConcatenationUID': '2.25.8'} if numbers else {}
        if numbers:
            more['InConcatenationNumber'] = p
        if total:
            more['InConcatenationTotalNumber'] = len(cuts) + 1
        if offsets:
            more['ConcatenationFrameOffsetNumber'] = bounds[p - 1]
        write_part(os.path.join(folder, f'part{p}.dcm'), slices[bounds[p - 1]:bounds[p]], bounds[p - 1], **more)


def main():
    scan = Scan(os.path.join(ROOT, 'testdata', 'phantom'))
    expected = None
    cuts = (16, 32)
    cases = {  # the parts, their numbering; the message, and whether it is refused
        'whole': ((1, 2, 3), {}, None, False),
        'whole, without a total': ((1, 2, 3), {'total': False}, None, False),
        'whole, without offsets': ((1, 2, 3), {'offsets': False}, None, False),
        'whole, by offsets alone': ((1, 2, 3), {'total': False, 'numbers': False}, None, False),
        'no first part': ((2, 3), {}, 'part 1 of 3, frames 1 to 16 of a concatenation', False),
        'no last part': ((1, 2), {}, 'part 3 of 3 of a concatenation', False),
        'no middle part': ((1, 3), {}, 'part 2 of 3, frames 17 to 32', True),
        'one alone': ((2,), {}, 'part 1, 3 of 3, frames 1 to 16', False),
        'no middle part, without a total': ((1, 3), {'total': False}, 'part 2, frames 17 to 32', True),
        'no middle part, without offsets': ((1, 3), {'offsets': False}, 'part 2 of 3', True),
        'no first part, without offsets': ((2, 3), {'offsets': False, 'total': False}, 'part 1 of', False),
        'no middle part, by offsets alone': ((1, 3), {'total': False, 'numbers': False}, 'frames 17 to 32', True),
        'an offset alone': ((3,), {'total': False, 'numbers': False}, 'frames 1 to 32', False),
        'an end without total': ((1, 2), {'total': False}, None, False),
    }
    with tempfile.TemporaryDirectory() as work:
        for n, (name, (parts, how, words, refused)) in enumerate(cases.items()):
            folder = os.path.join(work, str(n))
            write(folder, scan.files, cuts, parts, **how)
            out = os.path.join(work, 'out.png')
            done = run('render', folder, '-o', out, '--force', '--size', '40x40')
            check(f'{name}: exit', done.returncode == (4 if refused else 0), done.stderr)
            check(f'{name}: finding', (words or '') in done.stderr and bool(words) == ('concatenation' in done.stderr),
                  done.stderr)
            if name.startswith('whole'):
                found = picture(folder, work)
                expected = expected or picture(scan.folder, work)
                check(f'{name}: the same picture', found == expected, found if isinstance(found, str) else '')
            if refused:
                done = run('render', folder, '-o', out, '--force', '--size', '40x40', '--allow-missing-slices')
                check(f'{name}: allowed', done.returncode == 0 and words in done.stderr, done.stderr)
            if words:
                done = run('info', folder, '--json', '--allow-missing-slices')
                check(f'{name}: info', done.stdout.count('"concatenation_incomplete"') == 1, done.stdout)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
