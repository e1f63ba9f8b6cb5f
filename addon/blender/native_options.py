# SPDX-License-Identifier: GPL-3.0-or-later
"""Converts settings by name to the native library's options structs."""

from ..core.runtime import native
from ..core.settings.parameters import TABLE, native_options
from .user_preferences import machine_options


def options_of(operation, values, machine=None):
    """The native options of an operation of the table, from its settings and those of the machine.

    Settings that the options struct lacks are left out. `machine`: machine_options() read earlier; None
    reads the preferences, on the main thread only.
    """
    machine = machine_options() if machine is None else machine
    options = getattr(native.library(), TABLE[operation]["struct"])
    return options(**native_options(operation, {**values, **machine}))
