# SPDX-License-Identifier: GPL-3.0-or-later
"""The job of deform and stylize: planned, solved on a worker, placed; and the first result meanwhile."""

import contextlib
import hashlib
import math

import bpy
import numpy as np

from ..blender import host, modifier_stack, references
from ..blender.evaluation import depsgraph_of
from ..blender.host import has_window
from ..blender.language import about, translated
from ..blender.object_references import ObjectReference, settings_of
from ..blender.property_definitions import effective_value
from ..carried.carrying import Carrying
from ..core.errors import UserError, refuse
from ..core.geometry.spaces import inverse, similarity, transform
from ..core.poses import Pose
from ..core.runtime import native
from ..core.runtime.jobs import Item
from ..field_modifier import layers, motion
from ..handles import empties
from ..handles.overlays import Preview
from ..jobs.job_operator import JobOperator
from ..live.sessions import end_for_job
from ..poses import applying
from ..results import placement
from ..results.placement import SolvedMesh, destination, placement_refusal
from ..solver.source_reader import points_now, read_at_rest
from ..surface.source_surface import PointsBefore

# Preview of a running solve on the source itself, by its field modifier.
#
# The earlier motion is restored bit for bit before the result is placed, the job cancelled, a step undone
# or the file saved. Undo steps pushed during the solve contain the preview, so the motion is also restored
# after undo or redo to them.

WAIT = 0.2  # seconds between checks whether Edit Mode has ended


class Steps(dict):
    """{session_uid: {digest of previewed offsets: the motion before them}} of this file's jobs."""

    def note(self, source, shown, before):
        self.setdefault(source.session_uid, {})[digest(shown)] = before

    def recover(self):
        """After undo or redo: restores the motion of sources whose step contains a preview."""
        # A list: restoring removes helper objects, which may invalidate Blender's iterator.
        for source in [item for item in bpy.data.objects if item.session_uid in self]:
            known = self[source.session_uid]
            shown = motion.snapshot(source) if source.mode != "EDIT" else None
            if shown is not None and digest(shown) in known:
                motion.restore(source, known[digest(shown)])


steps = Steps()


def digest(moved):
    return None if moved.offsets is None else hashlib.sha1(moved.offsets.tobytes()).digest()


class FirstResult:
    """Shows a solve's points on the source that it works on; main thread but for `points`."""

    def __init__(self, surface):
        self._surface, self._shown, self._before = surface, False, None

    @property
    def points(self):
        """(n, 3) points at rest, in solve space."""
        return self._surface.vertices

    def show(self, points):
        """Moves the source's points to (n, 3) in solve space; not while the user works on the mesh."""
        source = self._surface.reference.find()
        if source is None or source.mode != "OBJECT":
            return
        try:
            if not self._shown:
                before = motion.snapshot(source)
                # Undo ends the preview: a modifier that it has added goes before; what others refer to stays.
                with contextlib.nullcontext() if before is None else references.between():
                    motion.bind(bpy.context, source)
                self._shown, self._before = True, before
            local = self._surface.space.to_local(points.astype(float))
            motion.write(source, motion.Motion(local - self._surface.local))
            steps.note(source, motion.snapshot(source), self._before)
        except UserError:  # the mesh has changed: the job reports it
            self.clear()

    def hand_over(self):
        """Restores the motion from before the preview, but leaves a modifier that the preview has added to
        the result: Blender crashes if a modifier is removed while one of its inputs is being typed."""
        source = self._surface.reference.find()
        modifier = modifier_stack.find(source) if self._shown and source is not None else None
        if modifier is None or self._before is not None or source.mode != "OBJECT":
            self.clear()
        else:
            motion.write_to(motion.carrier(source, modifier), motion.Motion(None))

    def keep(self):
        """Leaves the source as it is, now that the result is placed."""
        self._shown = False

    def clear(self):
        """Restores the motion from before the preview."""
        if self._shown:
            self._shown = False
            put_back(self._surface.reference, self._before)


