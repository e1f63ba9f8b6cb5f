# SPDX-License-Identifier: GPL-3.0-or-later
"""What deforming and stylizing share: a field is solved on the worker, then moves a mesh."""

from dataclasses import dataclass

import bpy
import numpy as np

from ..blender.language import translated
from ..blender.settings import chosen
from ..core.errors import UserError
from ..core.geometry.edges import Topology
from ..core.runtime.jobs import Item
from ..results.placement import deliver, refuse
from ..surface.source_surface import read_surface, settings_of
from ..viewport.previews import Preview


@dataclass
class Moved:
    """What the worker hands back, in local coordinates."""

    vertices: np.ndarray
    topology: Topology | None  # of the implicit surface; None for the source's own mesh
    report: dict


def plan_move(context, operator, source, kind, samples, seed, solve):
    """The job's item. `solve(stages, surface, samples)` returns the field, on the worker."""
    surface = read_surface(context, source)
    ours = settings_of(source)
    output = chosen("output", ours, operator)
    cells = chosen("resolution", ours, operator)
    choice = chosen("surface", ours, operator)
    target = chosen("target", ours, operator)
    if target != "NEW":
        refuse(source, output, target, surface.local)

    preview = Preview(surface) if operator.has_window else None

    def work(stages):
        if preview is not None:
            stages.watched_points = preview.points
        use_fit = choice == "FIT" or output != "WARP" or (choice == "AUTO" and surface.is_cached)
        field = solve(stages, surface, surface.samples(stages, samples, seed, use_fit))
        topology, report = None, {"output": output, **dict(field.report)}
        if output == "REMESH":
            after, topology, figures = surface.extract_moved(stages, field, cells, 0.3)
            report |= figures
        else:
            before = surface.vertices
            if output == "SURFACE":
                before, topology = surface.extract(stages, cells, 0.1)
            after = field(before)
        if not np.isfinite(after).all():
            raise UserError("the result has vertices that are not finite; try other settings")
        return Moved(surface.space.to_local(after), topology, report)

    def apply(moved):
        owner = surface.who.get()
        item = deliver(bpy.context, owner, kind, output, target, moved, surface.local)
        return describe(item, moved.report)

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
        figures.append(translated("{share} folded", share=f"{report['flipped_share']:.1%}"))
    return ", ".join(figures)
