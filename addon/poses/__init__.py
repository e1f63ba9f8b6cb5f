# SPDX-License-Identifier: GPL-3.0-or-later
"""Named fields, stored in the file and applied to other meshes of the same shape."""
