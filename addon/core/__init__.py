# SPDX-License-Identifier: GPL-3.0-or-later
"""Logic of the add-on that needs no Blender."""
