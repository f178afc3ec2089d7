"""The package ctsplat: the pictures of the program, arrays in any order, errors, Ctrl-C, threads and forks."""
import glob
import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading

import numpy as np
import pytest

import ctsplat

PROGRAM, DATA = os.environ["CTSPLAT"], os.environ["CTS_TESTDATA"]
PHANTOM = os.path.join(DATA, "phantom")  # with an L on its left
LABELS = os.path.join(DATA, "fuzz", "labels", "binary")
SMALL = {"size": (96, 80)}


def by_program(tmp_path, *options, path=PHANTOM, name="program.png"):
    target = tmp_path / name
    subprocess.run([PROGRAM, "render", path, "-o", target, "--force", *options], check=True)
    return target.read_bytes() if "--rotation" not in options else None


def by_package(tmp_path, volume, **options):
    target = tmp_path / "package.png"
    volume.render(**options).save(target, force=True)
    return target.read_bytes()


@pytest.fixture(scope="module")
def phantom():
    return ctsplat.load(PHANTOM)


SCENES = [dict(preset=p, view=v) for p in ("bone", "skin", "muscle", "ct-aaa", "lung-window")
          for v in ("anterior", (30, 20), (-70.5, -35), "head", "left", (135, 0))] + [
    dict(preset="bone", mode="mip", view=(20, 10)), dict(preset="skin", mode="average"), dict(mode="minip"),
    dict(preset="bone", background="none"), dict(preset="bone", shade=False, background="#203040"),
    dict(preset="skin", crop=(-40, 40, -50.5, 10, -30, 30)), dict(preset="bone", remove_table=False),
    dict(preset="bone", engine="combined", kernel="gaussian", fit="volume"), dict(preset="bone", slab="20@5"),
    dict(preset="skin", smooth=1.5, max_error=4, annotate="orientation,scale", mm_per_pixel=1.25),
]


def as_options(scene):
    words = []
    for name, value in scene.items():
        if isinstance(value, bool):
            value = "on" if value else "off"
        elif isinstance(value, tuple):
            value = ",".join(map(str, value))
        words += ["--" + name.replace("_", "-"), str(value)]
    return words


def test_scenes_of_the_program(tmp_path, phantom):
    assert len(SCENES) == 40
    for scene in SCENES:
        expected = by_program(tmp_path, "--size", "96x80", *as_options(scene))
        assert by_package(tmp_path, phantom, **scene, **SMALL) == expected, scene


@pytest.mark.parametrize("series", ["geometry/uneven", "geometry/tilted", "geometry/coronal", "geometry/sagittal",
                                    "geometry/feet-first", "geometry/oblique", "syntax/jpeg-2000", "syntax/rle"])
def test_series(tmp_path, series):
    path = os.path.join(DATA, series)
    expected = by_program(tmp_path, "--size", "96x80", path=path)
    volume = ctsplat.load(path)
    assert by_package(tmp_path, volume, **SMALL) == expected
    if series != "geometry/uneven":
        again = ctsplat.Volume(volume.hu.transpose(2, 0, 1), affine_lps=volume.affine_lps[:, [0, 2, 1, 3]])
        one, other = (v.render(fit="volume", **SMALL).rgba for v in (volume, again))
        assert np.sqrt(np.mean((one - other) ** 2)) < 1 / 255  # stored along other axes


def test_arrays_in_any_order(tmp_path, phantom):
    hu, lps = phantom.hu, phantom.affine_lps
    expected = by_package(tmp_path, phantom, preset="skin", view=(40, 10), **SMALL)
    mirrored = by_package(tmp_path, phantom, preset="skin", view=(-40, 10), **SMALL)
    assert expected != mirrored
    reversed_columns = np.array(lps)  # as SimpleITK gives it: indices k, j, i
    volumes = {"SimpleITK": ctsplat.Volume(hu, affine_lps=reversed_columns[:, [2, 1, 0, 3]])}
    # As nibabel gives it: x, y, z in RAS, rows and columns stored from right to left and back to front.
    ras, nx, ny = np.diag([-1.0, -1, 1, 1]) @ lps, hu.shape[2], hu.shape[1]
    flipped = np.array(ras)
    flipped[:, 3] += ras[:, 0] * (nx - 1) + ras[:, 1] * (ny - 1)
    flipped[:, :2] *= -1
    volumes["nibabel"] = ctsplat.Volume(np.asfortranarray(hu.transpose(2, 1, 0)[::-1, ::-1]), affine_ras=flipped)
    volumes["float64"] = ctsplat.Volume(hu.astype(float), affine_lps=lps[:, [2, 1, 0, 3]])
    volumes["strided"] = ctsplat.Volume(np.repeat(hu, 2, axis=2)[:, :, ::2], affine_lps=lps[:, [2, 1, 0, 3]])
    for name, volume in volumes.items():
        assert by_package(tmp_path, volume, preset="skin", view=(40, 10), **SMALL) == expected, name
    swapped = ctsplat.Volume(np.asfortranarray(hu.transpose(2, 1, 0)), affine_lps=ras)
    assert by_package(tmp_path, swapped, preset="skin", view=(40, 10), **SMALL) != expected


