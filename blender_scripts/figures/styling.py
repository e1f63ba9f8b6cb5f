# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of styles: of the library, of objects, on all shapes, and with materials."""

import bpy
import numpy as np
import shapes
import stage
from mathutils import Matrix
from shapes import Ellipsoid, Shape, build

import arapfields as af

from .common import Box, add, add_boxes, in_column, measured, samples_of, shape, stack, suzanne, warped

# Gauss styles: a column a style with its preference on a sphere, a row a shape, in the radial field.

STYLES = ["cube", "octahedron", "dodecahedron", "hexagonal prism", "square pyramid", "cylinder"]
ROWS = [("dog", 48), ("suzanne", 28), ("octopus", 0)]  # and its turn
SPACING, STRENGTH = 2.1, 0.6
ENDS = [(-0.5 * SPACING, 0.0, 0.5), ((len(STYLES) + 0.5) * SPACING, 0.0, 0.5)]  # of every row: columns align
OPTIONS = {
    "samples": 3000,
    "coarse_centers": 150,
    "fine_centers": 800,
    "bending": 0.1,
    "iterations": 40,
    "tolerance": 3e-4,
    "interior": False,  # a style acts everywhere alike: nothing is to be held apart
}
LOW, HIGH = np.array((0.012, 0.03, 0.12)), np.array((0.95, 0.34, 0.02))


def ball(colours_of, rings=64):
    """A sphere of the Shape kind, coloured by its normals."""
    from shapes import Shape

    u, v = np.meshgrid(np.linspace(0, np.pi, rings + 1), np.linspace(0, 2 * np.pi, 2 * rings, endpoint=False))
    points = np.stack([np.sin(u) * np.cos(v), np.sin(u) * np.sin(v), np.cos(u)], -1).reshape(-1, 3)
    a, i = np.meshgrid(np.arange(2 * rings), np.arange(rings), indexing="ij")
    b = (a + 1) % (2 * rings)
    one, two = a * (rings + 1) + i, b * (rings + 1) + i
    triangles = np.concatenate(
        [np.stack(t, -1).reshape(-1, 3) for t in ((one, one + 1, two), (two, one + 1, two + 1))]
    )
    return Shape(points, triangles, colours_of(points))


def preference_colours(style):
    def colours(normals):
        g = np.clip(af.gauss_preference(normals, af.preferred_normals(style)), 0, 1)[:, None]
        return LOW + (HIGH - LOW) * g**2

    return colours


def stylized(rest, live, style):
    live.reset()
    live.set_style(style, STRENGTH)
    field = live.solve()
    return warped(rest, field), {
        "preference_rest": round(
            float(np.mean(af.gauss_preference(live.normals, af.preferred_normals(style)))), 3
        ),
        "preference": round(live.deformer.report.preference, 3),
        "flipped_share": round(live.deformer.report.flipped_share, 4),
        "min_determinant": round(live.deformer.report.min_determinant, 3),
    }


class Live:
    """A live deformer with the normals of the samples it was given."""

    def __init__(self, samples):
        self.normals = samples.normals
        self.deformer = af.LiveDeformer(samples, options=af.LiveOptions(**OPTIONS))
        self.reset, self.set_style, self.solve = (
            self.deformer.reset,
            self.deformer.set_style,
            self.deformer.solve,
        )


def spheres(path):
    """The first row: each style's preference."""
    stage.clear()
    balls = [ball(preference_colours(style)) for style in STYLES]
    shown = [
        add(made, style, in_column(made, made, 1 + i, 25, SPACING))
        for i, (style, made) in enumerate(zip(STYLES, balls, strict=True))
    ]
    shown += [stage.caption(style, (SPACING * (1 + i), -0.9, -0.42), 0.24) for i, style in enumerate(STYLES)]
    shown.append(stage.caption("at rest", (0, -0.9, -0.42), 0.24))
    stage.photograph(shown, path, elevation=10, around=ENDS, margin=0.01)


