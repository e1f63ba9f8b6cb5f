# SPDX-License-Identifier: GPL-3.0-or-later
"""What the functions take, as type checkers see it."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt


class SupportsArray(Protocol):
    """Arrays, and what makes one of itself."""

    def __array__(self) -> npt.NDArray[Any]: ...


class SupportsDLPack(Protocol):
    """Memory that is shared by DLPack, such as a tensor's."""

    def __dlpack__(self) -> Any: ...


if TYPE_CHECKING:
    from typing_extensions import Buffer

    Number: TypeAlias = float | np.floating[Any] | np.integer[Any]
    Flat: TypeAlias = SupportsArray | SupportsDLPack | Buffer | Sequence[Number]
    # Not numpy's own alias, which takes texts too.
    ArrayLike: TypeAlias = Flat | Sequence[Flat] | Sequence[Sequence[Flat]]
    """NumPy arrays, nested sequences, and what has the buffer protocol, DLPack or `__array__`."""
else:
    ArrayLike = npt.ArrayLike
