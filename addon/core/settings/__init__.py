# SPDX-License-Identifier: GPL-3.0-or-later
"""Tables of what can be set, and the choices; no bpy."""
