# SPDX-License-Identifier: GPL-3.0-or-later
"""What all kinds of report have."""

import dataclasses
import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar


@dataclass(frozen=True, kw_only=True)
class Report:
    """What all reports have."""

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
        """Plain numbers, texts, lists and dicts by name."""
        plain: dict[str, Any] = json.loads(json.dumps(dataclasses.asdict(self)))
        return plain
