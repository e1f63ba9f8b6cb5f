# SPDX-License-Identifier: GPL-3.0-or-later
"""What artists set of a wrap."""

from .parameters import parameters

WRAP = parameters("wrap")
