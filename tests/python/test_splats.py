# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats: moved by fields, sampled, turned, read and written."""

import json
import math
import sys
from functools import cache

import numpy as np
import pytest
from support.files import archives
from support.files import splats as written_splats
from support.files.archives import files_of_at_most
from support.files.splats import MESH, SIZE, splats
from support.geometry import cases
from support.programs.cli import run

import arapfields as af
from arapfields.__main__ import main
from arapfields.cli import usd


def axes(quaternions):
    """(n, 3, 3) rotations of unit quaternions (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternions, float).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def covariances(splats):
    turned = axes(splats.rotations) * np.asarray(splats.scales, float)[:, None, :]
    return turned @ turned.swapaxes(1, 2)


def legendre(band, order, z):
    """Associated Legendre functions without the Condon–Shortley phase, by their definition as derivatives."""
    polynomial = (
        np.polynomial.legendre.Legendre.basis(band).deriv(order)
        if order
        else (np.polynomial.legendre.Legendre.basis(band))
    )
    return (1 - z * z) ** (order / 2) * polynomial(z)


def harmonics(directions, count):
    """(n, count) real spherical harmonics by their angles; the sign of order m is (−1)^m."""
    x, y, z = directions.T
    angle, columns = np.arctan2(y, x), []
    for band in range(round(count**0.5)):
        for m in range(-band, band + 1):
            order = abs(m)
            factor = math.factorial(band - order) / math.factorial(band + order)
            scale = math.sqrt((2 - (m == 0)) * (2 * band + 1) / (4 * math.pi) * factor)
            wave = np.sin(order * angle) if m < 0 else np.cos(order * angle)
            columns.append((-1) ** order * scale * legendre(band, order, z) * wave)
    return np.array(columns).T


def render(splats, camera, pixels=64, focal=1.6):
    """(pixels, pixels, 3) picture by a camera, (4, 4) world → camera, that looks along its −z."""
    turn, shift = camera[:3, :3], camera[:3, 3]
    centers = np.asarray(splats.centers, float)
    eye = -turn.T @ shift
    seen = centers @ turn.T + shift
    depth = -seen[:, 2]
    flat = focal * seen[:, :2] / depth[:, None]
    slope = np.zeros((len(seen), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = focal / depth
    slope[:, 0, 2], slope[:, 1, 2] = focal * seen[:, 0] / depth**2, focal * seen[:, 1] / depth**2
    slope = slope @ turn
    inverse = np.linalg.inv(slope @ covariances(splats) @ slope.swapaxes(1, 2) + 1e-5 * np.eye(2))
    colours = np.asarray(splats.harmonics, float)
    away = (centers - eye) / np.linalg.norm(centers - eye, axis=1, keepdims=True)
    colours = np.maximum(0.5 + np.einsum("nk,nkc->nc", harmonics(away, colours.shape[1]), colours), 0)
    steps = (np.arange(pixels) + 0.5) / pixels * 2 - 1
    grid = np.stack(np.meshgrid(steps, -steps), -1)
    image, left = np.zeros((pixels, pixels, 3)), np.ones((pixels, pixels))
    for i in np.argsort(depth, kind="stable"):
        offset = grid - flat[i]
        power = np.einsum("ijk,kl,ijl->ij", offset, inverse[i], offset)
        alpha = np.minimum(splats.opacities[i] * np.exp(-0.5 * power), 0.99)
        image += (left * alpha)[..., None] * colours[i]
        left *= 1 - alpha
    return image


def psnr(one, other):
    return -10 * np.log10(max(np.mean((one - other) ** 2), 1e-20))


# Gaussian splats: moved by fields, sampled, read and written.

SINGLE = 1e-5  # what single precision leaves of a covariance
EXACT = 1e-6  # a rigid motion, of single-precision numbers of a size of 1
PREPARED = 2e-4  # of the size: jets in single precision
AT_THE_LIMIT = 0.002  # share of splats that one of two ways divides: their first part is elsewhere
DRAWN = 0.02  # a covariance of points that are drawn
PSNR_SAME = 60.0  # dB: the same picture but for rounding
FIELDS = ("centers", "rotations", "scales", "opacities", "harmonics")


@cache
def bent(degrees=70.0, reach=0.0):
    samples = af.sample_mesh(*MESH, count=4000)
    held, turned = (
        cases.box([-0.9, -0.4, -0.4], [-0.5, 0.4, 0.4]),
        cases.box([0.5, -0.4, -0.4], [0.9, 0.4, 0.4]),
    )
    handles = [cases.moved(held), cases.moved(turned, cases.turn([0, 1, 0], degrees), reach=reach)]
    return af.deform(samples, handles)


MOTION = cases.turn([1, 2, 3], 130, (0.2, 0.1, -0.3)) @ cases.shift([0.4, -0.2, 0.1])


def affine(tmp_path, motion):
    """Exactly: its kernels are zero."""
    saved = tmp_path / "affine.safetensors"
    bent().save(saved)
    texts, arrays = archives.read(saved)
    frame = texts["structure"]["frame"]
    center, turn = np.array(frame["center"]), motion[:3, :3]
    arrays["coefficients"] = np.zeros_like(arrays["coefficients"])
    arrays["coefficients"][-4] = (turn @ center + motion[:3, 3] - center) / frame["scale"]
    arrays["coefficients"][-3:] = turn.T
    saved.write_bytes(archives.packed(texts, arrays))
    return af.DeformationField.load(saved)


def test_a_rigid_motion_keeps_the_picture_of_a_moving_camera(tmp_path):
    motion, field = MOTION, affine(tmp_path, MOTION)
    rest = splats()
    moved = field.apply_to(rest)
    turn = motion[:3, :3]
    assert np.abs(moved.centers - (rest.centers @ turn.T + motion[:3, 3])).max() < EXACT
    assert np.abs(axes(moved.rotations) - turn @ axes(rest.rotations)).max() < EXACT
    assert np.abs(moved.scales / rest.scales - 1).max() < EXACT
    directions = np.random.default_rng(4).normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    seen, seen_before = harmonics(directions @ turn.T, 16), harmonics(directions, 16)
    colours = np.einsum("dk,nkc->ndc", seen, np.asarray(moved.harmonics, float))
    assert np.abs(colours - np.einsum("dk,nkc->ndc", seen_before, rest.harmonics)).max() < EXACT
    assert np.array_equal(moved.opacities, rest.opacities) and not np.array_equal(
        moved.harmonics, rest.harmonics
    )
    for axis, degrees in (([0, 1, 0], 20), ([1, 0, 1], 115)):
        camera = cases.shift([0, 0, -2.2]) @ cases.turn(axis, degrees)
        before, after = render(rest, camera), render(moved, camera @ np.linalg.inv(motion))
        assert before.std() > 0.05 and psnr(before, after) > PSNR_SAME
        unturned = af.GaussianSplats(
            moved.centers, moved.rotations, moved.scales, moved.opacities, rest.harmonics
        )
        assert psnr(before, render(unturned, camera @ np.linalg.inv(motion))) < 35.0


def test_covariances_are_those_of_points_that_the_field_moves():
    field, rest = bent(), splats(40, harmonics=1, width=0.01)
    moved = covariances(field.apply_to(rest, max_stretch=np.inf))
    jacobian = field.jacobian(rest.centers)
    exact = jacobian @ covariances(rest) @ jacobian.swapaxes(1, 2)
    assert np.abs(moved - exact).max() < SINGLE * np.abs(exact).max()
    rng = np.random.default_rng(1)
    turned = axes(rest.rotations) * np.asarray(rest.scales, float)[:, None, :]
    for i in range(0, 40, 8):
        normal = rng.normal(size=(40000, 3))
        normal @= np.linalg.inv(np.linalg.cholesky(np.cov(normal.T))).T  # their covariance is exactly 1
        points = rest.centers[i] + normal @ turned[i].T
        drawn = np.cov(field(points).T)
        assert np.linalg.norm(drawn - moved[i]) < DRAWN * np.linalg.norm(moved[i])


def test_stretched_splats_are_split_and_keep_their_moments(tmp_path):
    rest = splats(60, harmonics=4, width=0.3)
    field = bent(150.0)
    assert len(field.apply_to(rest, max_stretch=np.inf)) == len(rest) < len(field.apply_to(rest))
    field = affine(tmp_path, MOTION @ np.diag([1.5, 1, 1, 1]))
    assert len(field.apply_to(rest, max_stretch=1.51)) == len(rest)
    whole = field.apply_to(rest, max_stretch=np.inf)
    parts = field.apply_to(rest, max_stretch=1.2)
    divided = np.flatnonzero(parts.scales.prod(1)[:60] < 0.75 * whole.scales.prod(1))
    others = 60 + np.arange(len(divided))
    assert len(divided) > 30 and len(parts) == 60 + len(divided)
    halves = np.stack([parts.centers[divided], parts.centers[others]]).astype(float)
    size = whole.scales[divided].max(1)
    assert np.abs(halves.mean(0) - whole.centers[divided]).max() < 1e-6
    spread = np.einsum("hni,hnj->nij", halves - halves.mean(0), halves - halves.mean(0)) / 2
    of_parts = covariances(parts)
    mixed = (of_parts[divided] + of_parts[others]) / 2 + spread
    off = np.abs(mixed - covariances(whole)[divided]).max((1, 2))
    assert (off < EXACT * size**2).all()
    assert np.abs(parts.harmonics[divided] - parts.harmonics[others]).max() < SINGLE


def test_prepared_splats_move_as_others_do():
    rest = splats(3000, harmonics=9, width=0.05)
    prepared, again = af.PreparedSplats(rest), None
    for degrees, most in ((70.0, np.inf), (150.0, 1.2)):
        field = bent(degrees)
        before, moved = again, field.apply_to(rest, max_stretch=most)
        again = prepared.moved(field, before, max_stretch=most)
        assert before is None or len(before) == 0  # its memory is the result's
        assert len(prepared) == len(rest) and abs(len(again) - len(moved)) <= AT_THE_LIMIT * len(moved)
        apart = np.abs(again.centers[: len(rest)] - moved.centers[: len(rest)]).max(1)
        assert (apart > 5 * PREPARED).mean() <= AT_THE_LIMIT and apart.max() < moved.scales.max()
        if most == np.inf:
            assert np.abs(again.centers - moved.centers).max() < PREPARED
            off = np.abs(covariances(again) - covariances(moved)).max((1, 2))
            assert (off < 5 * PREPARED * moved.scales.max(1) ** 2).all()
            assert np.abs(again.harmonics - moved.harmonics).max() < 5 * PREPARED
    given = af.GaussianSplats(*[getattr(rest, name) for name in FIELDS])
    with pytest.raises(af.InvalidInput, match="max_stretch"):
        af.PreparedSplats(given).moved(field, max_stretch=0.5)
    with pytest.raises(af.InvalidInput, match="max_stretch"):
        field.apply_to(given, max_stretch=0.5)


def numbers(splats):
    """(n, 4 + 3k) what a motion changes of splats, in the order of PreparedSplats.changes()."""
    rest = splats.harmonics[:, 1:].swapaxes(1, 2).reshape(len(splats), -1)
    return np.column_stack([splats.rotations, np.log(splats.scales), rest])


@pytest.mark.parametrize("functions", (1, 4, 9, 16))
def test_changes_are_differences_of_moved_numbers(functions):
    rest = splats(1303, functions)  # not a whole number of packs
    prepared, given = af.PreparedSplats(rest), numbers(rest)
    rows, columns = np.full_like(given, np.nan), np.full_like(given.T, np.nan)
    for field in (bent(), bent(30.0, reach=0.5)):
        moved = prepared.moved(field, max_stretch=np.inf)
        for changes in (rows.T, columns):  # numbers that lie apart, and side by side
            made = (column.copy() for column in given.T)  # which nothing else holds
            centers = prepared.changes(field, made, list(changes))
            assert np.array_equal(centers, moved.centers)
            assert np.abs(given + changes.T - numbers(moved)).max() < SINGLE
        assert np.array_equal(rows.T, columns)
    for wrong, word in (
        (given.T[1:], "rest"),
        (given.T.astype(float), r"rest\[0\]"),
        (given.T[:, 1:], r"rest\[0\]"),
    ):
        with pytest.raises(af.InvalidInput, match=word):
            prepared.changes(field, list(wrong), list(columns[: len(wrong)]))
    for call in (af.PreparedSplats, field.apply_to, af.sample_splats):
        with pytest.raises(TypeError):
            call(None)
    columns.flags.writeable = False
    with pytest.raises(af.InvalidInput, match=r"changes\[0\]: it cannot be written to"):
        prepared.changes(field, list(given.T), list(columns))


def test_samples_lie_where_splats_are_and_look_outward():
    many = splats(6000, harmonics=1, width=0.01, seed=2)
    floating = np.random.default_rng(3).uniform(-3, 3, (40, 3)) + np.array([0, 5, 0])
    mixed = af.GaussianSplats(
        np.concatenate([many.centers, floating]),
        np.concatenate([many.rotations, np.tile([1, 0, 0, 0], (40, 1))]),
        np.concatenate([many.scales, np.full((40, 3), 0.1)]),
        np.concatenate([np.full(6000, 0.9), np.full(40, 0.9)]),
        np.zeros((6040, 1, 3)),
    )
    samples = af.sample_splats(mixed, 1500)
    assert 1000 < len(samples) <= 1500 and samples.points[:, 1].max() < 1
    outward = samples.points / SIZE**2
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert (samples.normals * outward).sum(1).min() > 0.7
    exact = bent()
    held, turned = (
        cases.box([-0.9, -0.4, -0.4], [-0.5, 0.4, 0.4]),
        cases.box([0.5, -0.4, -0.4], [0.9, 0.4, 0.4]),
    )
    handles = [cases.moved(held), cases.moved(turned, cases.turn([0, 1, 0], 70))]
    off = np.abs(af.deform(samples, handles)(MESH[0]) - exact(MESH[0])).max()
    assert off < 0.03 * 1.6, off


def test_the_command_line_bends_a_scan(tmp_path, capsys):
    scan, out = tmp_path / "scan.ply", tmp_path / "bent.ply"
    splats(3000, 4, width=0.02).save(scan)
    box = ["--box", "-inf,-inf,-inf", "-0.5,inf,inf", "--point", "0.7,0,0", "0.7,0,0.3"]
    saved = tmp_path / "field.safetensors"
    assert main(["deform", str(scan), "-o", str(out), "--save-field", str(saved), *box, "--quiet"]) == 0
    rest, moved = af.GaussianSplats.load(scan), af.GaussianSplats.load(out)
    field = af.DeformationField.load(saved)
    assert np.abs(moved.centers[: len(rest)] - field(rest.centers)).max() < SINGLE
    assert main(["warp", str(saved), str(scan), "-o", str(tmp_path / "again.ply"), "--quiet"]) == 0
    assert (tmp_path / "again.ply").read_bytes() == out.read_bytes()
    for arguments, word in (
        (["deform", str(scan), "-o", str(tmp_path / "bent.obj"), *box], "allowed are .ply, .glb, .usd"),
        (["warp", str(saved), str(scan), "-o", str(out), "--share", "0.5"], "--share"),
        (["extract", str(scan), "-o", str(tmp_path / "bent.obj")], "holds splats"),
    ):
        assert main(arguments) == 2
        assert word in capsys.readouterr().err


# Gaussian splats: their numbers, read, written and refused.


def test_a_splat_file_keeps_its_other_properties(tmp_path):
    for count in (1, 4, 9, 16):
        given = splats(7, count)
        given.save(tmp_path / "a.ply")
        back = af.GaussianSplats.load(tmp_path / "a.ply")
        for name in FIELDS:
            assert np.array_equal(getattr(back, name), getattr(given, name)), name
    text, rows = (tmp_path / "a.ply").read_bytes().split(b"end_header\n")
    width = len(rows) // 7
    more = b"".join(rows[i * width : (i + 1) * width] + bytes([i, 0, 0, 0, 0, 0, 0, 64, 9]) for i in range(7))
    text += b"property double weight\nproperty uchar label\nend_header\n"
    (tmp_path / "b.ply").write_bytes(text + more)
    af.GaussianSplats.load(tmp_path / "b.ply").save(tmp_path / "c.ply")
    assert (tmp_path / "c.ply").read_bytes() == text + more
    assert af.GaussianSplats.is_file(tmp_path / "b.ply") and not af.GaussianSplats.is_file(
        tmp_path / "no.ply"
    )


def test_opaque_and_invisible_splats_stay_so(tmp_path):
    """An exporter writes the logit of an opacity of 1 as infinity."""
    splats(5, 4).save(tmp_path / "a.ply")
    good = (tmp_path / "a.ply").read_bytes()
    row = len(good.split(b"end_header\n")[1]) // 5
    for value, opacity in ((np.inf, 1.0), (-np.inf, 0.0)):
        at = len(good) - row - 32  # of the opacity of the last splat but one
        content = good[:at] + np.array([value], "<f4").tobytes() + good[at + 4 :]
        (tmp_path / "b.ply").write_bytes(content)
        scan = af.GaussianSplats.load(tmp_path / "b.ply")
        assert scan.opacities[3] == opacity and 0 < scan.opacities[4] < 1
        scan.save(tmp_path / "c.ply")
        assert (tmp_path / "c.ply").read_bytes() == content
        again = af.GaussianSplats(scan.centers, scan.rotations, scan.scales, scan.opacities, scan.harmonics)
        assert again.opacities[3] == opacity
        samples = af.sample_mesh(
            [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], 200
        )
        field = af.deform(samples, [af.PointHandle([0, 0, 0], [0.1, 0, 0])], af.DeformOptions(iterations=3))
        assert field.apply_to(scan).opacities[3] == opacity


def test_bad_splat_files_are_named(tmp_path):
    splats(5, 4).save(tmp_path / "a.ply")
    good = (tmp_path / "a.ply").read_bytes()
    bad = tmp_path / "bad.ply"
    nan, inf = (np.array([value], "<f4").tobytes() for value in (np.nan, -np.inf))
    for content, word in (
        (good[:10], "no PLY"),
        (good[:-3], "cut off"),
        (good.replace(b"vertex 5", b"vertex 4000000000"), "cut off"),
        (good.replace(b"vertex 5", b"vertex -5"), "no count"),
        (good.replace(b"binary_little_endian", b"ascii"), "ascii"),
        (good.replace(b"property float opacity\n", b""), "lacks properties"),
        (good.replace(b"property float rot_1", b"property blob rot_1"), "unknown"),
        (good.replace(b"float f_rest_3", b"float f_rest_2"), "lacks properties"),
        (good.replace(b"end_header", b"element face 3\nend_header"), "elements face"),
        (good[:-4] + nan, "splat 4 has NaN as rot_3"),
        (good[:-20] + inf + good[-16:], "splat 4 has infinity as scale_2"),
        (good[:-32] + nan + good[-28:], "splat 4 has NaN as opacity"),
        (good[:-16] + bytes(16), "rotation of splat 4 is zero"),
    ):
        bad.write_bytes(content)
        with pytest.raises(af.InvalidInput, match=f"bad.ply.*{word}"):
            af.GaussianSplats.load(bad)
    with pytest.raises(OSError):
        af.GaussianSplats.load(tmp_path / "absent.ply")
    with pytest.raises(OSError):
        splats(5).save(tmp_path / "absent" / "a.ply")
    given = [np.zeros((2, 3)), [[1, 0, 0, 0]] * 2, np.ones((2, 3)), [0.5, 0.5], np.zeros((2, 4, 3))]
    for at, value, word in (
        (0, np.zeros((2, 2)), "centers"),
        (1, [[2, 0, 0, 0]] * 2, "rotations"),
        (2, np.zeros((2, 3)), "scales"),
        (3, [0.5, 1.5], "opacities"),
        (3, [0.5], "opacities"),
        (4, np.zeros((2, 5, 3)), "harmonics"),
    ):
        with pytest.raises(af.InvalidInput, match=word):
            af.GaussianSplats(*given[:at], value, *given[at + 1 :])
    with pytest.raises(af.InvalidInput, match="opaque"):
        af.sample_splats(af.GaussianSplats(*given))


# Gaussian splats turned as a whole, and written as glTF and USD, by Python and by the command line.

CLOSE = 1e-5  # of what is read back
EXACT_AS_WRITTEN = 2e-6  # of single-precision numbers of a size of 1


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
    assert np.abs(moved.centers - (rest.centers @ motion[:3, :3].T + motion[:3, 3])).max() < EXACT_AS_WRITTEN
    assert np.abs(axes(moved.rotations) - turn @ axes(rest.rotations)).max() < EXACT_AS_WRITTEN
    assert np.abs(moved.scales / rest.scales / scale - 1).max() < EXACT_AS_WRITTEN
    assert np.array_equal(moved.opacities, rest.opacities)
    directions = np.random.default_rng(4).normal(size=(20, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    for count in (4, 9, 16):
        rest = splats(30, count)
        seen, before = harmonics(directions @ turn.T, count), harmonics(directions, count)
        colours = np.einsum("dk,nkc->ndc", seen, np.asarray(rest.transformed(motion).harmonics, float))
        assert np.abs(colours - np.einsum("dk,nkc->ndc", before, rest.harmonics)).max() < EXACT_AS_WRITTEN


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


def test_splats_whose_z_is_up_are_turned_for_gltf(tmp_path):
    given = splats(300)
    given.save_gltf(tmp_path / "a.glb", up="z")
    back, _ = written_splats.gltf(tmp_path / "a.glb")
    turn = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
    wanted, linear = given.transformed(turn), turn[:3, :3]
    assert np.array_equal(back.centers, wanted.centers) and np.array_equal(back.harmonics, wanted.harmonics)
    assert np.abs(covariances(back) - covariances(wanted)).max() < CLOSE
    # Own axes are exchanged as those of space are, which Blender's importer takes back.
    assert np.abs(axes(back.rotations) - linear @ axes(given.rotations) @ linear.T).max() < EXACT_AS_WRITTEN
    assert np.abs(back.scales - given.scales[:, [0, 2, 1]]).max() < CLOSE


def test_limits_of_gltf_are_named(tmp_path):
    with pytest.raises(af.InvalidInput, match="up"):
        splats(3).save_gltf(tmp_path / "a.glb", up="x")
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
def test_verbs_write_moved_splats_in_each_format(tmp_path):
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
