# SPDX-License-Identifier: GPL-3.0-or-later
"""The mouse over the 3D view, moved by xdotool; waits go by what has happened, as the machine may be busy."""

import time

import stage
from bpy_extras.view3d_utils import location_3d_to_region_2d


def pixel(point):
    """Where a point of the world is on the screen; the window fills it."""
    window, area, region = stage.view()
    spot = location_3d_to_region_2d(region, area.spaces.active.region_3d, point)
    return int(region.x + spot[0]), int(window.height - region.y - spot[1])


def hover(spot):
    stage.tool("mousemove", spot[0] - 4, spot[1])
    yield 0.2
    stage.tool("mousemove", *spot)
    yield 0.3


def until(reached, limit=20.0):
    """Waits until a condition holds, so many seconds at most: the machine may be busy."""
    begin = time.perf_counter()
    while not reached() and time.perf_counter() - begin < limit:
        yield 0.02
    yield 0.05


def is_followed():
    """Whether the shape has reached the handle that is dragged."""
    from addon.live import sessions

    return all(s.worker is not None and s.worker.wait(0.0) for s in sessions.live.values())


def is_dragging():
    from addon.pin_tool.hover import hover

    return hover.drag is not None


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
