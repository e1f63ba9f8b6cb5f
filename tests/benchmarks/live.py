# SPDX-License-Identifier: GPL-3.0-or-later
"""Live deformation and stylization over radial fields: set-up, drags, energies against the neural field's."""

import numpy as np

import arapfields as af

from .shapes import FULL, Clock, deformer, handles, label, samples, targets

NEURAL_ITERATIONS = 500


def drag(live, name, degrees=range(0, FULL + 1, 2)):
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
    steps = [drag(live, name) for _ in range(rounds)]
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


def run():
    neural = {name: neural_field(name) for name in ("bunny", "spot", "hand")}
    rows = [drag_row(name, field) for name, field in neural.items()]
    larger = {"coarse_centers": 100, "fine_centers": 600, "samples": 3000}
    rows += [drag_row("bunny", neural["bunny"], 1, **larger)]
    rows += [drag_row("bunny", None, interior=False)]
    rows += [polish_row(name, neural[name]) for name in ("bunny", "hand")]
    rows += [style_row(aim, options) for aim, options in STYLES.items()]
    return [*rows, slider_row(), warp_row()]
