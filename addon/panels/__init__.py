# SPDX-License-Identifier: GPL-3.0-or-later
"""The side panel, one section a file, in the order of work."""

from . import deform, handles, result, source, status, stylize, surface

SECTIONS = [source, surface, handles, deform, stylize, result, status]
