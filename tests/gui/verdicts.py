# SPDX-License-Identifier: GPL-3.0-or-later
"""Expected results of each check in Blender's window. Needs no Blender."""

import json
from collections.abc import Callable
from dataclasses import dataclass

JUDGED = "judged.json"  # file in the folder: {part: lines of failures}
BEGUN = ["it broke off"]  # lines of a part that has not ended


@dataclass(frozen=True)
class Rule:
    """A condition on a result, with its description."""

    text: str
    holds: Callable

    def each(self, count=None):
        """A rule for every entry of a list, of length `count` if given."""
        return Rule(
            f"each {self.text}",
            lambda figures: count in (None, len(figures)) and all(map(self.holds, figures)),
        )


def is_(value):
    return Rule(f"is {value!r}", lambda figures: json.dumps(figures) == json.dumps(value))


def above(least):
    return Rule(f"above {least:g}", lambda figures: figures > least)


def below(most):
    return Rule(f"below {most:g}", lambda figures: figures < most)


def near(value, by):
    """Close to a value, of either sign: signs of rotations depend on the view."""
    return Rule(f"{value:g} ± {by:g}", lambda figures: abs(abs(figures) - value) <= by)


def having(**rules):
    """A dictionary with at least these entries."""
    text = ", ".join(f"{name} {rule.text}" for name, rule in rules.items())
    return Rule(text, lambda figures: all(rule.holds(figures[name]) for name, rule in rules.items()))


def all_of(rule, *names):
    return dict.fromkeys(names, rule)


TRUE, EMPTY, FIGURE = is_(True), is_([]), Rule("a figure", lambda figures: figures is not None)
ALL_EXACT = Rule("exact each time", lambda figures: figures["exact"] == figures["of"] > 0)
UNDONE = {
    **{f"undo_stray_{kind}": EMPTY for kind in ("objects", "meshes", "node_groups", "scenes", "collections")},
    "undo_to_the_start": TRUE,
    "undo_leaves": is_((["Bar"], [])),
}
EXPECTED = {  # {part: {result: rule}}, complete
    "panel": {"panel_seen": TRUE, "languages": above(0), "sections": above(10)},
    "labels": all_of(EMPTY, "cut_en_US", "cut_de_DE", "cut_narrow_en_US", "cut_narrow_de_DE"),
    "use": {"face_dragged": above(1.2)}
    | all_of(TRUE, "face_holds_more", "face_is_one_undo_step", "cancelled_in_the_status_bar"),
    "jobs": {
        "invoke": is_("{'RUNNING_MODAL'}"),
        "click_s": below(2.0),
        "running": TRUE,
        "previews": above(0),
        "cancel_s": below(10.0),
        "exact_after_cancel": TRUE,
        "shown_on_the_mesh": above(0.3),
        "exact_after_cancel_in_place": TRUE,
        **all_of(is_(False), "escape_over_the_sidebar_cancels", "escape_of_a_popup_cancels"),
        "escape_s": below(10.0),
        **all_of(TRUE, "exact_after_escape", "preview_gone", "one_undo_step"),
        "modal_against_blocking": is_(0.0),
    },
    "live": {
        "drag_moved_handle": Rule("moved", lambda figures: abs(figures) > 0.01),
        "drag_moved_shape": above(0.05),
        **all_of(TRUE, "live_after_undo", "drag_is_one_undo_step"),
        "shape_returns_with_undo": below(1e-3),
        "off_restores": TRUE,
    },
    "pins": {
        "pins_drag_moves": above(0.2),
        "pins_escape_of_a_new_pin": TRUE,
        "pins_after_the_drag": FIGURE.each(1),
        **all_of(TRUE, "pins_beside_the_mesh_stays", "pins_escape_of_a_drag", "pins_anchor"),
        "pins_ring_turns_degrees": near(45.0, 10.0),
        "pins_r_turns_degrees": Rule("turned", lambda figures: abs(figures) > 5),
        "pins_wheel_during_a_drag": having(
            zooms=TRUE,
            pin_moves_pixels=Rule("30 across", lambda figures: abs(figures[0] - 30) + abs(figures[1]) <= 6),
            reach_before_and_after_ctrl=Rule("changed", lambda figures: figures[0] != figures[1]),
        ),
        **all_of(TRUE, "pins_ctrl_click_deletes", "pins_x_deletes_the_last", "pins_no_stray_object"),
    },
    "undo": all_of(ALL_EXACT, "undo_after_drags", "undo_within_drags", "undo_escaped") | UNDONE,
    "wrap": {
        "wrap_target_by_eyedropper": TRUE,
        "wrap_first_pair": is_(1),
        "wrap_taken_back": is_(0),
        "wrap_landmarks_off_by": below(0.15).each(10),
        "wrap_escape": TRUE,
        "wrap_moves": above(0.05).each(2),
        **all_of(TRUE, "wrap_undone", "wrap_undone_bones", "wrap_redone", "wrap_redone_bones"),
        "wrap_stack": Rule("a field and an armature", lambda figures: {"NODES", "ARMATURE"} <= {*figures}),
    },
    "endings": {
        **dict.fromkeys(("ends_on_undo", "ends_on_load"), TRUE),
        **dict.fromkeys(("ends_on_undo_s", "ends_on_load_s"), below(5.0)),
        "switched_off": TRUE,
    },
    "film": {"pins": FIGURE.each(4), "moved": above(0.2)},
    "tutorial": {"handles": is_(2), "deformed_by": above(0.1), "stylized_by": above(0.01)},
}


def failures(figures, parts):
    """Lines of failures: errors, missing and unexpected results."""
    lines = [figures["error"]] if "error" in figures else []
    for part in parts:
        for name, rule in EXPECTED[part].items():
            if name not in figures:
                lines.append(f"{part}: {name} is missing; {rule.text} is expected")
            elif not holds(rule, figures[name]):
                lines.append(f"{part}: {name} is {figures[name]!r}; {rule.text} is expected")
    return lines


def holds(rule, value):
    try:
        return bool(rule.holds(value))
    except (TypeError, KeyError, IndexError):
        return False
