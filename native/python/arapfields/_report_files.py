# SPDX-License-Identifier: GPL-3.0-or-later
"""Reports as files keep them."""

import dataclasses
import json
from typing import Any

from ._files import json_text
from .reports import HandleError, Report, SolveReport


def to_json(report: Report | None) -> str:
    """A report, with its kind, as a file keeps it."""
    if report is None:
        return "{}"
    return json_text({"kind": type(report).__name__, **dataclasses.asdict(report)})


def from_json(text: str) -> Report | None:
    """What to_json wrote, or a report of a file from before kinds were written.

    None for an empty one and for what another program wrote; ValueError for one of ours that does not fit.
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
    """A field's value from JSON, where NaN and infinity are null and tuples are lists."""
    declared = {field.name: field.type for field in dataclasses.fields(kind)}.get(name)
    if name == "handles":
        return tuple(HandleError(**handle) for handle in value)
    if name == "loss":
        return tuple((int(iteration), float(loss)) for iteration, loss in value)
    if name == "notes":
        return tuple(str(note) for note in value)
    if declared is float:
        return float("nan") if value is None else float(value)
    return value
