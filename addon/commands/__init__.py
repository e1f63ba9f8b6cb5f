# SPDX-License-Identifier: GPL-3.0-or-later
"""Work without a window: `blender --command arapfields VERB …`, and the scripts of blender_scripts/.

Exit codes: 0 done, 1 something failed, 2 bad input or usage, 130 interrupted.
"""

COMMAND = "arapfields"
_registered = None


def register():
    global _registered
    import bpy

    from .main import run

    _registered = bpy.utils.register_cli_command(COMMAND, run)


def unregister():
    global _registered
    import bpy

    if _registered is not None:
        bpy.utils.unregister_cli_command(_registered)
    _registered = None
