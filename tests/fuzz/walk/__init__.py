# SPDX-License-Identifier: GPL-3.0-or-later
"""Random walks through Blender with the extension: `python -m tests.fuzz.walk`.

A walk is a scene and a list of steps, each with a seed of its own, so that a part of the list is a walk as
well: what fails is shortened to the steps that it needs. Walks run in processes of their own, and may crash.
"""
