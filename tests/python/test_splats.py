# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats: moved by fields, sampled, read and written."""

from functools import cache

import numpy as np
import pytest
from support.files import archives
from support.geometry import cases
from support.geometry.scan import MESH, SIZE, splats
from support.oracles.splat_render import axes, covariances, harmonics, psnr, render

import arapfields as af
from arapfields.__main__ import main

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


def test_a_rigid_motion_gives_the_same_picture_to_a_camera_that_moves_along(tmp_path):
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
        points = rest.centers[i] + rng.normal(size=(40000, 3)) @ turned[i].T
        drawn = np.cov(field(points).T)
        assert np.linalg.norm(drawn - moved[i]) < DRAWN * np.linalg.norm(moved[i])


def test_what_is_stretched_or_bent_is_divided_and_keeps_its_moments(tmp_path):
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
def test_changes_are_what_a_motion_adds_to_each_number(functions):
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
