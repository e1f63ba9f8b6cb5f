# SPDX-License-Identifier: GPL-3.0-or-later
"""ARAP Fields in Blender: fit an implicit surface, pose it with handles, stylize it."""


def register():
    from . import registration

    registration.register()


def unregister():
    from . import registration

    registration.unregister()
