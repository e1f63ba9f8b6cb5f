# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact over the family of poses in support/geometry/contact_cases.py, with and without.

Depths and areas in per cent of the size and of the area; handles' errors where nothing holds them back in per
cent of the size; processor seconds of the default deform. ONLY, a part of a name, chooses cases.
"""

import os
import time

import numpy as np

import arapfields as af

from . import shapes


def solve(case, rest, triangles, contact, options=None):
    """(moved vertices, field, processor seconds)"""
    samples = af.sample_mesh(rest, triangles, 20_000, seed=0)
    begin = time.process_time()
    if not case.frames:
        wanted = options or af.DeformOptions()
        result = af.deform(samples, case.handles, wanted, contact=case.contact() if contact else None)
    else:
        live = af.LiveDeformer(samples, case.handles)
        for k in range(case.frames + 1):
            if contact:
                live.set_contact(case.contact(k / case.frames))
            result = live.solve(iterations=20)
    return np.asarray(result(rest)), result, time.process_time() - begin


def errors(case, rest, moved, held):
    """The largest mean error at the vertices inside a handle, of handles that contact does not hold back."""
    found = [0.0]
    ones = np.ones((len(rest), 1))
    for i, handle in enumerate(case.handles):
        inside = (np.abs(np.hstack([rest, ones]) @ np.linalg.inv(handle.rest).T)[:, :3] <= 1).all(1)
        if i not in held and inside.any():
            motion = handle.target @ np.linalg.inv(handle.rest)
            targets = (np.hstack([rest, ones]) @ motion.T)[inside, :3]
            found.append(np.linalg.norm(moved[inside] - targets, axis=1).mean())
    return max(found)


def measure(case):
    from support.geometry import contact_cases as family

    rest, triangles = family.surface(case.shape, str(shapes.data()))
    size = np.ptp(rest, axis=0).max()
    row = {"case": case.name}
    free, _, row["free_s"] = solve(case, rest, triangles, False)
    moved, result, row["contact_s"] = solve(case, rest, triangles, True)
    held = {h.handle for h in result.report.contact.held}
    row["held"] = " ".join(f"{h.handle}:{h.by}:{h.distance / size:.3f}" for h in result.report.contact.held)
    row["error_free"] = 100 * errors(case, rest, free, held) / size
    row["error"] = 100 * errors(case, rest, moved, held) / size
    row["flipped"] = 100 * result.report.flipped_share
    row["ratio"] = row["contact_s"] / row["free_s"]
    if case.solids:
        row["deep_free"] = 100 * family.deepest(case, free) / size
        row["deep"] = 100 * family.deepest(case, moved) / size
    if case.itself:
        for name, reader in (("inside", family.overlapping), ("cut", family.crossing)):
            row[name + "_free"] = 100 * reader(rest, free, triangles)
            row[name] = 100 * reader(rest, moved, triangles)
    return {k: round(v, 4) if isinstance(v, float) else v for k, v in row.items()}, moved


def run():
    from support.geometry import contact_cases as family

    only = os.environ.get("ONLY", "")
    rows = []
    for case in family.family(str(shapes.data())):
        if only in case.name:
            row, moved = measure(case)
            rows.append(row)
            print(row, flush=True)
            if os.environ.get("KEEP"):
                np.save(os.path.join(os.environ["KEEP"], case.name.replace(" ", "_") + ".npy"), moved)
    return rows
