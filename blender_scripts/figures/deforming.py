# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of deformations: shapes under handles, the bend, exact handles, inverses, live frames."""

import time
from statistics import median

import examples
import numpy as np
import stage
from mathutils import Vector
from shapes import Shape

import arapfields as af

from .common import Box, add, add_boxes, deformed, measured, samples_of, shape, stack, turned, warped
from .styling import OPTIONS as STYLE_OPTIONS

# Our own shapes, side by side.

ROWS = (
    (("lizard", 38), ("octopus", 0), ("dog", 50), ("bar", 30)),
    (("hand", -8), ("dinosaur", 55), ("mug", 25), ("ring", 30)),
)


def draw_shapes(output):
    stage.clear()
    shown, figures = [], {}
    for depth, row in enumerate(ROWS):
        for column, (name, degrees) in enumerate(row):
            made = shape(name)
            place = turned(made, 2.4 * column + 1.2 * depth, degrees, y=2.6 * depth)
            shown.append(add(made, name, place))
            figures[name] = {"vertices": len(made.vertices), "triangles": len(made.triangles)}
    stage.photograph(shown, output / "shapes.png", elevation=20)
    return figures


# Six shapes under cuboid handles: at rest above, deformed below; a handle keeps its colour.

# shape: (turn on the table, handles); a box without a motion holds its part.
CASES = {
    "lizard": (
        62,
        [
            Box((0, 0.05, 0.2), (0.30, 0.30, 0.22)),
            Box((0, -0.93, 0.2), (0.24, 0.26, 0.2), -55, "X", (0, -0.45, 0.2)),
            Box((0.25, 1.48, 0.07), (0.38, 0.16, 0.12), 70, "X", (-0.1, 0.8, 0.15)),
        ],
    ),
    "dinosaur": (
        62,
        [
            Box((0, -0.02, 0.17), (0.45, 0.26, 0.2)),
            Box((0, -0.72, 1.40), (0.28, 0.36, 0.30), 45, "Z", (0, -0.5, 1.3), (0, -0.05, 0.28)),
            Box((0, 1.27, 0.82), (0.16, 0.26, 0.18), 50, "X", (0, 0.5, 0.75)),
        ],
    ),
    "octopus": (
        0,
        [
            Box((0, 0, 0.30), (0.38, 0.38, 0.16)),
            Box((-1.0, -0.28, 0.14), (0.24, 0.30, 0.17), 65, "Y", (-0.42, -0.2, 0.25)),
            Box((1.0, -0.28, 0.14), (0.24, 0.30, 0.17), -65, "Y", (0.42, -0.2, 0.25)),
            Box((0, 0, 1.08), (0.44, 0.44, 0.28), 22, "Y", (0, 0, 0.75), (0.06, 0, 0.12)),
        ],
    ),
    "hand": (
        -8,
        [
            Box((0.0, 0.0, 0.08), (0.42, 0.24, 0.52)),
            Box((0.415, -0.04, 1.36), (0.14, 0.14, 0.15), 30, "Y", (0.29, 0.0, 0.78)),
            Box((0.63, -0.16, 0.74), (0.16, 0.15, 0.2), 30, "Y", (0.35, -0.05, 0.35)),
            Box((-0.415, -0.04, 1.24), (0.13, 0.14, 0.15), -30, "Y", (-0.29, 0.0, 0.76)),
        ],
    ),
    "mug": (
        18,
        [
            Box((0.0, 0.0, 0.22), (0.56, 0.56, 0.26)),
            Box((0.83, 0.0, 0.62), (0.2, 0.16, 0.22), 0, "Y", None, (0.38, 0.0, 0.2)),
            Box((-0.1, 0.0, 1.12), (0.46, 0.56, 0.12), 24, "Z", (0, 0, 1.1), (0, 0, 0.1)),
        ],
    ),
    "dog": (
        52,
        [
            Box((0.0, 0.05, 0.21), (0.36, 0.66, 0.22)),
            Box((0.0, -0.76, 1.26), (0.34, 0.40, 0.34), -60, "Z", (0, -0.55, 1.1), (0.0, 0.0, 0.16)),
            Box((0.05, 0.70, 1.10), (0.16, 0.30, 0.20), -48, "X", (0, 0.6, 0.8)),
        ],
    ),
}
# Fingers lie close together: a finer encoding and softer bends keep one from taking the others along.
FINER = {
    "frequency": 4.0,
    "octaves": 6,
    "bending": 0.1,
    "learning_rate": 0.02,
    "width": 128,
    "iterations": 200,
}
OPTIONS = {"hand": FINER}
SHEETS = {  # and where each stands
    "deformations": {"lizard": -2.5, "dinosaur": 0.0, "octopus": 2.4},
    "deformations_more": {"hand": -1.8, "mug": 0.0, "dog": 2.45},
}


