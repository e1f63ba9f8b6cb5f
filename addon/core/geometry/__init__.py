# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve space, handles, and meshes as arrays; no bpy."""
