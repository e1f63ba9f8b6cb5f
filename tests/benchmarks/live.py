# SPDX-License-Identifier: GPL-3.0-or-later
"""Live solves: seconds a step, and poses against solves from rest."""

import numpy as np

import arapfields as af

from .peer.theirs import rotations
from .shapes import (
    FULL,
    ROOT,
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

# Live deformation and stylization over radial fields: set-up, drags, energies against the neural field's.

NEURAL_ITERATIONS = 500


def timed_drag(live, name, degrees=range(0, FULL + 1, 2)):
    """Wall and processor seconds per solve while the handle moves there and back in these steps."""
    live.reset()
    poses = [targets(name, d) for d in [*degrees, *reversed(degrees)]]
    with Clock() as clock:
        for pose in poses:
            live.solve(pose)
    return clock.wall / len(poses), clock.cpu / len(poses)


def converged(live, name):
    live.solve(targets(name, FULL), iterations=300, tolerance=1e-6)
    return live.report


def drag_row(name, neural, rounds=3, **options):
    setups, whole = [], []
    for _ in range(rounds):
        with Clock() as clock:
            live = deformer(name, **options)
        setups.append((clock.wall, clock.cpu))
        with Clock() as clock:
            live.solve(targets(name, FULL))
        whole.append((clock.wall, clock.cpu))
    twelve = live.report.energy
    steps = [timed_drag(live, name) for _ in range(rounds)]
    (setup, setup_cpu), (rest, rest_cpu), (step, step_cpu) = (
        np.min(times, axis=0) for times in (setups, whole, steps)
    )
    centers = live.field.centers
    best = converged(live, name)
    return {
        "what": f"{label(name)}, {centers} centers"
        + ("" if options.get("interior", True) else ", straight distances"),
        "setup_s": round(setup, 3),
        "setup_cpu_s": round(setup_cpu, 3),
        "solves_per_s": round(1 / step),
        "per_cpu_s": round(1 / step_cpu),
        "rest_to_70_s": round(rest, 3),
        "rest_to_70_cpu_s": round(rest_cpu, 3),
        "energy_12_steps": round(twelve, 4),
        "energy": round(best["energy"], 4),
        "of_neural": round(twelve / neural.report.energy, 2) if neural else "",
        "handle_error": round(best["handle_error_mean"], 4),
    }


def neural_field(name):
    options = af.DeformOptions(field="neural", iterations=NEURAL_ITERATIONS)
    return af.deform(samples(name), handles(name, FULL), options)


def polish_row(name, neural, iterations=NEURAL_ITERATIONS // 3):
    """A network initialized by the radial field, against one from rest."""
    with Clock() as clock:
        options = af.DeformOptions(field="neural", start="radial", iterations=iterations)
        field = af.deform(samples(name), handles(name, FULL), options)
    return {
        "what": f"{label(name)}: neural polish of the radial field, {iterations} iterations",
        "energy": round(field.report.energy, 4),
        "of_neural": round(field.report.energy / neural.report.energy, 2),
        "of_its_time": round(clock.wall / neural.report.seconds, 2),
        "handle_error": round(field.report.handle_error_mean, 4),
    }


STYLES = {  # {wanted mean of g: options for it}
    0.90: {"fine_centers": 400, "coarse_centers": 80, "gauss_weight": 4.0},
    0.95: {"fine_centers": 700, "coarse_centers": 140, "gauss_weight": 6.0, "samples": 3000},
    0.97: {"fine_centers": 1000, "coarse_centers": 200, "gauss_weight": 8.0, "samples": 4000},
}


def style_row(aim, options, most=60):
    """Time from the samples to spot in the cube style at this mean preference, including setup."""
    surface = samples("spot")
    with Clock() as clock:
        live = af.LiveDeformer(surface, options=af.LiveOptions(bending=0.01, barrier=1.0, **options))
        live.set_style("cube")
        steps = 0
        while steps < most:
            live.solve(iterations=2, tolerance=1e-9)
            steps += 2
            if live.report.preference >= aim:
                break
    return {
        "what": f"{label('spot')} to cube, mean g >= {aim}",
        "centers": live.field.centers,
        "steps": steps,
        "seconds": round(clock.wall, 2),
        "cpu_s": round(clock.cpu, 2),
        "preference": round(live.report.preference, 3),
        "flipped_share": live.report.flipped_share,
    }


def slider_row(updates=30):
    """Small changes of a style's strength, sharpness or orientation, with 600 centers."""
    live = af.LiveDeformer(
        samples("spot"),
        options=af.LiveOptions(
            coarse_centers=100, fine_centers=500, bending=0.1, barrier=1.0, gauss_weight=4.0
        ),
    )
    live.set_style("cube", strength=0.3)
    live.solve(iterations=40)
    cube = af.preferred_normals("cube")
    row = {"what": "style slider, 600 centers: updates a second"}
    for name in ("strength", "sharpness", "orientation"):
        with Clock() as clock:
            for i in range(updates):
                strength = 0.3 + (0.5 * i / updates if name == "strength" else 0)
                sharpness = 5.0 + (2.0 * i / updates if name == "sharpness" else 0)
                angle = np.radians(i if name == "orientation" else 0)
                turn = [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
                live.set_style(cube @ np.array(turn).T, strength=strength, sharpness=sharpness)
                live.solve()
        row[name] = round(updates / clock.wall, 1)
        row[f"{name}_per_cpu_s"] = round(updates / clock.cpu, 1)
    return row


def warp_row(count=50000, rounds=10):
    live = deformer("bunny")
    field = live.solve(targets("bunny", FULL))
    points = np.ascontiguousarray(samples("bunny", count).points)
    live.track(points)
    with Clock() as tracked:
        for _ in range(rounds):
            live.tracked()
    with Clock() as anew:
        for _ in range(rounds):
            field(points)
    return {
        "what": f"{count} points moved by the field",
        "tracked_ms": round(1e3 * tracked.wall / rounds, 1),
        "tracked_cpu_ms": round(1e3 * tracked.cpu / rounds, 1),
        "anew_ms": round(1e3 * anew.wall / rounds, 1),
        "anew_cpu_ms": round(1e3 * anew.cpu / rounds, 1),
    }


def run_live():
    neural = {name: neural_field(name) for name in ("bunny", "spot", "hand")}
    rows = [drag_row(name, field) for name, field in neural.items()]
    larger = {"coarse_centers": 100, "fine_centers": 600, "samples": 3000}
    rows += [drag_row("bunny", neural["bunny"], 1, **larger)]
    rows += [drag_row("bunny", None, interior=False)]
    rows += [polish_row(name, neural[name]) for name in ("bunny", "hand")]
    rows += [style_row(aim, options) for aim, options in STYLES.items()]
    return [*rows, slider_row(), warp_row()]


# The live solver beside libigl's ARAP of the mesh; its cost by size; fingers that move alone.
#
# `python -m tests.benchmarks.live` draws the picture of docs/performance.md (libigl, matplotlib,
# data).


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


def run_live_compare():
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


CLAY, MOVED = np.array([0.80, 0.76, 0.70]), np.array([0.45, 0.62, 0.80])


def draw(axes, vertices, triangles, toward, title, colour=MOVED):
    """Draws flat-shaded triangles from direction `toward`, z up, from back to front."""
    toward = np.asarray(toward, float) / np.linalg.norm(toward)
    right = np.cross([0, 0, 1], toward)
    right /= np.linalg.norm(right)
    up = np.cross(toward, right)
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1), 1e-12)[:, None]
    front = np.flatnonzero(normals @ toward > 0)
    front = front[np.argsort(corners[front].mean(1) @ toward)]
    light = toward + 0.6 * up - 0.5 * right
    shade = np.clip(0.35 + 0.65 * normals[front] @ light / np.linalg.norm(light), 0.1, 1)
    from matplotlib.collections import PolyCollection

    flat = np.stack([corners[front] @ right, corners[front] @ up], -1)
    axes.add_collection(PolyCollection(flat, facecolors=shade[:, None] * colour, edgecolors="face", lw=0.2))
    axes.set_aspect("equal")
    axes.set_title(title, fontsize=10)
    axes.set_axis_off()
    axes.autoscale()


def picture(resolution=80):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, places = plt.subplots(2, 3, figsize=(9, 7.2))
    vertices, triangles = surface("bunny", resolution)
    whole, view = volume(vertices, triangles), [0.25, -1, 0.15]
    theirs = igl_arap(vertices, triangles, placements("bunny"), targets("bunny", FULL))[0]
    ours = deformer("bunny").solve(targets("bunny", FULL))(vertices)
    draw(places[0, 0], vertices, triangles, view, "rest", CLAY)
    for place, moved, name in (
        (places[0, 1], ours, "live solver"),
        (places[0, 2], theirs, "libigl, ARAP of the mesh"),
    ):
        draw(place, moved, triangles, view, f"{name}: {volume(moved, triangles) / whole:.2f} of the volume")
    vertices, triangles = surface("hand", resolution)
    palm, finger = placements("hand")
    pair = [
        cases.moved(palm),
        cases.moved(finger, cases.turn([0, 1, 0], 50, (-0.1, -0.05, 0.05))),
    ]
    view = [1, 0.15, 0.1]
    draw(places[1, 0], vertices, triangles, view, "rest", CLAY)
    for place, interior, name in (
        (places[1, 1], True, "distances inside the shape"),
        (places[1, 2], False, "distances in space"),
    ):
        live = af.LiveDeformer(samples("hand"), pair, af.LiveOptions(interior=interior))
        field = live.solve(iterations=100)
        draw(place, field(vertices), triangles, view, f"{name}: E = {live.report['energy']:.4f}")
    figure.tight_layout()
    target = ROOT / "docs" / "images" / "live-compare.webp"
    figure.savefig(target, dpi=110, pil_kwargs={"quality": 95})
    print("wrote", target)


if __name__ == "__main__":
    picture()
