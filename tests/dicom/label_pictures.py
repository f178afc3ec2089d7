#!/usr/bin/env python3
"""Pictures of labels in every format: label_pictures.py CTSPLAT SOURCE_ROOT

Whether a picture is grey follows from its scene, and is the same in every format; so does whether skin may be visible.
Masks are written here, on the head of testdata. Exit 77 where numpy or pydicom is missing."""
import json
import os
import re
import subprocess
import sys
import tempfile

from labels_numpy import CTSPLAT, ROOT, Scan, affine, check, failures, np, write_nifti

PNG_GREY, PNG_RGB = 0, 2
GREY_PRESETS = ('ct-coronary-arteries', 'ct-cropped-volume-bone', 'ct-mip', 'ct-soft-tissue', 'ct-x-ray', 'own')
# Half floats of a linear colour, and 8 bits a channel.
EXR_RMSE, BYTES_MAX = 1e-3, 0.51 / 255


def run(*words):
    return subprocess.run([CTSPLAT, *words], capture_output=True, text=True)


def presets():
    return [p['name'] for p in json.loads(run('presets', '--json').stdout)['presets'] if p['mode'] == 'composite' and p.get('scale', 'HU') == 'HU']


def compared(a, b):
    return json.loads(run('compare', '--json', a, b).stdout)


def photometric(path):
    with open(path, 'rb') as f:
        return re.search(rb'\x28\0\x04\0CS..(\w+)', f.read(), re.DOTALL).group(1).decode()


def recognizable(path):
    with open(path, 'rb') as f:
        return re.search(rb'\x28\0\x02\x03CS..(\w+)', f.read(), re.DOTALL).group(1).decode()


def masks_of(scan, work):
    """A solid organ in the middle of the head, and all of the head."""
    hu = scan.hu()[0]
    places = np.argwhere(hu > -300)
    low, high = places.min(axis=0), places.max(axis=0)
    middle, reach = (low + high) / 2, (high - low) / 10
    organ = np.all(np.abs(np.moveaxis(np.indices(scan.shape), 0, -1) - middle) < reach, axis=-1)
    folder = os.path.join(work, 'masks')
    os.makedirs(folder)
    for name, mask in (('organ', organ), ('head', hu > -300)):
        write_nifti(os.path.join(folder, name + '.nii'), mask.transpose(2, 1, 0), affine(scan), code=2)
    return folder


def test_grey(folder, masks, work):
    """Every preset with each kind of appearance: all formats show one picture."""
    own = os.path.join(work, 'own.json')
    with open(own, 'w') as f:
        json.dump({'name': 'own', 'points': [{'hu': -200, 'rgb': [0, 0, 0], 'opacity': 0},
                                             {'hu': 300, 'rgb': [1, 1, 1], 'opacity': 0.5}]}, f)
    names = presets() + [own]
    if os.environ.get('CTS_SANITIZE', 'none') != 'none':
        names = [n for i, n in enumerate(names) if i % 4 == 0 or n in ('bone', 'ct-mip', own)]
    kinds = {'body': (['--label', 'organ=#0000ff:1'], True), 'tint': (['--label', 'head=#00ff00'], True),
             'rest': (['--label', 'rest=#0000ff:0.4'], True), 'colours': (['--label-colours'], True),
             'preset': (['--label', 'head=skin'], True), 'grey preset': (['--label', 'organ=ct-soft-tissue'], False),
             'grey': (['--label', 'organ=#808080:1', '--label', 'head=#cccccc'], False),
             'hidden': (['--label', 'organ=#0000ff', '--hide', 'organ'], False),
             'no colour': (['--hide', 'organ'], False), 'background': (['--background', '#000040'], True),
             'clear': (['--label', 'organ=#0000ff:1', '--background', 'none'], True)}
    for kind, (options, coloured) in kinds.items():
        out = os.path.join(work, kind)
        done = run('batch', folder, '-O', out, '--labels', masks, '--presets', ','.join(names), '--views', 'anterior',
                   '--formats', 'png,exr,dcm', '--size', '24x24', *options)
        check(f'{kind}: batch', done.returncode == 0, done.stderr)
        top = [e.path for e in os.scandir(out) if e.is_dir()] if done.returncode == 0 else []
        for name in names if top else []:
            name = os.path.basename(name).replace('.json', '')
            png, exr, dcm = (os.path.join(top[0], f'{name}-anterior.{ending}') for ending in ('png', 'exr', 'dcm'))
            with open(png, 'rb') as f:
                colour_type = f.read(26)[25]
            is_grey = name in GREY_PRESETS and not coloured
            if kind != 'clear':
                check(f'{kind}, {name}: colour type', colour_type == (PNG_GREY if is_grey else PNG_RGB), colour_type)
            expected = 'MONOCHROME2' if is_grey else 'RGB'
            check(f'{kind}, {name}: photometric', photometric(dcm) == expected, f'{photometric(dcm)} {expected}')
            # Colours of hardly any alpha are known to few bits, and a capture has none.
            for other, most in ((exr, {'rmse': EXR_RMSE}), (dcm, {'max': BYTES_MAX})) if kind != 'clear' else ():
                found = compared(png, other)
                check(f'{kind}, {name}: {other[-3:]} equals png', all(found[k] <= v for k, v in most.items()), found)


def test_skin(folder, masks, work):
    """RecognizableVisualFeatures: YES whenever skin may be visible."""
    cases = [('-p bone', 'NO'), ('-p skin', 'YES'), ('-p ct-x-ray', 'YES'), ('-p bone --label rest=skin', 'YES'),
             ('-p bone --label rest=#ff8080:0.5', 'YES'), ('-p bone --label rest=#ff8080', 'NO'),
             ('-p bone --label head=skin', 'YES'), ('-p bone --label head=#ff0000:1', 'YES'),
             ('-p bone --label organ=#ff0000:1', 'NO'), ('-p bone --label organ=muscle', 'NO'),
             ('-p bone --label-colours', 'NO'), ('-p skin --show organ', 'NO'), ('-p skin --show head', 'YES'),
             ('-p skin --hide organ', 'YES'), ('-p skin --hide rest,head --label organ=skin', 'NO'),
             ('-p skin --slab 20', 'YES'), ('-p bone --slab 20', 'NO'), ('-p skin --show organ,rest', 'YES'),
             ('--mode mip --window -1000,1000', 'YES'), ('--mode mip --window 200,1500', 'NO'),
             ('--mode mip --window -200,300 --slab 10', 'YES'), ('--mode average --window -500,500', 'YES'),
             ('--mode average --window 100,400', 'NO'), ('--mode mip --window -1000,1000 --show organ', 'NO'),
             ('-p bone --label rest=skin --deidentify', 'YES'), ('-p bone --deidentify', 'NO')]
    out = os.path.join(work, 'skin.dcm')
    for words, expected in cases:
        done = run('render', folder, '--labels', masks, '-o', out, '--force', '--size', '24x24', *words.split())
        check(f'{words}: render', done.returncode == 0, done.stderr)
        check(f'{words}: skin', done.returncode or recognizable(out) == expected, f'expected {expected}')
        warned = 'skin may be visible' in done.stderr
        check(f'{words}: warning', warned == ('--deidentify' in words and expected == 'YES'), done.stderr)


def main():
    scan = Scan(os.path.join(ROOT, 'testdata/phantom'))
    with tempfile.TemporaryDirectory() as work:
        masks = masks_of(scan, work)
        test_grey(scan.folder, masks, work)
        test_skin(scan.folder, masks, work)
    sys.exit(1 if failures else 0)


if __name__ == '__main__':
    main()
