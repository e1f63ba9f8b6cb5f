# SPDX-License-Identifier: GPL-3.0-or-later
"""Properties of object.arapfields, which the .blend stores."""
