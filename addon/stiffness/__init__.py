# SPDX-License-Identifier: GPL-3.0-or-later
"""Painted stiffness: vertex groups that make parts of a source stiffer or softer."""
