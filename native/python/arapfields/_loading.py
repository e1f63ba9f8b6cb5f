# SPDX-License-Identifier: GPL-3.0-or-later
"""Loads the native module once torch is the right one. Ctrl-C meanwhile is no failed import."""

from ._interrupts import uninterrupted
from ._libtorch import check

check()
with uninterrupted():
    from ._native import __version__ as __version__
