# SPDX-License-Identifier: GPL-3.0-or-later
"""Base class and types of custom energies for deform and stylize."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ._native import InvalidInput
from .arrays import ArrayLike


@dataclass(frozen=True, eq=False)
class Jets:
    """A field f at n samples of the rest surface, in the mesh's coordinates."""

    points: npt.NDArray[np.float64]
    """Rest positions x (n, 3)."""
    values: npt.NDArray[np.float64]
    """f(x) (n, 3)."""
    jacobians: npt.NDArray[np.float64]
    """(n, 3, 3): [:, i, j] = ∂f_i/∂x_j."""
    second: npt.NDArray[np.float64] | None = None

    @property
    def hessians(self) -> npt.NDArray[np.float64]:
        """(n, 3, 3, 3): [:, i, j, k] = ∂²f_i/∂x_j∂x_k (1/length). InvalidInput for an energy of order 1."""
        if self.second is None:
            raise InvalidInput("hessians: the energy's order is 1; one of order 2 has them")
        return self.second


class EnergyValue(NamedTuple):
    """An energy's value and its derivatives by the jets; None for derivatives that are zero."""

    value: float
    values: ArrayLike | None = None
    """∂value/∂values (n, 3)."""
    jacobians: ArrayLike | None = None
    """∂value/∂jacobians (n, 3, 3)."""
    hessians: ArrayLike | None = None
    """∂value/∂hessians (n, 3, 3, 3), all of whose entries are independent variables."""


class Energy(ABC):
    """A term of the loss, written in Python: `deform(samples, handles, options, energies=[mine])`.

    It is called in each iteration with the jets at that iteration's samples; its value is added to the loss
    with weight 1. Use a mean over the samples to be independent of their number. For order 1, a plain
    function of the jets is enough.
    """

    order: int = 1
    """Highest order of the derivatives it uses: 1 or 2; second derivatives are computed only for 2."""

    @abstractmethod
    def __call__(self, jets: Jets) -> EnergyValue:
        """The value and its derivatives."""
