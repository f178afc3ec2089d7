"""forms.py [grey|colour BACKGROUND PNG DCM]...: both files have the form that preset and background give, and hold one
picture. BACKGROUND is #rrggbb or none; the picture's corner shows it."""
import sys

import numpy as np
from pictures import check, read_png

try:
    import pydicom
except ImportError:
    pydicom = None


def check_capture(form, background, png_path, dcm_path):
    grey = form == 'grey'
    clear = background == 'none'
    behind = [0, 0, 0] if clear else [int(background[i:i + 2], 16) / 255 for i in (1, 3, 5)]

    with open(png_path, 'rb') as f:
        head = f.read(26)
    check(head[24] == 16, '%s: %d bits' % (png_path, head[24]))
    check(head[25] == (6 if clear else 0 if grey else 2), '%s: colour type %d' % (png_path, head[25]))
    png = read_png(png_path)
    if png.shape[2] == 1:
        png = png.repeat(3, 2)
    alpha = png[..., 3:] if clear else 1
    check(np.abs(png[0, 0, :3] - behind).max() < 1e-4, '%s: the corner is %s' % (png_path, png[0, 0]))
    check(not clear or png[0, 0, 3] == 0, png_path + ': the corner hides what is behind')
    if not pydicom:
        return
    dcm = pydicom.dcmread(dcm_path)
    check(dcm.PhotometricInterpretation == ('MONOCHROME2' if grey else 'RGB'), dcm_path + ': grey or colour')
    check((dcm.SamplesPerPixel, dcm.BitsAllocated) == ((1, 16) if grey else (3, 8)), dcm_path + ': bits')
    pixels = dcm.pixel_array
    if int(dcm.get('NumberOfFrames', 1)) > 1:
        pixels = pixels[-1]
    pixels = pixels / (65535 if grey else 255)
    if grey:
        pixels = pixels[..., None].repeat(3, 2)
    step = 1 / 65535 if grey else 1 / 255
    # colour, alpha and the product are each rounded to half a step
    bound = (0.501 if not grey else 1.51 if clear else 0) * step
    check(np.abs(png[..., :3] * alpha - pixels).max() <= bound, dcm_path + ': another picture than the .png')


words = sys.argv[1:]
check(words and len(words) % 4 == 0, 'arguments: groups of four')
for i in range(0, len(words), 4):
    check_capture(*words[i:i + 4])
