# SPDX-License-Identifier: GPL-3.0-or-later
"""Enum items for settings that are no solver options: (identifier, label, tip); the styles."""

from .parameters import parameters

# Enum items for settings that are no solver options: (identifier, label, tip).

EMPTY_KINDS = (  # of handles that Empties move
    ("CUBE", "Region", "What lies in the box at rest follows the Empty"),
    ("POINT", "Point Pin", "The point of the surface nearest to the Empty at rest follows it"),
    ("GROUP", "Vertex Group", "What a vertex group of the object holds follows the Empty"),
    ("PIN", "Pin", "A small round region of the surface follows the Empty"),
)
HANDLE_KINDS = (
    *EMPTY_KINDS,
    ("BONE", "Bone", "The bone's vertex group, or what lies about the bone, follows it"),
)
HANDLE_PLACES = (
    ("AUTO", "Selected Empties", "The selected Empties; where none is selected, a new one at the 3D cursor"),
    ("CURSOR", "3D Cursor", "A new box at the 3D cursor"),
    ("SELECTION", "Selected Vertices", "A new box around the mesh's selected vertices"),
)
BONES = (  # of an armature, as handles
    ("AUTO", "Automatic", "The bones selected in Pose Mode; else all deforming bones"),
    ("SELECTED", "Selected", "The selected bones"),
    ("DEFORMING", "Deforming", "All bones that deform and, where the mesh has groups of bones, have one"),
)
CARRYING = (  # carriers of other objects
    ("FOLLOW", "Follow", "Bends with the body: clothes, hair, lattices"),
    ("RIGID", "Rigid", "Moves and turns as a whole: eyes, buttons, glasses"),
    ("TOGETHER", "Together", "Bends with the body and resists as the body does: sleeves, armour"),
)
SCOPES = (  # of a job
    ("ACTIVE", "Active", "The active object alone"),
    ("SELECTED", "Selected", "Every selected mesh object, one after another"),
    ("COLLECTION", "Collection", "Every mesh object of the active object's collections"),
)
SKINNED = (
    ("SELECTED", "Selected", "Every selected mesh object"),
    ("COLLECTION", "Collection", "Every mesh object of the armature's collections"),
)
SKIN_GROUPS = (
    ("REPLACE", "Replace", "The bones' groups are made anew, except locked ones; other groups stay"),
    ("KEEP", "Keep", "Groups that bones have already stay; other bones share what these leave"),
)
SURFACES = (
    ("EXACT", "Exact", "The mesh's own triangles, as far as they lie between inside and outside; at once"),
    (
        "FIT",
        "Fit",
        "A smooth surface that is fitted to the mesh, which also closes its holes; fitted first "
        "where it is out of date",
    ),
)
OUTPUTS = (
    ("WARP", "Original Mesh", "The object's own vertices moved: UVs, materials, groups and topology stay"),
    (
        "SURFACE",
        "Implicit Surface",
        "A new mesh of the implicit surface, moved along: even triangles, no seams",
    ),
    (
        "REMESH",
        "Remeshed Surface",
        "A new mesh of the moved surface: even triangles also where the shape is stretched; takes longer",
    ),
)
PLACEMENTS = (  # of a result
    (
        "MODIFIER",
        "Modifier",
        "A modifier of the source itself, which can be faded, masked and moved in its stack; for the surface "
        "outputs a new object",
    ),
    ("NEW", "New Object", "An object of its own in the place of the source, which is hidden"),
    ("REPLACE", "Replace Mesh", "The source itself moves; its handles' poses become their rest poses"),
    ("KEY", "Shape Key", "One more shape key of the source, which can be blended and animated"),
)
PLACEMENT_NUMBERS = {"NEW": 0, "REPLACE": 1, "KEY": 2, "MODIFIER": 3}  # enum values in .blend files
ORIENTATIONS = (  # of a style
    ("UPRIGHT", "World Upright", "The style stands upright in the world and heads where the object does"),
    ("OBJECT", "Object", "The style stands along the object's own axes"),
    ("WORLD", "World", "The style stands along the world's axes"),
    ("EMPTY", "Empty", "The style stands along the axes of a chosen object"),
)
NORMALS = (
    ("SMOOTH", "Smooth", "Shaded as one smooth surface"),
    ("FLAT", "Flat", "Every triangle shaded for itself"),
)
BAKE_FORMATS = (
    (
        "PC2",
        "PC2 Cache",
        "A file beside the .blend, which Blender's Mesh Cache modifier plays; of any length",
    ),
    ("MDD", "MDD Cache", "The same in the other format of that modifier, which more programs read"),
    ("KEYS", "Shape Keys", "An object with one shape key a frame, all in the .blend: for short ranges"),
)
SPLAT_FORMATS = (
    ("PLY", "PLY", "A file a frame, in the common layout"),
    ("GLTF", "glTF", "A .glb file a frame, with KHR_gaussian_splatting"),
    ("USD", "USD", "A .usdc file with all frames, where this Blender's USD knows splats"),
)
BAKE_KINDS = (
    (
        "AUTO",
        "Automatic",
        "What is live; else the deformation, or the style where it follows the handles, or has keyframes and "
        "there are no handles",
    ),
    ("DEFORM", "Deform", "What the handles do"),
    ("STYLIZE", "Stylize", "What the style does, and the handles where it follows them"),
)
BAKE_RANGES = (
    ("SCENE", "Scene", "The scene's frames, or its preview range where that is on"),
    ("HANDLES", "Animation", "From the first to the last keyframe of what moves the handles or the style"),
    ("CUSTOM", "Custom", "From one frame to another"),
)
EXPORT_FORMATS = (
    ("ABC", "Alembic", "An .abc file: the mesh at every frame"),
    ("USD", "USD", "A .usdc file: the mesh at every frame"),
    ("GLTF", "glTF", "A .glb file: one morph target a frame; for short ranges"),
)
LIVE_KINDS = (
    ("DEFORM", "Deform", "The shape follows its handles"),
    ("STYLIZE", "Stylize", "The shape follows the style's settings, and its handles where the style does"),
)

