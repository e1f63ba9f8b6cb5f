# SPDX-License-Identifier: GPL-3.0-or-later
"""Gauss stylization of a cow towards a cube: time to a mean preference of 0.95.

`at_175_s` are the seconds scaled to a machine whose bare matrix products run at 175 GFLOP/s.
"""

import arapfields as af

from . import shapes
from .timing import first_good, product_rate

PREFERENCE = 0.95


def good(field):
    return field.report.preference >= PREFERENCE


def run():
    samples = shapes.samples("spot")
    settings = {
        "neural 4x256": (dict(field="neural"), (60, 80, 100, 140, 200, 300)),
        "neural 4x128": (dict(field="neural", width=128), (60, 80, 100, 140, 200, 300)),
        "radial": (dict(field="radial"), (10, 20, 40)),
    }
    rows = []
    for name, (options, counts) in settings.items():
        rate = product_rate()

        def solve(count, options=options):
            return af.stylize(samples, "cube", af.StylizeOptions(iterations=count, **options))

        count, seconds, report = first_good(solve, good, counts)
        rate = (rate + product_rate()) / 2
        rows.append(
            {
                "what": f"{shapes.label('spot')} to a mean preference >= {PREFERENCE}: {name}",
                "iterations": count,
                "seconds": round(seconds, 2),
                "products_GFLOPs": round(rate),
                "at_175_s": round(seconds * rate / 175, 2),
                "preference": round(report.preference, 3),
                "flipped": report.flipped_share,
            }
        )
    return rows