def test_attributes(phantom):
    assert phantom.grey.dtype == np.uint16 and phantom.hu.dtype == np.int16 and not phantom.grey.flags.writeable
    assert np.array_equal(np.asarray(phantom), phantom.grey.astype(int) - 1024)
    assert phantom.shape == phantom.grey.shape
    with pytest.raises(ValueError):
        phantom.grey[0, 0, 0] = 1
    spaced = ctsplat.Volume(np.zeros((3, 4, 5), np.int16), (3, 2, 1))
    assert spaced.spacing_mm == (3, 2, 1) and np.allclose(spaced.affine_lps, np.diag([1, 2, 3, 1]))
    fractions = ctsplat.Volume(np.linspace(-1000, 1000, 8).reshape(2, 2, 2), (1, 1, 1))
    assert fractions.hu.dtype == np.float32
    assert np.allclose(fractions.hu.ravel(), np.linspace(-1000, 1000, 8), atol=0.02)


def test_picture(tmp_path, phantom):
    picture = phantom.render("bone", size=(64, 48), background="none", depth=True)
    without = phantom.render("bone", size=(64, 48), background="none")
    assert without.depth_mm is None and np.array_equal(without.rgba, picture.rgba)
    assert picture.rgba.shape == (48, 64, 4) and picture.rgba.dtype == np.float32
    assert picture.depth_mm.shape == (48, 64) and np.isinf(picture.depth_mm).any() and picture.depth_mm.min() > 0
    assert 0 < picture.bound.rms_estimate < picture.bound.rmse <= 0.5 / 255 * 1.5 and "composite" in picture.log["stages"]
    assert picture._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    picture.save(tmp_path / "a.exr")
    with pytest.raises(ctsplat.Error) as e:
        picture.save(tmp_path / "a.exr")
    assert e.value.code == 5
    grey = phantom.render(mode="mip", preset="bone", size=(32, 32))
    assert grey.rgba.shape == (32, 32, 4) and grey.depth_mm is None


def test_prepared_once(phantom):
    """A further picture of the same preset has the bytes of a first one, and what was made for that one."""
    def skipped(**options):
        picture = ctsplat.load(PHANTOM).render(size=(96, 80), **options)
        again = volume.render(size=(96, 80), **options)
        assert np.array_equal(again.rgba, picture.rgba), options
        return again.log["skipped"]

    volume = ctsplat.load(PHANTOM)
    assert "openness" not in skipped(preset="bone", view=(30, 20))
    for options in (dict(view=(40, -10)), dict(max_error=4, occlusion=0.2)):
        assert "openness" in skipped(preset="bone", **options), options
    assert "openness" not in skipped(preset="skin")
    assert "openness" not in skipped(preset="bone", remove_table=False)


HOLDS_ALL = """
import os, sys
import numpy, ctsplat

data, out = sys.argv[1:]
plain = ctsplat.load(os.path.join(data, "syntax", "explicit"))
for syntax in "big deflated implicit jpeg-2000 jpeg-lossless jpeg-ls rle".split():
    assert numpy.array_equal(ctsplat.load(os.path.join(data, "syntax", syntax)).hu, plain.hu), syntax
picture = plain.render(size=(32, 32))
for ending in "png exr dcm jpg webp".split():
    picture.save(os.path.join(out, "a." + ending))
    assert os.path.getsize(os.path.join(out, "a." + ending)) > 100, ending
try:
    ctsplat.load([], study_uid="1.2", **{"from": "A@127.0.0.1:1"})
except ctsplat.Error as e:
    assert "127.0.0.1" in str(e), e
print(*sorted({line.split()[-1] for line in open("/proc/self/maps") if "ctsplat" in line and ".so" in line}))
"""


