#!/usr/bin/env python3
"""Label files and lists of labels as they are met: label_kinds.py CTSPLAT SOURCE_ROOT

Numbers that are off by rounding, colours and regions of tables, names with separators, colours of segments, label maps of
NIfTI CTs in a batch. Exit 77 where numpy or pydicom is missing."""
import json
import os
import subprocess
import sys
import tempfile

from labels_numpy import CTSPLAT, ROOT, Scan, affine, check, failures, info, np, write_nifti, write_seg

# A transparent preset, through which labels within the head are visible.
GLASS = '{"name": "glass", "points": [{"hu": -200, "rgb": [1, 1, 1], "opacity": 0.01}]}'
BLUE_LAB = {'DCMTK, highdicom, dcmjs (D65)': (21165, 53249, 5175), 'white': (65535, 32896, 32896)}


def run(*words):
    return subprocess.run([CTSPLAT, *map(str, words)], capture_output=True, text=True)


def found(scan, *labels, names=None):
    code, text, all_of_it = info(scan.folder, *labels, names=names)
    return all_of_it['series'][0]['labels'] if code == 0 else text


def boxes(scan, n=4):
    """Boxes beside each other within the head."""
    volume = np.zeros(scan.shape, int)
    k, j, i = (s // 2 for s in scan.shape)
    for number in range(1, n + 1):
        volume[k - 6:k + 6, j - 10:j + 10, i - 12 + 6 * (number - 1):i - 12 + 6 * number] = number
    return volume


def test_rounding(scan, work):
    volume = boxes(scan)
    ijk, matrix, path = volume.transpose(2, 1, 0), affine(scan), os.path.join(work, 'map.nii')
    expected = {n: int((volume == n).sum()) for n in (1, 2, 3, 4)}
    cases = {'float': {'volume': ijk * 1.0, 'code': 16}, 'below': {'volume': ijk * (1 - 2e-9), 'code': 64},
             'above': {'volume': np.where(ijk, ijk + 4.58e-5, 0), 'code': 16},
             'near 1e-3': {'volume': np.where(ijk, ijk - 9.9e-4, 9e-4), 'code': 64},
             'below 0': {'volume': np.where(ijk, ijk, -9e-4), 'code': 64},
             'scl_slope': {'volume': ijk * 51, 'code': 2, 'slope': 1 / 51},
             'slope and intercept': {'volume': ijk * 25 + 5, 'code': 2, 'slope': 1 / 25, 'intercept': -0.2}}
    for name, case in cases.items():
        write_nifti(path, case.pop('volume'), matrix, **case)
        got = found(scan, path)
        check(f'rounding: {name}', got and not isinstance(got, str) and {l['number']: l['voxels'] for l in got} == expected,
              got)
    write_nifti(path, (ijk == 1) * 255, matrix, code=2, slope=1 / 255)
    got = found(scan, path)
    check('rounding: 255 / 255', not isinstance(got, str) and [(l['number'], l['voxels']) for l in got] == [(1, expected[1])],
          got)
    for value, said in ((0.998, 'holds 0.998,'), (1.00120002, 'holds 1.00120002,'), (0.37, 'holds 0.37,'),
                        (-1, 'holds -1,'), (65535.5, 'holds 65535.5,'), (float('nan'), 'holds nan,')):
        write_nifti(path, np.where(ijk == 1, value, 0.0), matrix, code=64)
        got = found(scan, path)
        check(f'rounding: {value} is refused', isinstance(got, str) and said in got, got)
    # One file that is off stops no folder.
    folder = os.path.join(work, 'folder')
    os.makedirs(folder)
    write_nifti(os.path.join(folder, 'one.nii'), ijk == 1, matrix, code=2)
    write_nifti(os.path.join(folder, 'two.nii'), (ijk == 2) * 255, matrix, code=2, slope=1 / 255)
    got = found(scan, folder)
    check('rounding: folder', not isinstance(got, str) and [l['voxels'] for l in got] == [expected[1], expected[2]], got)


def picture(scan, work, *words, ending='png'):
    path = os.path.join(work, 'picture.' + ending)
    done = run('render', scan.folder, '-o', path, '--force', '--size', '32x32', '-p', GLASS, '--fit', 'volume',
               *words)
    if done.returncode:
        return done.stderr
    with open(path, 'rb') as f:
        return f.read()


def same(name, scan, work, a, b, differs=None):
    """Both lists of words make one picture, and that of `differs` is another."""
    first, second = picture(scan, work, *a), picture(scan, work, *b)
    check(f'{name}: is drawn', isinstance(first, bytes), first)
    check(f'{name}: reference', isinstance(second, bytes), second)
    check(f'{name}: same picture', first == second)
    if differs is not None:
        check(f'{name}: it matters', picture(scan, work, *differs) != first)


def test_tables(scan, work):
    volume = boxes(scan)
    path, table = os.path.join(work, 'map.nii'), os.path.join(work, 'table')
    write_nifti(path, volume.transpose(2, 1, 0), affine(scan))
    own = ['--labels', path, '--label-names', table, '--label-colours']
    colours = [f'--label={n}={c}' for n, c in ((1, '#ff0000'), (2, '#00ff00'), (3, '#0000ff'), (4, '#804020'))]
    for name, text in {
            'ITK-SNAP': '################\n# ITK-SnAP Label Description File\n    0     0    0    0        0  0  0    "Clear Label"\n'
                        '    1   255    0    0        1  1  1    "one"\n    2     0  255    0        0.5  0  1    "two"\n'
                        '    3     0    0  255        1  1  1    "three"\n    4   128   64   32        1  1  1    "four"\n',
            'tabs, CRLF': '1\t255\t0\t0\t1\t1\t1\t"one"\r\n2\t0\t255\t0\t1\t1\t1\t"two"\r\n3\t0\t0\t255\t1\t1\t1\t"three"\r\n'
                          '4\t128\t64\t32\t1\t1\t1\t"four"\r\n'}.items():
        with open(table, 'w', newline='') as f:
            f.write(text)
        same(f'table: {name}', scan, work, own, ['--labels', path, *colours], ['--labels', path, '--label-colours'])
    xml = ''.join(f'<Label Key="{n}" Red="{r}" Green="{g}" Blue="{b}">n{n}</Label>' for n, r, g, b in
                  ((1, 1, 0, 0), (2, 0, 1, 0), (3, 0, 0, 1), (4, 128 / 255, 64 / 255, 32 / 255)))
    write_nifti(path, volume.transpose(2, 1, 0), affine(scan), extension=f'<a>{xml}</a>'.encode())
    same('table: Caret', scan, work, ['--labels', path, '--label-colours'], ['--labels', path, *colours])


def test_regions(scan, work):
    path, names = os.path.join(work, 'map.nii'), os.path.join(work, 'dataset.json')
    write_nifti(path, boxes(scan).transpose(2, 1, 0), affine(scan))
    with open(names, 'w') as f:
        json.dump({'channel_names': {'0': 'CT'}, 'labels': {'background': 0, 'whole tumor': [1, 2, 3], 'tumor core': [2, 3],
                                                            'enhancing': 3, 'both, at last': [1, 4]},
                   'regions_class_order': [1, 2, 3]}, f)
    base = ['--labels', path, '--label-names', names]
    got = found(scan, path, names=names)
    check('regions: names', not isinstance(got, str) and [l['name'] for l in got] == ['label 1', 'label 2', 'enhancing', 'label 4'], got)
    for words, plain, other in (
            (['--show', 'whole tumor'], ['--show', '1,2,3'], ['--show', 'all']),
            (['--hide', 'tumor core'], ['--hide', '2,3'], ['--hide', '2']),
            (['--show', 'Whole*,4'], ['--show', '1,2,3,4'], ['--show', '4']),
            (['--show', '1:tumor core,rest'], ['--show', '2,3,rest'], ['--show', '2']),
            (['--show', 'both, at last'], ['--show', '1,4'], ['--show', '1']),
            (['--label', 'whole tumor=#ff0000', '--label', 'tumor core=#00ff00'],
             ['--label', '1=#ff0000', '--label', '2=#00ff00', '--label', '3=#00ff00'], ['--label', '1=#ff0000'])):
        same(f'regions: {words}', scan, work, base + words, base + plain, base + other)
    message = picture(scan, work, *base, '--show', 'whole tumr')
    check('regions: hint', isinstance(message, str) and 'did you mean whole tumor?' in message, message)
    with open(names, 'w') as f:
        json.dump({'a': ['one']}, f)
    check('regions: no numbers', 'is no list of numbers' in str(found(scan, path, names=names)))


NAMES = {1: 'Lung, left', 2: 'CTV=50Gy', 3: 'Kidney', 4: 'right'}


def named(scan, work, names, file='map.nii'):
    path, table = os.path.join(work, file), os.path.join(work, file + '.json')
    write_nifti(path, np.where(np.isin(boxes(scan), list(names)), boxes(scan), 0).transpose(2, 1, 0), affine(scan))
    with open(table, 'w') as f:
        json.dump({str(n): name for n, name in names.items()}, f)
    return ['--labels', path, '--label-names', table]


def test_separators(scan, work):
    base = named(scan, work, NAMES)
    look = os.path.join(work, 'look.json')

    def look_file(**more):
        with open(look, 'w') as f:
            json.dump(more, f)
        return ['--look', look]

    def same_as(words, plain, other):
        same(f'separators: {words}', scan, work, base + words, base + plain, base + other)

    same_as(['--show', 'Lung, left'], ['--show', '1'], ['--show', '3'])
    same_as(['--show', 'rest,lung, LEFT,right'], ['--show', 'rest,1,4'], ['--hide', 'all'])
    same_as(['--hide', '1:Lung, left,Kidney'], ['--hide', '1,3'], ['--hide', '1'])
    same_as(['--show', 'Lung, *,rest'], ['--show', '1,rest'], ['--show', '1'])
    same_as(['--show', 'Kidney,right'], ['--show', '3,4'], ['--show', '3'])
    same_as(['--show', '["Lung, left","rest"]'], ['--show', '1,rest'], ['--show', '1'])
    same_as(['--label', 'CTV=50Gy=#ff0000'], ['--label', '2=#ff0000'], ['--label', '1=#ff0000'])
    same_as(['--label', 'CTV*=#ff0000:1'], ['--label', '2=#ff0000:1'], ['--label', '2=#ff0000'])
    same_as(['--label', 'CTV=50Gy=skin'], ['--label', '2=skin'], ['--label', '2=bone'])
    same_as(['--label', 'Lung, left=#0000ff', '--label-order', 'Lung, left,2'],
            ['--label', '1=#0000ff', '--label-order', '1,2'], [])
    same_as(look_file(show=['Lung, left', 'rest'], label={'CTV=50Gy': '#00ff00'}),
            ['--show', '1,rest', '--label', '2=#00ff00'], ['--show', '1'])
    own = '{"name": "a=b", "points": [{"hu": 0, "rgb": [1, 1, 0], "opacity": 0.5}]}'
    same_as(['--label', f'CTV=50Gy={own}'], ['--label', f'2={own}'], [])
    for words, hint in ((['--show', 'Lung, lfet'], 'did you mean Lung, left?'),
                        (['--hide', 'rest,Lung,left'], 'did you mean Lung, left?'),
                        (['--label', 'CTV=51Gy=#ff0000'], 'did you mean CTV=50Gy?'),
                        (look_file(show=['Kidney,right']), 'no label has this name or number'),
                        (['--show', 'Kidney,,right'], 'an empty name')):
        message = picture(scan, work, *base, *words)
        check(f'separators: {words} is refused', isinstance(message, str) and hint in message, message)
        check(f'separators: {words} is one line', isinstance(message, str) and message.count('error:') == 1, message)
    both = named(scan, work, {**NAMES, 2: 'Kidney,right'})
    same('separators: one label', scan, work, both + ['--show', 'Kidney,right'], both + ['--show', '2'],
         both + ['--show', '3,4'])


def journal(out):
    with open(os.path.join(out, 'batch.jsonl')) as f:
        return [json.loads(line) for line in f]


def test_batch(scan, work):
    base, out = named(scan, work, NAMES), os.path.join(work, 'out')
    common = ['batch', scan.folder, '-O', out, '--fresh', '--size', '16x16', *base]
    for words, code, status, said in (
            (['--show', 'Lung, left,Spleen'], 0, 'done', 'no label is called Spleen'),
            (['--show', 'Lung, left'], 0, 'done', None),
            (['--show', 'Spleen,Liver'], 0, 'skipped', 'no label Spleen, Liver'),
            (['--show', 'Spleen,rest'], 0, 'done', 'no label is called Spleen'),
            (['--hide', 'Spleen'], 8, 'failed', 'no label has this name or number'),
            (['--label', 'Spleen=#ff0000'], 8, 'failed', 'no label has this name or number'),
            (['--label', 'CTV=50Gy=bone'], 0, 'done', None)):
        done = run(*common, *words)
        check(f'batch: {words}: exit', done.returncode == code, f'{done.returncode} {done.stderr}')
        lines = journal(out) if os.path.exists(out) else []
        check(f'batch: {words}: status', lines and lines[-1]['status'] == status, lines)
        text = json.dumps([lines[-1]['reason'], lines[-1]['findings']]) if lines else ''
        check(f'batch: {words}: journal', said in text if said else 'labels_lacking' not in text, text)
    expected = picture(scan, work, *base, '--show', 'Lung, left')
    glass = os.path.join(work, 'glass.json')
    with open(glass, 'w') as f:
        f.write(GLASS)
    done = run('batch', scan.folder, '-O', out, '--fresh', '--size', '32x32', *base, '--show', 'Lung, left,Spleen', '-p', glass,
               '--fit', 'volume')
    check('batch: names that are lacking', done.returncode == 0, done.stderr)
    made = [os.path.join(folder, f) for folder, _, files in os.walk(out) for f in files if f == 'glass-anterior.png']
    check('batch: one picture', len(made) == 1, os.listdir(out))
    for path in made:
        with open(path, 'rb') as f:
            check('batch: shows what it has', f.read() == expected)


def test_lab(scan, work):
    path = os.path.join(work, 'seg.dcm')
    d = write_seg(path, scan, {1: boxes(scan) == 1, 2: boxes(scan) == 2})
    for segment, lab in zip(d.SegmentSequence, BLUE_LAB.values()):
        segment.RecommendedDisplayCIELabValue = list(lab)
    d.save_as(path, write_like_original=False)
    expected = ['--labels', path, '--label', '1=#0000ff', '--label', '2=#ffffff']
    for n, words in enumerate((expected, ['--labels', path, '--label-colours'])):
        picture(scan, work, *words)
        os.rename(os.path.join(work, 'picture.png'), os.path.join(work, f'{n}.png'))
    found = json.loads(run('compare', '--json', os.path.join(work, '0.png'), os.path.join(work, '1.png')).stdout)
    check('CIELab: blue is blue', found['max'] < 1 / 255, found)


def legend(scan, work, *words):
    path = os.path.join(work, 'legend.png')
    done = run('render', scan.folder, '-o', path, '--force', '--size', '400x300', '-p', GLASS, '--annotate', 'labels', *words)
    with open(path, 'rb') as f:
        return f.read() if done.returncode == 0 else b'', done.stderr


def test_letters(scan, work):
    """Names in other letters: the drawn part, and the warning."""
    said = 'are incomplete and preceded'
    for name, alike, drawn in (('Größe', 'GRÖSSE', False), ('ήπαρ', 'ΉΠΑΡ', False), ('肝臓', '3', True),
                              ('肝臓 liver', '3 LIVER', True), ('l' * 200, None, True), ('Śledziona, lewa', None, False)):
        first, text = legend(scan, work, *named(scan, work, {3: name}), '--label', '3=#00ff00')
        check(f'letters: {name[:20]}: drawn', first and said in text if drawn else first and text == '', text)
        if alike:
            second, _ = legend(scan, work, *named(scan, work, {3: alike}), '--label', '3=#00ff00')
            check(f'letters: {name[:20]} as {alike}', first == second)
    path = os.path.join(work, 'seg.dcm')
    for charset, name in ((['', 'ISO 2022 IR 87'], '肝臓'), (['ISO 2022 IR 6', 'ISO 2022 IR 87'], 'liver=肝臓'),
                          (['ISO 2022 IR 13', 'ISO 2022 IR 87'], 'ﾔﾏﾀﾞ^肝臓'), ('ISO_IR 100', 'Größe'),
                          ('ISO_IR 126', 'ήπαρ'), ('ISO_IR 192', '肝臓'), ('ISO_IR 144', 'печень')):
        d = write_seg(path, scan, {1: boxes(scan) == 1})
        d.SpecificCharacterSet, d.SegmentSequence[0].SegmentLabel = charset, name
        d.save_as(path, write_like_original=False)
        got = found(scan, path)
        check(f'letters: {charset}', not isinstance(got, str) and got[0]['name'] == name, got)


def test_stems(scan, work):
    """NIfTI CTs of a batch, each with its own label map."""
    hu, volume = scan.hu()[0].astype(int).transpose(2, 1, 0), boxes(scan).transpose(2, 1, 0)
    images, maps = os.path.join(work, 'images'), os.path.join(work, 'maps')
    os.makedirs(images)
    os.makedirs(maps)
    pairs = {'case_1_0000.nii.gz': ('case_1.nii', 1), 'case_2.nii.gz': ('case_2.nii', 2),
             'case[3]_0000.nii': ('case[3]_0000.nii', 3), 'x.nii.gz_4.nii': ('x.nii.gz_4.nii', 4)}
    for image, (label, n) in pairs.items():
        write_nifti(os.path.join(images, image), hu, affine(scan))
        write_nifti(os.path.join(maps, label), np.where(volume == n, n, 0), affine(scan))
    write_nifti(os.path.join(maps, 'case[3].nii'), volume, affine(scan))  # the whole name wins
    for pattern in ('{stem}.nii', '{stem}.ni*'):
        out = os.path.join(work, 'out')
        done = run('batch', *(os.path.join(images, i) for i in pairs), '-O', out, '--fresh', '--size', '8x8', '--labels',
                   os.path.join(maps, pattern))
        check(f'stems: {pattern}: exit', done.returncode == 0, done.stderr)
        got = sorted([l['number'] for l in line['labels']] for line in journal(out)) if done.returncode == 0 else []
        check(f'stems: {pattern}: each has its own', got == [[1], [2], [3], [4]], got)
    code, text, all_of_it = info(os.path.join(images, 'case_1_0000.nii.gz'), os.path.join(maps, '{stem}.nii'))
    check('stems: info', code == 0 and [l['number'] for l in all_of_it['series'][0]['labels']] == [1], text)
    # A batch renders pictures again where the label map of a CT changes.
    run('batch', os.path.join(images, 'case_1_0000.nii.gz'), '-O', out, '--fresh', '--size', '8x8', '--labels',
        os.path.join(maps, '{stem}.nii'))
    write_nifti(os.path.join(maps, 'case_1.nii'), volume, affine(scan))
    os.utime(os.path.join(maps, 'case_1.nii'), (1e9, 1e9))
    run('batch', os.path.join(images, 'case_1_0000.nii.gz'), '-O', out, '--size', '8x8', '--labels',
        os.path.join(maps, '{stem}.nii'))
    check('stems: a map that changes', [l['number'] for l in journal(out)[-1]['labels']] == [1, 2, 3, 4])
    code, text, all_of_it = info(scan.folder, os.path.join(maps, '{stem}.nii'))
    check('stems: a DICOM series has none', code == 0 and 'no file is named as its pattern says' in
          str(all_of_it['series'][0]['findings']) + text, text)


def main():
    scan = Scan(os.path.join(ROOT, 'testdata/phantom'))
    for test in (test_rounding, test_tables, test_regions, test_separators, test_batch, test_lab, test_letters, test_stems):
        with tempfile.TemporaryDirectory() as work:
            test(scan, work)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
