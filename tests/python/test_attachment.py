# SPDX-License-Identifier: GPL-3.0-or-later
"""What a field moves beside its own mesh: points, rigid motions, other meshes of the same shape."""

import threading
import time

import numpy as np
import pytest
from support.geometry.cases import box, moved, shift, turn
from support.geometry.characters import FOOT, HIP, LEG, ring, trousers
from support.oracles import random_rotations
from support.programs.cli import run

import arapfields as af

# Points and rigid motions that a field carries along with a body.

# Points that a field carries along with a body, and rigid motions.


def length(samples):
    """About that of the body."""
    return np.ptp(samples.points, axis=0).max()


@pytest.fixture(scope="module")
def body():
    return af.sample_surface(trousers(), 5000, seed=0)


@pytest.fixture(scope="module")
def striding(body):
    """The trunk held; the legs spread by 20 degrees each about the hips."""
    return spread(body, 20)


def spread(body, degrees, axis=(0, 1, 0)):
    handles = [moved(box([-1, -1, HIP], [1, 1, 2]))]
    for side in (-1, 1):
        leg = box([min(0, side), -1, -1], [max(0, side), 1, HIP - 0.2])
        handles.append(moved(leg, turn(axis, -side * degrees, (side * LEG, 0, HIP))))
    return af.deform(body, handles)


def leg_axis(side, heights, degrees, axis=(0, 1, 0)):
    """Points of a leg's axis as its handle takes them."""
    points = np.column_stack([0 * heights + side * LEG, 0 * heights, heights])
    motion = turn(axis, -side * degrees, (side * LEG, 0, HIP))
    return points @ motion[:3, :3].T + motion[:3, 3]


def test_points_on_the_surface_go_where_the_field_takes_them(body, striding):
    points = body.points[:500]
    attached = af.Attachment(body, points)
    assert np.abs(attached.positions(striding) - striding(points)).max() <= 1e-12  # rounding
    assert (attached.distances < 1e-9).all()


def test_hair_roots_stay_on_the_scalp(body, striding):
    """Strands from points between the samples: their roots are the field's own to 1e-4 of the size."""
    surface, _ = af.extract_surface(trousers(), 96)
    chosen = np.random.default_rng(0).choice(len(surface), 300, replace=False)
    roots = surface[chosen]
    attached = af.Attachment(body, np.concatenate([roots, roots + np.array([0, 0.3, 0])]))
    assert np.abs(attached.positions(striding)[:300] - striding(roots)).max() < 1e-4 * length(body)


def test_at_rest_nothing_moves_and_a_rigid_motion_moves_all(body):
    rng = np.random.default_rng(1)
    points = rng.uniform([-1, -1, -0.5], [1, 1, 2], (2000, 3))
    attached = af.Attachment(body, points)
    handles = [moved(box([-1, -1, -1], [1, 1, 3]))]
    live = af.LiveDeformer(body, handles)
    assert np.abs(attached.positions(live.solve()) - points).max() < 1e-6
    motion = np.eye(4)
    motion[:3, :3] = random_rotations(1, rng)[0]
    motion[:3, 3] = [0.5, -1, 2]
    field = live.solve([motion @ box([-1, -1, -1], [1, 1, 3])], iterations=200, tolerance=1e-12)
    expected = points @ motion[:3, :3].T + motion[:3, 3]
    assert np.abs(attached.positions(field) - expected).max() < 1e-3


# Half the width and depth of a skirt, and how much wider it is below: from 0.03 of the body's size off the
# skin, nearer than which the field itself moves it, to three times as wide as the body.
SKIRTS = [
    (0.22, 0.15, 0.0),
    (0.25, 0.15, 0.4),
    (0.25, 0.18, 0.0),
    (0.28, 0.2, 0.8),
    (0.35, 0.3, 0.0),
    (0.5, 0.5, 0.0),
]
AROUND = [60] * len(SKIRTS) + [320]  # points around each; one is dense as well
SKIRTS.append((0.25, 0.15, 0.0))


@pytest.fixture(scope="module", params=[("aside", 10), ("aside", 20), ("aside", 30), ("ahead", 30)])
def apart(request, body):
    """(field, axis, degrees): the legs move apart, to the sides or as in a stride."""
    way, degrees = request.param
    axis = [0, 1, 0] if way == "aside" else [1, 0, 0]
    return spread(body, degrees, axis), axis, degrees


