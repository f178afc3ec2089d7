"""The captures of captures.sh read by pydicom and GDCM: pixels equal the PNG's, headers agree with the manual."""
import glob
import os
import subprocess
import sys
import zlib

import numpy

try:
    import pydicom
except ImportError:
    sys.exit(0)


def read_png(path):
    """Samples of a PNG as ctsplat writes it: 16 bits, grey or RGB, not interlaced."""
    data = open(path, 'rb').read()
    assert data[:8] == b'\x89PNG\r\n\x1a\n'
    at, packed = 8, b''
    while at < len(data):
        n, kind = int.from_bytes(data[at:at + 4], 'big'), data[at + 4:at + 8]
        body = data[at + 8:at + 8 + n]
        if kind == b'IHDR':
            width, height = int.from_bytes(body[:4], 'big'), int.from_bytes(body[4:8], 'big')
            channels = {0: 1, 2: 3}[body[9]]
            assert body[8] == 16
        elif kind == b'IDAT':
            packed += body
        at += n + 12
    raw, step = zlib.decompress(packed), 2 * channels
    rows, before = [], bytearray(width * step)
    for y in range(height):
        line = bytearray(raw[y * (width * step + 1):(y + 1) * (width * step + 1)])
        filt, line = line[0], line[1:]
        for i in range(len(line)):
            a = line[i - step] if i >= step else 0
            b, c = before[i], before[i - step] if i >= step else 0
            if filt == 4:
                p = a + b - c
                a, b, c = min(((abs(p - v), k, v) for k, v in enumerate((a, b, c))))[2], 0, 0
                line[i] = (line[i] + a) & 255
            else:
                line[i] = (line[i] + (0, a, b, (a + b) // 2)[filt]) & 255
        rows.append(bytes(line))
        before = line
    return numpy.frombuffer(b''.join(rows), '>u2').reshape(height, width, channels)


def pngs(kind):
    names = sorted(glob.glob('phantom-%s-[0-9]*.png' % kind)) or ['phantom-%s.png' % kind]
    return numpy.array([read_png(name) for name in names]).astype(int)


def frames_of(pixels, shape):
    return numpy.asarray(pixels).astype(int).reshape(shape)


def check(name, pixels, truth, bits):
    expected = truth if bits == 16 else numpy.floor(truth / 65535 * 255 + 0.5).astype(int)
    wrong = numpy.abs(frames_of(pixels, truth.shape) - expected)
    # The PNG's 16 bits were rounded once already: half a step of 8 bits may fall to either side.
    assert wrong.max() <= (bits == 8) and (wrong > 0).mean() < 0.01, (name, wrong.max(), (wrong > 0).mean())


for kind in ('still', 'turn', 'mip-still', 'mip-turn'):
    truth = pngs(kind)
    bits = 16 if kind.startswith('mip') else 8
    plain = pydicom.dcmread('phantom-%s.dcm' % kind)
    check(kind, plain.pixel_array, truth, bits)
    # Under sanitizers, captures.sh compresses some kinds only.
    thorough = os.environ.get('CTS_SANITIZE', 'none') == 'none'
    for compression in ('rle', 'jpeg-lossless') if thorough or kind in ('still', 'mip-turn') else ():
        name = 'phantom-%s-%s.dcm' % (kind, compression)
        data = pydicom.dcmread(name)
        n_frames = int(data.get('NumberOfFrames', 1))
        fragments = list(pydicom.encaps.generate_pixel_data_frame(data.PixelData, n_frames))
        assert len(fragments) == n_frames, name
        if subprocess.run('command -v gdcmconv >/dev/null', shell=True).returncode == 0:
            subprocess.run(['gdcmconv', '--raw', name, 'gdcm.dcm'], check=True)
            raw = pydicom.dcmread('gdcm.dcm')
            if raw.get('PlanarConfiguration', 0):
                pixels = raw.pixel_array
            else:
                pixels = raw.pixel_array
            assert (frames_of(pixels, truth.shape) == frames_of(plain.pixel_array, truth.shape)).all(), name
        if compression == 'rle':
            assert (data.pixel_array == plain.pixel_array).all(), name
        tool = {'rle': 'dcmdrle', 'jpeg-lossless': 'dcmdjpeg'}[compression]
        subprocess.run([tool, name, 'dcmtk.dcm'], check=True)
        assert (pydicom.dcmread('dcmtk.dcm').pixel_array == plain.pixel_array).all(), name

still, turn = pydicom.dcmread('phantom-still.dcm'), pydicom.dcmread('phantom-turn.dcm')
assert still.SeriesDescription == 'VR bone', still.SeriesDescription
assert 'error estimate 0.' in still.DerivationDescription
assert '/255 rms, largest ' in still.DerivationDescription and 'engine tiled' in still.DerivationDescription
assert still.BurnedInAnnotation == 'YES' and turn.BurnedInAnnotation == 'NO'
assert len(still.DerivationCodeSequence) == 1 and still.DerivationCodeSequence[0].CodeValue == '113074'
assert still.ViewCodeSequence[0].CodeMeaning == 'Anterior'
assert [float(a) for a in turn.FramePrimaryAngleVector] == [0, 120, 240]
assert [float(a) for a in turn.FrameSecondaryAngleVector] == [0, 0, 0]
assert still.SeriesInstanceUID != turn.SeriesInstanceUID and still.SeriesNumber != turn.SeriesNumber
assert still.ICCProfile[36:40] == b'acsp' and still.ColorSpace == 'SRGB'