def test_moved_with_its_libraries(tmp_path):
    """Every codec, format and program works from the package's own folder."""
    package = os.path.dirname(ctsplat.__file__)
    with open("/proc/self/maps", encoding="ascii") as maps:
        library = next(line.split()[-1] for line in maps if "/libctsplat.so" in line)
    shutil.copytree(package, tmp_path / "ctsplat")
    (tmp_path / "lib" / "ctsplat").mkdir(parents=True)
    shutil.copy(library, tmp_path / "lib")
    beside = os.path.dirname(library) + "/c*/"
    parts = glob.glob(beside + "libctsplat-*.so") + [p for p in glob.glob(beside + "ctsplat-*") if os.path.isfile(p)]
    assert len(parts) >= 4, parts
    for part in parts:
        shutil.copy(part, tmp_path / "lib" / "ctsplat")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "LD_LIBRARY_PATH": str(tmp_path / "lib"),
                   "CTSPLAT_LIBEXEC": ""}
    used = subprocess.run([sys.executable, "-c", HOLDS_ALL, DATA, tmp_path], env=environment, check=True,
                          stdout=subprocess.PIPE, text=True, cwd=tmp_path).stdout.split()
    assert len(used) >= 2 and all(path.startswith(str(tmp_path)) for path in used), used


def test_presets(phantom):
    assert {"bone", "skin", "ct-bone"} <= set(ctsplat.presets())
    preset = ctsplat.Preset.from_points([(100, (1, 0, 0), 0.0), (300, (1, 1, 1), 0.5)], name="mine", shade=None)
    assert preset.name == "mine"
    assert phantom.render(preset, **SMALL).rgba.max() > 0
    with pytest.raises(ctsplat.Error):
        ctsplat.Preset.from_points([(300, (1, 0, 0), 0.0), (100, (1, 1, 1), 0.5)])


def test_flags():
    text = subprocess.run([PROGRAM, "render", "--help", "all"], check=True, stdout=subprocess.PIPE, text=True).stdout
    flags = {name.replace("-", "_") for name in re.findall(r"^ +(?:-., )?--([a-z-]+)(?:  |$)", text, re.M)}
    assert flags - {"help"} == ctsplat._FLAGS - {"depth"}  # the program's files decide


def test_errors(tmp_path, phantom):
    for code, call in [
        (3, lambda: ctsplat.load(tmp_path)),
        (3, lambda: ctsplat.load(tmp_path / "nothing")),
        (2, lambda: phantom.render("bonne")),
        (2, lambda: phantom.render(size="huge")),
        (2, lambda: phantom.render(no_such_option=1)),
        (2, lambda: phantom.render(path=PHANTOM)),
        (2, lambda: phantom.render(rotation=4)),
        (3, lambda: phantom.render(labels=PHANTOM)),
        (4, lambda: ctsplat.Volume(np.zeros((4, 4, 4)), (1, 1, 1)).render(labels=LABELS)),
        (2, lambda: ctsplat.Volume(np.zeros((2, 2, 2)))),
        (2, lambda: ctsplat.Volume(np.zeros((2, 2)), (1, 1, 1))),
        (2, lambda: ctsplat.Volume(np.zeros((2, 2, 2), complex), (1, 1, 1))),
        (4, lambda: ctsplat.Volume(np.zeros((2, 2, 2)), (1, 0, 1))),
        (4, lambda: ctsplat.Volume(np.full((2, 2, 2), 1e9), (1, 1, 1))),
        (2, lambda: ctsplat.Volume(np.zeros((4, 4, 4)), (1, 1, 1)).render(**SMALL).save(tmp_path / "a.dcm")),
    ]:
        with pytest.raises(ctsplat.Error) as e:
            call()
        assert e.value.code == code, e.value
    with ctsplat.Volume(np.zeros((4, 4, 4)), (1, 1, 1)) as volume:
        volume.render(**SMALL)
    with pytest.raises(ctsplat.Error):
        volume.render(**SMALL)
    lost = ctsplat.Volume(np.array([[[np.nan, np.inf], [0, 1]], [[2, 3], [4, 5]]]), (1, 1, 1))
    assert [f.code for f in lost.diagnostics] == ["not_finite"]


