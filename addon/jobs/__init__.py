# SPDX-License-Identifier: GPL-3.0-or-later
"""Running jobs: the operator, its progress in the window, Cancel."""
