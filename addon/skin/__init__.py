# SPDX-License-Identifier: GPL-3.0-or-later
"""Skin weights of an armature's bones, and correctives, from poses of the field."""
