# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of parameters and enum items; no bpy."""
