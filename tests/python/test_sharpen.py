# SPDX-License-Identifier: GPL-3.0-or-later
"""The finish of a style on a mesh's own vertices: identities, folds, what stays, and what is refused."""

import numpy as np
import pytest
from support.geometry.meshes import box, read, sphere, subdivide, suzanne, torus
from support.tasks import cancelled_when

import arapfields as af

CUBE = np.concatenate([np.eye(3), -np.eye(3)])
ALIKE = 1e-6  # of a size of about 1: what the conjugate gradients leave
NONE_ROUNDED = 1e-12
SYMMETRIC = 1e-9  # of a size of about 1: rounding of sums in another order; no fold has to be opened
PLACED = 1e-5  # of a size of about 1: distances are in single precision


def subdivided_box(times):
    vertices, triangles = box((1.0, 0.7, 0.5))
    for _ in range(times):
        vertices, triangles = subdivide(vertices, triangles)
    return vertices, triangles


def rotation(seed):
    turn, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return turn * np.sign(np.linalg.det(turn))


def angle_to_style(vertices, triangles, preferred=CUBE):
    """The mean angle in degrees to the nearest preferred normal, by area."""
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1)
    cosines = (normals / areas[:, None] @ preferred.T).max(axis=1)
    return np.average(np.degrees(np.arccos(np.clip(cosines, -1, 1))), weights=areas)


def meshes():
    return {
        "sphere": sphere(1.0, 4),
        "ellipsoid": (sphere(1.0, 3)[0] * [1.0, 0.6, 0.3], sphere(1.0, 3)[1]),
        "torus": torus(),
        "box": subdivided_box(3),
        "suzanne": suzanne(),
        "rough": (
            sphere(1.0, 4)[0] + np.random.default_rng(5).normal(scale=0.02, size=sphere(1.0, 4)[0].shape),
            sphere(1.0, 4)[1],
        ),
    }


@pytest.mark.parametrize("options", [{"style_weight": 0.0}, {"strength": 0.0}, {"iterations": 0}])
def test_without_weight_it_gives_the_moved_vertices_back(options):
    vertices, triangles = sphere(1.0, 2)
    moved = vertices @ rotation(0) * [1.0, 1.2, 0.8]
    assert np.array_equal(af.sharpen(vertices, triangles, moved, "cube", af.SharpenOptions(**options)), moved)


@pytest.mark.parametrize("style", ["cube", "object"])
def test_what_has_its_style_stays_under_rigid_motions(style):
    """A box, moved and turned with its style, is at its style: a fixed point."""
    vertices, triangles = subdivided_box(3)
    turn, shift = rotation(1), np.array([3.0, -2.0, 5.0])
    normals = "cube" if style == "cube" else af.ObjectStyle(*box())
    moved = vertices @ turn.T + shift
    orientation = turn
    if style == "object":  # an object's targets belong to the normals at rest
        moved, orientation = vertices + shift, np.eye(3)
    sharpened = af.sharpen(vertices, triangles, moved, normals, orientation=orientation)
    assert np.abs(sharpened - moved).max() < (ALIKE if style == "cube" else 0.05)


def test_it_moves_and_turns_with_the_whole():
    vertices, triangles = torus()
    turn, shift = rotation(2), np.array([1.0, 2.0, 3.0])
    plain = af.sharpen(vertices, triangles, vertices, "cube")
    turned = af.sharpen(vertices @ turn.T + shift, triangles, vertices @ turn.T + shift, CUBE @ turn.T)
    assert np.abs(plain @ turn.T + shift - turned).max() < ALIKE
    larger = af.sharpen(100 * vertices, triangles, 100 * vertices, "cube")
    assert np.abs(larger - 100 * plain).max() < 100 * ALIKE