def test_settings_in_messages(phantom):
    """Settings are named as in Python."""
    with pytest.raises(ctsplat.Error, match="`label_colours`"):
        phantom.render(label_colours=True, **SMALL)


def test_outliers():
    """Isolated values that no scanner measures, of each kind of number."""
    hu = np.linspace(-1000, 1033, 32 * 32 * 32).round().reshape(32, 32, 32)
    for kind, low, high in [(np.float64, -3.4e38, 3e5), (np.float32, -1e6, 7e4), (np.int32, -2 ** 31, 2 ** 31 - 1)]:
        odd, even = hu.astype(kind), hu.astype(kind)
        odd[3, 4, 5], odd[20, 20, 20] = low, high
        even[3, 4, 5], even[20, 20, 20] = -1024, 1033
        volume = ctsplat.Volume(odd, (1, 1, 1))
        assert [f.code for f in volume.diagnostics] == ["outliers"], kind
        assert np.array_equal(volume.hu, even), kind
    hu[::2] = 1e6
    with pytest.raises(ctsplat.Error, match="from -.* to 1e\\+06 are no Hounsfield units"):
        ctsplat.Volume(hu, (1, 1, 1))


def test_fill():
    hu = np.full((24, 24, 24), -1000, np.int16)
    hu[6:18, 6:18, 6:18] = 40
    filled = hu.copy()
    filled[:4] = filled[:, :, 20:] = 0
    hu[:4] = hu[:, :, 20:] = -1024
    volume = ctsplat.Volume(filled, (1, 1, 1))
    odd = volume.render("skin", **SMALL)
    assert "constant_fill" in [f.code for f in odd.diagnostics]
    cleared = volume.render("skin", fill=0, **SMALL)
    assert "constant_fill" not in [f.code for f in cleared.diagnostics]
    expected = ctsplat.Volume(hu, (1, 1, 1)).render("skin", **SMALL)
    assert np.array_equal(cleared.rgba, expected.rgba) and not np.array_equal(odd.rgba, expected.rgba)
    assert volume.hu[0, 0, 0] == 0


def test_rotation(tmp_path, phantom):
    by_program(tmp_path, "--rotation", "5", "--size", "96x80", name="turn.png")
    for i, picture in enumerate(phantom.rotation(5, **SMALL)):
        assert picture.bound.rmse < 1 / 255
        picture.save(tmp_path / "package.png", force=True)
        assert (tmp_path / "package.png").read_bytes() == (tmp_path / ("turn-%03d.png" % i)).read_bytes(), i
    assert i == 4
    for picture in phantom.rotation(300, **SMALL):
        break  # the others are not made
    assert phantom.render(**SMALL).size == (96, 80)
    with pytest.raises(ctsplat.Error):
        list(phantom.rotation(3, "bonne"))


def test_rotation_and_others(phantom):
    """A thread does not wait for itself; closing the volume ends its rotations."""
    with ctsplat.load(PHANTOM) as volume:
        pictures = volume.rotation(3, **SMALL)
        next(pictures)
        for call in (lambda: volume.render(**SMALL), lambda: next(volume.rotation(2, **SMALL))):
            with pytest.raises(ctsplat.Error) as e:
                call()
            assert e.value.code == 2
        assert volume.hu.shape == phantom.hu.shape
        other = []
        thread = threading.Thread(target=lambda: other.append(volume.render(**SMALL)))
        thread.start()
        assert len(list(pictures)) == 2
        thread.join()
        assert other[0].rgba.tobytes() == volume.render(**SMALL).rgba.tobytes()
        pictures = volume.rotation(300, **SMALL)
        next(pictures)
    with pytest.raises(ctsplat.Error):
        list(pictures)


def test_what_outlives_its_volume(tmp_path, phantom):
    with ctsplat.load(PHANTOM) as volume:
        grey, picture = volume.grey, volume.render(**SMALL)
    assert np.array_equal(grey, phantom.grey)
    picture.save(tmp_path / "a.png")
    assert (tmp_path / "a.png").read_bytes() == by_program(tmp_path, "--size", "96x80")
    with pytest.raises(ctsplat.Error):
        picture.save(tmp_path / "a.dcm")


