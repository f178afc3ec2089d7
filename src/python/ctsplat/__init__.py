"""Rendering of CT series and arrays of HU, without a display.

>>> volume = ctsplat.load("folder of slices")
>>> volume.render(preset="skin", view=(30, 15)).save("head.png")

A picture has the bytes that `ctsplat render` writes for the same options, which are written with underscores.
"""
import hashlib
import itertools
import json
import os
import re
import queue
import struct
import tempfile
import threading
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np

from ._ctsplat import ffi, lib

__all__ = ["Error", "Diagnostic", "Bound", "Preset", "Picture", "Volume", "load", "presets"]
__version__ = "@VERSION@"


class Error(Exception):
    """A failure, with the message of `ctsplat`. code: the exit code of `ctsplat` for it (ctsplat(1))."""

    def __init__(self, text: str, code: int):
        super().__init__(text)
        self.code = code


class Diagnostic(NamedTuple):
    """A note or warning about the input. code: a stable word; severity: "note", "warning" or "refusal"."""

    code: str
    severity: str
    text: str


class Bound(NamedTuple):
    """Upper limits of a picture's error, in display values 0 to 1: rms, and of any one pixel (None: no limit is
    known). rms_estimate: the likely error, no limit."""

    rmse: float
    max: Optional[float]
    kind: str
    rms_estimate: float


def _text(chars: Any) -> str:
    return ffi.string(chars).decode("utf-8", "replace") if chars else ""


def _said(chars: Any) -> str:
    """A message of the library, which names settings in backticks as the program's options are written."""
    return re.sub("`[a-z]+(-[a-z0-9]+)+`", lambda setting: setting[0].replace("-", "_"), _text(chars))


def _check(status: int, err: Any) -> None:
    if status:
        group = status // 10
        raise Error(_said(err.text), {1: 1, 6: 130, 7: 1}.get(group, group))


class _Report:
    """A CtsReport while a call fills it, and its contents afterwards."""

    def __init__(self) -> None:
        self.c = ffi.gc(ffi.new("CtsReport *"), lib.cts_report_free)

    def diagnostics(self) -> List[Diagnostic]:
        found = self.c.diagnostics
        names = lib.cts_severity_names
        return [Diagnostic(_text(f.code), _text(names[f.severity]), _said(f.text)) for f in found.items[0 : found.n]]

    def log(self) -> Dict[str, Any]:
        stages = {}
        for i in range(lib.CTS_N_STAGES):
            stage = self.c.stages[i]
            if stage.ran:
                stages[_text(lib.cts_stage_names[i])] = {"wall_ms": stage.wall_ms, "cpu_ms": stage.cpu_ms}
        skipped = {_text(s.what): _text(s.why) for s in self.c.skips[0 : self.c.n_skips]}
        return {"stages": stages, "skipped": skipped}

    def bound(self) -> Optional[Bound]:
        b = self.c.bound
        return Bound(b.rmse, b.max if b.max >= 0 else None, "estimated", b.rms_estimate) if b.known else None


_FLAGS = {"allow_missing_slices", "deidentify", "depth", "explain", "force", "insecure_http", "label_colours", "new_uids",
          "show_paths", "summary"}


def _values(name: str, value: Any) -> List[str]:
    """The arguments of an option: several where it may be repeated."""
    if isinstance(value, Preset):
        return [value.json]
    if isinstance(value, bool):
        if name in _FLAGS:
            return [""] if value else []
        return ["on" if value else "off"]
    if isinstance(value, (str, os.PathLike)):
        return [os.fspath(value)]
    if isinstance(value, (int, float, np.integer, np.floating)):
        return [repr(value.item() if isinstance(value, np.generic) else value)]
    if name == "label" and isinstance(value, dict):
        return ["%s=%s" % item for item in value.items()]
    try:
        items = list(value)
    except TypeError:
        raise Error("%s: a %s is no value of it (a text, a number, or a list of these)"
                    % (name, type(value).__name__), 2) from None
    if name in ("label", "labels", "path"):
        return [item if isinstance(item, str) else _fspath(name, item) for item in items]
    if name in ("show", "hide", "label_order"):  # names may hold commas
        return [json.dumps([str(item) for item in items])]
    return [("x" if name == "size" else ",").join(x for item in items for x in _values(name, item))]