def draw_styles(output):
    paths, results = [output / "styles-0.png"], {}
    spheres(paths[0])
    for name, degrees in ROWS:
        rest = suzanne() if name == "suzanne" else shape(name)
        live = Live(samples_of(rest))
        stage.clear()
        shown = [add(rest, name, in_column(rest, rest, 0, degrees, SPACING))]
        for column, style in enumerate(STYLES, 1):
            moved, results[f"{name}, {style}"] = stylized(rest, live, style)
            shown.append(add(moved, style, in_column(moved, rest, column, degrees, SPACING)))
        paths.append(output / f"styles-{name}.png")
        stage.photograph(shown, paths[-1], elevation=12, around=ENDS, margin=0.01)
    stack(paths, output / "styles.png")
    return results


# All styles of six shapes as stylize makes them by default: a row a shape, in two sheets.

SHEET_ROWS = [("dog", 48), ("dinosaur", 55), ("lizard", 40), ("octopus", 0), ("suzanne", 28), ("chapel", 38)]
SHEET_SPACING = 2.1
SHEET_SAMPLES = 20000
SHEET_STYLES = af.style_names()
SHEETS = [SHEET_STYLES[:7], SHEET_STYLES[7:]]
SHEET_ENDS = [(-0.5 * SHEET_SPACING, 0.0, 0.5), (7.5 * SHEET_SPACING, 0.0, 0.5)]


def stylized_by_default(rest, samples, style):
    """The shape in the style, all options as they are by default, and what it came to."""
    preferred = af.preferred_normals(style)
    field = af.stylize(samples, style)
    moved = warped(rest, field)
    parts = shapes.feet(rest.vertices, rest.triangles)
    before, after = rest.vertices, moved.vertices
    figures = {
        "preference_rest": af.gauss_preference(samples.normals, preferred).mean(),
        "preference": field.report.preference,
        "share_rest": shapes.share_along(before, rest.triangles, preferred),
        "share": shapes.share_along(after, rest.triangles, preferred),
        "tilt": shapes.tilt(before, after, rest.triangles),
        "unevenness": shapes.unevenness(after, shapes.on_the_ground(before, parts), np.ptp(before[:, 2])),
        "volume": shapes.enclosed(after, rest.triangles) / shapes.enclosed(before, rest.triangles),
        "flipped_share": field.report.flipped_share,
        "min_determinant": field.report.min_determinant,
    }
    return moved, {name: round(float(value), 4) for name, value in figures.items()}


def draw_style_sheet(output):
    rests = {name: suzanne() if name == "suzanne" else shape(name) for name, _ in SHEET_ROWS}
    samples = {name: samples_of(rest, SHEET_SAMPLES) for name, rest in rests.items()}
    results = {}
    for number, styles in enumerate(SHEETS, 1):
        paths = []
        for name, degrees in SHEET_ROWS:
            rest = rests[name]
            stage.clear()
            shown = [add(rest, name, in_column(rest, rest, 0, degrees, SHEET_SPACING))]
            for column, style in enumerate(styles, 1):
                moved, results[f"{name}, {style}"] = stylized_by_default(rest, samples[name], style)
                shown.append(add(moved, style, in_column(moved, rest, column, degrees, SHEET_SPACING)))
                if name == SHEET_ROWS[0][0]:
                    shown.append(stage.caption(style, (SHEET_SPACING * column, 0.2, 2.05), 0.24))
            paths.append(output / f"style-sheet-{number}-{name}.png")
            stage.photograph(shown, paths[-1], elevation=12, around=SHEET_ENDS, margin=0.01)
        stack(paths, output / f"style-sheet-{number}.png")
    return results


# The finish on the mesh: shapes in two styles, by the field alone and finished.

FINISH_ROWS, FINISH_STYLES = ("dog", "dinosaur"), ("cube", "dodecahedron")