def test_labels(tmp_path):
    """Label files with the series, or with a picture of it."""
    plain, words = ctsplat.load(PHANTOM), ("--labels", LABELS, "--hide", "1", "--label-colours", "--size", "96x80")
    expected, scene = by_program(tmp_path, *words), dict(hide="1", label_colours=True, **SMALL)
    grey = plain.grey
    assert by_package(tmp_path, plain, labels=LABELS, **scene) == expected
    assert by_package(tmp_path, plain, **scene) == expected  # they stay
    assert by_package(tmp_path, ctsplat.load(PHANTOM, labels=[LABELS]), **scene) == expected
    assert by_package(tmp_path, plain, labels=None, **SMALL) == by_program(tmp_path, "--size", "96x80") != expected
    assert np.array_equal(grey, plain.grey)


def test_files_of_the_program(tmp_path, phantom):
    for name, words in [("a.webp", dict(rotation=3, frame_rate=5)), ("b.webp", dict(swivel=(40, 20))),
                        ("a.dcm", dict(rotation=2, series_number=7)), ("a.jpg", dict(annotate="scale", quality=50))]:
        expected = tmp_path / "own" / name
        expected.parent.mkdir(exist_ok=True)
        subprocess.run([PROGRAM, "render", PHANTOM, "-o", expected, "--size", "96x80", *as_options(words)], check=True,
                       stderr=subprocess.DEVNULL)
        assert phantom.save(tmp_path / name, **words, **SMALL) == []
        made, own = (tmp_path / name).read_bytes(), expected.read_bytes()
        assert made[-96 * 80 * 3:] == own[-96 * 80 * 3:] if name == "a.dcm" else made == own, name  # its times differ
        with pytest.raises(ctsplat.Error):
            phantom.save(tmp_path / name, **words, **SMALL)


PAGES = []
for path in os.environ["CTS_PAGES"].split(":"):
    with open(path, encoding="utf-8") as text:
        PAGES += [re.sub("^    ", "", page, flags=re.M) for page in re.findall("(?:^    .*\n)+", text.read(), re.M)
                  if not page.startswith("    ctsplat ")]  # a command line


@pytest.mark.parametrize("page", PAGES, ids=[str(k) for k in range(len(PAGES))])
def test_pages_as_written(tmp_path, monkeypatch, phantom, page):
    for name in re.findall("nibabel|pandas", page):
        pytest.importorskip(name)
    nibabel = pytest.importorskip("nibabel")
    monkeypatch.chdir(tmp_path)
    os.makedirs("scans")
    os.makedirs("archive/empty")
    os.makedirs("segmentations")
    for link in "scans/head", "scans/trunk", "archive/one":
        os.symlink(PHANTOM, link)
    hu = phantom.hu.transpose(2, 1, 0)
    nibabel.save(nibabel.Nifti1Image(hu, phantom.affine_ras), "ct.nii.gz")
    nibabel.save(nibabel.Nifti1Image((hu > 300).astype(np.uint8), phantom.affine_ras), "segmentations/liver.nii.gz")
    made = {}
    exec(page, made)  # pylint: disable=exec-used
    for name in re.findall(r'save\("(\S+?)"', page):
        assert os.path.getsize(name) > 100, name
    if "table" in made:
        assert list(made["table"]["series"]) == ["empty", "one"] and made["table"]["png"][1][:4] == b"\x89PNG"


def test_interrupt(phantom):
    """Ctrl-C in the midst of a picture that takes a minute and more."""
    timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        phantom.render("skin", engine="raycast", size=(4000, 4000))
    assert phantom.render(**SMALL).size == (96, 80)


