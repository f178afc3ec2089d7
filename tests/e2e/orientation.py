"""orientation.py ANTERIOR POSTERIOR LEFT HEAD: four pictures of the phantom, bone with teeth marked green, 2 mm pixels.

The points are the shapes' of tests/tools/phantom.c. The marker on the left side is an L in the anterior view,
and only there on the right; the nose points to the left in the left view and down in the head view."""
import sys

from pictures import View, check, read_png

ANGLES = {'anterior': (0, 0), 'posterior': (180, 0), 'left': (90, 0), 'head': (0, 90)}
STEM, FOOT, NOOK = (82, -18, 92), (101, -18, 62), (98, -18, 88)


def mirrored(p):
    return (-p[0],) + p[1:]


views = {name: View(read_png(path), *ANGLES[name], 2) for name, path in zip(ANGLES, sys.argv[1:5])}


def lit(view, p):
    return max(views[view].at(*p)[:3]) > 0.3


for view in 'anterior', 'posterior':
    for p in STEM, FOOT:
        check(lit(view, p), '%s: the L is not where it belongs' % view)
    for p in NOOK, mirrored(STEM), mirrored(FOOT):
        check(not lit(view, p), '%s: light where none belongs; is the picture mirrored?' % view)
x, _ = views['anterior'].pixel(*STEM)
check(x > views['anterior'].width / 2, "the patient's left is not on the right of the anterior view")
x, _ = views['posterior'].pixel(*STEM)
check(x < views['posterior'].width / 2, "the patient's left is not on the left of the posterior view")

# The teeth are in front of the spine and the back of the skull: only the front view is green.
teeth = (8, -68, -48)
red, green = views['anterior'].at(*teeth)[:2]
check(green > 2 * red and green > 0.3, 'anterior: the teeth are not in front')
red, green = views['posterior'].at(*teeth)[:2]
check(red > 2 * green and red > 0.3, 'posterior: the teeth shine through the back of the head')

# In views from the left and from above, the jaw lies to the left and below; in the back there is air below the skull.
check(lit('left', (0, -68, -48)), 'left: no jaw on the left')
check(not lit('left', (0, 68, -75)), 'left: a jaw on the right')
check(lit('head', (0, -68, 0)), 'head: no jaw at the bottom')
_, y = views['head'].pixel(0, -68, 0)
check(y > views['head'].height / 2, 'head: the face is not at the bottom')
for p in STEM, FOOT:
    check(lit('head', p), 'head: the L is not on the right')
    check(not lit('head', mirrored(p)), 'head: mirrored')
