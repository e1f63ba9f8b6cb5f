# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights and corrective shape keys of an armature, computed from poses of the field."""
