#!/usr/bin/env python3
"""A NIfTI CT as the volume: nifti_volume.py CTSPLAT SOURCE_ROOT

Of series of testdata NIfTI files are written here, in every way of writing them; each gives the picture of its series.
Exit 77 where numpy or pydicom is missing."""
import gzip
import json
import os
import subprocess
import sys
import tempfile

from labels_numpy import CTSPLAT, ROOT, Scan, affine, blobs, check, failures, info, np, numbers_of, write_nifti


def run(*words):
    return subprocess.run([CTSPLAT, *words], capture_output=True, text=True)


def picture(path, work, *options):
    """The picture's bytes, or the message if there is none."""
    out = os.path.join(work, 'picture.png')
    done = run('render', path, '-o', out, '--force', '--size', '60x60', '--preset', 'skin', '--view', '30,20', *options)
    if done.returncode:
        return done.stderr
    with open(out, 'rb') as f:
        return f.read()


def ways(ijk, matrix):
    """Equivalent forms of the same volume: HU by slope and intercept, reversed axes."""
    flip = matrix @ np.array([[-1, 0, 0, ijk.shape[0] - 1], [0, -1, 0, ijk.shape[1] - 1], [0, 0, 1, 0], [0, 0, 0, 1]])
    mirror = matrix @ np.array([[-1, 0, 0, ijk.shape[0] - 1], [0, 1, 0, 0], [0, 0, -1, ijk.shape[2] - 1],
                                [0, 0, 0, 1]])
    return {'int16': {}, 'gzip': {'ending': '.nii.gz'}, 'big-endian': {'big': True}, 'second': {'version': 2},
            'int32': {'code': 8}, 'float': {'code': 16}, 'double': {'code': 64, 'version': 2},
            'unsigned': {'volume': ijk + 1024, 'code': 512, 'slope': 1, 'intercept': -1024},
            'slope': {'volume': 2 * ijk + 6, 'code': 8, 'slope': 0.5, 'intercept': -3},
            'qform': {'qform': True}, 'flipped': {'volume': ijk[::-1, ::-1], 'matrix': flip},
            'left-handed': {'volume': ijk[::-1, :, ::-1], 'matrix': mirror},
            'rows and columns changed': {'volume': ijk.transpose(1, 0, 2), 'matrix': matrix[:, [1, 0, 2, 3]]}}


def test_same_picture(scan, ijk, work):
    expected = picture(scan.folder, work)
    for name, case in ways(ijk, affine(scan)).items():
        path = os.path.join(work, 'ct' + case.pop('ending', '.nii'))
        write_nifti(path, case.pop('volume', ijk), case.pop('matrix', affine(scan)), **case)
        found = picture(path, work)
        check(f'{name}: the same picture', found == expected, found if isinstance(found, str) else '')


def test_gzip(scan, ijk, work):
    """Members one behind another, with other bytes behind them; streams that end early or are damaged."""
    path, packed = os.path.join(work, 'ct.nii'), os.path.join(work, 'ct.nii.gz')
    write_nifti(path, ijk, affine(scan))
    expected = picture(path, work)
    with open(path, 'rb') as f:
        plain = f.read()
    whole = gzip.compress(plain, 0)
    # The second member begins at each place beside the end of a part of 256 KiB that is read at a time.
    first = 2**18 - len(gzip.compress(plain[:2**18], 0)) + 2**18
    for n in (1, 400, *range(first - 2, first + 3)):
        stream = gzip.compress(plain[:n], 0) + gzip.compress(plain[n:]) + b'more'
        cases = {f'two members, {n}': (stream, None)}
        if n == 1:
            cases |= {'cut': (whole[:-3000], 'cut short'), 'damaged': (whole[:-8] + whole[:8], 'damaged')}
        for name, (data, words) in cases.items():
            with open(packed, 'wb') as f:
                f.write(data)
            found = picture(packed, work)
            check(f'gzip: {name}', words in str(found) if words else found == expected, str(found)[-200:])


def test_info(scan, ijk, work):
    path, mask = os.path.join(work, 'ct.nii.gz'), os.path.join(work, 'mask.nii')
    write_nifti(path, ijk, affine(scan))
    write_nifti(mask, numbers_of(blobs(scan.shape), scan.shape)[0].transpose(2, 1, 0), affine(scan))
    series, dicom = (info(p, mask)[2]['series'][0] for p in (path, scan.folder))
    check('no UID', series['series_uid'] == '' and series['transfer_syntax'] == 'NIfTI', str(series))
    for key in ('dims', 'spacing_mm', 'hu_min', 'hu_max', 'orientation', 'tilt_deg', 'labels'):
        check(f'info: {key}', series[key] == dicom[key], f'{series[key]} {dicom[key]}')
    # Fractions of HU, as resampling makes them.
    write_nifti(path, ijk + 0.3, affine(scan), code=16)
    third = info(path, mask)[2]['series'][0]
    for a, b in zip(third['labels'], dicom['labels']):
        check('fractions', abs(a['hu_mean'] - b['hu_mean'] - 0.3) < 0.03, f'{a} {b}')


