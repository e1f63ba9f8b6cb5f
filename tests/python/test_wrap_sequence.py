# SPDX-License-Identifier: GPL-3.0-or-later
"""A template that follows the frames of a scanned motion."""

import numpy as np
import pytest
from support.geometry import wrap_cases as cases

import arapfields as af

NOISE = 0.003  # of the diagonal, along each axis; new in each frame
# Of the noise's own size: held points hardly move, and the basis averages over many scanned vertices.
MOTION_OF_WHAT_IS_STILL = 0.5
SLIDING = 0.3  # of the tip's way: its round end, stretched on one side, may slide along itself
OPTIONS = af.WrapOptions(alignment="none", centers=200, stages=3, iterations=6)
ROUNDING = 1e-9
OFF = 0.005  # of the diagonal, on average from the surface without noise


@pytest.fixture(scope="module")
def played():
    """Frames of a figure of which the nose bends, the template's vertices in each, and the fields."""
    v, f = cases.figure(3)
    diagonal = np.linalg.norm(np.ptp(v, axis=0))
    scanned, faces = cases.figure(4)
    rng = np.random.default_rng(0)
    samples, true, fields = af.sample_mesh(v, f, 2000), [], []
    sequence = None
    for angle in np.append(np.linspace(0, 0.3, 5), [0.3, 0.15, 0.0]):
        true.append((bent(scanned, angle), faces))
        noisy = true[-1][0] + rng.normal(0, NOISE * diagonal, scanned.shape)
        target = af.MeshSdf(noisy, faces)
        field = sequence.next(target) if sequence else af.wrap(samples, target, [], OPTIONS)
        sequence = sequence or af.WrapSequence(samples, field, OPTIONS)
        fields.append(field)
    return v, diagonal, true, np.array([field(v) for field in fields]), fields, samples


def bent(points, angle):
    """Turns what lies beyond x = 0.5 about z, more the farther out."""
    turn = angle * np.clip(points[:, 0] - 0.5, 0, None)
    c, s = np.cos(turn), np.sin(turn)
    x, y, z = (points - [0.5, 0, 0]).T
    return np.stack([c * x - s * y + 0.5, s * x + c * y, z], axis=1)


def test_what_moves_is_followed_and_comes_back(played):
    v, diagonal, true, found, *_ = played
    for shape, mesh in zip(found, true, strict=True):
        assert np.abs(af.MeshSdf(*mesh)(shape)).mean() < OFF * diagonal
    assert np.linalg.norm(found[-1] - found[0], axis=1).mean() < OFF * diagonal  # no drift
    tip = v[:, 0].argmax()
    told = bent(v, 0.3)[tip] - v[tip]
    assert np.linalg.norm(found[4][tip] - found[0][tip] - told) < SLIDING * np.linalg.norm(told)


def test_what_is_still_moves_less_than_the_noise(played):
    v, diagonal, _, found, *_ = played
    steps = np.linalg.norm(np.diff(found[:, v[:, 0] < 0], axis=0), axis=2) / diagonal
    noise = NOISE * np.sqrt(3)
    assert np.sqrt((steps**2).mean()) < MOTION_OF_WHAT_IS_STILL * noise
    assert steps.max() < noise


def test_rounding_moves_nothing(played):
    """In single precision it moved points by a tenth of the noise, in some frames by twice the noise."""
    v, _, true, _, fields, samples = played
    shapes = []
    for moved in (0, ROUNDING):
        vertices, faces = true[1]
        target = af.MeshSdf(vertices + moved * np.sin(np.arange(vertices.size)).reshape(-1, 3), faces)
        shapes.append(af.WrapSequence(samples, fields[0], OPTIONS).next(target)(v))
    assert np.abs(shapes[1] - shapes[0]).max() < 1e3 * ROUNDING


def test_a_frames_field_is_kept_in_a_file(played, tmp_path):
    v, *_, found, (*_, field), _ = played
    field.save(tmp_path / "frame.safetensors")
    again = af.DeformationField.load(tmp_path / "frame.safetensors")
    assert np.abs(again(v) - found[-1]).max() < 1e-6
    assert field.report.to_target_mean < 0.02


def test_a_sequence_goes_on_from_a_frame_in_a_file(played, tmp_path):
    """To the last bit: a frame's field holds all that its sequence keeps."""
    v, _, true, _, (first, *_), samples = played
    targets = [af.MeshSdf(*mesh) for mesh in true[1:4]]
    sequence = af.WrapSequence(samples, first, OPTIONS)
    sequence.next(targets[0]).save(tmp_path / "frame.safetensors")
    kept = af.DeformationField.load(tmp_path / "frame.safetensors")
    again, by_state = af.WrapSequence(samples, kept, OPTIONS), af.WrapSequence(samples, first, OPTIONS)
    by_state.state = sequence.state
    assert np.array_equal(by_state.field(v), sequence.field(v))
    for target in targets[1:]:
        true_next = sequence.next(target)(v)
        assert np.array_equal(again.next(target)(v), true_next)
        assert np.array_equal(by_state.next(target)(v), true_next)
    with pytest.raises(af.InvalidInput, match="state"):
        by_state.state = sequence.state[1:]
    with pytest.raises(af.InvalidInput, match="other samples or options"):
        af.WrapSequence(samples, kept, af.WrapOptions(centers=50))


def test_what_is_no_first_frame_is_named(played):
    v, *_, (*_, field), samples = played
    target = af.MeshSdf(*cases.figure(2))
    with pytest.raises(af.InvalidInput, match="samples"):
        af.WrapSequence(af.sample_mesh(2 * v, cases.figure(3)[1], 500), field)
    sequence = af.WrapSequence(samples, field, OPTIONS)
    task = af.Task()
    task.cancel()
    with pytest.raises(af.Cancelled):
        sequence.next(target, task=task)
