# SPDX-License-Identifier: GPL-3.0-or-later
"""Commands without a window: `blender --command arapfields VERB …`, also used by blender_scripts/.

Exit codes: 0 done, 1 something failed, 2 bad input or usage, 130 interrupted.
"""

COMMAND = "arapfields"
_registered = []


def register():
    import bpy

    from .main import run

    _registered.append(bpy.utils.register_cli_command(COMMAND, run))


def unregister():
    import bpy

    while _registered:
        bpy.utils.unregister_cli_command(_registered.pop())
