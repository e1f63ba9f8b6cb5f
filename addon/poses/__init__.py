# SPDX-License-Identifier: GPL-3.0-or-later
"""Fields that are kept under a name, and applied to other meshes of the same shape."""