@pytest.mark.parametrize("name", sorted(meshes()))
@pytest.mark.parametrize("style", ["cube", "octahedron"])
def test_it_comes_nearer_to_the_style_and_folds_nothing(name, style):
    vertices, triangles = meshes()[name]
    preferred = af.preferred_normals(style)
    for weight in (8.0, 64.0):
        sharpened = af.sharpen(vertices, triangles, vertices, style, af.SharpenOptions(style_weight=weight))
        before, after = (angle_to_style(v, triangles, preferred) for v in (vertices, sharpened))
        assert after < before or (name == "box" and style == "cube")
        assert len(af.folded_triangles(vertices, triangles, sharpened)) == 0


@pytest.mark.parametrize("name", sorted(meshes()))
def test_the_folded_triangles_are_among_those_of_before(name):
    vertices, triangles = meshes()[name]
    random = np.random.default_rng(7)
    moved = vertices * [1.3, 0.8, 1.0] + random.normal(scale=0.04, size=vertices.shape)
    before = af.folded_triangles(vertices, triangles, moved)
    after = af.folded_triangles(vertices, triangles, af.sharpen(vertices, triangles, moved, "cube"))
    assert set(after) <= set(before)
    assert len(before) > 0 or name == "box"


@pytest.mark.parametrize("name", sorted(meshes()))
def test_single_folds_of_before_are_opened(name):
    """A vertex here and there lies beyond its neighbours."""
    vertices, triangles = meshes()[name]
    moved = vertices * [1.3, 0.8, 1.0]
    for triangle in triangles[np.random.default_rng(3).choice(len(triangles), 6, replace=False)]:
        moved[triangle[0]] += 1.5 * (moved[triangle[1]] - moved[triangle[0]])
    assert len(af.folded_triangles(vertices, triangles, moved)) > 0
    opened = af.sharpen(vertices, triangles, moved, "cube")
    assert len(af.folded_triangles(vertices, triangles, opened)) == 0


@pytest.mark.parametrize("shrink", [0.0, 1e-3, 1e-2])
def test_a_patch_that_is_hard_to_open_leaves_the_finish_elsewhere(shrink):
    """What a field has pressed to nearly a point has no shape there that could be given back."""
    vertices, triangles = sphere(1.0, 5)
    cap, middle = vertices[:, 2] > 0.97, np.array([0.0, 0.0, 0.97])
    moved = vertices.copy()
    moved[cap] = middle + shrink * (vertices[cap] - middle)
    moved[cap] += np.random.default_rng(0).normal(scale=1e-5, size=(cap.sum(), 3))
    before = af.folded_triangles(vertices, triangles, moved)
    sharpened = af.sharpen(vertices, triangles, moved, "cube")
    assert set(af.folded_triangles(vertices, triangles, sharpened)) <= set(before)
    assert angle_to_style(sharpened, triangles) < 0.2 * angle_to_style(moved, triangles)


def truncated(vertices, triangles, corners, shares, random):
    """Each of these vertices cut off at a share of its edges: tiny triangles, as marching cubes leave them
    where a surface passes a corner of their grid."""
    vertices, triangles = list(vertices), [list(t) for t in triangles]
    for corner, share in zip(corners, shares, strict=True):
        around = [t for t in triangles if corner in t]
        after = {t[(t.index(corner) + 1) % 3]: t[(t.index(corner) + 2) % 3] for t in around}
        ring = [next(iter(after))]
        while after[ring[-1]] != ring[0]:
            ring.append(after[ring[-1]])
        cuts = np.arange(len(ring)) + len(vertices)
        edges = np.array([vertices[i] - vertices[corner] for i in ring])
        noise = random.normal(scale=0.1 * np.linalg.norm(edges, axis=1).mean(), size=edges.shape)
        vertices += list(vertices[corner] + share * (edges + noise))
        triangles = [t for t in triangles if corner not in t]
        for k in range(len(ring)):
            last = (k + 1) % len(ring)
            triangles += [[cuts[k], ring[k], ring[last]], [cuts[k], ring[last], cuts[last]]]
            if 0 < k < len(ring) - 1:
                triangles.append([cuts[0], cuts[k], cuts[last]])
    return np.array(vertices), np.array(triangles)


