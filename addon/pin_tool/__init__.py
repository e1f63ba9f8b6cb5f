# SPDX-License-Identifier: GPL-3.0-or-later
"""The pin tool: handles that are placed on the surface by a click and moved by a drag."""
