# SPDX-License-Identifier: GPL-3.0-or-later
"""A scan of Gaussian splats, without a surface, posed by a field; and what its parts give."""

import math
import time

import numpy as np
import stage

from . import splat_view
from .common import shape
from .deformations import CASES
from .looping import MILLISECONDS, REST, encode

SIZE, FRAMES, SPLATS = (440, 330), 12, 14000
EYE, TARGET = np.array([1.6, -5.6, 2.6]), np.array([0.0, -0.1, 0.5])


def render(output):
    import arapfields as af

    octopus = shape("octopus")
    scan = splat_view.of_surface(octopus, SPLATS)
    samples = af.sample_splats(scan, 6000)
    boxes = CASES["octopus"][1]
    live = af.LiveDeformer(samples, [box.handle for box in boxes])
    prepared, ground = af.PreparedSplats(scan), float(scan.centers[:, 2].min())

    def posed(share):
        shifts = [tuple(share * np.array(box.shift)) for box in boxes]
        parts = [box._replace(angle=share * box.angle, shift=s) for box, s in zip(boxes, shifts, strict=True)]
        return live.solve([np.array(part.target) for part in parts])

    def picture(splats):
        from PIL import Image

        return Image.fromarray(splat_view.picture(splats, EYE, TARGET, SIZE, focal=4.6, ground=ground))

    frames, seconds = 4 if stage.DRAFT else FRAMES, 0.0
    taken = []
    for frame in range(frames):
        field = posed((1 - math.cos(math.pi * frame / (frames - 1))) / 2)
        begin = time.process_time()
        moved = prepared.moved(field)
        seconds += time.process_time() - begin if frame else 0.0
        taken.append(picture(moved))
    unturned = af.GaussianSplats(
        field(np.asarray(scan.centers, float)), scan.rotations, scan.scales, scan.opacities, scan.harmonics
    )
    sheet(output / "workflow-splats.png", [taken[0], picture(unturned), taken[-1]])
    order = [*taken, *taken[-2:0:-1]]
    waits = [MILLISECONDS] * len(order)
    waits[0] = waits[frames - 1] = REST
    size = encode(order, waits, output / "loop-splats.webp", taken[-1])
    return {"splats": len(scan), "divided": len(moved) - len(scan), "frames": frames, "bytes": size}


def sheet(path, pictures):
    """Side by side."""
    from PIL import Image

    whole = Image.new("RGB", (len(pictures) * SIZE[0], SIZE[1]), "white")
    for place, one in enumerate(pictures):
        whole.paste(one, (place * SIZE[0], 0))
    whole.save(path)