RESULT_KINDS = (
    ("DEFORM", "Pose", "What the handles have made"),
    ("STYLIZE", "Style", "What the style has made"),
    ("WRAP", "Wrap", "What the wrap has made"),
)

# Kinds of data transferred from a wrapped object to its target.
TRANSFERRED = (
    ("KEYS", "Shape Keys", "Each key of the object, turned and scaled as the wrap does, with its drivers"),
    ("GROUPS", "Vertex Groups", "Weights and groups; locked groups of the target stay"),
    ("ATTRIBUTES", "Attributes", "Colors and other attributes of vertices and face corners"),
    ("EDGES", "Seams and Creases", "Seams, sharp edges, creases and bevel weights, along the nearest edges"),
    (
        "ARMATURE",
        "Armature",
        "A copy of the armature that was fitted to the wrapped shape, with its modifier",
    ),
    (
        "UV_MAPS",
        "UV Maps",
        "Replaces maps of these names; faces across a seam show a strip beyond it, and maps overlap there",
    ),
    ("CARRIED", "Carried Objects", "A copy of each object that it carries, at its distance from the target"),
)

TASKS = [
    ("POSE", "Pose", "Move the shape by pins and handles, around what is in its way"),
    ("STYLE", "Style", "Give the shape the faces and edges of a cube, of another solid or of any object"),
    ("WRAP", "Wrap", "Lay the mesh onto the surface of another object"),
    ("RIG", "Rig", "Weights of an armature, and stored poses"),
    ("ANIMATE", "Animate", "Keyframe the handles, bake and export, and let parts swing by themselves"),
]


# Settings of the stylization, and the list of styles.

STYLIZE = parameters("stylize")

STYLES = [  # (native name, label in the menu)
    ("cube", "Cube"),
    ("tetrahedron", "Tetrahedron"),
    ("octahedron", "Octahedron"),
    ("dodecahedron", "Dodecahedron"),
    ("icosahedron", "Icosahedron"),
    ("square prism", "Square Prism"),
    ("hexagonal prism", "Hexagonal Prism"),
    ("triangular prism", "Triangular Prism"),
    ("square pyramid", "Square Pyramid"),
    ("hexagonal pyramid", "Hexagonal Pyramid"),
    ("triangular pyramid", "Triangular Pyramid"),
    ("cylinder", "Cylinder"),
    ("cone", "Cone"),
    ("plane pair", "Flat Top and Bottom"),
]

CUSTOM = {  # styles by an object of the scene: {identifier: (label, tip)}
    "AXES": ("Axes of an Object", "Turns the surface along the axes of an object of your choice"),
    # Last, as Faces of a Mesh was: .blend files store its index.
    "OBJECT": ("Object", "Turns the surface towards what a mesh object of your choice has in each direction"),
}


def style_identifier(name):
    """Blender's identifier of a native style: "square prism" → "SQUARE_PRISM"."""
    return name.upper().replace(" ", "_")


def style_name(identifier):
    """The native style of a Blender identifier."""
    return identifier.lower().replace("_", " ")