def objects_of(names, shapes, targets):
    """A row of shapes with their boxes."""
    shown = []
    for name, x in names.items():
        degrees, boxes = CASES[name]
        place = turned(shape(name), x, degrees)
        shown.append(add(shapes[name], name, place))
        shown += add_boxes(boxes, place, targets)
    return shown


def draw_deformations(output):
    results = {}
    for sheet, names in SHEETS.items():
        rest, moved = {name: shape(name) for name in names}, {}
        for name in names:
            field, moved[name] = deformed(rest[name], CASES[name][1], **OPTIONS.get(name, {}))
            results[name] = measured(field)
        stage.clear()
        rows = {"rest": objects_of(names, rest, False), "deformed": objects_of(names, moved, True)}
        stage.set_up([*rows["rest"], *rows["deformed"]], elevation=15)
        paths = []
        for drawn in rows:
            for row, objects in rows.items():
                for item in objects:
                    item.hide_render = row != drawn
            paths.append(output / f"{sheet}-{drawn}.png")
            stage.take(paths[-1])
        stack(paths, output / f"{sheet}.png")
    return results


# The picture at the top of the README: a shape at rest with its handles, deformed, and in two styles.

HERO_SPACING = 2.15
TEXTS = ("at rest", "deformed", "cube style", "octahedron style")


def draw_hero(output):
    dinosaur, (_, boxes) = shape("dinosaur"), CASES["dinosaur"]
    samples = samples_of(dinosaur)
    field, moved = deformed(dinosaur, boxes, samples)
    live = af.LiveDeformer(samples, options=af.LiveOptions(**STYLE_OPTIONS))
    results, shapes = {"deformed": measured(field)}, [dinosaur, moved]
    for style in ("cube", "octahedron"):
        live.reset()
        live.set_style(style, 0.7)
        shapes.append(warped(dinosaur, live.solve()))
        results[style] = {"preference": round(live.report.preference, 3)}
    stage.clear()
    shown = []
    for column, (made, text) in enumerate(zip(shapes, TEXTS, strict=True)):
        place = turned(dinosaur if column < 2 else made, HERO_SPACING * column, 58)
        shown.append(add(made, f"dinosaur {column}", place))
        under = place @ Vector((made.vertices.min(0) + made.vertices.max(0)) / 2)
        if column < 2:
            shown += add_boxes(boxes, place, column == 1)
        shown.append(stage.caption(text, (under.x, -1.6, -0.02), 0.17))
    stage.photograph(shown, output / "hero.png", width=1440, elevation=10)
    return results


# One bar, its ends turned, under four weights of the bend; and stretch and bend over that weight.

BENDING_SPACING = 1.5
WEIGHTS = [0.0, 1e-3, 1e-2, 1e-1]
BENDING_BOXES = [
    Box((-0.66, 0, 0.12), (0.16, 0.17, 0.17)),
    Box((0.66, 0, 0.12), (0.16, 0.17, 0.17), -90, "Y", (0.0, 0.0, 0.12), (0.05, 0.0, 0.05)),
]


def draw_bending(output):
    bar = shape("slender_bar")
    samples = samples_of(bar)
    stage.clear()
    shown, results = [], {}
    for column, weight in enumerate([None, *WEIGHTS]):
        at = BENDING_SPACING * column + (0.3 if column else -0.1)
        place = turned(bar, at, 12)
        if weight is None:
            moved = bar
        else:
            field, moved = deformed(bar, BENDING_BOXES, samples, bending=100 * weight, bending_unit="cube")
            stretch, bend = af.arap_energy(field, samples.points)
            results[f"{weight:g}"] = {**measured(field), "stretch": round(stretch, 5), "bend": round(bend, 4)}
        shown.append(add(moved, f"bar {weight}", place))
        shown += add_boxes(BENDING_BOXES, place, weight is not None)
        text = "rest" if weight is None else f"λ = {weight:g}"
        shown.append(stage.caption(text, (at - (0.3 if column else 0.05), -1.0, 0.0), 0.14))
    stage.photograph(shown, output / "bending.png", elevation=14)
    plot(results, output / "bending-plot.png")
    return results