def _instead(item: Any) -> str:
    """Advice for an object that is no path."""
    if hasattr(item, "save_as"):  # pydicom
        return 'save data sets into a folder, ds.save_as("FOLDER/1.dcm") and so on, and give the folder'
    if hasattr(item, "read"):
        return "write what it reads into a file, and give the file"
    if isinstance(item, np.ndarray) or hasattr(item, "dataobj"):
        return "give HU in memory to ctsplat.Volume"
    return "give paths of files or folders"


def _fspath(name: str, item: Any) -> str:
    if not isinstance(item, (str, os.PathLike)):
        raise Error("%s: a %s is no path (%s)" % (name, type(item).__name__, _instead(item)), 2)
    return os.fsdecode(item)


def _paths(name: str, path: Any) -> List[str]:
    """One path, or several."""
    several = isinstance(path, (list, tuple, set, frozenset)) or (hasattr(path, "__next__") and not hasattr(path, "read"))
    return [_fspath(name, item) for item in (path if several else [path])]


def _write_nifti(path: str, array: np.ndarray, affine_ras: np.ndarray) -> None:
    """array: index i, j, k."""
    codes = {"uint16": 512, "int16": 4, "float32": 16}
    head = bytearray(544)
    struct.pack_into("<i8s2h8q", head, 0, 540, b"n+2\0\r\n\x1a\n", codes[array.dtype.name], 8 * array.dtype.itemsize, 3,
                     *array.shape, 1, 1, 1, 1)
    struct.pack_into("<8d", head, 104, 1, *np.linalg.norm(affine_ras[:3, :3], axis=0), 0, 0, 0, 0)
    struct.pack_into("<qdd", head, 168, len(head), 1, 0)
    struct.pack_into("<2i", head, 344, 0, 2)
    struct.pack_into("<12d", head, 400, *affine_ras[:3].ravel())
    struct.pack_into("<i", head, 500, 2)
    with open(path, "wb") as file:
        file.write(head)
        file.write(array.astype(array.dtype.newbyteorder("<"), copy=False).tobytes(order="F"))


class _Mask:
    """Numbers of labels: of an array as Volume.hu is, on its grid, or of a nibabel image, on its own."""

    def __init__(self, given: Any):
        self.affine = None if isinstance(given, np.ndarray) else np.array(given.affine, float)
        array = _filled(given if self.affine is None else np.asanyarray(given.dataobj), 0)
        while array.ndim > 3 and array.shape[-1] == 1:
            array = array[..., 0]
        if array.ndim != 3 or array.dtype.kind not in "biuf":
            raise Error("labels: an array of %s in %d dimensions holds no numbers of labels (take 3 dimensions)"
                        % (array.dtype, array.ndim), 2)
        whole = np.rint(array) if array.dtype.kind == "f" else array
        if array.size and not (np.abs(array - whole).max() <= 1e-3 if array.dtype.kind == "f" else True) or \
                array.size and not (whole.min() >= 0 and whole.max() <= 65535):
            raise Error("labels: the array holds what is no number of a label (whole, 0 to 65535)", 2)
        self.numbers = whole.astype(np.uint16)
        self.key = hashlib.blake2b(self.numbers.tobytes() + repr(
            (array.shape, None if self.affine is None else self.affine.tolist())).encode()).hexdigest()

    def __eq__(self, other: Any) -> bool:
        return isinstance(other, _Mask) and self.key == other.key

    def write(self, path: str, volume: "Volume") -> None:
        if self.affine is not None:
            _write_nifti(path, self.numbers, self.affine)
        elif self.numbers.shape != volume._volume_shape():
            raise Error("labels: the array's shape is %s, that of volume.hu %s (layers, rows, columns; a mask on another grid "
                        "needs its affine: give a nibabel image, or a file)"
                        % (self.numbers.shape, volume._volume_shape()), 2)
        else:
            _write_nifti(path, self.numbers.transpose(2, 1, 0), volume.affine_ras)