def draw_style_finish(output):
    turns, paths, results = dict(SHEET_ROWS), [], {}
    ends = [(-0.5 * SHEET_SPACING, 0.0, 0.5), (4.5 * SHEET_SPACING, 0.0, 0.5)]
    before = {"centers": af.CENTERS_BEFORE_SHARPEN, "iterations": af.ITERATIONS_BEFORE_SHARPEN}
    for name in FINISH_ROWS:
        rest = shape(name)
        samples = samples_of(rest, SHEET_SAMPLES)
        stage.clear()
        shown, column = [add(rest, name, in_column(rest, rest, 0, turns[name], SHEET_SPACING))], 0
        for style in FINISH_STYLES:
            alone = warped(rest, af.stylize(samples, style))
            field = af.stylize(samples, style, af.StylizeOptions(**before))
            moved = af.sharpen(
                rest.vertices, rest.triangles, warped(rest, field).vertices, style, up=[0, 0, 1]
            )
            for label, made in (("field alone", alone), ("finished", rest._replace(vertices=moved))):
                column += 1
                shown.append(add(made, label, in_column(made, rest, column, turns[name], SHEET_SPACING)))
                if name == FINISH_ROWS[0]:
                    place = (SHEET_SPACING * column, 0.2, 2.05)
                    shown.append(stage.caption(f"{style}, {label}", place, 0.2))
            folded = len(af.folded_triangles(rest.vertices, rest.triangles, moved))
            results[f"{name}, {style}"] = {"folded": folded}
        paths.append(output / f"style-finish-{name}.png")
        stage.photograph(shown, paths[-1], elevation=12, around=ends, margin=0.01)
    stack(paths, output / "style-finish.png")
    return results


# Styles read off objects: a column an object, shown on top, a row a shape, all options by default.

OBJECTS_SPACING, SAMPLES = 2.1, 6000
COLOUR = (0.42, 0.20, 0.08)


def sphere(subdivisions):
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions)
    return taken(bpy.context.object)


def taken(item):
    """A mesh object as a Shape; it is removed."""
    mesh = item.data
    mesh.calc_loop_triangles()
    vertices = np.array([vertex.co for vertex in mesh.vertices], float)
    triangles = np.array([triangle.vertices for triangle in mesh.loop_triangles], np.int64)
    bpy.data.objects.remove(item, do_unlink=True)
    return Shape(vertices, triangles, np.tile(COLOUR, (len(vertices), 1)))


def superquadric(power, scale=(1.0, 1.0, 1.0)):
    ball = sphere(6)
    norm = (np.abs(ball.vertices) ** power).sum(1, keepdims=True) ** (1 / power)
    return ball._replace(vertices=ball.vertices / norm * scale)


def rock():
    ball, rng = sphere(2), np.random.default_rng(5)
    return ball._replace(
        vertices=ball.vertices * rng.uniform(0.8, 1.15, (len(ball.vertices), 1)) * (1, 0.8, 0.75)
    )


def head():
    """A head of few triangles."""
    made = build(
        [
            Ellipsoid((0, 0, 0.25), (0.62, 0.75, 0.7)),
            Ellipsoid((0, -0.25, -0.35), (0.42, 0.45, 0.45)),
            Ellipsoid((0, -0.78, 0.0), (0.13, 0.2, 0.2)),
            Ellipsoid((0.6, 0.05, 0.05), (0.1, 0.16, 0.25)),
            Ellipsoid((-0.6, 0.05, 0.05), (0.1, 0.16, 0.25)),
            Ellipsoid((0, 0.1, -0.8), (0.32, 0.36, 0.5)),
        ],
        0.1,
        base=COLOUR,
        cells=60,
    )
    item = add(made, "head")
    modifier = item.modifiers.new("Decimate", "DECIMATE")
    modifier.ratio = 160 / len(made.triangles)
    bpy.context.view_layer.objects.active = item
    bpy.ops.object.modifier_apply(modifier="Decimate")
    return taken(item)


