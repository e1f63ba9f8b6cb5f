# SPDX-License-Identifier: GPL-3.0-or-later
"""The Geometry Nodes modifier that holds a source's motion, its layers, masks and cache."""
