# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats turned as a whole, and written as glTF and USD, by Python and by the command line."""

import json
import sys

import numpy as np
import pytest
from support.files import written_splats
from support.files.full_disk import files_of_at_most
from support.geometry import cases
from support.geometry.scan import splats
from support.oracles.splat_render import axes, covariances, harmonics
from support.programs.cli import run

import arapfields as af
from arapfields.cli import usd

CLOSE = 1e-5  # of what is read back
EXACT = 2e-6  # of single-precision numbers of a size of 1
MOTION = cases.turn([1, 2, 3], 130, (0.2, 0.1, -0.3)) @ cases.shift([0.4, -0.2, 0.1])


def is_usd_here():
    try:
        usd.require_usd_splats()
    except ImportError:
        return False
    return True


needs_usd = pytest.mark.skipif(not is_usd_here(), reason="usd-core is missing, or knows no splats")


def same(one, other, tolerance=CLOSE):
    """Whether splats agree in all, with rotations up to their sign."""
    signs = np.sign(np.sum(one.rotations * other.rotations, axis=1, keepdims=True))
    gaps = [np.abs(getattr(one, name) - getattr(other, name)) for name in ("centers", "scales", "opacities")]
    gaps += [np.abs(one.harmonics - other.harmonics), np.abs(one.rotations - signs * other.rotations)]
    return max(gap.max() for gap in gaps) < tolerance


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_a_similarity_turns_shapes_and_colours(scale):
    rest, motion = splats(), MOTION @ np.diag([scale, scale, scale, 1.0])
    moved, turn = rest.transformed(motion), MOTION[:3, :3]
    assert np.abs(moved.centers - (rest.centers @ motion[:3, :3].T + motion[:3, 3])).max() < EXACT
    assert np.abs(axes(moved.rotations) - turn @ axes(rest.rotations)).max() < EXACT
    assert np.abs(moved.scales / rest.scales / scale - 1).max() < EXACT
    assert np.array_equal(moved.opacities, rest.opacities)
    directions = np.random.default_rng(4).normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for count in (4, 9, 16):
        rest = splats(30, count)
        seen, before = harmonics(directions @ turn.T, count), harmonics(directions, count)
        colours = np.einsum("dk,nkc->ndc", seen, np.asarray(rest.transformed(motion).harmonics, float))
        assert np.abs(colours - np.einsum("dk,nkc->ndc", before, rest.harmonics)).max() < EXACT


def test_an_affine_map_gives_the_covariances_of_moved_points():
    rest, linear = splats(40_000, harmonics=4), np.array([[1.5, 0.4, 0], [0, 0.7, -0.2], [0.1, 0, 1.1]])
    whole = np.eye(4)
    whole[:3, :3] = linear
    moved = rest.transformed(whole)
    wanted = linear @ covariances(rest) @ linear.T
    size = np.abs(wanted).max()
    assert np.abs(covariances(moved) - wanted).max() < CLOSE * size
    back = moved.transformed(np.linalg.inv(whole))
    assert np.abs(covariances(back) - covariances(rest)).max() < CLOSE * size


@pytest.mark.parametrize(
    "matrix", [np.diag([1.0, -1, 1, 1]), np.diag([1.0, 0, 1, 1]), np.eye(4) + np.eye(4)[::-1], np.eye(3)]
)
def test_maps_that_mirror_flatten_or_project_are_refused(matrix):
    with pytest.raises(af.InvalidInput, match="matrix"):
        splats(5).transformed(matrix)


@pytest.mark.parametrize("count", [1, 4, 9, 16])
def test_gltf_is_read_back(count, tmp_path):
    given = splats(300, count)
    given.save_gltf(tmp_path / "a.glb", "Ärmel")
    back, name = written_splats.gltf(tmp_path / "a.glb")
    assert name == "Ärmel" and same(back, given) and np.array_equal(back.centers, given.centers)
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]


def test_what_gltf_cannot_hold_is_named(tmp_path):
    empty = af.GaussianSplats(*(np.zeros((0, *shape)) for shape in ((3,), (4,), (3,), (), (1, 3))))
    with pytest.raises(af.InvalidInput, match="splats"):
        empty.save_gltf(tmp_path / "a.glb")
    (tmp_path / "b.glb").write_text("before")
    with files_of_at_most(5000), pytest.raises(OSError, match=r"b\.glb"):
        splats(300).save_gltf(tmp_path / "b.glb")
    assert (tmp_path / "b.glb").read_text() == "before"
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        splats(300).save_gltf(tmp_path / "b.glb", task=task)
    assert [path.name for path in tmp_path.iterdir()] == ["b.glb"]


@needs_usd
@pytest.mark.parametrize("suffix", ["usdc", "usda"])
def test_usd_is_read_back(suffix, tmp_path):
    for count in (1, 4, 9, 16):
        given, path = splats(60, count), tmp_path / f"a{count}.{suffix}"
        file = usd.SplatFile(path, up="z", name="Left arm")
        file.add(given)
        file.finish()
        back, stage = written_splats.usd(path)
        assert same(back, given) and str(stage.GetDefaultPrim().GetPath()) == "/Left_arm"