def put_back(reference, before):
    """Restores the motion `before` as soon as the source is not in Edit Mode."""

    def attempt():
        source = reference.find()
        if source is not None and source.mode == "EDIT":
            return WAIT
        if source is not None:
            under_rig = settings_of(source).under_rig
            motion.restore(source, before)
            if settings_of(source).under_rig != under_rig:  # the result is still to come to that place
                settings_of(source).under_rig = under_rig
        return None

    if attempt() is not None:
        host.start(attempt, first=WAIT)


# Base of the Deform and Stylize jobs: solves a field on the worker, then moves a mesh by it.


def plan_solve_job(
    context, operator, source, kind, samples, seed, solve, places=False, finish=None, space=None
):
    """The job's item. `solve(tracker, surface, samples, weight)` returns the field, on the worker.

    `finish(tracker, surface, points, triangles, moved)` gives vertices that the field has moved their places.
    `space`: the solve space, by default that of the object's present matrix.
    `places`: the object's transform takes the similarity part of the result, the mesh the rest.
    """
    settings = settings_of(source)
    output, result = destination(settings, operator)
    refuse(placement.refusal(source, output, result))
    operator.end_live(context, source, kind)
    refuse(placement.refusal(source, output, result))  # of the stack with the result below as a layer
    exact = effective_value("surface", settings, operator) == "EXACT"
    extraction = {name: effective_value(name, settings, operator) for name in ("resolution", "refine_thin")}
    carrying, in_place = Carrying(context, source), placement.in_place(output, result)
    further = {"exact": exact, "carrying": carrying, "space": space}
    surface, is_at_hand = read_at_rest(context, source, kind, in_place, output, **further)
    placed = PointsBefore(surface, surface.local if is_at_hand else points_now(context, source, surface))
    carried = carrying.poses(surface.space, depsgraph_of(context))
    handle_count = len(empties.used(source))
    preview = None
    if operator.in_window:
        preview = (FirstResult if placement.keeps_mesh(output, result) else Preview)(surface)

    def work(tracker):
        if preview is not None:
            tracker.rest_preview_points = preview.points
        weight = 1.0 if output == "WARP" else 0.7  # share of the solve in the remaining work
        weight *= 1.0 if finish is None else 0.8
        points = surface.samples(tracker, samples, seed, own_triangles=surface.exact and output == "WARP")
        field = solve(tracker, surface, points, weight)
        topology, report = None, {"output": output, **field.report.to_dict()}
        needs_own = output == "WARP" or places
        own = field(surface.vertices, triangles=surface.faces) if needs_own else None
        if own is not None:
            if finish is not None and surface.faces is not None:
                own = finish(tracker, surface, surface.vertices, surface.faces, own)
            own = placed.moved(own, field)
        if output == "REMESH":
            after, topology, figures = surface.extract_moved(tracker, field, **extraction)
            report |= figures
        elif output == "SURFACE":
            extracted, topology = surface.extract(tracker, 0.1, **extraction)
            after = field(extracted)
            if finish is not None:
                after = finish(tracker, surface, extracted, topology.corners, after)
        else:
            after = own
        if not np.isfinite(after).all():
            raise UserError("The result has vertices at invalid locations; try other settings")
        moves, place = np.eye(4), None
        if places:
            moves = similarity(placed.now, own)
            after = transform(inverse(moves), after)
            place = surface.space.solve_to_world @ moves @ surface.space.local_to_solve
        takes_turns = placement.keeps_mesh(output, result)
        turns = surface.turns(field, surface.vertices, moves) if takes_turns else None
        changes = surface.splat_changes(field)[1] if surface.in_place else None
        moved = carrying.moved(native.library(), points, field, carried, before=placed)
        local = surface.space.to_local(after)
        if output == "WARP":
            local = surface.space.moved_to_local(after, placed.now, placed.local)
        pose = Pose(field, points, surface.space.local_to_solve)
        return SolvedMesh(local, topology, report, turns, changes, moved, place), pose

    def apply(work_result):
        solved, pose = work_result
        if preview is not None:
            preview.hand_over()
        owner = surface.reference.get()
        if kind == "DEFORM":
            settings_of(owner).long_triangles = solved.report.get("turned_triangles", 0)
        item = placement.place_result(bpy.context, owner, kind, output, result, solved, placed.local)
        if result != "NEW":
            operator.ways = tuple(one for one in operator.ways if one[0].uid != surface.reference.uid)
        if preview is not None:
            preview.keep()
        if solved.place is not None:
            placement.put(bpy.context, item, solved.place)
        applying.solved[owner.session_uid] = pose
        carrying.put(bpy.context, solved.carried)
        reasons = carrying.take_warnings() + (layers.reasons_unseen(owner) if item == owner else [])
        operator.warnings += [about(owner.name, reason) for reason in reasons]
        named = "" if item == owner else item.name
        shown = named + placement.hidden_note(placement.show_alone(owner, item))
        figures = solved.report | handle_error(solved.report, handle_count)
        return describe(shown.strip(), figures, np.ptp(surface.vertices, axis=0).max())

    edits = () if result == "NEW" else (surface.reference,)
    return Item(source.name, work, apply, preview, edits)


