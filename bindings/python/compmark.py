# SPDX-FileCopyrightText: 2026 The CompMark authors
# SPDX-License-Identifier: Apache-2.0
"""CompMark from Python: open a model, render it, and prove whose it is.

    import compmark
    model = compmark.Model("scene.cmk")
    picture = model.render(model.cameras[0])            # numpy array [height, width, 3], float32
    verdict = compmark.verify("owner.key", model="scene.cmk")
    verdict = compmark.verify("owner.key", pictures=[picture])
    print(verdict.detected, verdict.p_value, verdict.report["read"]["hex"])

It calls libcompmark (compmark.h) through ctypes, and needs numpy. COMPMARK_LIBRARY names the library where the system
does not find it.
"""

import ctypes
import dataclasses
import glob
import json
import os
import threading
from ctypes import POINTER, byref, c_char_p, c_double, c_float, c_int, c_int32, c_size_t, c_uint8, c_uint32, c_uint64, c_void_p

import numpy

__all__ = ["Camera", "Error", "Model", "Session", "Verdict", "verify", "version"]

_ABI = 1


class Error(Exception):
    """What the library refused, in a line: file, field, what is wrong, and the remedy."""


class _Camera(ctypes.Structure):
    _fields_ = [("width", c_int32), ("height", c_int32), ("fx", c_double), ("fy", c_double), ("cx", c_double),
                ("cy", c_double), ("rotation_camera_world", c_double * 9), ("center_world", c_double * 3)]


class _Picture(ctypes.Structure):
    _fields_ = [("name", c_char_p), ("pixels", POINTER(c_uint8)), ("width", c_int32), ("height", c_int32),
                ("channels", c_int32)]


class _Reading(ctypes.Structure):
    _fields_ = [("key", c_char_p), ("decoder", c_char_p), ("claim", c_char_p), ("time_stamp", c_char_p),
                ("model", c_char_p), ("unmarked", c_char_p), ("interference", c_char_p), ("images", POINTER(c_char_p)),
                ("image_count", c_size_t), ("pictures", POINTER(_Picture)), ("picture_count", c_size_t),
                ("false_positive_rate", c_double), ("tests", c_uint64), ("views", c_size_t), ("all_cameras", c_int32),
                ("mirrored", c_int32), ("background", c_float * 3), ("any_decoder", c_int32)]


class _Verdict(ctypes.Structure):
    _fields_ = [("verdict", c_int32), ("not_a_proof", c_int32), ("bits", c_uint64), ("matches", c_uint64),
                ("p_value", c_double), ("p_corrected", c_double)]


# Where the library was installed, in the prefix or anywhere; it is written here when this file is installed.
_LIBDIR = "@CMAKE_INSTALL_LIBDIR@"


def _place():
    """COMPMARK_LIBRARY, or the library that this file was installed with, or what the system finds."""
    if "COMPMARK_LIBRARY" in os.environ:
        return os.environ["COMPMARK_LIBRARY"]
    lib = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
    prefix = os.path.dirname(lib)
    # Debian has lib/<architecture>, Fedora lib64. An absolute folder is not joined to the prefix.
    for folder in [os.path.join(prefix, _LIBDIR), lib, os.path.join(lib, "*"), os.path.join(prefix, "lib64")]:
        beside = glob.glob(os.path.join(folder, "libcompmark.so.1"))
        if beside:
            return beside[0]
    return "libcompmark.so.1"


