# SPDX-License-Identifier: GPL-3.0-or-later
"""Paired timings: on a shared machine only ratios taken side by side mean anything."""

import statistics
import time


def once(call):
    begin = time.perf_counter()
    call()
    return time.perf_counter() - begin


def paired(ours, theirs, rounds=5, warm_up=True):
    """Runs both calls alternately; returns row fields: median seconds of each and median ratio."""
    if warm_up:
        ours(), theirs()
    pairs = [(once(ours), once(theirs)) for _ in range(rounds)]
    return {
        "ours_s": round(statistics.median(a for a, _ in pairs), 5),
        "theirs_s": round(statistics.median(b for _, b in pairs), 5),
        "times_faster": round(statistics.median(b / a for a, b in pairs), 2),
    }


def first_good(solve, good, counts):
    """The smallest of `counts` for which solve(count) is good, or None; its seconds and report."""
    for count in counts:
        begin = time.perf_counter()
        field = solve(count)
        seconds = time.perf_counter() - begin
        if good(field):
            return count, seconds, field.report
    return None, seconds, field.report


def product_rate(size=256, rows=10_000, rounds=9):
    """Present GFLOP/s of single-precision matrix products of a network's size."""
    import torch

    a, b, c = torch.randn(rows, size), torch.randn(size, size), torch.empty(rows, size)
    torch.mm(a, b, out=c)
    seconds = statistics.median(once(lambda: torch.mm(a, b, out=c)) for _ in range(rounds))
    return 2e-9 * rows * size * size / seconds
