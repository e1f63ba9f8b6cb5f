# SPDX-License-Identifier: GPL-3.0-or-later
"""Copying and pickling: options, handles and frames by their constructors' arguments, fields as files."""

import copyreg
import functools
import tempfile
from pathlib import Path
from typing import Any

NAMES: dict[str, tuple[str, ...]] = {
    "CuboidHandle": ("rest", "target", "weight", "allow_scale", "reach"),
    "PointHandle": ("rest", "target", "weight", "reach"),
    "RegionHandle": ("samples", "rest", "target", "weight", "allow_scale", "reach"),
    "CurveHandle": ("samples", "motion", "weight"),
    "Frame": ("center", "scale"),
}


FILED = ("DeformationField", "RadialField", "NeuralSdf")


def reduced(item: Any) -> tuple[functools.partial[Any], tuple[()]]:
    kind = type(item)
    names = NAMES.get(kind.__name__) or kind.fields
    return functools.partial(kind, **{name: getattr(item, name) for name in names}), ()


def filed(item: Any) -> tuple[Any, tuple[Any, bytes]]:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "pickled.safetensors")
        item.save(path)
        return restored, (type(item), path.read_bytes())


def restored(kind: Any, content: bytes) -> Any:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "pickled.safetensors")
        path.write_bytes(content)
        return kind.load(path)


def register(classes: dict[str, Any]) -> None:
    """Registers the functions that pickle; `classes`: {name: class} of the package."""
    for name, kind in classes.items():
        if name in NAMES or name.endswith("Options"):
            copyreg.pickle(kind, reduced)
        elif name in FILED:
            copyreg.pickle(kind, filed)