def _labels(value: Any) -> Any:
    """Paths and masks as a list."""
    def is_mask(item: Any) -> bool:
        return isinstance(item, np.ndarray) or (hasattr(item, "affine") and hasattr(item, "dataobj"))

    if value is None:
        return None
    items = list(value) if isinstance(value, (list, tuple)) else [value]
    for item in items:
        if not isinstance(item, (str, os.PathLike)) and not is_mask(item):
            raise Error("labels: a %s is none (%s)" % (type(item).__name__, _instead(item) if hasattr(item, "save_as") else
                        "give a path, an array of the shape of volume.hu, a nibabel image, or a list of these"), 2)
    return [_Mask(item) if is_mask(item) else os.fsdecode(item) for item in items]


class _Options:
    """CtsJobOption records, and the strings that they point at."""

    def __init__(self, options: Dict[str, Any]):
        self.keep: List[Any] = []
        pairs = [(name, text) for name, value in options.items() if value is not None for text in _values(name, value)]
        self.n = len(pairs)
        self.c = ffi.new("CtsJobOption[]", max(self.n, 1))
        for word, (name, value) in zip(self.c, pairs):
            word.name, word.value = self._chars(name.replace("_", "-")), self._chars(value)

    def _chars(self, text: str) -> Any:
        self.keep.append(ffi.new("char[]", os.fsencode(text)))
        return self.keep[-1]


def _interruptible(call: Any, err: Any) -> None:
    """Runs call(stop), which Ctrl-C stops; KeyboardInterrupt follows once it has ended."""
    if threading.current_thread() is not threading.main_thread():
        _check(call(ffi.NULL), err)
        return
    stop = lib.interrupts_stop()
    try:
        _check(call(stop), err)
    finally:
        lib.interrupts_pass()


def _owner(kind: str, free: Any) -> Any:
    """A pointer for an object of the library, which is freed with it."""
    return ffi.gc(ffi.new(kind + " **"), free)


class Preset:
    """A transfer function with its lighting: of a built-in name, a file, or JSON text as in ctsplat-preset(5)."""

    def __init__(self, name_or_file: str):
        self._c = ffi.new("CtsPreset *")
        err = ffi.new("CtsError *")
        _check(lib.cts_preset_load(os.fsencode(name_or_file), self._c, err), err)

    @classmethod
    def from_points(cls, points: Sequence[Tuple[float, Tuple[float, float, float], float]], *, name: str = "points",
                    **settings: Any) -> "Preset":
        """points: (HU, (red, green, blue), opacity per mm) with values 0 to 1, of rising HU. settings: the other keys
        of a preset file, such as shade=None, window=(low, high), or scale="relative" for numbers that are not HU."""
        key = "hu" if settings.get("scale", "HU") == "HU" else "at"
        made = [{key: float(hu), "rgb": [float(c) for c in rgb], "opacity": float(o)} for hu, rgb, o in points]
        return cls(json.dumps({"name": name, "points": made, **settings}))

    @property
    def name(self) -> str:
        return _text(self._c.name)

    @property
    def json(self) -> str:
        text = lib.cts_preset_to_json(self._c)
        if not text:
            raise MemoryError
        try:
            return _text(text)
        finally:
            lib.free(text)

    def __repr__(self) -> str:
        return "<ctsplat.Preset %s>" % self.name


def presets() -> List[str]:
    """The names of the built-in presets."""
    rows = iter(map(lib.cts_preset_builtin, itertools.count()).__next__, ffi.NULL)
    return [_text(row.name) for row in rows]


