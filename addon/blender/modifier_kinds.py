# SPDX-License-Identifier: GPL-3.0-or-later
"""What each kind of modifier does to a mesh, from which a new field modifier's place follows.

A field acts on the shape that is seen, so it stands behind what makes or moves that shape. It stands before
what only refines, hides or uses it, so that this follows the moved surface.
"""

from dataclasses import dataclass

MAKES = "makes"  # vertices, from others or from elsewhere
MOVES = "moves"  # vertices
WRITES = "writes"  # other data, by where the vertices are
REFINES = "refines"  # the shape, or its normals
HIDES = "hides"  # a part of it
USES = "uses"  # the surface where it stands in the stack, for something else


@dataclass(frozen=True)
class Kind:
    """`keeps`: every vertex stays, with its index."""

    role: str
    keeps: bool
    why: str

    @property
    def follows_field(self):
        """Whether a new field modifier is put before it."""
        return self.role in (REFINES, HIDES, USES)


def keeping(role, why):
    return Kind(role, True, why)


def changing(role, why):
    return Kind(role, False, why)


UNKNOWN = changing(MAKES, "it may make the shape")
KINDS = {
    # Modify
    "DATA_TRANSFER": keeping(WRITES, "what it takes from another mesh belongs to the places at rest"),
    "MESH_CACHE": keeping(MOVES, "a cache has the shape that the field acts on"),
    "MESH_SEQUENCE_CACHE": changing(MAKES, "a file has the shape, with any number of vertices"),
    "NORMAL_EDIT": keeping(REFINES, "normals are of the moved shape"),
    "WEIGHTED_NORMAL": keeping(REFINES, "normals are of the moved shape"),
    "UV_PROJECT": keeping(WRITES, "textures move with the surface: they are projected at rest"),
    "UV_WARP": keeping(WRITES, "it does not depend on the shape"),
    "VERTEX_WEIGHT_EDIT": keeping(WRITES, "the field's mask may be the group"),
    "VERTEX_WEIGHT_MIX": keeping(WRITES, "the field's mask may be the group"),
    "VERTEX_WEIGHT_PROXIMITY": keeping(WRITES, "the field's mask may be the group"),
    # Generate
    "ARRAY": changing(MAKES, "handles take hold of all copies"),
    "BEVEL": changing(REFINES, "the bevel's width is of the moved shape"),
    "BOOLEAN": changing(MAKES, "the cut is where the other object stands, and moves with the surface"),
    "BUILD": changing(HIDES, "it shows more faces from frame to frame"),
    "DECIMATE": changing(MAKES, "it would choose other vertices for each moved shape"),
    "EDGE_SPLIT": changing(REFINES, "it splits sharp edges of the moved shape, and tears nothing"),
    "MASK": changing(HIDES, "what it hides moves with the rest"),
    "MESH_TO_VOLUME": changing(MAKES, "of volumes alone"),
    "MIRROR": changing(MAKES, "the field moves both halves"),
    "MULTIRES": changing(REFINES, "its detail turns with the moved shape"),
    "NODES": changing(MAKES, "nodes may make the shape"),
    "REMESH": changing(MAKES, "it would make other vertices for each moved shape"),
    "SCREW": changing(MAKES, "the field moves the surface, not its profile"),
    "SKIN": changing(MAKES, "the field moves the surface, not its edges"),
    "SOLIDIFY": changing(REFINES, "the thickness is of the moved shape"),
    "SUBSURF": changing(REFINES, "few vertices move, and the moved shape is smooth"),
    "TRIANGULATE": changing(REFINES, "polygons are divided by the moved shape"),
    "VOLUME_TO_MESH": changing(MAKES, "the surface is made here"),
    "WELD": changing(MAKES, "distances at rest say what is one"),
    "WIREFRAME": changing(REFINES, "the thickness is of the moved shape"),
    "LINEART": changing(MAKES, "of Grease Pencil alone"),
    # Deform
    "ARMATURE": keeping(MOVES, "the field acts on the posed shape, but where it is told the unposed one"),
    "CAST": keeping(MOVES, "the field acts on the shape that is seen"),
    "CORRECTIVE_SMOOTH": keeping(MOVES, "it would smooth the field's motion away"),
    "CURVE": keeping(MOVES, "the field acts on the shape that is seen"),
    "DISPLACE": keeping(MOVES, "the field acts on the shape that is seen"),
    "HOOK": keeping(MOVES, "the field acts on the shape that is seen"),
    "LAPLACIANDEFORM": keeping(MOVES, "its anchors are bound to the shape at rest"),
    "LAPLACIANSMOOTH": keeping(MOVES, "handles hold the points that are seen"),
    "LATTICE": keeping(MOVES, "the field acts on the shape that is seen"),
    "MESH_DEFORM": keeping(MOVES, "it is bound to the shape at rest"),
    "SHRINKWRAP": keeping(MOVES, "it would take the shape back onto its target"),
    "SIMPLE_DEFORM": keeping(MOVES, "the field acts on the shape that is seen"),
    "SMOOTH": keeping(MOVES, "handles hold the points that are seen"),
    "SURFACE_DEFORM": keeping(MOVES, "it is bound to the shape at rest"),
    "VOLUME_DISPLACE": changing(MAKES, "of volumes alone"),
    "WARP": keeping(MOVES, "the field acts on the shape that is seen"),
    "WAVE": keeping(MOVES, "the field acts on the shape that is seen"),
    # Physics
    "CLOTH": keeping(MOVES, "a simulation would take the field's motion back"),
    "COLLISION": keeping(USES, "others collide with the surface that is seen"),
    "DYNAMIC_PAINT": changing(USES, "it paints where the surface is seen, or is painted there"),
    "EXPLODE": changing(USES, "pieces fly off the moved surface"),
    "FLUID": changing(USES, "a fluid meets the surface that is seen"),
    "OCEAN": changing(MAKES, "the waves are made here"),
    "PARTICLE_INSTANCE": changing(MAKES, "handles take hold of all copies"),
    "PARTICLE_SYSTEM": keeping(USES, "hair grows on the surface that is seen"),
    "SOFT_BODY": keeping(MOVES, "a simulation would take the field's motion back"),
    "SURFACE": keeping(USES, "force fields act from the surface that is seen"),
}


def kind_of(modifier):
    if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN":
        return UNKNOWN  # the fluid is its shape
    return KINDS.get(modifier.type, UNKNOWN)


def follows_field(modifier):
    """Whether a new field modifier is put before this one at the end of a stack, or pinned there."""
    return kind_of(modifier).follows_field or getattr(modifier, "use_pin_to_last", False)


def keeps_vertices(modifier):
    """Whether every vertex keeps its index."""
    return kind_of(modifier).keeps


def uses_surface(modifier):
    """Whether what it does is bound to the surface where it stands, and stays if the field comes later."""
    return kind_of(modifier).role == USES