def plot(results, path):
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, left = plt.subplots(figsize=(6.4, 3.2), dpi=150)
    right = left.twinx()
    at = np.arange(len(results))
    stretch, bend = ([row[name] for row in results.values()] for name in ("stretch", "bend"))
    (a,) = left.plot(at, stretch, "o-", color="#c2410c", label="mean stretch")
    (b,) = right.plot(at, bend, "s-", color="#1d4ed8", label="mean bend")
    left.set_xticks(at, [f"{float(weight):g}" for weight in results])
    left.set_xlabel("weight of the bend, λ")
    left.set_ylabel("stretch")
    right.set_ylabel("bend")
    left.set_ylim(bottom=0)
    right.set_ylim(bottom=0)
    left.legend(handles=[a, b], frameon=False, loc="upper center")
    figure.tight_layout()
    figure.savefig(path)
    plt.close(figure)


# Soft handles beside exact ones: the same bar, the same boxes, and how far each is from its targets.

EXACT_BOXES = [
    Box((-0.60, 0, 0.12), (0.22, 0.17, 0.17)),
    Box((0.60, 0, 0.12), (0.22, 0.17, 0.17), 120, "X", None, (0.0, 0.0, 0.22)),
]
NEAR, FAR = np.array((0.72, 0.42, 0.08)), np.array((0.75, 0.02, 0.02))
WORST = 0.03  # distance from the target at which the colour is full


def distances(rest, moved):
    """How far each vertex inside a box at rest is from where the box takes it; 0 elsewhere."""
    off = np.zeros(len(rest.vertices))
    for box in EXACT_BOXES:
        to_box = np.linalg.inv(np.array(box.rest))
        local = rest.vertices @ to_box[:3, :3].T + to_box[:3, 3]
        inside = (np.abs(local) <= 1).all(axis=1)
        target = np.array(box.target)
        goal = local @ target[:3, :3].T + target[:3, 3]
        off = np.where(inside, np.linalg.norm(moved.vertices - goal, axis=1), off)
    return off


def draw_exact(output):
    bar = shape("slender_bar")
    samples = samples_of(bar)
    stage.clear()
    place = turned(bar, 0.0, 16)
    shown = [
        add(bar, "rest", place),
        *add_boxes(EXACT_BOXES, place, False),
        stage.caption("at rest", (0, -1, 0.0), 0.13),
    ]
    results = {}
    for column, (name, options) in enumerate((("soft", {}), ("exact", {"exact_handles": True})), 1):
        field, moved = deformed(bar, EXACT_BOXES, samples, **options)
        off = distances(bar, moved)
        share = np.clip(off / WORST, 0, 1)[:, None]
        moved = moved._replace(colours=NEAR + (FAR - NEAR) * share)
        results[name] = {**measured(field), "largest_distance": float(f"{off.max():.2g}")}
        place = turned(bar, 2.1 * column, 16)
        shown += [add(moved, name, place), *add_boxes(EXACT_BOXES, place, True)]
        text = f"{name}: off by at most {off.max():.2g}, E = {field.report['energy']:.3f}"
        shown.append(stage.caption(text, (2.1 * column, -1, 0.0), 0.13))
    stage.photograph(shown, output / "exact.png", elevation=16)
    return results


# The fitted surface moved forward, beside the zero set of Φ∘f⁻¹ by two inverses.

FORWARD, INVERSE = (64, 40) if stage.DRAFT else (192, 128)  # grid points a side
INVERSE_SPACING = 2.3


def surface(vertices, triangles, colour):
    return Shape(vertices, np.asarray(triangles), np.tile(colour, (len(vertices), 1)))


def surface_distances(a, b):
    """Distances from each vertex of one mesh to the other surface, both ways."""
    there = np.abs(af.signed_distance(b.vertices, b.triangles, a.vertices))
    back = np.abs(af.signed_distance(a.vertices, a.triangles, b.vertices))
    return np.concatenate([there, back])


