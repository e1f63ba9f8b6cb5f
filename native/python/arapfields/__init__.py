# SPDX-License-Identifier: GPL-3.0-or-later
"""ARAP Fields: neural implicit surfaces from meshes, deformed as rigidly as possible.

Arrays are NumPy, all coordinates are the mesh's own; distances are negative inside.
"""

from ._native import (
    Cancelled,
    Cuboid,
    Distortion,
    Diverged,
    Frame,
    Handle,
    InvalidInput,
    NeuralSdf,
    Point,
    Region,
    SurfaceSamples,
    Task,
    __version__,
    gauss_preference,
    preferred_normals,
    sample_mesh,
    signed_distance,
    simd_level,
    style_names,
    thread_count,
    winding_number,
)

__all__ = [
    "Cancelled",
    "Cuboid",
    "Distortion",
    "Diverged",
    "Frame",
    "Handle",
    "InvalidInput",
    "NeuralSdf",
    "Point",
    "Region",
    "SurfaceSamples",
    "Task",
    "__version__",
    "gauss_preference",
    "preferred_normals",
    "sample_mesh",
    "signed_distance",
    "simd_level",
    "style_names",
    "thread_count",
    "winding_number",
]
