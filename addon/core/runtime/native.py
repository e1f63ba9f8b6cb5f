# SPDX-License-Identifier: GPL-3.0-or-later
"""Loading of the native library, and the reason if it cannot be used. Importing this module never raises."""

import contextlib
import ctypes
import importlib
import importlib.util
import platform
import sys
from pathlib import Path

from ..errors import UserError
from .threads import start_thread

WHEELS = Path(__file__).resolve().parents[3] / "wheels"  # in the extension
ADVICE = "Install arapfields-<version>-<platform>.zip of a release, not the source code"


def library():
    """The package `arapfields`; raises UserError if it cannot be used."""
    if is_loading():
        _state.thread.join()
    reason = problem()
    if reason:
        raise reason
    return sys.modules["arapfields"]


UNKNOWN = object()


class _State:
    """State of loading: the problem, if any, and the thread that loads the library."""

    problem, thread = UNKNOWN, None


_state = _State()


def preload():
    """Loads the library on a thread: first its file, without the GIL, then the module."""
    if _state.problem is UNKNOWN and _state.thread is None:
        _state.thread = start_thread("loading", _load)


def is_loading():
    return _state.thread is not None and _state.thread.is_alive()


def _load():
    with contextlib.suppress(Exception):
        for path in sorted(_folder().glob("libarapfields.*")):
            ctypes.CDLL(str(path))  # reads the disk while other threads run
    _state.problem = _try_import()


def problem():
    """UserError that says why the native library cannot be used; else None."""
    if is_loading():
        return UserError("The native library is being loaded; wait a moment")
    if _state.problem is UNKNOWN:
        _state.problem = _try_import()
    return _state.problem


def forget():
    """Resets the state, so that the next call of `problem` tries again."""
    _state.problem, _state.thread = UNKNOWN, None


def _try_import():
    try:
        module = importlib.import_module("arapfields")
        if hasattr(module, "deform"):
            return None
        return UserError(f"Another package named arapfields is installed. {ADVICE}")
    except ModuleNotFoundError as error:
        return _missing(error)
    except Exception as error:  # a broken library must not keep the add-on from loading
        return UserError("The native library cannot be loaded: {error}", error=error)


def _missing(error):
    served = sorted(path.stem.split("-")[2:] for path in WHEELS.glob("arapfields-*.whl"))
    if error.name == "arapfields" and served:  # Blender installs wheels for its Python and system only
        here = f"{sys.version_info.major}.{sys.version_info.minor}, {platform.system()} {platform.machine()}"
        pythons = [python for tags, *_ in served for python in tags.split(".")]
        which = ", ".join([*(f"{python[2]}.{python[3:]}" for python in pythons), served[0][-1]])
        return UserError(
            "This build has no module for Python {here} (it has: {which}). Take a build for this Blender",
            here=here,
            which=which,
        )
    if error.name == "arapfields":
        return UserError(f"The native library is not part of this installation. {ADVICE}")
    return UserError(f"The native library lacks {{module}}. {ADVICE}", module=error.name)


def _folder():
    spec = importlib.util.find_spec("arapfields")
    return Path(spec.origin).parent if spec and spec.origin else Path()


def report():
    """Lines that describe the library and the machine, for the preferences and for bug reports."""
    lines = [f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"]
    if problem():
        return [*lines, str(problem())]
    native = library()
    lines.append(f"arapfields {native.__version__} in {Path(native.__file__).parent}")
    lines.append(
        f"{native.thread_count()} threads, kernels for {native.simd_level()}, products by {native.backend()}"
    )
    lines.append(native.device_report())
    return lines
