# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes a second of a live solve that carries six objects of 100,000 points in all: clock and processor."""

import statistics
import time

import numpy as np

SHAPES, OBJECTS, POINTS = 60, 6, 100_000


def run():
    from support.geometry.cases import box, moved, shift
    from support.geometry.characters import HIP, trousers

    import arapfields as af

    body, rng, count = (
        af.sample_surface(trousers(), 6000, seed=0),
        np.random.default_rng(5),
        POINTS // OBJECTS,
    )
    near = [body.points[rng.integers(6000, size=count)] + rng.normal(0, 0.01, (count, 3)) for _ in range(4)]
    far = [rng.uniform([-0.7, -0.7, -0.2], [0.7, 0.7, 1.6], (count, 3)) for _ in range(2)]
    trunk, leg = box([-1, -1, HIP], [1, 1, 2]), box([-1, -1, -1], [0, 1, HIP - 0.2])
    live = af.LiveDeformer(body, [moved(trunk), moved(leg)])
    live.track(af.extract_surface(trousers(), 96)[0])
    objects = [af.Attachment(body, points) for points in (*near, *far)]

    def shape(i):
        live.follow([trunk, shift([0, 0.3 * np.sin(i / 6), 0]) @ leg], iterations=3)
        field = live.field
        return live.tracked(), [attached.positions(field) for attached in objects]

    shape(0)
    clock, processor = [], []
    for i in range(1, SHAPES + 1):
        before = time.perf_counter(), time.process_time()
        shape(i)
        clock.append(time.perf_counter() - before[0])
        processor.append(time.process_time() - before[1])
    row = {"what": f"{OBJECTS} carried objects, {POINTS} points"}
    row["shapes_a_second"] = round(1 / statistics.median(clock), 1)
    row["processor_ms_a_shape"] = round(1000 * statistics.median(processor), 1)
    return [row]