@pytest.mark.parametrize("seed", range(3))
def test_tiny_triangles_stay_open_and_the_finish_is_kept(seed):
    random = np.random.default_rng(seed)
    vertices, triangles = sphere(1.0, 4)
    far_apart = np.flatnonzero(random.permutation(len(vertices)) < 400)
    taken = []
    for corner in far_apart:
        if all(np.linalg.norm(vertices[corner] - vertices[other]) > 0.2 for other in taken):
            taken.append(corner)
    tiny = truncated(vertices, triangles, taken, 10.0 ** -random.uniform(2, 6, len(taken)), random)
    sharpened, without = (af.sharpen(v, t, v, "cube") for v, t in (tiny, (vertices, triangles)))
    assert len(af.folded_triangles(*tiny, sharpened)) == 0
    gain = angle_to_style(vertices, triangles) - angle_to_style(without, triangles)
    assert angle_to_style(*tiny) - angle_to_style(sharpened, tiny[1]) > 0.9 * gain


def test_one_triangle_that_stays_folded_does_not_take_the_finish_back(data_dir):
    """What has the style of a cube gets that of a tetrahedron: many triangles turn far, and some fold."""
    vertices, triangles = read(data_dir / "meshes" / "rockerArm.obj")
    cube = af.sharpen(vertices, triangles, vertices, "cube")
    sharpened = af.sharpen(vertices, triangles, cube, "tetrahedron")
    assert len(af.folded_triangles(vertices, triangles, sharpened)) == 0
    preferred = af.preferred_normals("tetrahedron")
    angles = [angle_to_style(each, triangles, preferred) for each in (cube, sharpened)]
    assert angles[1] < 0.3 * angles[0]


@pytest.mark.parametrize("style", ["cube", "octahedron"])
def test_a_mesh_with_mirrored_triangles_stays_symmetric(style):
    """Rough, and alike on both sides of x = 0; the style is, too."""
    vertices, triangles = sphere(1.0, 3)
    mirror = np.array([-1.0, 1.0, 1.0])
    partner = np.linalg.norm(vertices[:, None] - vertices * mirror, axis=2).argmin(axis=0)
    radii = 1 + np.random.default_rng(6).normal(scale=0.01, size=len(vertices))
    vertices = vertices * [1.0, 0.6, 0.8] * (0.5 * (radii + radii[partner]))[:, None]
    assert np.abs(vertices[partner] - vertices * mirror).max() < NONE_ROUNDED
    sharpened = af.sharpen(vertices, triangles, vertices, style)
    assert np.abs(sharpened - vertices).max() > 0.02
    assert np.abs(sharpened[partner] - sharpened * mirror).max() < SYMMETRIC


def test_a_triangle_that_has_turned_over_is_folded_and_a_turned_mesh_is_not():
    vertices, triangles = sphere(1.0, 3)
    assert len(af.folded_triangles(vertices, triangles, 3 * vertices @ rotation(3).T + 1)) == 0
    ring = np.unique(triangles[(triangles == 17).any(axis=1)])
    moved = vertices.copy()
    moved[17] += 3 * (vertices[ring].mean(axis=0) - vertices[ring[ring != 17][0]])
    folded = af.folded_triangles(vertices, triangles, moved)
    assert 0 < len(folded) < len(ring)
    assert (triangles[folded] == 17).any(axis=1).all()


def test_held_vertices_stay_and_weights_scale_the_effect():
    vertices, triangles = sphere(1.0, 4)
    weights = np.where(vertices[:, 2] > 0.3, 0.0, 1.0)
    sharpened = af.sharpen(vertices, triangles, vertices, "cube", weights=weights)
    assert np.array_equal(sharpened[weights == 0], vertices[weights == 0])
    assert np.abs(sharpened - vertices).max() > 0.05
    moved = [
        np.abs(
            af.sharpen(vertices, triangles, vertices, "cube", weights=np.full(len(vertices), w)) - vertices
        )
        for w in (0.1, 0.3, 1.0)
    ]
    assert moved[0].mean() < moved[1].mean() < moved[2].mean()
    assert np.array_equal(
        af.sharpen(vertices, triangles, vertices, "cube", weights=np.zeros(len(vertices))), vertices
    )


