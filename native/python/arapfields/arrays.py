# SPDX-License-Identifier: GPL-3.0-or-later
"""Types of array arguments, for type checkers."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt


class SupportsArray(Protocol):
    """Objects with `__array__`, such as NumPy arrays."""

    def __array__(self) -> npt.NDArray[Any]: ...


class SupportsDLPack(Protocol):
    """Objects that share memory by DLPack, such as tensors."""

    def __dlpack__(self) -> Any: ...


if TYPE_CHECKING:
    from typing_extensions import Buffer

    Number: TypeAlias = float | np.floating[Any] | np.integer[Any]
    Flat: TypeAlias = SupportsArray | SupportsDLPack | Buffer | Sequence[Number]
    # Not numpy's ArrayLike, which includes strings.
    ArrayLike: TypeAlias = Flat | Sequence[Flat] | Sequence[Sequence[Flat]]
    """NumPy arrays, nested sequences, and what has the buffer protocol, DLPack or `__array__`."""
else:
    ArrayLike = npt.ArrayLike
