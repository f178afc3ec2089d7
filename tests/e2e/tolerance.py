"""tolerance.py RMSE A B: two pictures of one size differ by less than RMSE, over display values 0..1, and are not empty."""
import sys

from pictures import check, read_png

a, b = (read_png(path)[..., :3] for path in sys.argv[2:4])
check(a.shape == b.shape, 'sizes %s and %s' % (a.shape, b.shape))
rmse = float(((a - b) ** 2).mean() ** 0.5)
check(a.max() > 0.3, 'an empty picture')
check(rmse < float(sys.argv[1]), '%s and %s: rmse %.6f' % (sys.argv[2], sys.argv[3], rmse))