def _load():
    library = ctypes.CDLL(_place())
    for name, result, arguments in [
        ("compmark_abi", c_int, []),
        ("compmark_version", c_char_p, []),
        ("compmark_session_new", c_void_p, [c_uint32]),
        ("compmark_session_free", None, [c_void_p]),
        ("compmark_last_error", c_char_p, [c_void_p]),
        ("compmark_model_open", c_void_p, [c_void_p, c_char_p]),
        ("compmark_model_free", None, [c_void_p]),
        ("compmark_model_recipe", c_char_p, [c_void_p]),
        ("compmark_model_anchors", c_size_t, [c_void_p]),
        ("compmark_model_cameras", c_size_t, [c_void_p]),
        ("compmark_model_camera", c_int, [c_void_p, c_void_p, c_size_t, POINTER(_Camera)]),
        ("compmark_render", c_int, [c_void_p, c_void_p, POINTER(_Camera), POINTER(c_float), c_size_t]),
        ("compmark_model_write", c_int, [c_void_p, c_void_p, c_char_p]),
        ("compmark_reading_init", None, [POINTER(_Reading)]),
        ("compmark_verify", c_int, [c_void_p, POINTER(_Reading), POINTER(_Verdict), POINTER(c_void_p)]),
        ("compmark_verify_restored", c_int, [c_void_p, POINTER(_Reading), POINTER(_Verdict), POINTER(c_void_p)]),
        ("compmark_text_free", None, [c_void_p]),
    ]:
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments
    if library.compmark_abi() != _ABI:
        raise ImportError(f"libcompmark has interface {library.compmark_abi()}, this module is for {_ABI}")
    return library


_library = _load()
version = _library.compmark_version().decode()


def _path(path):
    if path is None:
        return None
    name = os.fsencode(path)
    if b"\0" in name:  # C would read it up to there: another file
        raise ValueError("compmark: a path has a character of value 0")
    return name


class Session:
    """Threads; 0: as many as this process may use. Calls of several threads of Python wait for each other."""

    def __init__(self, threads=0):
        if not 0 <= threads <= 1024:
            raise ValueError("compmark: threads are 0 to 1024")
        self._lock = threading.Lock()
        self._handle = _library.compmark_session_new(threads)
        if not self._handle:
            raise MemoryError("compmark: no session")

    def __del__(self):
        if getattr(self, "_handle", None):
            _library.compmark_session_free(self._handle)

    def _call(self, function, *arguments, failed=-1):
        """The function's result, unless it is what it returns of an error."""
        with self._lock:  # a call and the reading of its error belong together
            result = function(self._handle, *arguments)
            if result == failed:
                raise Error(_library.compmark_last_error(self._handle).decode(errors="replace"))
        return result


_default = threading.local()


def _session(session):
    if session is not None:
        return session
    if not hasattr(_default, "session"):
        _default.session = Session()
    return _default.session


@dataclasses.dataclass
class Camera:
    """A pinhole camera: pixels; point_camera = rotation_camera_world @ (point_world - center_world)."""

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    rotation_camera_world: numpy.ndarray  # [3, 3]
    center_world: numpy.ndarray  # [3]


class Model:
    """model.safetensors of a run, a .cmk, or a splat file."""

    def __init__(self, path, session=None):
        self._session = _session(session)
        self._handle = self._session._call(_library.compmark_model_open, _path(path), failed=None)

    def __del__(self):
        if getattr(self, "_handle", None):
            _library.compmark_model_free(self._handle)

    @property
    def recipe(self):
        return _library.compmark_model_recipe(self._handle).decode()

    @property
    def anchors(self):
        return _library.compmark_model_anchors(self._handle)

    @property
    def cameras(self):
        """Those that are stored in it."""
        cameras = []
        for index in range(_library.compmark_model_cameras(self._handle)):
            c = _Camera()
            self._session._call(_library.compmark_model_camera, self._handle, index, byref(c))
            cameras.append(Camera(c.width, c.height, c.fx, c.fy, c.cx, c.cy,
                                  numpy.array(c.rotation_camera_world).reshape(3, 3), numpy.array(c.center_world)))
        return cameras

    def render(self, camera):
        """Array [height, width, 3] of float32, in [0, 1] but for rounding."""
        rotation = numpy.asarray(camera.rotation_camera_world, dtype=float).reshape(9)
        center = numpy.asarray(camera.center_world, dtype=float).reshape(3)
        c = _Camera(camera.width, camera.height, camera.fx, camera.fy, camera.cx, camera.cy, (c_double * 9)(*rotation),
                    (c_double * 3)(*center))
        picture = numpy.empty((max(0, camera.height), max(0, camera.width), 3), dtype=numpy.float32)
        self._session._call(_library.compmark_render, self._handle, byref(c), picture.ctypes.data_as(POINTER(c_float)),
                            picture.size)
        return picture

    def write(self, path):
        """As model.safetensors: what a .cmk is decoded to."""
        self._session._call(_library.compmark_model_write, self._handle, _path(path))


