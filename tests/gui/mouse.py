# SPDX-License-Identifier: GPL-3.0-or-later
"""Moves the mouse over the 3D view by xdotool; waits for conditions, as the machine may be busy."""

import time

import stage
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

from addon.core.runtime import jobs
from addon.live import sessions
from addon.pin_tool.hover import hover as hovering


def pixel(point):
    """Screen coordinates in pixels of a point in world space; the window fills the screen."""
    window, area, region = stage.view()
    spot = location_3d_to_region_2d(region, area.spaces.active.region_3d, Vector(point))
    return round(region.x + spot.x), round(window.height - region.y - spot.y)


def click(spot, button=1, pause=0.6):
    stage.tool("mousemove", spot[0] - 3, spot[1])
    yield 0.3
    stage.tool("mousemove", *spot)
    yield 0.3
    stage.tool("click", button)
    yield pause


def keys(*names, pause=0.4):
    for name in names:
        stage.tool("key", name)
        yield pause


def hover(spot):
    stage.tool("mousemove", spot[0] - 4, spot[1])
    yield 0.2
    stage.tool("mousemove", *spot)
    yield 0.3


def until(reached, limit=20.0, sign=lambda: None):
    """Waits until a condition holds, at most `limit` seconds since `sign()` last changed."""
    begin, seen = time.perf_counter(), sign()
    while not reached() and time.perf_counter() - begin < limit:
        yield 0.02
        if sign() != seen:
            begin, seen = time.perf_counter(), sign()
    yield 0.05


def until_idle(limit=60.0):
    """Waits until no job runs, or a job has made no progress for `limit` seconds."""
    yield from until(lambda: jobs.running() is None, limit, jobs.progress)


def until_live_rests(limit=30.0):
    """Waits until the live shapes, if any, are refined and shown."""
    yield 0.1
    yield from until(lambda: all(s.worker and s.worker.is_settled for s in sessions.live.values()), limit)
    yield 0.1


def is_followed():
    """Whether the shape has reached the dragged handle."""
    return all(s.worker is not None and s.worker.wait(0.0) for s in sessions.live.values())


def is_dragging():
    return hovering.drag is not None


def release():
    """Releases the button, and waits until the shape is at rest."""
    stage.tool("mouseup", 1)
    yield 0.1
    yield from until(lambda: not is_dragging())
    yield 0.2


def drag(start, end, steps=8, pause=0.05, hold=False):
    """Presses the button at one pixel, moves to another, and releases it there unless `hold`."""
    yield from hover(start)
    stage.tool("mousedown", 1)
    yield from until(is_dragging, 3.0)
    for step in range(1, steps + 1):
        share = step / steps
        stage.tool("mousemove", *(round(a + share * (b - a)) for a, b in zip(start, end, strict=True)))
        yield pause
    yield 0.2
    yield from until(is_followed)
    if not hold:
        yield from release()