def evenness(made):
    """Spread of the triangles' areas: standard deviation over mean."""
    a, b, c = (made.vertices[made.triangles[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    return round(float(areas.std() / areas.mean()), 2)


def pulled_back(sdf, field, inverse, colour, forward):
    """The zero set of Φ∘f⁻¹, and how far it is from the surface moved forward, in cells of its grid."""
    begin = time.perf_counter()
    extracted = af.extract_deformed(sdf, field, INVERSE, inverse=inverse)
    seconds, report = time.perf_counter() - begin, extracted.report
    made = surface(*extracted, colour)
    cells = surface_distances(forward, made) / report.spacing
    return made, {
        "seconds": round(seconds, 1),
        "cell": round(float(report.spacing), 4),
        "points_inverted": report.inverted,
        "failures": report.failures,
        "cells_apart_mean": round(float(cells.mean()), 3),
        "cells_apart_95_percent": round(float(np.quantile(cells, 0.95)), 3),
        "cells_apart_largest": round(float(cells.max()), 3),
        "evenness": evenness(made),
    }


def draw_inverse(output):
    degrees, boxes = CASES["dog"]
    mesh = shape("dog")
    sdf = af.fit_sdf(mesh.vertices, mesh.triangles)
    samples = af.sample_surface(sdf, 20000)
    field = af.deform(
        samples, [box.handle for box in boxes], af.DeformOptions(iterations=60 if stage.DRAFT else 300)
    )
    inverse = af.train_inverse(
        field, samples, af.InverseTrainingOptions(iterations=100 if stage.DRAFT else 600)
    )
    vertices, triangles = af.extract_surface(sdf, FORWARD)
    rest = surface(vertices, triangles, stage.CLAY)
    forward = surface(field(vertices), triangles, stage.RESULT)
    newton, by_newton = pulled_back(sdf, field, None, stage.SURFACE, forward)
    trained, by_training = pulled_back(sdf, field, inverse, (0.36, 0.58, 0.40), forward)
    stage.clear()
    shown = []
    columns = ((rest, "fitted"), (forward, "moved by f"), (newton, "Newton's f⁻¹"), (trained, "trained f⁻¹"))
    for column, (made, text) in enumerate(columns):
        place = turned(rest, INVERSE_SPACING * column, degrees)
        shown += [add(made, text, place), *add_boxes(boxes, place, column > 0)]
        shown.append(stage.caption(text, (INVERSE_SPACING * column, -1.3, 0.0), 0.2))
    stage.photograph(shown, output / "inverse.png", elevation=12)
    return {
        "deformed": measured(field),
        "fit_near_error": round(float(sdf.report.near_mean), 5),
        "trained_error_mean": round(float(inverse.report.error_mean), 5),
        "forward_evenness": evenness(forward),
        "newton": by_newton,
        "trained": by_training,
    }


# A handle dragged in small steps, the shape following live: six frames of the motion.

FRAMES, STEPS, LIVE_SPACING = 6, 12, 1.95
ANCHOR = Box((0, -0.02, 0.17), (0.45, 0.26, 0.2))


def head(share):
    """The dinosaur's head, part of the way: down to the left and round."""
    return Box((0, -0.72, 1.40), (0.28, 0.36, 0.30), -62 * share, "X", (0, -0.2, 1.0), (0.25 * share, 0, 0))


def tail(share):
    return Box((0, 1.27, 0.82), (0.16, 0.26, 0.18), 55 * share, "X", (0, 0.5, 0.75))


def draw_live(output):
    dinosaur = shape("dinosaur")
    boxes = [ANCHOR, head(0), tail(0)]
    begin = time.perf_counter()
    live = af.LiveDeformer(samples_of(dinosaur), [box.handle for box in boxes])
    set_up = time.perf_counter() - begin
    stage.clear()
    shown, seconds = [], []
    for frame in range(FRAMES):
        if frame:
            for step in range(STEPS):
                share = (frame - 1 + (step + 1) / STEPS) / (FRAMES - 1)
                boxes = [ANCHOR, head(share), tail(share)]
                begin = time.perf_counter()
                field = live.solve([np.array(box.target) for box in boxes])
                seconds.append(time.perf_counter() - begin)
        moved = warped(dinosaur, field) if frame else dinosaur
        place = turned(dinosaur, LIVE_SPACING * frame, 66, scale=0.8)
        shown.append(add(moved, f"frame {frame}", place))
        shown += add_boxes(boxes, place, True, edge=0.013)
    stage.photograph(shown, output / "live.png", elevation=10)
    report = live.report
    return {
        "solves": len(seconds),
        "median_solve_ms": round(1000 * median(seconds), 1),
        "set_up_s": round(set_up, 3),
        "energy": round(report.energy, 4),
        "min_determinant": round(report.min_determinant, 3),
    }


# The meshes of the batch page, each in the style of a cube, as the batch's default makes it.

BATCH_SPACING, TURN = 1.9, 55


def draw_batch(output):
    stage.clear()
    shown, results = [], {}
    for column, name in enumerate(examples.MESHES):
        rest = shape(name)
        field = af.stylize(samples_of(rest, 20000), "cube")
        moved = warped(rest, field)
        results[name] = {"preference": round(field.report.preference, 3)}
        shown.append(add(moved, name, turned(moved, BATCH_SPACING * column, TURN, 0.85)))
    stage.photograph(shown, output / "workflow-batch.png", width=1000, samples=16, elevation=12)
    return results
