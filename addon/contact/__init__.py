# SPDX-License-Identifier: GPL-3.0-or-later
"""Contact of a source with obstacles, the ground and itself."""
