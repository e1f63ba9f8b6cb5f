# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports as JSON in files."""

import dataclasses
import functools
import json
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from ._files import json_text
from .reports import Report, SolveReport


def to_json(report: Report | None) -> str:
    """JSON of a report and its kind."""
    if report is None:
        return "{}"
    return json_text({"kind": type(report).__name__, **dataclasses.asdict(report)})


def from_json(text: str) -> Report | None:
    """The report of a JSON text of to_json, or of files from before the kind was written.

    None for an empty report or one of another program; ValueError if fields do not match the kind.
    """
    found = json.loads(text)
    if not isinstance(found, dict):
        raise ValueError("its report is no object")
    kind = Report.kinds.get(found.pop("kind", None) or _kind_of(found))
    if kind is None:
        return None
    if kind is SolveReport and "out_of_time" in found:
        found["stopped_by"] = "time_budget" if found.pop("out_of_time") else "iterations"
    try:
        return kind(**{name: _restored(kind, name, value) for name, value in found.items()})
    except (TypeError, ValueError) as error:
        raise ValueError(f"its report does not fit: {error}") from None


def _kind_of(found: dict[str, Any]) -> str:
    marks = {
        "near_mean": "FitReport",
        "setup_seconds": "LiveReport",
        "error_mean": "InverseReport",
        "out_of_time": "SolveReport",
    }
    return next((kind for mark, kind in marks.items() if mark in found), "")


def _restored(kind: type[Report], name: str, value: Any) -> Any:
    """The value of a field from JSON, in which NaN and infinity are null and tuples are lists."""
    declared = _declared(kind).get(name, object)
    try:
        return _typed(value, declared)
    except (TypeError, ValueError):
        raise ValueError(f"{name} is {value!r:.40}") from None


@functools.cache
def _declared(kind: type[Report]) -> dict[str, Any]:
    return get_type_hints(kind)


def _typed(value: Any, declared: Any) -> Any:
    """The value converted to the annotated type; TypeError if that is impossible."""
    origin, inner = get_origin(declared), get_args(declared)
    if origin is tuple and isinstance(value, list):
        if inner[-1] is Ellipsis:
            return tuple(_typed(item, inner[0]) for item in value)
        return tuple(_typed(item, one) for item, one in zip(value, inner, strict=True))
    if origin is dict and isinstance(value, dict):
        return {_typed(name, inner[0]): _typed(item, inner[1]) for name, item in value.items()}
    if origin is Literal and value in inner:
        return value
    if origin in (Union, UnionType):
        return None if value is None else _typed(value, inner[0])
    if dataclasses.is_dataclass(declared) and isinstance(value, dict):
        hints = get_type_hints(declared)
        return declared(**{name: _typed(item, hints.get(name, object)) for name, item in value.items()})
    if declared is float and value is None:
        return float("nan")
    if declared is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if declared is object or type(value) is declared:
        return value
    raise TypeError
