# SPDX-License-Identifier: GPL-3.0-or-later
"""Runs ugogon/gaussStylization by its Python module: gauss_stylization.py MODULE PROBLEM.npz RESULT.npz

MODULE is the folder of its module. PROBLEM holds vertices (n,3), triangles (m,3), normals (k,3) of the style
and strength, its lambda. One vertex is held; iterations end, and everything else is, as in its own main.py.
"""

import sys
import time

import numpy as np

MOST, INNER, ENOUGH = 100, 6, 0.001  # its main.py: iterations, those of its ADMM, change of the energy


def unit_box(vertices):
    """As its loadMesh places a mesh; the scale."""
    placed = vertices - vertices.min(0)
    scale = placed.max()
    placed = placed / scale
    return placed - placed.mean(0), scale


def main(folder, problem, result):
    sys.path.insert(0, folder)
    import gauss_stylization as gs

    given = np.load(problem)
    rest, scale = unit_box(given["vertices"])
    begin, work = time.perf_counter(), time.process_time()
    V, U = np.asfortranarray(rest), np.asfortranarray(rest.copy())
    F = np.asfortranarray(given["triangles"].astype(np.int32))
    data = gs.data()
    data.lamda = float(given["strength"])
    gs.add_style(np.asfortranarray(given["normals"].astype(float)), np.array([]), data)
    data.reset()
    gs.init_constraints(V, F, data)
    gs.gauss_style_precomputation(V, F, data)
    energy, iterations = gs.orginal_energy_without_arap(U, data, gs.calc_normals(U, F)), 0
    while iterations < MOST:
        gs.gauss_style_single_iteration(V, U, F, data, INNER)
        before, energy = energy, gs.orginal_energy_without_arap(U, data, gs.calc_normals(U, F))
        iterations += 1
        if not abs(energy - before) > ENOUGH:
            break
    took = time.perf_counter() - begin, time.process_time() - work
    shift = given["vertices"].min(0) - (rest.min(0) * scale)
    np.savez(result, moved=U * scale + shift, seconds=took, iterations=iterations)


if __name__ == "__main__":
    main(*sys.argv[1:])
