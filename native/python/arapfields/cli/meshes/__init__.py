# SPDX-License-Identifier: GPL-3.0-or-later
"""Mesh files: OBJ, PLY, STL and OFF, read with all that they hold and written with moved vertices."""
