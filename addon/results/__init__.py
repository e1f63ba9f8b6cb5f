# SPDX-License-Identifier: GPL-3.0-or-later
"""Results of solves, and their placement in the scene."""
