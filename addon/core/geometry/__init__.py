# SPDX-License-Identifier: GPL-3.0-or-later
"""Spaces, handles' boxes, meshes as arrays; no bpy."""
