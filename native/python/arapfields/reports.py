# SPDX-License-Identifier: GPL-3.0-or-later
"""Measurements of calls: a frozen class for each kind of report.

Energies are the unit cube's, lengths the mesh's. `report["bend"]` reads report.bend; to_dict() is for JSON.
"""

import dataclasses
import functools
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Generic, Literal, NamedTuple, Self, TypeAlias, TypeVar

import numpy as np
import numpy.typing as npt

# The base class of reports, and the argument of callbacks.


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


# Classes of reports on contact.


@dataclass(frozen=True, kw_only=True)
class HeldBack(Report):
    """A handle that contact prevents from reaching its target."""

    handle: int
    by: str
    """Such as "obstacles[0]" or "ground"."""
    distance: float
    """Mean distance to the target, in mesh units."""


@dataclass(frozen=True, kw_only=True)
class ContactReport(Report):
    """Contact of a solved surface."""

    deepest: float
    """Largest penetration of a sample beyond an obstacle's margin, in mesh units."""
    touching: float
    """Share of the area in contact."""
    held: tuple[HeldBack, ...]
    crossing: tuple[str, ...]
    """Obstacles, such as "obstacles[0]", that cross the surface at rest; points inside them stay."""
    self_intersections: int | None
    """Pairs of the mesh's triangles that pass through each other and do not at rest, of parts that are far
    from each other there. None without `itself`, for samples that know no mesh, and after step()."""


StoppedBy: TypeAlias = Literal["iterations", "time_budget", "target_error", "callback", "diverged"]


@dataclass(frozen=True, kw_only=True)
class FitReport(Report):
    """Absolute errors of fit_sdf at points outside the training set, in mesh units."""

    near_mean: float
    """Mean error near the surface."""
    near_max: float
    """Largest error near the surface."""
    volume_mean: float
    """Mean error at points uniform in the cube."""
    volume_max: float
    """Largest error at these points."""
    scale: float
    """Mesh units per cube unit."""
    iterations: int
    seconds: float
    distance_seconds: float
    """Seconds spent on exact distances."""
    stopped_by: StoppedBy
    device: str


@dataclass(frozen=True, kw_only=True)
class HandleError(Report):
    """Distances between one handle's samples and their targets, in mesh units."""

    error_mean: float
    error_max: float


@dataclass(frozen=True, kw_only=True)
class EnergyReport(Report):
    """Common fields of the reports of deform, stylize and LiveDeformer, measured at surface samples."""

    stretch: float
    """Mean ‖J − R‖²."""
    bend: float
    """Mean squared derivative of the closest rotation R."""
    energy: float
    """stretch + bending · bend."""
    handle_error_mean: float
    """Mean distance between the handles' samples and their targets, in mesh units."""
    handle_error_max: float
    """Largest distance between a sample and its target, in mesh units."""
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
    contact: ContactReport
    preference: float | None = None
    """Mean agreement with the preferred normals, if there are any."""
    notes: tuple[str, ...] = ()
    """Warnings: folds, distant targets, margins that were reduced."""
    terms: dict[str, float] = field(default_factory=dict, hash=False)
    """The weighted terms of the minimised sum at the end; a network's are of its last batch of samples."""


@dataclass(frozen=True, kw_only=True)
class SolveReport(EnergyReport):
    """Energies, errors and loss history of deform or stylize."""

    scale: float
    """Mesh units per cube unit."""
    stopped_by: StoppedBy
    handles: tuple[HandleError, ...]
    """Each handle's errors."""
    loss: tuple[tuple[int, float], ...]
    """(iteration, loss), at most a few hundred pairs."""
    far_target: float | None = None
    """Distance of the farthest target divided by the shape's size, if that is large."""
    turned_triangles: int = 0
    """Triangles of the mesh that turn over where the field does not fold: they are too long for the motion.
    0 where they are less than 0.2 % of it."""

    @property
    def out_of_time(self) -> bool:
        """Whether the time budget ended the solve."""
        return self.stopped_by == "time_budget"