class Picture:
    """A rendered picture. Display values (sRGB); row 0 is the top.

    rgba: float32, (height, width, 4), colours multiplied by alpha; depth_mm: float32, (height, width), from the camera
    plane to the first visible surface, inf where there is none, None without depth=True (which .exr outputs need) or
    where the mode has no surfaces; bound: upper limit
    of its error, None where the engine has none; log: times by stage and skipped steps; diagnostics: notes and
    warnings.
    Pictures can be pickled, but lose their series, which .dcm outputs need."""

    def __init__(self, owner: Any, report: _Report, volume: "Volume"):
        self._owner, self._c = owner, owner[0]
        self._volume: Optional["Volume"] = volume
        self.bound, self.log, self.diagnostics = report.bound(), report.log(), report.diagnostics()

    def __reduce__(self) -> Any:
        c = self._c
        pixels = self._array(c.pixels, (c.height, c.width, c.n_channels))
        return _unpickled, (np.array(pixels), None if self.depth_mm is None else np.array(self.depth_mm),
                            bytes(ffi.buffer(ffi.addressof(c, "info"))), bool(c.has_alpha), self.bound, self.log,
                            self.diagnostics)

    @property
    def size(self) -> Tuple[int, int]:
        """Width and height."""
        return self._c.width, self._c.height

    def _array(self, pointer: Any, shape: Tuple[int, ...]) -> np.ndarray:
        buffer = _Buffer(self, int(ffi.cast("uintptr_t", pointer)), shape, "<f4")
        return np.asarray(buffer)

    @property
    def rgba(self) -> np.ndarray:
        c = self._c
        values = self._array(c.pixels, (c.height, c.width, c.n_channels))
        if c.n_channels == 4:
            return values
        rgba = np.ones((c.height, c.width, 4), np.float32)
        rgba[..., :3] = values
        return rgba

    @property
    def depth_mm(self) -> Optional[np.ndarray]:
        c = self._c
        return self._array(c.depth_mm, (c.height, c.width)) if c.depth_mm else None

    def save(self, path: Union[str, os.PathLike], *, force: bool = False, png_bits: int = 16, quality: int = 90) -> None:
        """Writes the picture; the ending picks the format. A file that exists stays, unless force."""
        if png_bits not in (8, 16):
            raise Error("png_bits is 8 or 16", 2)
        settings = ffi.new("CtsExportSettings *")
        settings.force, settings.png_8_bits, settings.quality = force, png_bits == 8, quality
        chars, err = os.fsencode(path), ffi.new("CtsError *")
        if chars.lower().endswith(b".dcm"):
            if self._volume is None:
                raise Error("%s: a picture that was pickled has no series (write .dcm before)" % os.fspath(path), 2)
            settings.source = lib.cts_session_series(self._volume._open())
            if settings.source == ffi.NULL:
                raise Error("%s: an array without a patient cannot become a DICOM object" % os.fspath(path), 2)
        output = _owner("CtsExport", lib.cts_export_discard)
        _check(lib.cts_export_begin(output, chars, self._c, 1, settings, ffi.NULL, err), err)
        with output:  # a file that is not whole by its end is given up
            _check(lib.cts_export_rows(output[0], self._c, err), err)
            if self.bound:
                lib.cts_export_error(output[0], ffi.new("CtsErrorBound *", {"known": True, "rmse": self.bound.rmse}))
            _check(lib.cts_export_end(output, ffi.NULL, err), err)

    def _repr_png_(self) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "picture.png")
            self.save(path, png_bits=8)
            with open(path, "rb") as file:
                return file.read()


def _unpickled(pixels: np.ndarray, depth: Optional[np.ndarray], info: bytes, has_alpha: bool, bound: Optional[Bound],
               log: Dict[str, Any], diagnostics: List[Diagnostic]) -> Picture:
    picture, err = Picture.__new__(Picture), ffi.new("CtsError *")

    def free(owner: Any) -> None:
        if owner[0] != ffi.NULL:
            owner[0].depth_mm = ffi.NULL  # Python's
        lib.cts_picture_free(owner)

    picture._owner = _owner("CtsPicture", free)
    height, width, n_channels = pixels.shape
    _check(lib.cts_picture_new(picture._owner, width, height, n_channels, err), err)
    c = picture._c = picture._owner[0]
    if len(info) != ffi.sizeof(c.info):
        raise Error("the picture was pickled by another version of ctsplat", 2)
    ffi.memmove(c.pixels, np.ascontiguousarray(pixels), pixels.nbytes)
    ffi.memmove(ffi.addressof(c, "info"), info, len(info))
    c.has_alpha = has_alpha
    if depth is not None:
        picture._depth = np.ascontiguousarray(depth)
        c.depth_mm = ffi.cast("float *", picture._depth.ctypes.data)
    picture._volume, picture.bound, picture.log, picture.diagnostics = None, bound, log, diagnostics
    return picture


