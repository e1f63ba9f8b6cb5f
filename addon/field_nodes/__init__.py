# SPDX-License-Identifier: GPL-3.0-or-later
"""The field itself as a Geometry Nodes group: it moves any geometry, also without the extension."""
