# SPDX-License-Identifier: GPL-3.0-or-later
"""Results that follow their handles while these move."""
