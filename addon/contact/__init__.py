# SPDX-License-Identifier: GPL-3.0-or-later
"""What a source does not pass: obstacles and the ground."""
