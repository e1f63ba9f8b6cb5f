# SPDX-License-Identifier: GPL-3.0-or-later
"""Stepping live sources, as their timer does."""

import contextlib

import bpy

from addon.live import sessions
from addon.solver import setup

WAIT = 30  # seconds for a shape to follow
FEW_SAMPLES = 1500  # a quarter of a live solver's own: for tests that do not ask how well it solves


@contextlib.contextmanager
def few_samples():
    """Live solvers that are set up in it have FEW_SAMPLES."""
    usual, setup.SAMPLES = setup.SAMPLES, FEW_SAMPLES
    try:
        yield
    finally:
        setup.SAMPLES = usual


def step(refined=False):
    bpy.context.view_layer.update()
    sessions.update(bpy.context, wait=WAIT, refined=refined)
