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
    return Rule(f"is {value!r}", lambda figures: plain(figures) == plain(value))


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


def plain(value):
    """The value as read from JSON: tuples are lists."""
    return json.loads(json.dumps(value))


def all_of(rule, *names):
    return dict.fromkeys(names, rule)


TRUE, EMPTY, FIGURE = is_(True), is_([]), Rule("a figure", lambda figures: figures is not None)
ONCE = having(one_undo_step=TRUE, moved_by=above(0.01), shapes=above(0), first_picture_s=FIGURE)
ALL_EXACT = Rule("exact each time", lambda figures: figures["exact"] == figures["of"] > 0)
MOVES = having(updates_per_second=above(0))
RENDERED = having(each_once=TRUE, frames_differ=TRUE, agrees=TRUE, still_live=TRUE)
PINS_RATE = {
    "pins_vertices": above(40_000),
    "pins_first_shape_s": below(5.0),
    "pins_drag": having(shapes_per_second=above(1)),
    "pins_main_thread": FIGURE,
    "pins_without_drawing": MOVES,
}
PICKS = {"picks": FIGURE, "picks_right": TRUE}
UNDONE = {
    **{f"undo_stray_{kind}": EMPTY for kind in ("objects", "meshes", "node_groups", "scenes", "collections")},
    "undo_to_the_start": TRUE,
    "undo_leaves": is_((["Bar"], [])),
}
WITHIN, ESCAPED = {"undo_within_drags": ALL_EXACT}, {"undo_escaped": ALL_EXACT}
EXPECTED = {  # {part: {result: rule}}, complete
    "panel": {"panel_seen": TRUE, "languages": above(0), "sections": above(10)},
    "labels": all_of(EMPTY, "cut_en_US", "cut_de_DE", "cut_narrow_en_US", "cut_narrow_de_DE"),
    "use": {
        "face_dragged": above(1.2),
        **all_of(TRUE, "face_holds_more", "face_is_one_undo_step", "searched", "cancelled_in_the_status_bar"),
    },
    "picks": PICKS,
    "picks-in-place": PICKS,
    "jobs": {
        **all_of(FIGURE, "redraw_s", "late_without_a_job"),
        "invoke": is_("{'RUNNING_MODAL'}"),
        "click_s": below(2.0),
        "late_with_a_job": FIGURE,
        "running": TRUE,
        **all_of(FIGURE, "progress", "main_thread_at_once"),
        "previews_per_second": above(0),
        "looks_per_second": above(0),
        "cancel_s": below(10.0),
        "exact_after_cancel": TRUE,
        "shown_on_the_mesh": above(0.3),
        "exact_after_cancel_in_place": TRUE,
        "escape_s": below(10.0),
        **all_of(TRUE, "exact_after_escape", "preview_gone", "one_undo_step"),
        "modal_against_blocking": is_(0.0),
    },
    "stalls": {"window": FIGURE, "plain": FIGURE, "as_it_opens": FIGURE},
    "live": {
        "live_click_s": below(5.0),
        "live_first_shape_s": below(20.0),
        "live_vertices": above(40_000),
        "live_as_it_opens": MOVES,
        "live_plain": MOVES,
        "live_solve_and_warp_on_worker": FIGURE,
        "live_without_drawing": MOVES,
        "live_refined": is_({"converged": True}),
        "drag_moved_handle": Rule("moved", lambda figures: abs(figures) > 0.01),
        "drag_moved_shape": above(0.05),
        **all_of(TRUE, "live_after_undo", "drag_is_one_undo_step"),
        "shape_returns_with_undo": below(1e-3),
        "off_restores": TRUE,
    },
    "press": {
        "press_deform": ONCE.each(),
        "press_stylize": ONCE.each(),
        "cancel_deform": TRUE.each(2),
        "cancel_stylize": TRUE.each(2),
        **all_of(TRUE, "step_between_holds_nothing", "step_between_shape"),
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
        **PINS_RATE,
    },
    "pins-rate": PINS_RATE,
    "undo": {"undo_after_drags": ALL_EXACT, **WITHIN, **ESCAPED, **UNDONE},
    "undo-within": {**WITHIN, **UNDONE},
    "undo-escaped": {**ESCAPED, **UNDONE},
    "render": {"render_MODIFIER": RENDERED, "render_NEW": RENDERED},
    "table": {"table": having(wrong=is_({})), "table_not_at_that_stage": EMPTY},
    "wrap": {
        "wrap_target_by_eyedropper": TRUE,
        "wrap_first_pair": is_(1),
        "wrap_taken_back": is_(0),
        "wrap_landmarks_off_by": below(0.15).each(10),
        "wrap_escape": TRUE,
        "wrap_press_s": FIGURE,
        "wrap_moves": above(0.05).each(2),
        **all_of(TRUE, "wrap_undone", "wrap_undone_bones", "wrap_redone", "wrap_redone_bones"),
        "wrap_stack": Rule("a field and an armature", lambda figures: {"NODES", "ARMATURE"} <= {*figures}),
        **all_of(TRUE, "wrap_transferred", "wrap_transfer_undone", "wrap_transfer_redone"),
        **all_of(TRUE, "wrap_outlives_its_target", "wrap_opened_again"),
        **all_of(TRUE, "sequence_escape", "sequence_undone"),
        "sequence_rises_by": near(0.1, by=0.02),
    },
    "endings": {
        **dict.fromkeys(("ends_on_undo", "ends_on_load"), TRUE),
        **dict.fromkeys(("ends_on_undo_s", "ends_on_load_s"), below(5.0)),
        "switched_off": TRUE,
    },
    "film": {"pins": FIGURE.each(4), "moved": above(0.2)},
    "pose": {
        "anchors": is_([True, True, True, False, False]),
        "trunk_moved": below(0.03),  # of the height
        "hoof_hangs_degrees": above(40),
        "feet_moved": below(0.01),
    },
    "walk": {
        "suzanne": is_(["Suzanne"]),
        "modifiers": is_(["SUBSURF"]),
        "empties": is_([[0.0, -0.35, -0.52, 0.5, 0.62, 0.46], [1.12, 0.32, 0.17, 0.3, 0.36, 0.4]]),
        "selected": FIGURE.each(3),
        "active": is_("Suzanne"),
        "handles": Rule("holds something", lambda figures: figures[1] > 0).each(2),
        "row_selects": is_("Handle 2"),
        "deformed_by": above(0.1),
        "stack": Rule("with the field", lambda figures: "ARAP Fields" in figures),
        "stylized_by": above(0.01),
        "stylized_live": is_(0),
        "fitted": TRUE,
    },
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
