# SPDX-License-Identifier: GPL-3.0-or-later
"""Ten thousand motions of a live bar; fingers of a published hand."""

from pathlib import Path

import numpy as np
import pytest
from support.geometry.bar import LEFT, RIGHT, bar_samples, turned
from support.geometry.cases import box, moved, published_samples, turn
from support.tolerances import LIVE_DRIFT

import arapfields as af


def resident_mebibytes():
    status = Path("/proc/self/status").read_text()
    return int(status.split("VmRSS:")[1].split()[0]) / 1024


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="no /proc to read memory from")
def test_ten_thousand_motions_leave_no_trace():
    samples = bar_samples()
    options = af.LiveOptions(samples=800, coarse_centers=30, fine_centers=120, threads=1)
    live, fresh = (
        af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)], options) for _ in range(2)
    )
    pose = [LEFT, turned(30) @ RIGHT]
    expected = fresh.solve(pose, iterations=300, tolerance=1e-9)(samples.points[:500])
    rng = np.random.default_rng(0)
    for i in range(10000):
        angles, offset = 25 * rng.normal(size=3), 0.3 * rng.normal(size=3)
        motion = turned(angles[0], 0) @ turned(angles[1], 1) @ turned(angles[2], 2, offset)
        live.solve([LEFT, motion @ RIGHT])
        assert np.isfinite(live.report.value) and np.isfinite(live.report.handle_error_max)
        if i == 1000:
            memory = resident_mebibytes()
    assert resident_mebibytes() < memory + 2
    shape = live.solve(pose, iterations=300, tolerance=1e-9)(samples.points[:500])
    assert np.abs(shape - expected).max() < LIVE_DRIFT * 4  # the bar is 4 long
    live.reset()
    assert np.abs(live.field(samples.points) - samples.points).max() < 1e-8


def test_a_finger_of_a_hand_moves_nearly_alone(data_dir):
    """The middle finger turned aside by 25 degrees, the palm held: how far the other fingertips go, by the
    hand's length (1.48)."""
    samples = published_samples(data_dir / "neural_sdf" / "hand.pt")
    palm, finger = box([-1, -1, -1], [0.1, 1, 0.03]), box([0, -0.2, 0.62], [0.4, 0.08, 0.9])
    tips = np.array([[0.33, -0.38, 0.1], [0.22, -0.27, 0.56], [0.24, 0.18, 0.62], [0.16, 0.37, 0.35]])
    handles = [moved(palm), moved(finger, turn([1, 0, 0], -25, (-0.1, -0.05, 0.05)))]
    shares, energies = [], []
    for interior in (True, False):
        live = af.LiveDeformer(samples, handles, af.LiveOptions(interior=interior))
        field = live.solve()
        shares.append(np.linalg.norm(field(tips) - tips, axis=1).max() / 1.48)
        energies.append(live.report.energy)
    assert shares[0] < 0.05 < 0.1 < shares[1]
    assert energies[0] < 0.5 * energies[1]


def test_refined_by_a_style_and_handles_at_once():
    """Strength, sharpness and orientation of a style move while a handle does; no set-up is made anew."""
    samples = bar_samples()
    live = af.LiveDeformer(
        samples,
        [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, RIGHT)],
        af.LiveOptions(samples=800, coarse_centers=30, fine_centers=120, bending=0.1, gauss_weight=2.0),
    )
    cube = af.preferred_normals("cube")
    for i in range(1, 6):
        live.set_style(cube @ turned(4.0 * i, 0)[:3, :3].T, strength=0.2 * i, sharpness=4 + 0.4 * i)
        live.solve([LEFT, turned(5.0 * i) @ RIGHT])
        assert live.report.flipped_share == 0 and live.report.handle_error_mean < 0.05
    setup = live.report.setup_seconds
    live.solve(iterations=60)
    assert live.report.setup_seconds == setup
    alone = af.LiveDeformer(samples, [af.Cuboid(LEFT, LEFT), af.Cuboid(RIGHT, turned(25) @ RIGHT)])
    plain = alone.solve(iterations=60)
    twisted = af.gauss_preference(samples.normals, cube @ turned(20.0, 0)[:3, :3].T).mean()
    assert live.report.preference > twisted + 0.05
    assert np.abs(live.field(samples.points) - plain(samples.points)).max() > 0.02
