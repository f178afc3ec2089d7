"""size.py PNG WIDTH HEIGHT [dark]: the picture has this size and is not empty (unless it may be dark)."""
import sys

from pictures import check, read_png

picture = read_png(sys.argv[1])
check(picture.shape[:2] == (int(sys.argv[3]), int(sys.argv[2])), 'size %s' % (picture.shape,))
check(sys.argv[4:] or picture[..., :3].max() > 0.3 and picture[..., :3].min() < 0.1, 'an empty picture')
