# SPDX-License-Identifier: GPL-3.0-or-later
"""The one way from settings by name to the native library's options."""

from ..core.runtime import native
from ..core.settings.parameters import TABLE, native_options
from .user_preferences import machine_options


def options_of(operation, values, machine=None):
    """The library's options of an operation of the table, from its settings and those of the machine.

    Settings that these options do not have are left out. `machine`: as the preferences had it; None: as they
    have it now, on the main thread.
    """
    machine = machine_options() if machine is None else machine
    options = getattr(native.library(), TABLE[operation]["struct"])
    return options(**native_options(operation, {**values, **machine}))
