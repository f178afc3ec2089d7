#!/usr/bin/env python3
"""Series that are no volume: their thumbnails, and what a batch shows of them: planar.py CTSPLAT SOURCE_ROOT IMAGE_DUMP

Exit 77 where numpy or pydicom is missing."""
import glob
import json
import os
import shutil
import subprocess
import sys
import tempfile

IMAGE_DUMP = sys.argv.pop(3)
from labels_numpy import CTSPLAT, ROOT, FileDataset, FileMetaDataset, check, failures, generate_uid, np

CR, SC, US, DOSE, SR = ('1.2.840.10008.5.1.4.1.1.' + end for end in ('1', '7', '6.1', '481.2', '88.11'))


def write(path, sop_class, pixels, photometric='MONOCHROME2', series=None, implicit=False, **more):
    """An image of pixels: frames (where there are several), rows, columns, colours."""
    meta = FileMetaDataset()
    meta.TransferSyntaxUID, meta.MediaStorageSOPClassUID = '1.2.840.10008.1.2' + ('' if implicit else '.1'), sop_class
    d = FileDataset(path, {}, file_meta=meta, preamble=b'\0' * 128)
    d.is_little_endian, d.is_implicit_VR = True, implicit
    d.SOPClassUID, d.Modality = sop_class, {CR: 'CR', US: 'US', DOSE: 'RTDOSE', SR: 'SR'}.get(sop_class, 'OT')
    d.SOPInstanceUID = meta.MediaStorageSOPInstanceUID = generate_uid()
    d.SeriesInstanceUID, d.StudyInstanceUID, d.PatientID = series or generate_uid(), generate_uid(), 'P'
    if pixels is not None:
        pixels = np.asarray(pixels)
        d.SamplesPerPixel = 3 if photometric in ('RGB', 'YBR_FULL') else 1
        shape = pixels.shape[:-1] if d.SamplesPerPixel == 3 else pixels.shape
        d.Rows, d.Columns = shape[-2:]
        if len(shape) == 3:
            d.NumberOfFrames = shape[0]
        d.PhotometricInterpretation, d.PixelRepresentation, d.PlanarConfiguration = photometric, 0, 0
        d.BitsAllocated = d.BitsStored = 8 * pixels.dtype.itemsize
        d.HighBit = d.BitsStored - 1
        d.PixelData = pixels.tobytes() + b'\0' * (pixels.nbytes % 2)
    for key, value in more.items():
        setattr(d, key, value)
    d.save_as(path, write_like_original=False)
    return d.SeriesInstanceUID


def dump(folder):
    out = subprocess.run([IMAGE_DUMP, folder], capture_output=True, text=True)
    check(f'{folder} is read', out.returncode == 0, out.stderr)
    found = {}
    for line in out.stdout.splitlines():
        image = json.loads(line)
        if 'rgb' in image:
            size = image['size'][::-1] + [3]
            image['rgb'] = np.frombuffer(bytes.fromhex(image['rgb']), np.uint8).reshape(size).astype(int)
        found[image['uid']] = image
    return found


