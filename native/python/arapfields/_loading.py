# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the native module after checking torch's version; Ctrl-C during the import is deferred."""

from ._interrupts import uninterrupted
from ._libtorch import check

check()
with uninterrupted():
    from ._native import __version__ as __version__
