#!/usr/bin/env python3
"""NIfTI files whose sform and qform disagree: nifti_forms.py CTSPLAT SOURCE_ROOT

A CT with two positions is refused or causes a warning, unless an option decides; for a label map the form that
equals the CT's is used. Exit 77 where numpy or pydicom is missing."""
import os
import subprocess
import struct
import sys
import tempfile

from labels_numpy import CTSPLAT, ROOT, Scan, affine, blobs, check, failures, info, np, numbers_of, write_nifti
from nifti_volume import picture, run


def write_two(path, volume, sform, qform, codes=(1, 2), dims=None):
    """A file with both forms; codes: (qform's, sform's)."""
    write_nifti(path + '.q', volume, qform, qform=True)
    write_nifti(path, volume, sform)
    with open(path + '.q', 'rb') as f:
        other = f.read()
    os.remove(path + '.q')
    with open(path, 'rb') as f:
        head = bytearray(f.read())
    head[76:108], head[256:280] = other[76:108], other[256:280]
    struct.pack_into('<2h', head, 252, *codes)
    if dims:
        struct.pack_into('<8h', head, 40, *dims)
    with open(path, 'wb') as f:
        f.write(head)


def turned(matrix, degrees, axis=2):
    a, b = [i for i in range(3) if i != axis]
    turn = np.eye(4)
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    turn[[a, a, b, b], [a, b, a, b]] = c, -s, s, c
    return turn @ matrix


