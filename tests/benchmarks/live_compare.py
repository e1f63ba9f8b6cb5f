# SPDX-License-Identifier: GPL-3.0-or-later
"""The live solver beside libigl's ARAP of the mesh; its cost by size; fingers that move alone."""

import numpy as np

import arapfields as af

from .live_cases import (
    FULL,
    Clock,
    cases,
    deformer,
    drag,
    hand,
    handles,
    inside,
    label,
    placements,
    samples,
    surface,
    targets,
    volume,
)
from .peer.yardstick import rotations


def igl_arap(vertices, triangles, boxes, poses, tolerance=1e-4, most=2000):
    """libigl's ARAP from rest until an iteration moves by less than this share of the whole motion."""
    import igl

    members = [np.flatnonzero(inside(rest, vertices)) for rest in boxes]
    goal = []
    for rest, target, rows in zip(boxes, poses, members, strict=True):
        motion = target @ np.linalg.inv(rest)
        goal.append(vertices[rows] @ motion[:3, :3].T + motion[:3, 3])
    data = igl.ARAPData()
    with Clock() as setup:
        igl.arap_precomputation(vertices, triangles, 3, np.concatenate(members), data)
    data.max_iter = 1
    moved, goal = vertices.copy(), np.concatenate(goal)
    with Clock() as clock:
        iteration = 0
        while iteration < most:
            iteration += 1
            before, moved = moved, igl.arap_solve(goal, data, moved)
            if np.linalg.norm(moved - before) < tolerance * np.linalg.norm(moved - vertices):
                break
    return moved, setup, clock, iteration


def compare_rows(name, resolution=96):
    vertices, triangles = surface(name, resolution)
    poses, whole = targets(name, FULL), volume(vertices, triangles)
    samples(name)
    theirs, setup, clock, iterations = igl_arap(vertices, triangles, placements(name), poses)
    with Clock() as our_setup:
        live = deformer(name)
        live.track(vertices)
    with Clock() as our_clock:
        live.solve(poses, iterations=100, tolerance=1e-4)
        ours = live.tracked().astype(float)
    shared = {"vertices": len(vertices)}
    return [
        {
            "what": f"{label(name)}: live",
            **shared,
            "setup_cpu_s": round(our_setup.cpu, 3),
            "steps": live.report.iterations,
            "cpu_s": round(our_clock.cpu, 3),
            "mesh_energy": round(rotations(vertices, triangles, ours)[1], 3),
            "volume_ratio": round(volume(ours, triangles) / whole, 3),
        },
        {
            "what": f"{label(name)}: libigl",
            **shared,
            "setup_cpu_s": round(setup.cpu, 3),
            "steps": iterations,
            "cpu_s": round(clock.cpu, 3),
            "mesh_energy": round(rotations(vertices, triangles, theirs)[1], 3),
            "volume_ratio": round(volume(theirs, triangles) / whole, 3),
        },
    ]


def cost_row(centers, count):
    options = {"coarse_centers": centers // 6, "fine_centers": centers - centers // 6, "samples": count}
    with Clock() as setup:
        live = deformer("bunny", **options)
    pair = handles("bunny")
    with Clock() as added:
        live.set_handles([*pair, af.Point([0, 0, 0.2], [0, 0, 0.2])])
    live.set_handles(pair)
    steps = 0
    with Clock() as clock:
        for degrees in range(5, FULL + 1, 5):
            live.solve(targets("bunny", degrees))
            steps += live.report.iterations
    live.solve(iterations=200, tolerance=1e-6)
    return {
        "what": label("bunny"),
        "centers": centers,
        "samples": count,
        "setup_cpu_s": round(setup.cpu, 3),
        "handle_added_cpu_s": round(added.cpu, 3),
        "step_cpu_ms": round(1e3 * clock.cpu / steps, 2),
        "energy": round(live.report.energy, 4),
    }


def finger_row(finger, motion, degrees, field=None):
    (palm, middle), surface_samples = placements("hand"), samples("hand")
    box, pivot = (middle, drag("hand")[3]) if finger == "middle" else hand()["index"]
    box = box if finger == "middle" else cases.box(*box)
    pair = [cases.moved(palm), cases.moved(box, cases.turn(hand()[motion], degrees, pivot))]
    if field is None:
        live = af.LiveDeformer(surface_samples, pair)
        field = live.solve(iterations=100, tolerance=1e-5)
        energy, name = live.report.energy, "radial"
    else:
        trained = af.deform(surface_samples, pair, af.DeformOptions(field="neural", iterations=300))
        energy, name, field = trained.report.energy, field, trained
    row = {
        "what": f"{label('hand')}, % of its length: {finger} {motion} {abs(degrees)} degrees",
        "field": name,
        "energy": round(energy, 4),
    }
    for tip, place in hand()["tips"].items():
        near = np.argsort(np.linalg.norm(surface_samples.points - place, axis=1))[:20]
        points = surface_samples.points[near]
        share = np.linalg.norm(field(points) - points, axis=1).max() / hand()["length"]
        row[tip] = "moved" if tip == finger else round(100 * share, 1)
    return row


def run():
    rows = [row for name in ("bunny", "hand") for row in compare_rows(name)]
    for centers in (120, 360, 1500):
        rows.append(cost_row(centers, 2000))
    rows += [cost_row(360, count) for count in (1000, 8000)]
    for finger, motion, degrees in (
        ("middle", "aside", -25),
        ("middle", "forward", 20),
        ("middle", "forward", 50),
    ):
        rows.append(finger_row(finger, motion, degrees))
        rows.append(finger_row(finger, motion, degrees, field="neural, 300 iterations"))
    return rows
