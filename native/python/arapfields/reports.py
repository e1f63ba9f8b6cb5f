# SPDX-License-Identifier: GPL-3.0-or-later
"""What calls measure on the way: a frozen class for each kind of report.

Energies are the unit cube's, lengths the mesh's. `report["bend"]` reads report.bend; to_dict() is for JSON.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Generic, Literal, NamedTuple, Self, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

from ._report import Report as Report
from .wrap_report import WrapReport as WrapReport

StoppedBy: TypeAlias = Literal["iterations", "time_budget", "target_error", "callback", "diverged"]


@dataclass(frozen=True, kw_only=True)
class FitReport(Report):
    """What fit_sdf reached: absolute errors at points that were not learnt from, in mesh units."""

    near_mean: float
    """Mean error near the surface."""
    near_max: float
    """Largest error near the surface."""
    volume_mean: float
    """Mean error at points spread evenly through the cube."""
    volume_max: float
    """Largest error there."""
    scale: float
    """Mesh units a cube unit."""
    iterations: int
    seconds: float
    distance_seconds: float
    """The part of the seconds that exact distances took."""
    stopped_by: StoppedBy
    device: str


@dataclass(frozen=True, kw_only=True)
class HandleError(Report):
    """How far one handle's samples are from where they are asked to be, in mesh units."""

    error_mean: float
    error_max: float


@dataclass(frozen=True, kw_only=True)
class EnergyReport(Report):
    """What the reports of deform, stylize and LiveDeformer share, measured at surface samples."""

    stretch: float
    """Mean ‖J − R‖²."""
    bend: float
    """Mean squared speed at which the closest rotation R turns."""
    energy: float
    """stretch + bending · bend."""
    handle_error_mean: float
    """Mean distance between the handles' samples and their targets, in mesh units."""
    handle_error_max: float
    """The largest one."""
    min_determinant: float
    """Smallest det J."""
    flipped_share: float
    """Share of samples where det J ≤ 0."""
    max_stretch: float
    """Largest singular value of J."""
    min_stretch: float
    """Smallest singular value of J."""
    iterations: int
    seconds: float
    preference: float | None = None
    """Mean agreement with the preferred normals, where there are any."""
    notes: tuple[str, ...] = ()
    """Sentences on what should not go unseen: folds, far targets, margins that were reduced."""


@dataclass(frozen=True, kw_only=True)
class SolveReport(EnergyReport):
    """What deform or stylize reached."""

    scale: float
    """Mesh units a cube unit."""
    stopped_by: StoppedBy
    handles: tuple[HandleError, ...]
    """Each handle's errors."""
    loss: tuple[tuple[int, float], ...]
    """(iteration, loss), at most a few hundred of them."""
    far_target: float | None = None
    """Sizes of the shape to the farthest handle's target, where that is far."""

    @property
    def out_of_time(self) -> bool:
        """Whether the time budget ended it."""
        return self.stopped_by == "time_budget"


@dataclass(frozen=True, kw_only=True)
class LiveReport(EnergyReport):
    """What the last solve or step of a LiveDeformer reached; `speed`, in mesh units a second, is a step's."""

    value: float
    """All that is minimised."""
    evaluations: int
    """Times that the energy was evaluated."""
    converged: bool
    """Whether a further step would gain next to nothing."""
    setup_seconds: float
    kinetic: float = 0.0
    speed: float = 0.0


@dataclass(frozen=True, kw_only=True)
class InverseReport(Report):
    """What train_inverse reached: distances ‖g(f(x)) − x‖ over the samples, in mesh units."""

    error_mean: float
    error_max: float
    iterations: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class SampleReport(Report):
    """What sample_surface did."""

    lines: int
    """Random lines cast."""
    evaluations: int
    """Points at which the function was evaluated, those with gradients included."""
    gradient_evaluations: int
    model_evaluations: int
    """Points spent before the first line."""
    lipschitz: float
    """The bound on the gradient that was measured."""
    largest_value: float
    """Largest |sdf| of the samples, in cube units."""
    seconds: float


@dataclass(frozen=True, kw_only=True)
class ExtractionReport(Report):
    """What extract_surface did."""

    evaluations: int
    """Points at which the function was evaluated, those with gradients included."""
    dense_evaluations: int
    """Points of the whole grid."""
    open: bool
    """Whether the surface leaves the cube, so that the mesh has a boundary."""
    seconds: float
    pieces: int
    """Parts of the mesh that share no vertex."""
    thin_cells: int
    """Cells at parts thinner than two cells."""
    refinement: int
    """Steps into which an edge of these was cut; 1 where none was."""
    holding_resolution: int
    """One that holds what came apart in fewer pieces; 0 where none was found or nothing did."""
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class DeformedExtractionReport(ExtractionReport):
    """What extract_deformed did."""

    inverted: int
    """Points whose rest positions were asked for."""
    failures: int
    """Those without one beside the surface, where the distance to the moved rest surface stands in."""
    spacing: float
    """Of the grid, a length."""


class _Mesh(NamedTuple):
    vertices: npt.NDArray[np.float64]
    triangles: npt.NDArray[np.int32]


ExtractionReportT = TypeVar("ExtractionReportT", bound=ExtractionReport, covariant=True)


class Extraction(_Mesh, Generic[ExtractionReportT]):
    """An extracted mesh: `V, F = extract_surface(sdf)`, vertices (n, 3), triangles (m, 3); and `report`."""

    report: ExtractionReportT

    def __new__(
        cls, vertices: npt.NDArray[np.float64], triangles: npt.NDArray[np.int32], report: ExtractionReportT
    ) -> Self:
        made = super().__new__(cls, vertices, triangles)
        object.__setattr__(made, "report", report)
        return made

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot assign to {name!r} of an Extraction")

    def __getnewargs__(self) -> tuple[Any, ...]:
        return *self, self.report


@dataclass(frozen=True, kw_only=True)
class Iteration:
    """What a callback gets after each iteration."""

    iteration: int
    """Iterations done, from 1."""
    loss: float
    """The estimate that this iteration lowered."""
    terms: Mapping[str, float]
    """The weighted terms of the loss, whose sum it is; see deform, stylize and fit_sdf for their names."""
    seconds: float
    """Since the iterations began."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "terms", MappingProxyType(dict(self.terms)))