class SolveOperator(JobOperator):
    """Mixin of jobs that solve a field; refuses results that cannot be placed before the solve."""

    ways = ()  # (ObjectReference, Way by make_way()) of sources without a result yet

    @classmethod
    def refuses(cls, source):
        """Checks the settings in the user interface only; a script's arguments are checked in `plan`."""
        return placement_refusal(source) if has_window() else None

    def end_live(self, context, source, kind):
        """Ends live mode after all checks, and makes the result that the run acts on a layer."""
        output, result = destination(settings_of(source), self)
        self.ended_live |= end_for_job(context, source, output, result)
        if any(reference.uid == source.session_uid for reference, _ in self.ways):
            return
        reason = None if result == "NEW" else layers.replaced(source, kind)
        self.warnings += [translated(reason)] if reason else []
        self.ways = (*self.ways, (ObjectReference(source), layers.make_way(source, kind)))

    def clear_up(self, job):
        """Restores the earlier results of sources whose job has failed."""
        for reference, way in self.ways:
            source = reference.find()
            if source is not None:
                layers.put_back(bpy.context, source, way)

    def in_place(self, source):
        return placement.in_place(*destination(settings_of(source), self))


def handle_error(report, count):
    """{"handle_error_max": largest error of the first `count` handles}, which are the user's."""
    errors = [handle["error_max"] for handle in report.get("handles", ())][:count]
    return {"handle_error_max": max(errors)} if errors else {}


def describe(shown, report, size):
    """One line: `shown` (the new object, what was hidden), the errors of handles or of the wrap, and folds.

    `size`: the object's longest side, of which errors are shares.
    """
    figures = [shown] if shown else []
    if report.get("handle_error_max"):
        share = max(0.001, math.ceil(1000 * report["handle_error_max"] / size) / 1000)
        figures.append(translated("follows its handles within {share}", share=f"{share:.1%}"))
    if "from_target_mean" in report:
        near = max(report["to_target_mean"], report["from_target_mean"])
        figures.append(translated("{share} of the target's size off on average", share=f"{near:.2%}"))
    if report.get("flipped_share"):
        figures.append(translated("{share} of it is folded over", share=f"{report['flipped_share']:.1%}"))
    elif "flipped_share" in report:
        figures.append(translated("no folds"))
    if report.get("far_target"):
        sizes = f"{report['far_target']:.0f}"
        figures.append(translated("a target is {sizes} times the object's size away", sizes=sizes))
    return ", ".join(figures)
