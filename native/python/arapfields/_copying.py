# SPDX-License-Identifier: GPL-3.0-or-later
"""Copying and pickling: by constructors' arguments or as files; what belongs to its process is refused.

Samples, object styles and what a plane's solver gives have states of their own in the native module.
"""

import copyreg
import functools
import tempfile
from collections.abc import Callable, Sized
from pathlib import Path
from typing import Any, NoReturn

from ._native import ImplicitFunction, InvalidInput

NAMES: dict[str, tuple[str, ...]] = {
    "Bone": ("head", "tail", "parent", "roll", "deform", "limits", "name"),
    "Contact": ("obstacles", "ground", "up", "itself", "friction"),
    "CuboidHandle": ("rest", "target", "weight", "allow_scale", "reach"),
    "CurveHandle": ("samples", "motion", "weight"),
    "Frame": ("center", "scale"),
    "MeshSdf": ("vertices", "triangles"),
    "Obstacle": ("function", "margin", "placement"),
    "PointHandle": ("rest", "target", "weight", "reach"),
    "RegionHandle": ("samples", "rest", "target", "weight", "allow_scale", "reach"),
}

FILED = ("DeformationField", "GaussianSplats", "NeuralSdf", "RadialField")

BOUND: dict[str, str] = {
    "Attachment": "the samples and points that it is made of",
    "Correspondence": "the field and meshes that it is made of",
    "LiveDeformer": "its samples, handles and options",
    "MotionState": "the samples, handles and options of its LiveDeformer",
    "PointCacheReader": "the file's path",
    "PointCacheWriter": "the file's path",
    "Task": "no task; each process has its own",
    "WrapSequence": "the samples, field and options that it is made of, and its state",
}


def reduced(item: Any) -> tuple[functools.partial[Any], tuple[()]]:
    kind = type(item)
    names = NAMES.get(kind.__name__) or kind.fields
    return functools.partial(kind, **{name: getattr(item, name) for name in names}), ()


def filed(item: Any) -> tuple[Any, tuple[Any, bytes]]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "pickled")
        item.save(path)
        return restored, (type(item), written(path).read_bytes())


def written(path: Path) -> Path:
    """The file that save() has made, with or without an extension of its own."""
    return path if path.exists() else next(path.parent.iterdir())


def restored(kind: Any, content: bytes) -> Any:
    if not isinstance(content, bytes):
        raise InvalidInput(f"pickled {kind.__name__}: got {type(content).__name__}; bytes are needed")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "pickled")
        path.write_bytes(content)
        try:
            return kind.load(path)
        except InvalidInput as error:
            said = str(error).replace(str(path), f"pickled {kind.__name__}")
            raise InvalidInput(said) from None


def function_of(kind: Any, frame: Any) -> Any:
    """An object of a subclass of ImplicitFunction, without a call of the subclass's __init__."""
    function = kind.__new__(kind)
    ImplicitFunction.__init__(function, frame)
    return function


def python_function(
    item: ImplicitFunction, _protocol: int = 2
) -> tuple[Callable[[], ImplicitFunction], tuple[()], Sized | None]:
    """An object of a subclass of ImplicitFunction by its frame; its attributes are the state."""
    make = functools.partial(function_of, type(item), item.frame)
    return make, (), dict(getattr(item, "__dict__", {})) or None


def prepared(item: Any) -> tuple[Any, tuple[Any]]:
    return type(item), (item.rest,)


def refused(item: Any) -> NoReturn:
    name = type(item).__name__
    raise TypeError(
        f"{name}: it belongs to its process, and is neither copied nor pickled; send {BOUND[name]}"
    )


def register(classes: dict[str, Any]) -> None:
    """Registers the functions that pickle; `classes`: {name: class} of the package."""
    for name, kind in classes.items():
        if name in NAMES or name.endswith("Options"):
            copyreg.pickle(kind, reduced)
        elif name in FILED:
            copyreg.pickle(kind, filed)
        elif name in BOUND:
            copyreg.pickle(kind, refused)
        elif name == "PreparedSplats":
            copyreg.pickle(kind, prepared)
    ImplicitFunction.__reduce_ex__ = python_function  # type: ignore[method-assign, assignment]