class _Buffer:
    """Memory of the library as a read-only array, which keeps its owner alive."""

    def __init__(self, owner: Any, address: int, shape: Tuple[int, ...], kind: str):
        self._owner = owner
        self.__array_interface__ = {"version": 3, "data": (address, True), "shape": shape, "typestr": kind}


_NUMBERS = {"int16": "CTS_INT16", "uint16": "CTS_UINT16", "int32": "CTS_INT32", "float32": "CTS_FLOAT32",
            "float64": "CTS_FLOAT64"}
_QUANTITIES = [ffi.string(name).decode() for name in lib.cts_quantity_names]
_NEAREST = {"b": "int16", "i": "float64", "u": "float64", "f": "float32"}


def _given(array: np.ndarray, affine_lps: np.ndarray) -> Any:
    given = ffi.new("CtsHuArray *")
    given.bytes = ffi.cast("void *", array.__array_interface__["data"][0])
    given.number = getattr(lib, _NUMBERS[array.dtype.name])
    for a in range(3):
        given.dims[a], given.stride_bytes[a] = array.shape[a], array.strides[a]
        given.origin_lps[a] = affine_lps[a, 3]
        for c in range(3):
            given.step_lps[a][c] = affine_lps[c, a]
    return given


def _filled(array: Any, value: int) -> np.ndarray:
    """The array with this value for what a NumPy mask hides, in a type that has it."""
    if not isinstance(array, np.ma.MaskedArray):
        return np.asarray(array)
    if array.dtype.kind == "u" and value < 0:
        array = array.astype("int16" if array.dtype.itemsize == 1 else "int32" if array.dtype.itemsize == 2 else "float64")
    elif array.dtype.kind in "bi" and array.dtype.itemsize == 1:
        array = array.astype("int16")
    return array.filled(value)


def _as_numbers(array: Any) -> np.ndarray:
    array = _filled(array, -1024)
    if array.ndim != 3:
        raise Error("an array of %d dimensions is no volume" % array.ndim, 2)
    if array.dtype.isnative and array.dtype.name in _NUMBERS:
        return array
    if array.dtype.kind not in "biuf":
        raise Error("an array of %s holds no HU" % array.dtype, 2)
    small = array.dtype.itemsize == 1
    return array.astype("int16" if small else array.dtype.newbyteorder("=").name
                        if array.dtype.newbyteorder("=").name in _NUMBERS else _NEAREST[array.dtype.kind])


