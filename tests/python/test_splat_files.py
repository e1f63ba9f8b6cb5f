# SPDX-License-Identifier: GPL-3.0-or-later
"""Gaussian splats: their numbers, read, written and refused."""

import numpy as np
import pytest
from support.geometry.scan import splats

import arapfields as af

FIELDS = ("centers", "rotations", "scales", "opacities", "harmonics")


def test_a_file_comes_back_and_keeps_what_it_has_besides(tmp_path):
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


def test_what_cannot_be_read_is_named(tmp_path):
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
