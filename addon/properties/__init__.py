# SPDX-License-Identifier: GPL-3.0-or-later
"""What is stored in the .blend: object.arapfields."""
