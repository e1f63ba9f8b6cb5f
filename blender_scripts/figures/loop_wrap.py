# SPDX-License-Identifier: GPL-3.0-or-later
"""The dog of the wrap page between its own shape and that of the scan, which stands beside it; both ends."""

import bpy

from .common import stack
from .looping import film
from .workflows import followed, in_examples, moved, snapshot


def loop(output):
    bpy.ops.wm.open_mainfile(filepath="out/examples/wrap.blend")
    rest = snapshot(output / "wrap-rest.png", 480)
    dog = followed("wrap")["dog"]
    end = snapshot(output / "wrap-end.png", 480)
    stack([rest, end], output / "workflow-wrap.png", gap=0, horizontal=True)
    far = moved("Dog")
    apart = -dog.location.x
    from addon.field_modifier import inputs

    def pose(share):
        inputs.put(dog.modifiers["ARAP Fields"], "Factor", share)
        dog.location.x = -apart * share
        dog.update_tag()

    return {**film(output, "loop-wrap", pose, width=440), "moved": far}


def render(output):
    return in_examples(lambda: loop(output.resolve()))
