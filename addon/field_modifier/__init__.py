# SPDX-License-Identifier: GPL-3.0-or-later
"""The modifier on the source itself that carries its motion."""