def test_details_stay():
    """A button on a ball, .03 high: under a face of the cube it keeps most of its height."""
    ball, triangles = sphere(1.0, 6)
    away = np.arccos(np.clip(ball[:, 2], -1, 1)) / 0.08  # of the button's radius, from the pole
    vertices = ball * (1 + 0.03 * np.clip(6 * (1 - away), 0, 1))[:, None]
    sharpened = af.sharpen(vertices, triangles, vertices, "cube")
    plain = af.sharpen(ball, triangles, ball, "cube")
    assert np.abs(plain - ball).max() > 0.05
    top, around = away < 0.5, (away > 1.2) & (away < 1.6)
    height = sharpened[top, 2].mean() - sharpened[around, 2].mean()
    flat = plain[top, 2].mean() - plain[around, 2].mean()
    assert height - flat > 0.6 * 0.03


def test_the_lowest_vertex_keeps_its_height():
    vertices, triangles = sphere(1.0, 4)
    up = np.array([0.0, 1.0, 0.0])
    sharpened = af.sharpen(vertices, triangles, vertices, "octahedron", up=2 * up)
    assert abs((sharpened @ up).min() - (vertices @ up).min()) < NONE_ROUNDED


CORNER = np.full(3, 3**-0.5)  # where a ball that becomes a cube bulges most


def obstacle(name):
    """In the way of that corner of a ball of radius 1."""
    if name == "ground":
        return af.Contact(ground=-1.0, up=-CORNER)
    if name == "ball":
        mesh, margin = (0.5 * sphere(1.0, 4)[0] + 1.53 * CORNER, sphere(1.0, 4)[1]), 0.02
    elif name == "box":
        mesh, margin = (box((1.0, 1.0, 1.0))[0], box()[1]), 0.0
        mesh = mesh[0] - mesh[0].min(axis=0) + 1.01 * CORNER, mesh[1]
    else:  # a sheet
        across = np.linalg.svd(CORNER[None])[2][1:]
        plate = np.array([[-2.0, -2], [2, -2], [2, 2], [-2, 2]]) @ across
        mesh, margin = (plate + 1.005 * CORNER, np.array([[0, 1, 2], [0, 2, 3]])), 0.0
    return af.Contact([af.Obstacle(af.MeshSdf(*mesh), margin)])


@pytest.mark.parametrize("up", [None, [0.0, 0.0, -1.0]])
@pytest.mark.parametrize("name", ["ground", "ball", "box", "sheet"])
def test_nothing_enters_an_obstacle(name, up):
    """Also what is beyond at the start goes no further; without the contact, something does."""
    vertices, triangles = sphere(1.0, 4)
    contact = obstacle(name)

    def distances(points):
        if name == "ground":
            return 1.0 - points @ CORNER
        if name == "sheet":
            return 1.005 - points @ CORNER
        return contact.obstacles[0].function(points) - contact.obstacles[0].margin

    for moved in (vertices, 1.05 * vertices @ rotation(4).T):
        least = np.minimum(distances(moved), 0.0)
        free, kept = (
            af.sharpen(vertices, triangles, moved, "cube", up=up, contact=each) for each in (None, contact)
        )
        if moved is vertices:
            assert (distances(free) - least).min() < -0.02
        assert name == "sheet" or (distances(kept) - least).min() > -PLACED
        passed = distances(kept) * distances(moved) < 0
        assert name != "sheet" or not passed.any()
        assert angle_to_style(kept, triangles) < 0.8 * angle_to_style(moved, triangles)
        assert len(af.folded_triangles(vertices, triangles, kept)) == 0


def test_contact_out_of_reach_changes_nothing():
    vertices, triangles = sphere(1.0, 4)
    far = af.Contact([af.Obstacle(af.MeshSdf(vertices + 5.0, triangles))], ground=-3.0)
    plain, beside = (af.sharpen(vertices, triangles, vertices, "cube", contact=c) for c in (None, far))
    assert np.array_equal(plain, beside)