def mirrored(matrix, n):
    """The same box, its first axis the other way."""
    return matrix @ np.array([[-1, 0, 0, n - 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])


def others(matrix, n):
    """A second form beside a right one: the message, and the result."""
    shifted = matrix.copy()
    shifted[:3, 3] += (30, 0, 0)
    unit = np.eye(4)
    return {'mirrored': (matrix @ np.diag([-1, 1, 1, 1]), 'mirrored', True),
            'mirrored in its box': (mirrored(matrix, n), 'mirrored', True),
            'quarter turn': (turned(matrix, 90), '90 degrees', True),
            'half turn': (turned(matrix, 180), '180 degrees', True),
            'unit matrix': (unit, 'degrees', True),
            'another size': (matrix @ np.diag([0.75, 0.75, 1, 1]), 'voxels of', False),
            'five degrees': (turned(matrix, 5, 1), '5 degrees', False),
            '30 mm off': (shifted, '30 mm apart', False),
            '0.2 %': (matrix @ np.diag([1.002, 1.002, 1.002, 1]), None, False),
            '0.01 degrees': (turned(matrix, 0.01), None, False)}


def test_ct(scan, ijk, work):
    right, path = affine(scan), os.path.join(work, 'ct.nii')
    expected = picture(scan.folder, work)
    for name, (other, words, refused) in others(right, ijk.shape[0]).items():
        write_two(path, ijk, right, other)
        out = os.path.join(work, 'out.png')
        done = run('render', path, '-o', out, '--force', '--size', '60x60', '--preset', 'skin', '--view', '30,20')
        check(f'{name}: exit', done.returncode == (4 if refused else 0), f'{done.returncode} {done.stderr}')
        reported = 'sform' in done.stderr and 'qform' in done.stderr
        check(f'{name}: finding', reported == bool(words) and (words or '') in done.stderr, done.stderr)
        check(f'{name}: one line', done.stderr.count('\n') == bool(words), done.stderr)
        for form, matrix in (('sform', right), ('qform', other)):
            decided = run('render', path, '-o', out, '--force', '--size', '60x60', '--nifti-form', form)
            check(f'{name}: {form} decides', decided.returncode == 0 and 'nifti-form' not in decided.stderr,
                  decided.stderr)
        if words:
            check(f'{name}: the sform', picture(path, work, '--nifti-form', 'sform') == expected)
            write_two(path, ijk, other, right)
            check(f'{name}: the qform', picture(path, work, '--nifti-form', 'qform') == expected)
    # A single form is used for any request; a form without axes does not count.
    write_nifti(path, ijk, right)
    check('no qform', picture(path, work, '--nifti-form', 'qform') == expected)
    for name, broken in {'zeros': 0 * right, 'not finite': np.nan * right}.items():
        write_two(path, ijk, broken, right)
        check(f'sform of {name}', picture(path, work) == expected)
        check(f'sform of {name}: quiet', run('info', path).stderr == '')
    n = ijk.shape
    write_two(path, ijk, right, right, dims=(4, *n, 0, 0, 0, 0))
    check('a fourth dimension of 0', picture(path, work) == expected)
    write_two(path, ijk, right, right, dims=(3, *n[:2], 0, 1, 1, 1, 1))
    check('a third dimension of 0', 'its dimension 3 is 0' in picture(path, work))


def findings(series, *codes):
    return [f for f in series['findings'] if f['code'] in codes]


def test_mask(scan, ijk, work):
    right, path, ct = affine(scan), os.path.join(work, 'mask.nii'), os.path.join(work, 'ct.nii')
    numbers = numbers_of(blobs(scan.shape), scan.shape)[0].transpose(2, 1, 0)
    write_nifti(path, numbers, right)
    write_nifti(ct, ijk, right)
    expected = info(scan.folder, path)[2]['series'][0]['labels']
    for name, (other, words, refused) in others(right, ijk.shape[0]).items():
        if not words:
            continue
        for forms in ((right, other), (other, right)):
            write_two(path, numbers, *forms)
            for source in (scan.folder, ct):
                code, err, found = info(source, path)
                case = f'{name}, {"sform" if forms[0] is right else "qform"} right, {"DICOM" if source != ct else "NIfTI"}'
                check(f'{case}: read', code == 0, err)
                if code:
                    continue
                series = found['series'][0]
                check(f'{case}: labels', series['labels'] == expected, str(series['labels']))
                reported = findings(series, 'nifti_form_taken')
                check(f'{case}: a note', len(reported) == 1 and reported[0]['severity'] == 'note', str(series['findings']))
    # Both fill the CT's box, each in another order than the CT: which one is right is unknown.
    write_two(path, numbers, right @ np.diag([1, -1, 1, 1]), right @ np.diag([-1, -1, 1, 1]))
    code, err, _ = info(scan.folder, path)
    check('both fill the box', code == 4 and 'contradict' in err, err)
    # Neither is the CT's: as of a CT.
    grown = right @ np.diag([1.5, 1.5, 1, 1])
    write_two(path, numbers, grown, grown @ np.diag([-1, 1, 1, 1]))
    code, err, _ = info(scan.folder, path)
    check('neither equals', code == 4 and 'neither equals' in err and 'nifti-form' in err, err)
    write_two(path, numbers, grown, grown @ np.diag([0.9, 0.9, 1, 1]))
    code, err, found = info(scan.folder, path)
    check('neither equals, nearly alike', code == 0 and len(findings(found['series'][0], 'nifti_forms')) == 1, err)
    write_two(path, numbers, right @ np.diag([-1, 1, 1, 1]), right)
    decided = subprocess.run([CTSPLAT, 'info', '--json', scan.folder, '--labels', path, '--nifti-form', 'qform'],
                             capture_output=True, text=True)
    check('an option decides', decided.returncode == 0 and 'nifti_form' not in decided.stdout, decided.stderr)


def test_batch(scan, ijk, work):
    path, out = os.path.join(work, 'ct.nii'), os.path.join(work, 'out')
    write_two(path, ijk, affine(scan), turned(affine(scan), 90))
    done = run('batch', path, '-O', out, '--size', '40x40')
    check('batch: refused', done.returncode == 8, done.stderr)
    done = run('batch', path, '-O', out, '--size', '40x40', '--nifti-form', 'sform')
    check('batch: decided', done.returncode == 0, done.stderr)


def main():
    scan = Scan(os.path.join(ROOT, 'testdata', 'phantom'))
    values, padding = scan.hu()
    ijk = np.where(padding, -1024, values).astype(int).transpose(2, 1, 0)
    for test in (test_ct, test_mask, test_batch):
        with tempfile.TemporaryDirectory() as work:
            test(scan, ijk, work)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
