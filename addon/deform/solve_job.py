# SPDX-License-Identifier: GPL-3.0-or-later
"""What deforming and stylizing share: a field is solved on the worker, then moves a mesh."""

from dataclasses import dataclass

import bpy
import numpy as np

from ..blender.language import translated
from ..blender.property_definitions import effective_value
from ..core.errors import UserError
from ..core.geometry.edges import Topology
from ..core.runtime.jobs import Item
from ..results.placement import place_result, require_placeable
from ..surface.source_surface import read_surface, settings_of
from ..viewport.previews import Preview


@dataclass
class SolvedMesh:
    """What the worker hands back, in local coordinates."""

    vertices: np.ndarray
    topology: Topology | None  # of the implicit surface; None for the source's own mesh
    report: dict


def plan_solve_job(context, operator, source, kind, samples, seed, solve):
    """The job's item. `solve(tracker, surface, samples, weight)` returns the field, on the worker."""
    surface = read_surface(context, source)
    settings = settings_of(source)
    output = effective_value("output", settings, operator)
    cells = effective_value("resolution", settings, operator)
    choice = effective_value("surface", settings, operator)
    target = effective_value("target", settings, operator)
    if target != "NEW":
        require_placeable(source, output, target, surface.local)

    preview = Preview(surface) if operator.in_window else None

    def work(tracker):
        if preview is not None:
            tracker.rest_preview_points = preview.points
        use_fit = choice == "FIT" or output != "WARP" or (choice == "AUTO" and surface.is_cached)
        weight = 1.0 if output == "WARP" else 0.7  # of the solve in what is left to do
        field = solve(tracker, surface, surface.samples(tracker, samples, seed, use_fit), weight)
        topology, report = None, {"output": output, **dict(field.report)}
        if output == "REMESH":
            after, topology, figures = surface.extract_moved(tracker, field, cells)
            report |= figures
        else:
            before = surface.vertices
            if output == "SURFACE":
                before, topology = surface.extract(tracker, cells, 0.1)
            after = field(before)
        if not np.isfinite(after).all():
            raise UserError("the result has vertices that are not finite; try other settings")
        return SolvedMesh(surface.space.to_local(after), topology, report)

    def apply(solved):
        owner = surface.reference.get()
        item = place_result(bpy.context, owner, kind, output, target, solved, surface.local)
        return describe(item, solved.report)

    return Item(source.name, work, apply, preview)


def describe(item, report):
    figures = [item.name]
    if "energy" in report:
        figures.append(translated("energy {value}", value=f"{report['energy']:.4g}"))
    if report.get("handle_error_mean"):
        figures.append(
            translated("handles off by {value} on average", value=f"{report['handle_error_mean']:.2g}")
        )
    if report.get("flipped_share"):
        share, worst = f"{report['flipped_share']:.1%}", f"{report['min_determinant']:.2g}"
        figures.append(translated("{share} folded (det J down to {worst})", share=share, worst=worst))
    if report.get("far_target"):
        sizes = f"{report['far_target']:.0f}"
        figures.append(translated("a target is {sizes} times the object's size away", sizes=sizes))
    return ", ".join(figures)