OBJECTS = {
    "cube": lambda: taken_primitive("cube"),
    "rounded cube": lambda: superquadric(4),
    "spindle": lambda: superquadric(1.3, (0.7, 0.7, 1.2)),
    "rock": rock,
    "head": head,
    "cylinder": lambda: taken_primitive("cylinder"),
}
OBJECTS_ENDS = [(-0.5 * OBJECTS_SPACING, 0.0, 0.5), ((len(OBJECTS) + 0.5) * OBJECTS_SPACING, 0.0, 0.5)]


def taken_primitive(name):
    getattr(bpy.ops.mesh, f"primitive_{name}_add")()
    return taken(bpy.context.object)


def flat(item):
    item.data.polygons.foreach_set("use_smooth", [False] * len(item.data.polygons))
    return item


def draw_style_objects(output):
    paths, results = [output / "style-objects-0.png"], {}
    stage.clear()
    objects = {name: make() for name, make in OBJECTS.items()}
    stage.clear()
    shown = []
    for column, (name, made) in enumerate(objects.items(), 1):
        item = add(made, name, in_column(made, made, column, 25, OBJECTS_SPACING))
        shown.append(item if name in ("rounded cube", "spindle") else flat(item))
        shown.append(stage.caption(name, (OBJECTS_SPACING * column, -1.0, -0.5), 0.24))
    stage.photograph(shown, paths[0], elevation=12, around=OBJECTS_ENDS, margin=0.01)
    for name, degrees in ROWS:
        rest = suzanne() if name == "suzanne" else shape(name)
        samples = samples_of(rest, SAMPLES)
        stage.clear()
        shown = [add(rest, name, in_column(rest, rest, 0, degrees, OBJECTS_SPACING))]
        for column, (style, made) in enumerate(objects.items(), 1):
            object_style = af.ObjectStyle(made.vertices, made.triangles)
            field = af.stylize(samples, object_style)
            moved = warped(rest, field)
            shown.append(add(moved, style, in_column(moved, rest, column, degrees, OBJECTS_SPACING)))
            agreement = (samples.normals * object_style.normals(samples.normals)).sum(1).mean()
            results[f"{name}, {style}"] = {
                "agreement_rest": round(float(agreement), 4),
                "agreement": round(field.report.preference, 4),
                "flipped_share": round(field.report.flipped_share, 4),
                "min_determinant": round(field.report.min_determinant, 4),
            }
        paths.append(output / f"style-objects-{name}.png")
        stage.photograph(shown, paths[-1], elevation=12, around=OBJECTS_ENDS, margin=0.01)
    stack(paths, output / "style-objects.png")
    return results


# An artist's mesh, three materials and a UV checker, deformed and stylized: all of it stays where it was.

CHARACTER_SPACING = 3.0
BOXES = [
    Box((0.0, -0.30, -0.50), (0.58, 0.75, 0.52)),
    Box((1.13, 0.32, 0.17), (0.27, 0.34, 0.37), -60, "Y", (0.80, 0.0, 0.20)),
    Box((-1.13, 0.32, 0.17), (0.27, 0.34, 0.37), 60, "Y", (-0.80, 0.0, 0.20)),
]


def checker(name, one, two, scale=24.0):
    """A material that shows the UV map as a checkerboard."""
    made = stage.material(name, one)
    nodes, links = made.node_tree.nodes, made.node_tree.links
    board, uv = nodes.new("ShaderNodeTexChecker"), nodes.new("ShaderNodeUVMap")
    board.inputs["Color1"].default_value, board.inputs["Color2"].default_value = (*one, 1), (*two, 1)
    board.inputs["Scale"].default_value = scale
    links.new(uv.outputs["UV"], board.inputs["Vector"])
    links.new(board.outputs["Color"], nodes["Principled BSDF"].inputs["Base Color"])
    return made