class Volume:
    """A volume in memory, for many pictures.

    Volume(array, spacing_mm=(k, j, i)): HU with index k towards the head, j to the back and i to the patient's left.
    Volume(array, affine_lps=A) or (array, affine_ras=A): A (4 x 4, mm) maps the array's indices to patient coordinates;
    nibabel's arrays and affines are RAS, SimpleITK's are LPS with reversed indices. With the wrong one left and right
    are swapped. What the mask of a NumPy masked array hides is air. quantity: HU, SUVbw, Bq/ml or stored (MR and others).
    As a context manager it frees its memory at the end."""

    def __init__(self, array: Any, spacing_mm: Optional[Sequence[float]] = None, *, affine_lps: Any = None,
                 affine_ras: Any = None, threads: int = 0, quantity: str = "HU"):
        if quantity not in _QUANTITIES:
            raise Error("quantity %s is not one of: %s" % (quantity, " ".join(_QUANTITIES)), 2)
        if sum(x is not None for x in (spacing_mm, affine_lps, affine_ras)) != 1:
            raise Error("one of spacing_mm, affine_lps and affine_ras is needed for the position of the voxels", 2)
        if spacing_mm is not None:
            affine = np.zeros((4, 4))
            affine[2, 0], affine[1, 1], affine[0, 2] = spacing_mm
        else:
            affine = np.array(affine_lps if affine_ras is None else affine_ras, float)
            if affine.shape != (4, 4):
                raise Error("an affine is 4 x 4", 2)
            affine = affine if affine_ras is None else np.diag([-1.0, -1, 1, 1]) @ affine
        numbers = _as_numbers(array)
        scanned, err = _owner("CtsScanned", lib.cts_scanned_free), ffi.new("CtsError *")
        report, given = _Report(), _given(numbers, affine)
        given.quantity = _QUANTITIES.index(quantity)
        given.modality = (lib.CTS_MODALITY_CT, lib.CTS_MODALITY_PT, lib.CTS_MODALITY_PT,
                          lib.CTS_MODALITY_MR)[given.quantity]
        _check(lib.cts_scanned_of_hu(given, threads, scanned, report.c, err), err)
        session = _owner("CtsSession", lib.cts_session_close)
        _check(lib.cts_session_take(session, scanned, err), err)
        self._begin()
        self._take(session, report, None)

    def _begin(self) -> None:
        self._session: Any = None
        self._lock = threading.RLock()  # a session takes one call at a time
        self._turns: Dict[int, _Turn] = {}  # running rotations, by the thread that takes their pictures

    def _take(self, session: Any, report: _Report, source: Optional[Dict[str, Any]]) -> None:
        self._session, self._source = session, source  # the options given to load()
        self._even: Any = None
        self.diagnostics = report.diagnostics()

    def _read(self, source: Dict[str, Any]) -> None:
        labels = source.get("labels") or []
        if self._session is None and any(isinstance(x, _Mask) and x.affine is None for x in labels):
            self._read({**source, "labels": None})  # position of the voxels
        with tempfile.TemporaryDirectory() as folder:
            paths = []
            for i, item in enumerate(labels):
                paths.append(item if isinstance(item, str) else os.path.join(folder, "labels-%d.nii" % (i + 1)))
                if isinstance(item, _Mask):
                    item.write(paths[-1], self)
            words, report, err = _Options({**source, "labels": paths or None}), _Report(), ffi.new("CtsError *")
            session = _owner("CtsSession", lib.cts_session_close)
            _interruptible(lambda stop: lib.cts_session_open(session, words.c, words.n, stop, report.c, err), err)
        self._take(session, report, source)

    def _keep_numbers(self) -> None:
        """An array of HU as a file, since labels are read together with a series."""
        self._folder = tempfile.TemporaryDirectory()
        path = os.path.join(self._folder.name, "ct.nii")
        _write_nifti(path, self.hu.transpose(2, 1, 0), self.affine_ras)
        self._source = {"path": [path]}

    def _volume_shape(self) -> Tuple[int, ...]:
        return tuple(self._volume().dims)[::-1]

    def _words(self, options: Dict[str, Any]) -> _Options:
        """The label options of a picture; labels not yet loaded are read, together with the series."""
        own = {name: options.pop(name) for name in ("labels", "label_names") if name in options}
        if "labels" in own:
            own["labels"] = _labels(own["labels"])
        self._open()
        if self._source is None and any(own.values()):
            self._keep_numbers()
        if self._source is not None and any(self._source.get(name) != value for name, value in own.items()):
            self._read({**self._source, **own})
        return _Options(options)

    def __enter__(self) -> "Volume":
        return self

    def __exit__(self, *_: Any) -> None:
        for turn in list(self._turns.values()):
            turn.end()
        with self._lock:
            self._session = self._even = None

    def _open(self) -> Any:
        if self._session is None:
            raise Error("the volume is closed", 2)
        return self._session[0]

    def _alone(self) -> Any:
        """The lock, where no rotation of this very thread holds it."""
        if threading.get_ident() in self._turns:
            raise Error("a rotation of this volume is under way (take all its pictures first, or close it)", 2)
        return self._lock

    def _volume(self) -> Any:
        """The evenly spaced volume of the scanned slices; a copy where slices are unevenly spaced."""
        scanned = lib.cts_session_scanned(self._open())
        if scanned.layer == ffi.NULL and scanned.even.grey != ffi.NULL:
            return scanned.even
        if self._even is None:
            made, err = _owner("CtsVolume", lib.cts_volume_free), ffi.new("CtsError *")
            _check(lib.cts_scanned_volume(ffi.cast("CtsScanned *", scanned), lib.CTS_INTERPOLATION_LINEAR, False, 0,
                                          made, ffi.new("CtsInterpolationCounts *"), err), err)
            self._even = made
        return self._even[0]

    @property
    def grey(self) -> np.ndarray:
        """Grey levels, uint16, index k, j, i: a read-only view of the library's own. HU = offset + step * grey, which
        is HU + 1024 where all HU are whole."""
        v = self._volume()
        owner = self._even or self._session
        return np.asarray(_Buffer(owner, int(ffi.cast("uintptr_t", v.grey)), tuple(v.dims)[::-1], "<u2"))

    @property
    def quantity(self) -> str:
        """HU, SUVbw, Bq/ml or stored: the meaning of `hu` and of all names with it."""
        return _QUANTITIES[self._scanned().quantity]

    @property
    def unit(self) -> str:
        """HU, g/ml, Bq/ml, or "" of stored values."""
        return ffi.string(lib.cts_quantity_units[self._scanned().quantity]).decode()

    @property
    def value_min(self) -> float:
        """The least value as scanned, padding left out."""
        return self._scanned().hu_min

    @property
    def value_max(self) -> float:
        return self._scanned().hu_max

    def _scanned(self) -> Any:
        return lib.cts_session_scanned(self._open()).even

    @property
    def hu(self) -> np.ndarray:
        """HU, or values of the volume's quantity, a copy, index k, j, i: int16 where that is exact, else float32. Below -1024 they are -1024."""
        v, grey = self._volume(), self.grey
        if v.hu_step == 1 and v.hu_offset == int(v.hu_offset) and v.hu_max <= 32767:
            return (grey.view(np.int16) + np.int16(v.hu_offset)).astype(np.int16, copy=False)
        return (v.hu_offset + v.hu_step * grey.astype(np.float64)).astype(np.float32)

    def __array__(self, dtype: Any = None, copy: Optional[bool] = None) -> np.ndarray:
        return self.hu if dtype is None else self.hu.astype(dtype)

    @property
    def shape(self) -> Tuple[int, int, int]:
        """Layers, rows, columns."""
        return tuple(lib.cts_session_scanned(self._open()).even.dims)[::-1]

    @property
    def affine_lps(self) -> np.ndarray:
        """4 x 4: indices i, j, k to mm, to the left, the back and the head."""
        v, affine = lib.cts_session_scanned(self._open()).even, np.eye(4)
        for c in range(3):
            affine[c, 3] = v.origin_lps[c]
            for a in range(3):
                affine[c, a] = v.step_lps[a][c]
        return affine

    @property
    def affine_ras(self) -> np.ndarray:
        """4 x 4: indices i, j, k to mm, to the right, the front and the head."""
        return np.diag([-1.0, -1, 1, 1]) @ self.affine_lps

    @property
    def spacing_mm(self) -> Tuple[float, float, float]:
        """From layer to layer, row to row, column to column."""
        steps = np.linalg.norm(self.affine_lps[:3, :3], axis=0)
        return float(steps[2]), float(steps[1]), float(steps[0])

    def render(self, preset: Union[str, Preset, None] = None, view: Any = None, size: Any = None,
               **options: Any) -> Picture:
        """Renders one picture. options: those of `ctsplat render`, such as mode="mip", max_error=2, crop=(x0, x1, y0, y1, z0,
        z1), background="none", shade=False, ambient_occlusion=0.5, labels="organs.nii.gz", threads=4."""
        picture = _owner("CtsPicture", lib.cts_picture_free)
        return Picture(picture, self._run({"preset": preset, "view": view, "size": size, **options}, picture), self)

    def save(self, path: Union[str, os.PathLike], preset: Union[str, Preset, None] = None, view: Any = None,
             size: Any = None, **options: Any) -> List[Diagnostic]:
        """Writes the files of `ctsplat render`, with its options: rotation=36 gives one animated .webp or one .dcm, or one
        file per picture; force=True overwrites. Returns the diagnostics."""
        return self._run({"output": path, "preset": preset, "view": view, "size": size, **options}, ffi.NULL).diagnostics()

    def _run(self, options: Dict[str, Any], picture: Any) -> _Report:
        report, err = _Report(), ffi.new("CtsError *")
        with self._alone():
            words, session = self._words(options), self._open()
            _interruptible(lambda stop: lib.cts_session_run(session, words.c, words.n, stop, picture, report.c, err), err)
        return report

    def rotation(self, frames: int, preset: Union[str, Preset, None] = None, view: Any = None, size: Any = None,
                 **options: Any) -> Iterator[Picture]:
        """Yields the pictures of a rotation over 360 degrees about the head-foot axis, from view on; the next one is rendered
        while the current one is used. Other threads that render this volume wait until the end."""
        with self._alone():
            words = self._words({"rotation": frames, "preset": preset, "view": view, "size": size, **options})
        turn = _Turn(self, words)
        try:
            while True:
                item = turn.made.get()
                if item is None:
                    break
                yield item
        finally:
            turn.end()
        if turn.failure:
            raise turn.failure


