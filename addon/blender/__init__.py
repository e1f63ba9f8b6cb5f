# SPDX-License-Identifier: GPL-3.0-or-later
"""Thin helpers on bpy, independent of the features."""
