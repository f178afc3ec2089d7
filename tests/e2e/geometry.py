"""Positions of the L, the metal pin and the picture's borders, from the numbers in tests/tools/phantom.c."""
import numpy as np

from pictures import View, check, read_png

# The extent of the letter L to the left and to the head, mm, and half a voxel by which it may be blurred.
L_LEFT, L_TOP, BLUR = (78, 106), 106, (1.75, 2.25)


def extent(view, level, z_from):
    """Of the pixels brighter than level above z_from: the left, right and upper border, mm."""
    grey = view.picture[..., 0]
    ys, xs = np.nonzero(grey[:int(view.height / 2 - z_from / view.mm)] > level)
    left, right = (xs.min() - view.width / 2) * view.mm, (xs.max() + 1 - view.width / 2) * view.mm
    return left, right, (view.height / 2 - ys.min()) * view.mm


for name, mm in ('mip-160x140', 2), ('mip-161x141', 2), ('fine', 1):
    picture = read_png(name + '.png')
    view = View(picture, 0, 0, mm)
    # Right of the head there are only the L, its post and the pin; the L's edge is half way from air, -1000 HU, to its
    # 1300 HU, in a window of 0 to 2000 HU.
    right = picture.copy()
    right[:, :int(view.pixel(74, 0, 0)[0])] = 0
    box = extent(View(right, 0, 0, mm), (1300 - 1000) / 2 / 2000, 60)
    for found, expected, blur in zip(box, L_LEFT + (L_TOP,), (BLUR[0], BLUR[0], BLUR[1])):
        check(abs(found - expected) <= blur + mm, '%s: the L is at %s, not at %s %s' % (name, box, L_LEFT, L_TOP))
    pin = view.at(90, -18, 44)[0]
    check(pin > 0.95, '%s: the pin is %.3f' % (name, pin))

for size in '160x140', '161x141':
    whole, crop = View(read_png('mip-%s.png' % size), 0, 0, 2), View(read_png('crop-%s.png' % size), 0, 0, 2)
    check(crop.picture.shape == whole.picture.shape, 'a crop changes the size')
    # The cropped box has its own frame: its centre is the picture's, and less is visible.
    lit = (crop.picture[..., 0] > 0.05).sum()
    check(0 < lit < (whole.picture[..., 0] > 0.05).sum() / 4, 'crop: %d pixels are left' % lit)

# The whole box fits: its diagonal is 95 % of the shorter side.
fit = read_png('fit.png')
mm = np.sqrt(2 * (63 * 3.5) ** 2 + (47 * 4.5) ** 2) / (0.95 * 100)
check(View(fit, 0, 0, mm).at(90, -18, 44)[0] > 0.95, 'fit: the pin is not where the default scale puts it')
check(fit[:, :60].max() < 0.01 and fit[:, 140:].max() < 0.01, 'fit: something outside the box')