class _Turn:
    """The thread that renders the pictures of a rotation."""

    def __init__(self, volume: Volume, words: _Options):
        self.volume, self.report, self.stop = volume, _Report(), ffi.new("sig_atomic_t *")
        self.made: "queue.Queue[Optional[Picture]]" = queue.Queue(1)
        self.failure: Optional[BaseException] = None
        self.taker = threading.get_ident()
        self.thread = threading.Thread(target=self.run, args=(words,), daemon=True)
        volume._turns[self.taker] = self
        self.thread.start()

    def run(self, words: _Options) -> None:
        err, handle = ffi.new("CtsError *"), ffi.new_handle(self)
        try:
            with self.volume._lock:
                _check(lib.cts_session_frames(self.volume._open(), words.c, words.n, self.stop, lib.take_frame, handle,
                                              self.report.c, err), err)
        except BaseException as failure:  # the generator raises it
            self.failure = failure
        self.made.put(None)

    def end(self) -> None:
        self.stop[0] = 1
        while self.thread.is_alive():
            try:
                self.made.get(timeout=0.01)
            except queue.Empty:
                pass
        self.volume._turns.pop(self.taker, None)
        self.made = queue.Queue()
        self.made.put(None)


@ffi.def_extern(error=lib.CTS_ERR_MEMORY)
def take_frame(context: Any, frame: int, picture: Any, err: Any) -> int:
    turn, owner = ffi.from_handle(context), _owner("CtsPicture", lib.cts_picture_free)
    owner[0] = picture
    turn.made.put(Picture(owner, turn.report, turn.volume))
    return 0


def load(path: Union[str, os.PathLike, Sequence[str]], series: Optional[str] = None, **options: Any) -> Volume:
    """Reads a CT series: path is a file, folder, zip file, DICOMDIR or NIfTI CT, or several of these; series its UID
    where there is more than one. options: threads, labels (a path, an array of the shape of volume.hu, in which what a
    NumPy mask hides has no label, a nibabel image, or a list of these), label_names, and those of the source (`from` is a
    keyword of Python: **{"from": peer})."""
    volume = Volume.__new__(Volume)
    volume._begin()
    volume._read({"path": _paths("load", path), "series": series, **options, "labels": _labels(options.get("labels"))})
    return volume
