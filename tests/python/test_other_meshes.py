# SPDX-License-Identifier: GPL-3.0-or-later
"""A field of one mesh applied to others of the same shape, from scripts and from the command line."""

import numpy as np
import pytest
from support.geometry.cases import box, moved, turn
from support.geometry.characters import HIP, LEG, trousers
from support.programs.cli import run

import arapfields as af


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


def apart(first, second, seed):
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
        at_rest = max(apart((W, G), (V, F), 1).max(), apart((V, F), (W, G), 2).max())
        other = (field.apply(W), G)
        posed = max(apart(other, middle, 1).max(), apart(middle, other, 2).max())
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