def test_lost(scan, ijk, work):
    path, holes = os.path.join(work, 'ct.nii'), ijk.astype(float)
    holes[:, :2] = np.nan
    write_nifti(path, holes, affine(scan), code=16)
    codes = [f['code'] for f in info(path)[2]['series'][0]['findings']]
    check('finding not_finite', 'not_finite' in codes and True, str(codes))
    write_nifti(path, ijk + 1024, affine(scan))
    reason = info(path)[2]['series'][0]
    check('no HU', not reason['renderable'] and 'quantity' in str(reason['findings']), str(reason))
    named = [info(path, quantity=q)[2]['series'][0] for q in ('HU', 'stored')]
    check('a named quantity', [s['quantity'] for s in named] == ['HU', 'stored'] and
          [s['value_max'] for s in named] == [ijk.max() + 1024] * 2 and 'hu_max' not in named[1], str(named))
    # Isolated values that no scanner measures: the others' picture. More, or larger parts, are refused by what is there.
    n = np.array(ijk.shape) // 2
    def with_values(values):
        changed = ijk.astype(float)
        for number, value in enumerate(values):
            changed[n[0] + 3 * number, n[1], n[2]] = value
        return changed
    for name, code, bad, good in [('three', 64, (3e5, -1e6, -3.4028e38), (ijk.max(), -1024, -1024)),
                                  ('floats', 16, (7e4, -4e4), (ijk.max(), -1024)),
                                  ('the least integer', 8, (-2 ** 31,), (-1024,))]:
        write_nifti(path, with_values(good), affine(scan), code=code)
        expected = picture(path, work)
        write_nifti(path, with_values(bad), affine(scan), code=code)
        check(f'outliers: {name}', picture(path, work) == expected, 'another picture')
        series = info(path)[2]['series'][0]
        check(f'outliers: {name}: range', [series['hu_min'], series['hu_max']] == [ijk.min(), ijk.max()], str(series))
        found = [f for f in series['findings'] if f['severity'] == 'warning']
        check(f'outliers: {name}: finding', [f['code'] for f in found] == ['outliers'] and
              found[0]['text'].startswith(f'{len(bad)} isolated voxel'), str(found))
    large = ijk.astype(float)
    large[n[0]:n[0] + 3, n[1]:n[1] + 3, n[2]] = 3e5
    write_nifti(path, large, affine(scan), code=16)
    check('outliers: a part of 9', f'values from {ijk.min()} to 300000 are no' in picture(path, work))
    extended = ijk.astype(float)
    extended[n[0], n[1], n[2]] = 30710
    write_nifti(path, extended, affine(scan), code=16)
    found = [f['code'] for f in info(path)[2]['series'][0]['findings'] if f['severity'] == 'warning']
    check('no finding for an extended scale', not found, str(found))
    holes[:] = np.nan
    write_nifti(path, holes, affine(scan), code=16)
    check('nothing finite', 'no finite number' in picture(path, work))


def test_refused(scan, ijk, work):
    def refused(name, code, words, *options, **more):
        path = os.path.join(work, 'bad' + more.pop('ending', '.nii'))
        matrix = affine(scan) @ np.array(more.pop('shear', np.eye(4)))
        write_nifti(path, ijk, matrix, **more)
        out = os.path.join(work, 'out.dcm')
        done = run('render', path, *(options or ('-o', os.path.join(work, 'out.png'))))
        check(f'{name}: exit {code}', done.returncode == code, f'{done.returncode} {done.stderr}')
        check(f'{name}: says so', words in done.stderr and done.stderr.count('\n') == 1, done.stderr)
        check(f'{name}: leaves nothing', not os.path.exists(out) and not os.path.exists(out[:-3] + 'png'))

    capture, state = os.path.join(work, 'out.dcm'), os.path.join(work, 'state.dcm')
    refused('a capture', 4, 'no patient', '-o', capture)
    refused('a state', 4, 'no patient', '-o', os.path.join(work, 'out.png'), '--write-state', state)
    refused('rows aslant', 4, 'not at right angles', shear=[[1, 0.2, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    refused('nowhere', 3, 'neither an sform nor a qform', form=False)
    refused('more voxels than bytes', 3, 'cut short', dims=(64, 64, 4800))
    refused('more voxels than gzip packs', 3, 'cut short', dims=(9000, 9000, 90), ending='.nii.gz')
    refused('no volume', 4, '1 slice', dims=(64, 64, 1))
    refused('huge voxels', 4, 'at most 10', shear=np.diag([4, 1, 1, 1]))
    other = os.path.join(work, 'other.nii.gz')
    with gzip.open(other, 'wb') as f:
        f.write(b'text' * 200)
    check('no NIfTI at all', 'is no NIfTI file' in picture(other, work))
    folder = os.path.join(work, 'folder')
    os.mkdir(folder)
    write_nifti(os.path.join(folder, 'mask.nii'), ijk, affine(scan))
    check('not named', 'NIfTI (name the file itself)' in picture(folder, work))


def test_batch(scan, ijk, work):
    paths = [os.path.join(work, name) for name in ('someone.nii', 'another.nii.gz')]
    out = os.path.join(work, 'batch')
    for path in paths:
        write_nifti(path, ijk, affine(scan))
    done = run('batch', *paths, '-O', out, '--size', '60x60', '--presets', 'skin', '--views', '30,20')
    check('batch', done.returncode == 0, done.stderr)
    with open(os.path.join(out, 'batch.jsonl')) as f:
        journal = f.read()
    lines = [json.loads(line) for line in journal.splitlines()]
    outputs = [os.path.join(out, o['path']) for line in lines if line.get('status') == 'done' for o in line['outputs']]
    check('a series each', len({line['series_uid'] for line in lines if 'series_uid' in line}) == 2, journal)
    check('a picture each', len(outputs) == 2, journal)
    check('no names', 'someone' not in journal and 'another' not in journal, journal)
    expected = picture(scan.folder, work)
    for path in outputs:
        with open(path, 'rb') as f:
            check('the picture of the series', f.read() == expected)


def main():
    scan = Scan(os.path.join(ROOT, 'testdata', 'phantom'))
    values, padding = scan.hu()
    ijk = np.where(padding, -1024, values).astype(int).transpose(2, 1, 0)
    for test in (test_same_picture, test_gzip, test_info, test_lost, test_refused, test_batch):
        with tempfile.TemporaryDirectory() as work:
            test(scan, ijk, work)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