@pytest.mark.parametrize("skirt, around", zip(SKIRTS, AROUND, strict=True))
def test_a_wide_skirt_spreads_with_the_legs_and_does_not_tear(body, apart, skirt, around):
    """No edge is stretched by over 10 % more than the legs' distance at its height."""
    half_width, half_depth, flare = skirt
    field, axis, degrees = apart
    heights = np.linspace(FOOT, HIP - 0.1, 23)
    points, edges = ring(half_width, half_depth, heights, around, flare)
    attached = af.Attachment(body, points)
    carried = attached.positions(field)
    between = leg_axis(1, heights, degrees, axis) - leg_axis(-1, heights, degrees, axis)
    asked = (np.linalg.norm(between, axis=1) / (2 * LEG))[edges[:, 0] // around]
    before = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    after = np.linalg.norm(carried[edges[:, 0]] - carried[edges[:, 1]], axis=1)
    assert (after / before / asked).max() < 1.1
    along = 0 if axis[1] else 1
    way = (carried - points)[:, along]
    lowest = points[:, 2] < FOOT + 1e-9
    at_right, at_left = points[:, 0] > 0.9 * points[:, 0].max(), points[:, 0] < 0.9 * points[:, 0].min()
    sides = way[lowest & at_right].mean(), way[lowest & at_left].mean()
    assert sides[0] * sides[1] < 0 and min(np.abs(sides)) > 0.05


def test_a_dress_that_lies_on_the_legs_does_not_tear(body, striding):
    """Where it lies on both legs, at 0.01 of the size, what is between them takes all of their way."""
    points, edges = ring(0.2, 0.12, np.linspace(FOOT, HIP - 0.1, 23), 160)
    carried = af.Attachment(body, points).positions(striding)
    before = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    after = np.linalg.norm(carried[edges[:, 0]] - carried[edges[:, 1]], axis=1)
    heights = points[:, 2].reshape(23, -1)[:, 0]
    asked = np.linalg.norm(leg_axis(1, heights, 20) - leg_axis(-1, heights, 20), axis=1) / (2 * LEG)
    assert (after / before / asked[edges[:, 0] // 160]).max() < 1.6


def test_a_shirt_keeps_its_distance_to_the_skin(body):
    """The trunk bent by 45 degrees: distances change by 3 % at most on average, and never their sign."""
    top = box([-1, -1, 1.1], [1, 1, 2])
    handles = [moved(box([-1, -1, -1], [1, 1, HIP])), moved(top, turn([1, 0, 0], 45, (0, 0, 0.9)))]
    field = af.deform(body, handles)
    surface, triangles = af.extract_surface(trousers(), 128)
    posed = field(surface)
    trunk = (surface[:, 2] > 0.75) & (surface[:, 2] < 1.15)
    normals = trousers_normals(surface[trunk])
    for distance in (0.01, 0.03, 0.05):
        shirt = surface[trunk] + distance * normals
        before = af.signed_distance(surface, triangles, shirt)
        after = af.signed_distance(posed, triangles, af.Attachment(body, shirt).positions(field))
        assert after.min() > 0, distance
        assert np.abs(after / before - 1).mean() < 0.03, distance


def trousers_normals(points):
    body, step = trousers(), 1e-4
    slope = np.column_stack([(body(points + e) - body(points - e)) for e in step * np.eye(3)])
    return slope / np.linalg.norm(slope, axis=1, keepdims=True)


def test_neighbours_stay_neighbours_everywhere(body, striding):
    """Wherever frames carry: a small step stays one. The legs ask for a few times its length between them."""
    rng = np.random.default_rng(2)
    points = rng.uniform([-0.6, -0.6, -0.2], [0.6, 0.6, 1.5], (20000, 3))
    points = points[trousers()(points) > 0.1 * length(body)]
    steps = 1e-3 * random_rotations(len(points), rng)[:, 0]
    attached = af.Attachment(body, np.concatenate([points, points + steps]))
    first, second = np.split(attached.positions(striding), 2)
    assert np.linalg.norm(second - first, axis=1).max() < 8e-3


def test_kinds_of_fields_and_frames_agree(body, striding):
    points = np.random.default_rng(3).uniform([-0.5, -0.5, 0], [0.5, 0.5, 1.4], (3000, 3))
    once = af.Attachment(body, points)
    expected = once.positions(striding)
    assert np.array_equal(once.positions(striding), expected)  # from what the first call kept

    other = af.SurfaceSamples(body.points, body.normals, af.Frame([1, 2, 3], 2.5))
    assert np.abs(af.Attachment(other, points).positions(striding) - expected).max() < 1e-5
    results = [None] * 4

    def ask(i):
        results[i] = once.positions(striding)

    threads = [threading.Thread(target=ask, args=(i,)) for i in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(result, expected) for result in results)


def test_bad_attachments_are_refused(body, striding):
    empty = af.Attachment(body, np.empty((0, 3)))
    assert empty.positions(striding).shape == (0, 3) and len(empty) == 0
    with pytest.raises(af.InvalidInput, match="points"):
        af.Attachment(body, [[0, 0, np.nan]])
    with pytest.raises(af.InvalidInput, match="points"):
        af.Attachment(body, [[0, 0]])
    one = af.SurfaceSamples([[1.0, 2, 3]], [[0, 0, 1]], af.Frame([0, 0, 0], 1))
    far = af.Attachment(one, [[1.0, 2, 3], [4, 5, 6], [100, 0, 0]])
    assert np.abs(far.positions(striding)).max() < 1e3  # one place alone serves all


def test_rigid_motions():
    rng = np.random.default_rng(4)
    points = rng.normal(size=(50, 3))
    rotation = random_rotations(1, rng)[0]
    motion = af.rigid_motion(points, points @ rotation.T + [1, 2, 3])
    assert np.abs(motion[:3, :3] - rotation).max() < 1e-11 and np.allclose(motion[:3, 3], [1, 2, 3])
    mirrored = af.rigid_motion(points, points * [-1, 1, 1])
    assert np.linalg.det(mirrored[:3, :3]) == pytest.approx(1)
    assert np.array_equal(af.rigid_motion([[1, 2, 3]], [[3, 2, 1]]), shift([2, 0, -2]))
    line = np.outer(np.arange(5.0), [1, 0, 0])
    assert np.allclose(af.rigid_motion(line, line + np.array([0, 0, 1])), shift([0, 0, 1]))
    weights = np.r_[np.ones(25), np.zeros(25)]
    half = np.concatenate([points[:25] + np.array([1, 0, 0]), rng.normal(size=(25, 3))])
    assert np.allclose(af.rigid_motion(points, half, weights=weights), shift([1, 0, 0]))
    assert np.allclose(af.rigid_motion(1e200 * points, 1e200 * (points + 1))[:3, :3], np.eye(3))
    for bad, name in [
        (((points, points[:9])), "moved"),
        (((points[:0], points[:0])), "points"),
        (((points, points * np.inf)), "moved"),
    ]:
        with pytest.raises(af.InvalidInput, match=name):
            af.rigid_motion(*bad)
    with pytest.raises(af.InvalidInput, match="weights"):
        af.rigid_motion(points, points, weights=-np.ones(50))


def test_many_points_are_carried_at_interactive_rates(body):
    """100,000 points, a third of them far: thirty shapes a second on two cores, with room to spare for
    slow and busy machines."""
    rng = np.random.default_rng(5)
    near = body.points[rng.integers(len(body), size=66_000)] + rng.normal(0, 0.01, (66_000, 3))
    far = rng.uniform([-0.7, -0.7, -0.2], [0.7, 0.7, 1.6], (34_000, 3))
    attached = af.Attachment(body, np.concatenate([near, far]))
    leg = box([-1, -1, -1], [0, 1, HIP - 0.2])
    live = af.LiveDeformer(body, [moved(box([-1, -1, HIP], [1, 1, 2])), moved(leg)])
    attached.positions(live.solve())
    shapes = [
        live.solve([np.array(box([-1, -1, HIP], [1, 1, 2])), shift([0, 0.01 * i, 0]) @ leg]) for i in range(5)
    ]
    start = time.process_time()
    for field in shapes:
        attached.positions(field)
    assert (time.process_time() - start) / len(shapes) < 0.4  # processor time of all threads


# What a body carries under a style: the field is steep off the surface, the frames are not.

spatial = pytest.importorskip("scipy.spatial")

SIZE = 0.97  # of the body, as attachments measure it
MOST = 2.0  # times as long: what an edge becomes, where the surface below takes 1.6 to 2


@pytest.fixture(scope="module")
def styled():
    body = af.sample_surface(trousers(), 5000, seed=0)
    return body, af.stylize(body, "cube", up=[0, 0, 1])


@pytest.mark.parametrize("share", [0.01, 0.02, 0.03, 0.04, 0.05])
def test_clothes_at_any_distance_keep_together_under_a_style(styled, share):
    body, field = styled
    points = body.points[::2] + share * SIZE * body.normals[::2]
    edges = spatial.cKDTree(points).query_pairs(0.02 * SIZE, output_type="ndarray")
    before = np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    long = before > 0.005 * SIZE
    moved = af.Attachment(body, points).positions(field)
    after = np.linalg.norm(moved[edges[:, 0]] - moved[edges[:, 1]], axis=1)
    assert (after / before)[long].max() < MOST


# A field of one mesh applied to others of the same shape, from scripts and from the command line.


@pytest.fixture(scope="module")
def meshes():
    """The same creature in about 2,000, 20,000 and 200,000 vertices."""
    return [af.extract_surface(trousers(), resolution) for resolution in (60, 190, 512)]


@pytest.fixture(scope="module")
def saved(meshes, tmp_path_factory):
    path = tmp_path_factory.mktemp("poses") / "step.safetensors"
    V, F = meshes[1]
    leg = box([0, -1, -1], [1, 1, 0.4])
    handles = [
        moved(box([-1, -1, 0.9], [1, 1, 2])),
        moved(leg, turn([1, 0, 0], 50, (LEG, 0, HIP))),
    ]
    af.deform(af.sample_mesh(V, F, 8000), handles).save(path)
    return path


def distances(first, second, seed):
    """Mean distance of points of one surface from the other."""
    points = af.sample_mesh(*first, 4000, seed=seed).points
    return np.abs(af.signed_distance(*second, points))


def test_levels_of_detail_move_as_one(meshes, saved):
    """Surfaces differ by at most 1 % of the motion more than at rest."""
    field = af.DeformationField.load(saved)
    sizes = [len(V) for V, _ in meshes]
    assert sizes[0] < 3000 and 15_000 < sizes[1] < 30_000 and sizes[2] > 130_000
    V, F = meshes[1]
    motion = np.linalg.norm(field(V) - V, axis=1).max()
    middle = (field.apply(V), F)
    for k in (0, 2):
        W, G = meshes[k]
        at_rest = max(distances((W, G), (V, F), 1).max(), distances((V, F), (W, G), 2).max())
        other = (field.apply(W), G)
        posed = max(distances(other, middle, 1).max(), distances(middle, other, 2).max())
        assert posed < at_rest + 0.01 * motion


def test_strength_and_refusal(meshes, saved):
    field = af.DeformationField.load(saved)
    V, _ = meshes[0]
    assert np.array_equal(field.apply(V), field(V))
    assert np.allclose(field.apply(V, strength=0.5), 0.5 * (V + field(V)))
    assert np.array_equal(field.apply(V, strength=0.0), V)
    assert field.apply(np.empty((0, 3))).shape == (0, 3)
    for other in (V + np.array([2, 0, 0]), 10 * V):
        with pytest.raises(af.InvalidInput, match=r"points: \d+ % of them lie outside of the field"):
            field.apply(other)
    with pytest.raises(af.InvalidInput, match="strength"):
        field.apply(V, strength=np.nan)


@pytest.mark.parametrize("suffix", ["obj", "xyz", "txt", "csv", "npy", "npz", "ply"])
def test_warp_moves_points_and_curves(meshes, saved, tmp_path, suffix):
    field, points = af.DeformationField.load(saved), meshes[0][0][:200]
    source, output = tmp_path / f"in.{suffix}", tmp_path / f"out.{suffix}"
    if suffix == "obj":
        lines = [f"v {x} {y} {z}" for x, y, z in points] + ["l 1 2 3", "l 4 5"]
        source.write_text("# a curve\n" + "\n".join(lines) + "\n")
    elif suffix == "npy":
        np.save(source, points)
    elif suffix == "npz":
        np.savez(source, points=points)
    elif suffix == "ply":
        head = "".join(f"property double {c}\n" for c in "xyz")
        source.write_bytes(
            f"ply\nformat binary_little_endian 1.0\nelement vertex 200\n{head}end_header\n".encode()
            + points.astype("<f8").tobytes()
        )
    else:
        np.savetxt(source, np.hstack([points, points]), delimiter="," if suffix == "csv" else " ")
    assert run("warp", saved, source, "-o", output, "--share", 0.5, "--quiet") == 0
    if suffix == "obj":
        text = output.read_text()
        assert text.startswith("# a curve") and "l 1 2 3" in text
        read_points = np.array([line.split()[1:] for line in text.splitlines() if line[0] == "v"], float)
    elif suffix == "npy":
        read_points = np.load(output)
    elif suffix == "npz":
        read_points = np.load(output)["points"]
    elif suffix == "ply":
        read_points = np.frombuffer(output.read_bytes()[-200 * 24 :], "<f8").reshape(-1, 3)
    else:
        read_points = np.loadtxt(output, delimiter="," if suffix == "csv" else None)
    assert np.abs(read_points - field.apply(points, strength=0.5)).max() < 1e-6


def test_warp_carries_attached_objects(meshes, saved, tmp_path, capsys):
    V, F = meshes[0]
    body, hair, output = (tmp_path / name for name in ("body.obj", "hair.xyz", "out.xyz"))
    body.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in V) + "".join(f"f {a} {b} {c}\n" for a, b, c in F + 1)
    )
    strands = np.random.default_rng(0).uniform([-0.4, -0.4, 0], [0.4, 0.4, 1.2], (300, 3))
    np.savetxt(hair, strands)
    assert run("warp", saved, hair, "-o", output, "--quiet") == 2
    assert "outside of the field" in capsys.readouterr().err and not output.exists()
    assert run("warp", saved, hair, "-o", output, "--body", body, "--quiet") == 0
    attached = af.Attachment(af.sample_mesh(V, F), strands)
    expected = attached.positions(af.DeformationField.load(saved))
    assert np.abs(np.loadtxt(output) - expected).max() < 1e-4


def test_symmetry_weights_scale_and_reach_by_flags(meshes, tmp_path):
    V, F = meshes[0]
    body, stiff = tmp_path / "body.obj", tmp_path / "stiff.txt"
    body.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in V) + "".join(f"f {a} {b} {c}\n" for a, b, c in F + 1)
    )
    np.savetxt(stiff, np.where(V[:, 2] > HIP, 1000.0, 1.0))
    field = tmp_path / "field.safetensors"
    common = ["deform", body, "--save-field", field, "--centers", 100, "--samples", 4000, "--quiet"]
    foot = ["--box", "0,-1,-1", "1,1,0.2", "--turn", "1,0,0", "20"]
    head = ["--box", "-1,-1,1", "1,1,2"]
    assert run(*common, *head, *foot, "--symmetry", "x", "--weights", stiff, "--bend-weights", stiff) == 0
    loaded, flip = af.DeformationField.load(field), np.array([-1, 1, 1])
    assert np.abs(loaded(V * flip) - loaded(V) * flip).max() < 1e-6
    assert np.abs(loaded(V) - V).max() > 0.03
    assert run(*common, *head, "--box", "0,-1,-1", "1,1,0.2", "--scale", "1.5") == 0
    low = V[(V[:, 2] < 0.2) & (V[:, 0] > 0)]
    assert np.ptp(af.DeformationField.load(field)(low)[:, 1]) > 1.3 * np.ptp(low[:, 1])
    assert run(*common, "--point", f"{LEG},0,0", f"{LEG},0.1,0", "--reach", 0.3) == 0
    high = V[V[:, 2] > 0.5]
    assert np.array_equal(af.DeformationField.load(field)(high), high)


@pytest.mark.parametrize(
    "content, words", [("1 2 3", "one for each"), ("-1 " * 9, "one for each"), ("a b", "not readable")]
)
def test_weights_that_do_not_fit_are_named(meshes, tmp_path, capsys, content, words):
    V, F = meshes[0]
    body, stiff = tmp_path / "body.obj", tmp_path / "stiff.txt"
    body.write_text(
        "".join(f"v {x} {y} {z}\n" for x, y, z in V) + "".join(f"f {a} {b} {c}\n" for a, b, c in F + 1)
    )
    stiff.write_text(content)
    code = run("deform", body, "-o", tmp_path / "o.obj", "--point", "0,0,1", "0,0,1", "--weights", stiff)
    assert code == 2 and "stiff.txt" in (text := capsys.readouterr().err) and words in text
