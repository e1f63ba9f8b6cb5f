# SPDX-License-Identifier: GPL-3.0-or-later
"""The base class of reports, and the argument of callbacks."""

import dataclasses
import functools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar


@dataclass(frozen=True, kw_only=True)
class Report:
    """A frozen set of measurements; `report["bend"]` reads report.bend."""

    kinds: ClassVar[dict[str, type["Report"]]] = {}

    def __init_subclass__(cls) -> None:
        Report.kinds[cls.__name__] = cls

    def __getitem__(self, name: str) -> Any:
        if name not in self.keys():
            raise KeyError(name)
        return getattr(self, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self.keys())

    @classmethod
    def keys(cls) -> tuple[str, ...]:
        """The fields' names, in order."""
        return tuple(field.name for field in dataclasses.fields(cls))

    def to_dict(self) -> dict[str, Any]:
        """{name: value}, values of plain types: numbers, strings, lists and dicts."""
        plain: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(self)))
        return plain


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """The argument of a callback, after each iteration."""

    iteration: int
    """Number of completed iterations, from 1."""
    loss: float
    """The loss estimated in this iteration."""
    terms: Mapping[str, float]
    """The weighted terms, which sum to the loss; see deform, stylize and fit_sdf for their names."""
    seconds: float
    """Time since the start of the iterations."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "terms", MappingProxyType(dict(self.terms)))

    def __reduce__(self) -> tuple[Any, tuple[()]]:
        given = {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}
        return functools.partial(type(self), **(given | {"terms": dict(self.terms)})), ()