def test_seams_stay_closed_and_loose_and_flat_parts_do_no_harm():
    """Each triangle with vertices of its own, a loose vertex, and triangles without area."""
    vertices, triangles = sphere(1.0, 3)
    apart = vertices[triangles].reshape(-1, 3)
    corners = np.arange(len(apart)).reshape(-1, 3)
    whole = af.sharpen(vertices, triangles, vertices, "cube")
    assert np.abs(af.sharpen(apart, corners, apart, "cube") - whole[triangles].reshape(-1, 3)).max() < ALIKE

    more = np.vstack([vertices, [[5.0, 5.0, 5.0]]])
    flat = np.vstack([triangles, [[0, 0, 1], [2, 2, 2]]])
    sharpened = af.sharpen(more, flat, more, "cube")
    assert np.array_equal(sharpened[-1], more[-1])
    assert np.abs(sharpened[:-1] - whole).max() < ALIKE
    nothing = np.zeros((3, 3))
    assert np.array_equal(af.sharpen(nothing, [[0, 1, 2]], nothing, "cube"), nothing)


def test_parts_that_have_come_apart_stay_apart():
    """Two boxes with a common face at rest: what was moved away is not pulled back."""
    vertices, triangles = subdivided_box(2)
    both = np.vstack([vertices, vertices + np.array([2.0, 0.0, 0.0])])
    faces = np.vstack([triangles, triangles + len(vertices)])
    moved = both + np.where(np.arange(len(both))[:, None] < len(vertices), 0.0, 1.0) * [1.5, 0.0, 0.0]
    sharpened = af.sharpen(both, faces, moved, "cube")
    assert np.abs(sharpened - moved).max() < ALIKE


def test_threads_change_nothing():
    vertices, triangles = sphere(1.0, 5)
    one, four = (
        af.sharpen(vertices, triangles, vertices, "cube", af.SharpenOptions(threads=threads, iterations=4))
        for threads in (1, 4)
    )
    assert np.array_equal(one, four)


def test_it_hears_cancel_and_its_progress_rises():
    vertices, triangles = sphere(1.0, 7)
    task = af.Task()
    options = af.SharpenOptions(iterations=100_000)
    with cancelled_when(task, lambda seen: len(seen) == 30) as seen, pytest.raises(af.Cancelled):
        af.sharpen(vertices, triangles, vertices, "cube", options, task=task)
    assert seen == sorted(seen) and task.progress < 1.0


VERTICES, TRIANGLES = sphere(1.0, 1)


@pytest.mark.parametrize(
    "name, call",
    [
        ("vertices", lambda: af.sharpen(VERTICES * np.nan, TRIANGLES, VERTICES, "cube")),
        ("triangles", lambda: af.sharpen(VERTICES, TRIANGLES + 100, VERTICES, "cube")),
        ("moved", lambda: af.sharpen(VERTICES, TRIANGLES, VERTICES[1:], "cube")),
        ("moved", lambda: af.sharpen(VERTICES, TRIANGLES, np.full_like(VERTICES, np.inf), "cube")),
        ("moved", lambda: af.folded_triangles(VERTICES, TRIANGLES, VERTICES[1:])),
        ("normals", lambda: af.sharpen(VERTICES, TRIANGLES, VERTICES, np.zeros((1, 3)))),
        ("weights", lambda: af.sharpen(VERTICES, TRIANGLES, VERTICES, "cube", weights=[1.0])),
        (
            "weights",
            lambda: af.sharpen(VERTICES, TRIANGLES, VERTICES, "cube", weights=-np.ones(len(VERTICES))),
        ),
        (
            "contact",
            lambda: af.sharpen(VERTICES, TRIANGLES, VERTICES, "cube", contact=af.Contact(itself=True)),
        ),
        ("up", lambda: af.sharpen(VERTICES, TRIANGLES, VERTICES, "cube", up=np.zeros(3))),
        (
            "style_weight",
            lambda: af.sharpen(VERTICES, TRIANGLES, VERTICES, "cube", af.SharpenOptions(style_weight=-1.0)),
        ),
    ],
)
def test_what_does_not_fit_is_named(name, call):
    with pytest.raises(af.InvalidInput, match=name):
        call()
