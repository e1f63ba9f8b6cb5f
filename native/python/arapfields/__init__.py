# SPDX-License-Identifier: GPL-3.0-or-later
"""ARAP Fields: neural implicit surfaces from meshes, deformed as rigidly as possible.

Arrays are NumPy, all coordinates are the mesh's own; distances are negative inside.
"""

from ._native import Cancelled, Diverged, Frame, InvalidInput, Task, __version__, simd_level, thread_count

__all__ = [
    "Cancelled",
    "Diverged",
    "Frame",
    "InvalidInput",
    "Task",
    "__version__",
    "simd_level",
    "thread_count",
]