@needs_usd
def test_a_usd_file_that_was_cut_off_is_named(tmp_path):
    with files_of_at_most(30_000), pytest.raises(OSError, match="the disk may be full"):
        file = usd.SplatFile(tmp_path / "a.usdc", up="z", name="a")
        file.add(splats(3000))
        file.finish()


def test_a_usd_without_the_type_is_named(tmp_path, monkeypatch, capsys):
    splats(50).save(tmp_path / "scan.ply")
    field = tmp_path / "field.safetensors"
    saved_field(tmp_path).save(field)
    for name, text in (("Unknown", "knows no Gaussian splats"), (None, "pip install 'arapfields[usd]'")):
        monkeypatch.setattr(usd, "SPLATS", name)
        if name is None:
            monkeypatch.setitem(sys.modules, "pxr", None)
        assert run("warp", field, tmp_path / "scan.ply", "-o", tmp_path / "a.usdc") == 2
        assert text in capsys.readouterr().err and not (tmp_path / "a.usdc").exists()


def saved_field(folder):
    """A field of the scan that moves its ends."""
    samples = af.sample_splats(splats(), 600)
    low, high = samples.points.min(0), samples.points.max(0)
    held = cases.box(low - 0.1, [low[0] + 0.3, *(high[1:] + 0.1)])
    turned = cases.box([high[0] - 0.3, *(low[1:] - 0.1)], high + 0.1)
    handles = [cases.moved(held), cases.moved(turned, cases.turn([0, 1, 0], 40))]
    return af.deform(samples, handles, af.DeformOptions(iterations=20))


@needs_usd
def test_the_verbs_write_what_they_move_in_each_format(tmp_path):
    splats().save(tmp_path / "scan.ply")
    scan, field = tmp_path / "scan.ply", tmp_path / "field.safetensors"
    solve = ["--box", "-inf,-inf,-inf", "-0.5,inf,inf", "--box", "0.5,-inf,-inf", "inf,inf,inf"]
    solve += ["--turn", "0,1,0", "30", "--samples", "600", "--iterations", "10", "--quiet"]
    verbs = {
        "deform": solve,
        "stylize": ["--style", "cube", "--samples", "600", "--iterations", "5", "--quiet"],
    }
    for verb, flags in verbs.items():
        places = {suffix: tmp_path / f"{verb}.{suffix}" for suffix in ("ply", "glb", "usdc")}
        assert run(verb, scan, "-o", places["ply"], "--save-field", field, *flags) == 0
        moved = af.GaussianSplats.load(places["ply"])
        assert np.abs(moved.centers[: len(splats())] - splats().centers).max() > 0.01
        for suffix in ("glb", "usdc"):
            assert run(verb, scan, "-o", places[suffix], *flags) == 0
            warped = tmp_path / f"warped.{suffix}"
            assert run("warp", field, scan, "-o", warped, "--quiet") == 0
            for place in (places[suffix], warped):
                read = written_splats.gltf if suffix == "glb" else written_splats.usd
                back, about = read(place)
                assert same(written_splats.with_z_up(back) if suffix == "glb" else back, moved)
                assert about == "scan" if suffix == "glb" else about.GetDefaultPrim().GetName() == "scan"
        assert run(verb, scan, "-o", places["glb"], "--up-axis", "y", *flags) == 0
        assert same(written_splats.gltf(places["glb"])[0], moved)


@needs_usd
def test_frames_are_files_of_gltf_and_one_of_usd(tmp_path):
    splats().save(tmp_path / "scan.ply")
    held, right = (cases.box([x - 0.2, -0.4, -0.4], [x + 0.2, 0.4, 0.4]) for x in (-0.7, 0.7))
    lifted = [cases.shift([0, 0, 0.1 * index]) @ right for index in range(3)]
    handles = [
        {"name": name, "type": "cuboid", "rest": rest.tolist(), "frames": np.array(frames).tolist()}
        for name, rest, frames in (("held", held, [held] * 3), ("moved", right, lifted))
    ]
    (tmp_path / "tracks.json").write_text(json.dumps({"fps": 25, "start": 5, "handles": handles}))
    given = [
        "animate",
        tmp_path / "scan.ply",
        "--tracks",
        tmp_path / "tracks.json",
        "--iterations",
        "6",
        "--quiet",
    ]
    for suffix in ("ply", "glb", "usdc"):
        assert run(*given, "-o", tmp_path / f"walk.{suffix}") == 0
    for frame in (5, 6, 7):
        wanted = af.GaussianSplats.load(tmp_path / f"walk.{frame:04d}.ply")
        back, _ = written_splats.gltf(tmp_path / f"walk.{frame:04d}.glb")
        assert same(written_splats.with_z_up(back), wanted)
        back, stage = written_splats.usd(tmp_path / "walk.usdc", frame)
        assert same(back, wanted)
    assert (stage.GetStartTimeCode(), stage.GetEndTimeCode(), stage.GetTimeCodesPerSecond()) == (5, 7, 25)
    assert run(*given, "-o", tmp_path / "walk.usdc", "--shard", "1/2") == 2