@dataclasses.dataclass
class Verdict:
    verdict: str  # "detected", "not_detected" or "inconclusive"
    not_a_proof: bool  # detected, but somebody could have made it so: report["proof"] has the reason
    bits: int
    matches: int
    p_value: float
    p_corrected: float
    report: dict  # docs/verification.md

    @property
    def detected(self):
        return self.verdict == "detected" and not self.not_a_proof


def _bytes_of(picture):
    """uint8 as it is; floats in [0, 1] are rounded."""
    picture = numpy.asarray(picture)
    if picture.ndim == 2:
        picture = picture[..., None]
    if picture.ndim != 3:
        raise ValueError("compmark: a picture is [height, width] or [height, width, channels]")
    if picture.dtype != numpy.uint8:
        if not numpy.issubdtype(picture.dtype, numpy.floating):
            raise ValueError("compmark: a picture has values of uint8, or floats in [0, 1]")
        if not numpy.isfinite(picture).all():
            raise ValueError("compmark: a picture has a value that is not a number")
        picture = numpy.rint(255 * numpy.clip(picture, 0, 1)).astype(numpy.uint8)
    return numpy.ascontiguousarray(picture)


def verify(key, *, model=None, images=(), pictures=(), decoder=None, claim=None, time_stamp=None, unmarked=None,
           interference=None, false_positive_rate=1e-6, tests=1, views=0, all_cameras=False, mirrored=False,
           background=(0, 0, 0), any_decoder=False, restored=False, session=None):
    """Is the message of this key in a model, in image files or folders, or in pictures (arrays)? A Verdict.

    Without a decoder: decoder.safetensors beside the model, or else the one that comes with the library. any_decoder:
    take it even if the record beside the key names another one. views: at most so many, 0: all. restored: the features
    that are left of the model are read in the unmarked one, which has to be given, as `compmark verify --restored` does.
    """
    if views < 0:
        raise ValueError("compmark: views are 0 (all) or more")
    if tests < 1:
        raise ValueError("compmark: tests are 1 or more")
    session = _session(session)
    if isinstance(images, (str, bytes, os.PathLike)):
        images = [images]
    if isinstance(pictures, numpy.ndarray) and pictures.ndim < 4:
        pictures = [pictures]
    reading = _Reading()
    _library.compmark_reading_init(byref(reading))
    reading.key, reading.decoder, reading.claim = _path(key), _path(decoder), _path(claim)
    reading.time_stamp, reading.model = _path(time_stamp), _path(model)
    reading.unmarked, reading.interference = _path(unmarked), _path(interference)
    files = (c_char_p * len(images))(*[_path(image) for image in images])
    reading.images, reading.image_count = files, len(images)
    arrays = [_bytes_of(picture) for picture in pictures]  # kept until the call is over
    given = (_Picture * len(arrays))(*[
        _Picture(None, array.ctypes.data_as(POINTER(c_uint8)), array.shape[1], array.shape[0], array.shape[2])
        for array in arrays
    ])
    reading.pictures, reading.picture_count = given, len(arrays)
    reading.false_positive_rate, reading.tests, reading.views = false_positive_rate, tests, views
    reading.all_cameras, reading.mirrored = int(all_cameras), int(mirrored)
    reading.background, reading.any_decoder = (c_float * 3)(*background), int(any_decoder)
    verdict, text = _Verdict(), c_void_p()
    function = _library.compmark_verify_restored if restored else _library.compmark_verify
    session._call(function, byref(reading), byref(verdict), byref(text))
    try:
        report = json.loads(ctypes.string_at(text.value))
    finally:
        _library.compmark_text_free(text)
    return Verdict({0: "detected", 1: "not_detected"}.get(verdict.verdict, "inconclusive"), bool(verdict.not_a_proof),
                   verdict.bits, verdict.matches, verdict.p_value, verdict.p_corrected, report)