def test_pixels(work):
    """Window, polarity, palette, colour model, aspect ratio, size; the middle frame and the middle file."""
    grey = np.arange(0, 96, 4, dtype=np.uint16).reshape(4, 6)
    shown = np.repeat((grey / 100 * 255)[..., None], 3, 2)
    window = {'WindowCenter': 50.5, 'WindowWidth': 101}
    red = np.zeros((4, 6, 3), np.uint8)
    red[:, :3, 0] = 255
    ybr = np.where(red[..., :1] > 0, np.uint8([76, 85, 255]), np.uint8([0, 128, 128]))
    table = {f'{c}PaletteColorLookupTable{part}': value for c, data in
             (('Red', [0, 255]), ('Green', [0, 0]), ('Blue', [0, 0])) for part, value in
             (('Descriptor', [2, 0, 16]), ('Data', (np.uint16(data) * 257).tobytes()))}
    frames = np.stack([np.full((4, 6), 10 * k, np.uint8) for k in range(5)])
    wide = np.tile(np.uint8([0, 0, 255, 255] * 120), (120, 1))
    cases = {
        'implicit': (grey, {'implicit': True, **window}, shown),
        'implicit palette': (red[..., 0] // 255, {'implicit': True, 'photometric': 'PALETTE COLOR', **table}, red),
        'window': (grey, {**window}, shown), 'inverted': (grey, {'photometric': 'MONOCHROME1', **window}, 255 - shown),
        'RGB': (red, {'photometric': 'RGB'}, red), 'YBR': (ybr, {'photometric': 'YBR_FULL'}, red),
        'palette': (red[..., 0] // 255, {'photometric': 'PALETTE COLOR', **table}, red),
        'frames': (frames, {'WindowCenter': 128, 'WindowWidth': 256}, np.full((4, 6, 3), 20)),
        'aspect': (red, {'photometric': 'RGB', 'PixelAspectRatio': [2, 1]}, np.repeat(red, 2, 0)),
        'large': (wide, {'WindowCenter': 128, 'WindowWidth': 256}, np.tile(np.repeat([0, 255] * 120, 3), 60).reshape(60, 240, 3)),
    }
    uids = {name: write(f'{work}/{name}', SC, pixels, **more) for name, (pixels, more, _) in cases.items()}
    middle = generate_uid()
    for number in range(5):
        write(f'{work}/m{9 - number}', CR, frames[number], series=middle, InstanceNumber=number, **cases['large'][1])
    found = dump(work)
    expected = {**{uids[name]: (name, rgb) for name, (_, _, rgb) in cases.items()}, middle: ('middle file', cases['frames'][2])}
    for uid, (name, rgb) in expected.items():
        got = found[uid].get('rgb', found[uid].get('error'))
        check(name, getattr(got, 'shape', 0) == rgb.shape and abs(got - rgb).max() <= 3, f'expected {rgb}, got {got}')


def test_samples(_):
    """Every encoding of pydicom's test files: a thumbnail, or a reason."""
    import pydicom
    folder = os.path.join(os.path.dirname(pydicom.__file__), 'data', 'test_files')
    if os.path.isdir(folder):
        found = dump(folder)
        check('of samples', len(found) > 4 and all('rgb' in i or i['error'] for i in found.values()), found)


def test_batch(work):
    """Statuses, what is hidden and when, names of volumes; nothing is made twice."""
    grey, archive, out = np.full((8, 8), 7, np.uint8), f'{work}/archive', f'{work}/out'
    shutil.copytree(os.path.join(ROOT, 'testdata', 'syntax', 'explicit'), archive)
    volume = json.loads(subprocess.run([CTSPLAT, 'info', archive, '--json'], capture_output=True, text=True).stdout)['series'][0]['series_uid']
    cases = {(CR, None): True, (CR, 'YES'): False, (SC, None): False, (SC, 'NO'): True, (US, None): False, (US, 'NO'): True}
    plain = {write(f'{archive}/{i}', sop_class, grey, **({'BurnedInAnnotation': burned} if burned else {})): is_plain
             for i, ((sop_class, burned), is_plain) in enumerate(cases.items())}
    plain[write(f'{archive}/screen', CR, np.zeros((8, 8, 3), np.uint8), 'RGB')] = False
    write(f'{archive}/same', SC, grey, series=volume, BurnedInAnnotation='NO')
    write(f'{archive}/dose', DOSE, grey)
    write(f'{archive}/report', SR, None)

    def batch(code, *options):
        done = subprocess.run([CTSPLAT, 'batch', archive, '-O', out, '--size', '32x32', *options], capture_output=True, text=True)
        check(f'exit code {code} of batch {options}', done.returncode == code, done.stderr)
        with open(f'{out}/batch.jsonl') as f:
            return done.stderr, {r['series_uid']: r for r in map(json.loads, f)}
    for options, shows_all in ((), False), (('--show-patient',), True), ((), False):
        said, records = batch(0, *options)
        check('the image of its UID', records[volume + '#2']['status'] == 'thumbnail' and
              len(records[volume + '#2']['thumbnails']) == 1, records.get(volume + '#2'))
        check('a volume, without the image of its UID', records[volume]['status'] == 'done' and records[volume]['modality'] == 'CT' and
              any(f['code'] == 'pages_dropped' for f in records[volume]['findings']), records[volume])
        for uid, is_plain in plain.items():
            r = records[uid]
            shown = [t['path'] for t in r['thumbnails']]
            check(f'{r["modality"]} by {options}', r['status'] == 'thumbnail' and len(shown) == (is_plain or shows_all) and
                  glob.glob(f'{out}/{r["folder"]}/thumbs/*') == [f'{out}/{path}' for path in shown] and
                  ('show-patient' in r['reason']) == (not shown), r)
        check('counts', '8 thumbnails' in said and 'without an image (reports, plans, labels): 2' in said, said)
    with open(f'{out}/index.html') as f:
        check('the sheet counts objects', '"objects":2,' in f.read())
    before = open(f'{out}/batch.jsonl').read()
    batch(0)
    check('nothing is made twice', open(f'{out}/batch.jsonl').read() == before)
    done = subprocess.run([CTSPLAT, 'info', archive, '--json'], capture_output=True, text=True)
    series = json.loads(done.stdout)['series']
    check('info', series[0]['series_uid'] == volume and series[0]['renderable'] and len(series) == 9 and series[-1]['series_uid'] == volume and
          all(s['passed'] and not s['renderable'] and 'no volume' in s['findings'][0]['text'] for s in series[1:]), series)


def test_not_shown(work):
    """An image that cannot be shown is refused, in journal and sheet, and again; a file is no folder for outputs."""
    archive, out = f'{work}/archive', f'{work}/out'
    os.mkdir(archive)
    write(f'{archive}/tall', CR, np.full((8, 8), 7, np.uint8), Rows=60000)
    write(f'{archive}/colours', CR, np.full((8, 8), 7, np.uint8), PhotometricInterpretation='ARGB')
    write(f'{archive}/good', CR, np.full((8, 8), 7, np.uint8))
    for _ in range(2):
        done = subprocess.run([CTSPLAT, 'batch', archive, '-O', out], capture_output=True, text=True)
        with open(f'{out}/batch.jsonl') as f:
            found = sorted((r['status'], r['reason'][:12], len(r['thumbnails'])) for r in map(json.loads, f))
        check('refused', done.returncode == 8 and '1 thumbnail' in done.stderr and '2 refused' in done.stderr and found[:2] == [
            ('refused', 'no thumbnail', 0)] * 2 and found[2][::2] == ('thumbnail', 1), (found, done.stderr))
    with open(f'{out}/index.html') as f:
        check('the sheet says why', f.read().count('no thumbnail: ') == 2)
    done = subprocess.run([CTSPLAT, 'batch', archive, '-O', f'{archive}/good'], capture_output=True, text=True)
    check('a file for a folder', done.returncode == 5 and 'good: Not a directory' in done.stderr, done.stderr)


for test in test_pixels, test_samples, test_batch, test_not_shown:
    with tempfile.TemporaryDirectory() as folder:
        test(folder)
sys.exit(bool(failures))
