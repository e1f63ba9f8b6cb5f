# SPDX-License-Identifier: GPL-3.0-or-later
"""The mouse over the 3D view, moved by xdotool; waits go by what has happened, as the machine may be busy."""

import time

import stage
from bpy_extras.view3d_utils import location_3d_to_region_2d
from mathutils import Vector

from addon.core.runtime import jobs
from addon.live import sessions
from addon.pin_tool.hover import hover as hovering


def pixel(point):
    """Where a point of the world is on the screen, from its top left; the window fills it."""
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
    """Waits until a condition holds, so many seconds at most since `sign()` last changed: the machine may be
    busy."""
    begin, seen = time.perf_counter(), sign()
    while not reached() and time.perf_counter() - begin < limit:
        yield 0.02
        if sign() != seen:
            begin, seen = time.perf_counter(), sign()
    yield 0.05


def until_idle(limit=60.0):
    """Until no job runs, or one has stood still for so long."""
    yield from until(lambda: jobs.running() is None, limit, jobs.progress)


def until_live_rests(limit=30.0):
    """Until the live shapes are refined and shown, if there are any."""
    yield 0.1
    yield from until(lambda: all(s.worker and s.worker.is_settled for s in sessions.live.values()), limit)
    yield 0.1


def is_followed():
    """Whether the shape has reached the handle that is dragged."""
    return all(s.worker is not None and s.worker.wait(0.0) for s in sessions.live.values())


def is_dragging():
    return hovering.drag is not None


def release():
    """The button goes up, and the shape comes to rest."""
    stage.tool("mouseup", 1)
    yield 0.1
    yield from until(lambda: not is_dragging())
    yield 0.2


def drag(start, end, steps=8, pause=0.05, hold=False):
    """The button pressed at one spot, and released at another unless it is to be held."""
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