def character():
    """Suzanne, subdivided for good, with materials for face, ears and eyes by loose part and place."""
    bpy.ops.mesh.primitive_monkey_add()
    item = bpy.context.object
    item.modifiers.new("Subdivision", "SUBSURF").levels = 3
    bpy.ops.object.modifier_apply(modifier="Subdivision")
    mesh = item.data
    mesh.polygons.foreach_set("use_smooth", [True] * len(mesh.polygons))
    for made in (
        checker("face", (0.55, 0.30, 0.14), (0.68, 0.42, 0.22)),
        checker("ears", (0.60, 0.12, 0.12), (0.78, 0.30, 0.24)),
        checker("muzzle", (0.82, 0.66, 0.45), (0.90, 0.78, 0.60)),
        stage.material("eyes", (0.02, 0.02, 0.03), roughness=0.15),
    ):
        mesh.materials.append(made)
    centres = np.array([p.center for p in mesh.polygons])
    ears = np.abs(centres[:, 0]) > 0.86
    muzzle = (centres[:, 2] < -0.02) & (centres[:, 1] < -0.42) & (np.abs(centres[:, 0]) < 0.62)
    index = np.where(ears, 1, np.where(muzzle, 2, 0))
    index[in_eyes(mesh)] = 3
    mesh.polygons.foreach_set("material_index", index.astype(np.int32))
    return item


def in_eyes(mesh):
    """Faces of the two loose parts that are not the head."""
    parent = np.arange(len(mesh.vertices))
    edges = np.array([edge.vertices for edge in mesh.edges])
    while True:
        low = np.minimum(parent[edges[:, 0]], parent[edges[:, 1]])
        before = parent.copy()
        np.minimum.at(parent, edges[:, 0], low)
        np.minimum.at(parent, edges[:, 1], low)
        parent = parent[parent]
        if (parent == before).all():
            break
    first = np.array([face.vertices[0] for face in mesh.polygons])
    sizes = np.bincount(parent)
    return parent[first] != sizes.argmax()


def arrays(mesh):
    vertices = np.empty(3 * len(mesh.vertices))
    mesh.vertices.foreach_get("co", vertices)
    mesh.calc_loop_triangles()
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def copy_with(item, vertices, column):
    """A copy of the object whose vertices were moved, and nothing else."""
    made = item.copy()
    made.data = item.data.copy()
    made.data.vertices.foreach_set("co", np.ascontiguousarray(vertices, np.float32).ravel())
    made.data.update()
    bpy.context.collection.objects.link(made)
    made.matrix_world = Matrix.Translation((CHARACTER_SPACING * column, 0, 0))
    return made


def kept(item, other):
    """Whether UVs and material indices are equal to the last bit."""
    pairs = []
    for mesh in (item.data, other.data):
        uv = np.empty(2 * len(mesh.loops), np.float32)
        mesh.uv_layers.active.data.foreach_get("uv", uv)
        index = np.empty(len(mesh.polygons), np.int32)
        mesh.polygons.foreach_get("material_index", index)
        pairs.append((uv, index))
    return all(np.array_equal(a, b) for a, b in zip(*pairs, strict=True))


def draw_character(output):
    stage.clear()
    item = character()
    vertices, triangles = arrays(item.data)
    samples = af.sample_mesh(vertices, triangles, 12000)
    field = af.deform(
        samples, [box.handle for box in BOXES], af.DeformOptions(iterations=60 if stage.DRAFT else 300)
    )
    live = af.LiveDeformer(samples, options=af.LiveOptions(**OPTIONS))
    live.set_style("cube", 0.6)
    cubic = live.solve()
    shown = [item, copy_with(item, field(vertices), 1), copy_with(item, cubic(vertices), 2)]
    for column, targets in ((0, False), (1, True)):
        shown += add_boxes(BOXES, Matrix.Translation((CHARACTER_SPACING * column, 0, 0)), targets)
    stage.photograph(shown, output / "character.png", elevation=8)
    return {
        "deformed": measured(field),
        "stylized": {"preference": round(live.report.preference, 3)},
        "uv_and_materials_equal": kept(item, shown[1]) and kept(item, shown[2]),
    }
