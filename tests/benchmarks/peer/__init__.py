# SPDX-License-Identifier: GPL-3.0-or-later
"""What runs the public code of others on the same constraints as ours, each in a process of its own."""
