# SPDX-License-Identifier: GPL-3.0-or-later
"""A whole character moves by its bones: eyes stay in their sockets, hair on the head."""

import numpy as np
import pytest
from support.blender.inside import IN_BLENDER

import arapfields as af

if IN_BLENDER:
    import bpy
    from support.blender import character
    from support.blender.live import step

    from addon.core.runtime import jobs
    from addon.live import sessions

pytestmark = pytest.mark.in_blender

STEPS = 4  # of live mode, in which its solver comes to rest


@pytest.mark.slow  # about ten seconds
def test_a_character_moves_whole():
    person = character.build()
    rest = {
        item.name: character.seen_mesh(item)[0]
        for item in (person.body, person.shirt, person.hat, *person.eyes)
    }
    skin = rest["Body"], character.seen_mesh(person.body)[2]
    strands = hair_points(person.hair)
    jobs.board.messages.clear()
    assert bpy.ops.arapfields.live() == {"FINISHED"}
    for share in np.linspace(0, 1, 4)[1:]:
        character.pose(person, neck=share * np.pi / 4, arm=share * np.pi / 3)
        for _ in range(STEPS):
            step(refined=True)
    assert sessions.is_live(person.body) and not jobs.messages(), jobs.messages()
    now = {name: character.seen_mesh(bpy.data.objects[name])[0] for name in rest}
    posed = now["Body"], skin[1]
    figures = {}

    head = rest["Body"][:, 2] > 1.6
    turn = rigid(rest["Body"][head], now["Body"][head])
    angle = np.degrees(np.arccos((np.trace(turn[:3, :3]) - 1) / 2))
    figures["head turned, degrees"] = angle
    hand = rest["Body"][:, 0] > 0.75
    figures["hand raised"] = (now["Body"][hand] - rest["Body"][hand])[:, 2].mean()

    for eye in person.eyes:
        before, after = rest[eye.name], now[eye.name]
        center = before.mean(axis=0)
        socket = np.linalg.norm(rest["Body"] - center, axis=1) < 2.5 * character.EYE
        with_socket = rigid(rest["Body"][socket], now["Body"][socket])
        off = after.mean(axis=0) - (with_socket[:3, :3] @ center + with_socket[:3, 3])
        figures[f"{eye.name} off its socket, of its radius"] = np.linalg.norm(off) / character.EYE
        depths = distances(*skin, before), distances(*posed, after)
        clear = np.abs(depths[0]) > 0.05 * character.EYE
        figures[f"{eye.name} cut by the skin, vertices"] = int((depths[0] * depths[1] < 0)[clear].sum())

    off = distances(*skin, rest["Shirt"]), distances(*posed, now["Shirt"])
    figures["shirt's distance changes on average"] = np.abs(off[1] / off[0] - 1).mean()
    figures["shirt's mean distance changes"] = abs(off[1].mean() / off[0].mean() - 1)
    figures["shirt's least distance, of its own"] = (off[1] / off[0]).min()

    roots = hair_points(person.hair)[:, 0]
    figures["hair roots off the scalp, of the size"] = (
        np.abs(distances(*posed, roots)).max() / character.HEIGHT
    )
    figures["hair roots off at rest"] = np.abs(distances(*skin, strands[:, 0])).max() / character.HEIGHT
    on_head = rest["Hat"] @ turn[:3, :3].T + turn[:3, 3]
    figures["hat off the head's motion, of the size"] = (
        np.linalg.norm(now["Hat"] - on_head, axis=1).max() / character.HEIGHT
    )
    for name, value in figures.items():
        print(f"{name}: {value:.3g}")

    assert 40 < figures["head turned, degrees"] < 50 and figures["hand raised"] > 0.4
    for eye in person.eyes:
        assert figures[f"{eye.name} off its socket, of its radius"] < 0.02
        assert not figures[f"{eye.name} cut by the skin, vertices"]
    assert figures["shirt's distance changes on average"] <= 0.03
    assert figures["shirt's least distance, of its own"] > 0
    assert figures["hair roots off the scalp, of the size"] <= 1e-4
    assert figures["hat off the head's motion, of the size"] < 0.02
    bpy.ops.arapfields.live()
    character.pose(person, 0, 0)
    for name, before in rest.items():
        assert np.abs(character.seen_mesh(bpy.data.objects[name])[0] - before).max() < 1e-4


def distances(vertices, triangles, points):
    """(p,) signed distances of points from a surface, negative inside."""
    return af.signed_distance(vertices, triangles, points)


def hair_points(hair):
    """(strands, points of each, 3) as they are shown."""
    data = hair.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(3 * len(data.points), np.float32)
    data.attributes["position"].data.foreach_get("vector", flat)
    return flat.reshape(len(data.curves), -1, 3).astype(np.float64)


def rigid(before, after):
    return af.rigid_motion(before, after)
