# SPDX-License-Identifier: GPL-3.0-or-later
from pathlib import Path

import bpy
import numpy as np

from ..blender import mesh_arrays, modifier_stack
from ..blender.evaluation import world_matrix
from ..blender.host import has_window
from ..blender.language import translated
from ..blender.object_references import source_of
from ..blender.property_definitions import flag, path_text, text
from ..blender.source_operator import SourceOperator
from ..blender.splat_layouts import holds_splats
from ..core.errors import UserError
from ..core.runtime import native
from . import caches, splat_files

KNOWN = (".ply", ".glb", ".usdc", ".usda", ".usd")


class ARAPFIELDS_OT_export_splats(SourceOperator, bpy.types.Operator):
    """Write the splats as the modifier shows them: their places, shapes and colours, in world space"""

    bl_label = "Export Splats"
    guide = "animation"
    of_linked = True

    __annotations__ = {
        "filepath": path_text(
            "File",
            "A .ply, a .glb, or .usdc where this Blender's USD knows splats",
            "FILE",
            options={"SKIP_SAVE"},
        ),
        "filter_glob": text(
            "Filter",
            "Files that are shown",
            default=";".join(f"*{suffix}" for suffix in KNOWN),
            options={"HIDDEN"},
        ),
        "check_existing": flag(
            "Check Existing", "Ask before a file is replaced", default=True, options={"HIDDEN", "SKIP_SAVE"}
        ),
    }

    @classmethod
    def refuses(cls, source):
        return None if holds_splats(source) else UserError("{name} holds no splats", source)

    def invoke(self, context, event):
        """Opens the file browser if no path is given."""
        if self.filepath or not has_window():
            return self.execute(context)
        folder = Path(bpy.path.abspath("//"))
        self.filepath = str(folder / f"{caches.encoded(source_of(context).name)}.ply")
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def change(self, context, source):
        if not self.filepath:
            raise UserError("Choose a file")
        path = caches.cache_path(
            source, context.scene, Path(self.filepath).suffix.lower(), "//", self.filepath
        )
        if path.suffix.lower() not in KNOWN:
            raise UserError("{path}: unknown extension; known are {known}", path=path, known=", ".join(KNOWN))
        native.library()
        splat_files.require_writable(path)
        splats = shown(context, source)
        splat_files.write(path, splats, source.name)
        values = {
            "count": f"{len(splats):,}",
            "path": path.name,
            "size": caches.size_text(path.stat().st_size),
        }
        return translated("{count} splats written to {path} ({size})", **values)


def shown(context, source):
    """The native GaussianSplats of an object right after the field's modifier, in world space."""
    own = modifier_stack.find(source)
    kept = [] if own is None else list(source.modifiers)[: source.modifiers.find(own.name) + 1]
    with modifier_stack.mesh_of(context, source, kept) as mesh:
        splats = mesh_arrays.arrays_of(source, mesh).splats
    if splats is None:
        raise UserError("{name}: a modifier before the field makes something else of its splats", source)
    return splats.made(native.library()).transformed(np.array(world_matrix(source)))


CLASSES = [ARAPFIELDS_OT_export_splats]