def test_interrupt_of_load(monkeypatch):
    """Ctrl-C while a PACS does not answer; loading files checks the same flag."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        def peer():
            connection = server.accept()[0]
            os.kill(os.getpid(), signal.SIGINT)
            while connection.recv(4096):
                pass
            connection.close()

        thread = threading.Thread(target=peer)
        thread.start()
        with pytest.raises(KeyboardInterrupt):
            ctsplat.load([], study_uid="1.2.3", peer_timeout=3600,
                         **{"from": "http://127.0.0.1:%d" % server.getsockname()[1]})
        thread.join()
    stop = ctsplat.ffi.new("sig_atomic_t *", 1)
    monkeypatch.setattr(ctsplat, "_interruptible", lambda call, err: ctsplat._check(call(stop), err))
    with pytest.raises(ctsplat.Error) as e:
        ctsplat.load(PHANTOM)
    assert e.value.code == 130


def test_threads_and_forks(tmp_path, phantom):
    expected = phantom.render("skin", **SMALL).rgba.tobytes()
    other = ctsplat.load(PHANTOM)
    same = []
    threads = [threading.Thread(target=lambda v=v: same.append(v.render("skin", **SMALL).rgba.tobytes() == expected))
               for v in (phantom, phantom, other, other)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert same == [True] * 4
    child = os.fork()
    if child == 0:
        ok = phantom.render("skin", **SMALL).rgba.tobytes() == expected
        os._exit(0 if ok and ctsplat.load(PHANTOM).render("skin", **SMALL).rgba.tobytes() == expected else 1)
    assert os.waitpid(child, 0)[1] == 0


def test_memory_is_flat(phantom):
    def resident():
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")

    n = 1000 if os.environ.get("CTS_SOAK") else 60
    for _ in range(20):
        phantom.render(**SMALL)
    before = resident()
    for _ in range(n):
        phantom.render(**SMALL)
    assert resident() - before < 8 << 20


if __name__ == "__main__":
    sys.exit(pytest.main([__file__, "-q", "-p", "no:cacheprovider", *sys.argv[1:]]))


def box_in(volume):
    mask = np.zeros(volume.shape, np.uint8)
    k, j, i = (n // 2 for n in volume.shape)
    mask[k - 5:k + 5, j - 8:j + 8, i - 8:i] = 1
    mask[k - 5:k + 5, j - 8:j + 8, i:i + 8] = 7
    return mask


class Image:
    """The interface of a nibabel image."""

    def __init__(self, dataobj, affine):
        self.dataobj, self.affine = dataobj, affine


def test_labels_in_memory(phantom):
    mask = box_in(phantom)
    scene = dict(preset="muscle", show="7", label="7=#0000ff:1", size=(64, 64))
    image = Image(mask.transpose(2, 1, 0)[..., None] * 1.0, phantom.affine_ras)
    flipped = Image(mask.transpose(2, 1, 0)[::-1], phantom.affine_ras @ np.array(
        [[-1, 0, 0, mask.shape[2] - 1], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]))
    pictures = [ctsplat.load(PHANTOM, labels=mask).render(**scene), ctsplat.load(PHANTOM).render(labels=mask, **scene),
                ctsplat.load(PHANTOM, labels=[image]).render(**scene), ctsplat.load(PHANTOM).render(labels=flipped, **scene),
                ctsplat.load(PHANTOM).render(labels=mask.astype(float) + 4e-5, **scene),
                ctsplat.Volume(phantom.hu.transpose(2, 1, 0), affine_lps=phantom.affine_lps).render(labels=mask, **scene)]
    assert (pictures[0].rgba[..., 2] > 0.5).any()
    for i, picture in enumerate(pictures[1:]):
        assert np.array_equal(picture.rgba, pictures[0].rgba), i
    volume = ctsplat.load(PHANTOM, labels=mask)
    other = mask.copy()
    other[mask == 7] = 1
    with pytest.raises(ctsplat.Error, match="no label has this name or number"):
        volume.render(labels=other, **scene)
    names = ctsplat.load(PHANTOM, labels=[mask, LABELS])
    assert np.array_equal(names.render(**{**scene, "show": ["1:7"], "label": {"1:7": "#0000ff:1"}}).rgba, pictures[0].rgba)


def test_masked_arrays(phantom):
    """Voxels hidden by a mask are air, or have no label."""
    hidden = np.zeros(phantom.hu.shape, bool)
    hidden[:, :, : hidden.shape[2] // 2] = True
    for kind in ("float32", "float64", "int16", "int32", "uint16", "uint8", "int8", ">i2"):
        hu = np.clip(phantom.hu, 0, 120).astype(kind)
        plain = np.where(hidden, -1024, hu.astype("float32"))
        volumes = [ctsplat.Volume(array, (1, 1, 1)) for array in (np.ma.array(hu, mask=hidden), plain)]
        assert (volumes[0].hu == volumes[1].hu).all(), kind
        mask = np.where(hidden, 2, 1)
        given = np.ma.array(mask.astype("int8" if kind == "int8" else "uint16"), mask=hidden)
        pictures = [ctsplat.load(PHANTOM, labels=labels).render(preset="muscle", show="1", **SMALL).rgba
                    for labels in (given, np.where(hidden, 0, mask))]
        assert (pictures[0] == pictures[1]).all(), kind


@pytest.mark.parametrize("labels, said", [
    (np.zeros((3, 4)), "take 3 dimensions"), (np.zeros((3, 4, 5)), "that of volume.hu"), (object(), "a object is none"),
    (3, "a int is none"), (["x", 3], "a int is none"), (np.full((48, 64, 64), 0.3), "no number of a label"),
    (np.full((48, 64, 64), -1), "no number of a label"), (np.zeros((48, 64, 64), complex), "holds no numbers")])
def test_labels_that_are_none(phantom, labels, said):
    for call in (lambda: ctsplat.load(PHANTOM, labels=labels), lambda: phantom.render(labels=labels)):
        with pytest.raises(ctsplat.Error, match=said):
            call()


def test_paths_that_are_none(phantom):
    import io
    for path in (io.BytesIO(b"x"), [io.BytesIO(b"x")], phantom.hu, 3, None, Image(phantom.hu, phantom.affine_ras), {"a": 1}):
        with pytest.raises(ctsplat.Error, match="is no path"):
            ctsplat.load(path)
    for path, said in ((io.BytesIO(b"x"), "into a file"), (phantom.hu, "ctsplat.Volume"), (3, "paths of files or folders")):
        with pytest.raises(ctsplat.Error, match=said):
            ctsplat.load(path)
    with pytest.raises(ctsplat.Error, match="is no value of it"):
        phantom.render(view=object())


def test_pydicom():
    pydicom = pytest.importorskip("pydicom")
    slices = [pydicom.dcmread(f) for f in sorted(glob.glob(os.path.join(PHANTOM, "*")))[:2]]
    for call in (lambda: ctsplat.load(slices[0]), lambda: ctsplat.load(slices), lambda: ctsplat.load(iter(slices)),
                 lambda: ctsplat.load(PHANTOM, labels=slices[0]), lambda: ctsplat.load(PHANTOM, labels=[LABELS, slices[0]])):
        with pytest.raises(ctsplat.Error, match=r"a FileDataset is (no path|none) \(save data sets into a folder, .*save_as"):
            call()


def test_lists_of_names(tmp_path, phantom):
    names = tmp_path / "names.json"
    names.write_text('{"1": "Lung, left", "7": "CTV=50Gy"}')
    volume = ctsplat.load(PHANTOM, labels=box_in(phantom), label_names=names)
    scene = dict(preset="muscle", size=(64, 64))
    expected = volume.render(show="1,rest", label=["1=#ff0000:1", "7=#00ff00"], **scene).rgba
    found = volume.render(show=["Lung, left", "rest"], label={"Lung, left": "#ff0000:1", "CTV=50Gy": "#00ff00"}, **scene).rgba
    assert np.array_equal(found, expected)


def test_pictures_are_pickled(tmp_path, phantom):
    import pickle
    for i, options in enumerate((dict(preset="bone", background="none", depth=True), dict(mode="mip"), dict(preset="skin"))):
        picture = phantom.render(size=(40, 30), **options)
        again = pickle.loads(pickle.dumps(picture))
        assert np.array_equal(again.rgba, picture.rgba) and again.size == picture.size
        assert (again.bound, again.log, again.diagnostics) == (picture.bound, picture.log, picture.diagnostics)
        assert (again.depth_mm is None) == (picture.depth_mm is None)
        if picture.depth_mm is not None:
            assert np.array_equal(again.depth_mm, picture.depth_mm)
        for ending in ("png", "exr", "jpg") if options.get("background") != "none" else ("png", "exr"):
            paths = [tmp_path / ("%d-%d.%s" % (i, k, ending)) for k in range(2)]
            picture.save(paths[0])
            again.save(paths[1])
            assert paths[0].read_bytes() == paths[1].read_bytes(), ending
        with pytest.raises(ctsplat.Error, match="has no series"):
            again.save(tmp_path / "x.dcm")
        assert np.array_equal(pickle.loads(pickle.dumps(again)).rgba, picture.rgba)