@dataclass(frozen=True, kw_only=True)
class LiveReport(EnergyReport):
    """The last solve or step of a LiveDeformer. `speed`: that of a step, in mesh units per second."""

    value: float
    """The minimised value, the sum of all terms."""
    evaluations: int
    """Number of evaluations of the energy."""
    converged: bool
    """Whether further steps would hardly reduce the value."""
    setup_seconds: float
    kinetic: float = 0.0
    speed: float = 0.0


@dataclass(frozen=True, kw_only=True)
class WrapReport(Report):
    """Distances and distortion of a wrap. Distances between surfaces are shares of the target's diagonal."""

    to_target_mean: float
    """Mean distance to the target from the parts of the wrapped surface that have a counterpart."""
    to_target_95: float
    """The 95 % quantile of that distance."""
    from_target_mean: float
    """Mean distance from the target to the wrapped surface."""
    from_target_95: float
    """The 95 % quantile of that distance."""
    matched_share: float
    """Share of the surface that has a counterpart; 1 for a closed target."""
    landmarks: tuple[float, ...]
    """Distance of each landmark from its target point, in mesh units."""
    left_out: tuple[int, ...]
    """Indices of landmarks that contradict the others and are ignored."""
    diagonal: float
    """Diagonal of the target's bounding box, in mesh units."""
    scale: float
    """Scale of the alignment."""
    stretch: float
    """Mean ‖J − R‖², without that scale."""
    bend: float
    """Mean squared derivative of the closest rotation R."""
    min_determinant: float
    """Smallest det J, without the scale."""
    flipped_share: float
    """Share of samples where det J ≤ 0."""
    iterations: int
    seconds: float
    notes: tuple[str, ...] = ()
    """Warnings: shapes that differ much, contradictory landmarks, folds."""


@dataclass(frozen=True, kw_only=True)
class InverseReport(Report):
    """Distances ‖g(f(x)) − x‖ of train_inverse over the samples, in mesh units."""

    error_mean: float
    error_max: float
    iterations: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class SampleReport(Report):
    """Lines and evaluations of sample_surface."""

    lines: int
    """Random lines cast."""
    evaluations: int
    """Number of evaluated points, including those with gradients."""
    gradient_evaluations: int
    model_evaluations: int
    """Evaluations before the first line."""
    lipschitz: float
    """The bound on the gradient, given or measured."""
    largest_value: float
    """Largest |sdf| of the samples, in cube units."""
    seconds: float


@dataclass(frozen=True, kw_only=True)
class ExtractionReport(Report):
    """Evaluations and topology of extract_surface."""

    evaluations: int
    """Number of evaluated points, including those with gradients."""
    dense_evaluations: int
    """Number of points of the full grid."""
    open: bool
    """Whether the surface leaves the cube, so that the mesh has a boundary."""
    seconds: float
    pieces: int
    """Number of connected components of the mesh."""
    thin_cells: int
    """Number of cells at parts thinner than two cells."""
    refinement: int
    """Number of parts of an edge of these cells; 1 without refinement."""
    holding_resolution: int
    """A resolution with fewer pieces; 0 if none was found, or nothing came apart."""
    notes: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class DeformedExtractionReport(ExtractionReport):
    """Evaluations, inverses and topology of extract_deformed."""

    inverted: int
    """Number of points whose rest positions were computed."""
    failures: int
    """Points without a rest position, at which the distance to the moved rest surface is used."""
    spacing: float
    """Spacing of the grid, in mesh units."""


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
        extraction = super().__new__(cls, vertices, triangles)
        object.__setattr__(extraction, "report", report)
        return extraction

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"cannot assign to {name!r} of an Extraction")

    def __getnewargs__(self) -> tuple[Any, ...]:
        return *self, self.report
