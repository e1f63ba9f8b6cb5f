# SPDX-License-Identifier: GPL-3.0-or-later
"""An independent renderer of Gaussian splats (Zwicker et al. 2001, Kerbl et al. 2023) in NumPy."""

import math

import numpy as np


def axes(quaternions):
    """(n, 3, 3) rotations of unit quaternions (w, x, y, z)."""
    w, x, y, z = np.asarray(quaternions, float).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def covariances(splats):
    turned = axes(splats.rotations) * np.asarray(splats.scales, float)[:, None, :]
    return turned @ turned.swapaxes(1, 2)


def legendre(band, order, z):
    """Associated Legendre functions without the Condon–Shortley phase, by their definition as derivatives."""
    polynomial = (
        np.polynomial.legendre.Legendre.basis(band).deriv(order)
        if order
        else (np.polynomial.legendre.Legendre.basis(band))
    )
    return (1 - z * z) ** (order / 2) * polynomial(z)


def harmonics(directions, count):
    """(n, count) real spherical harmonics by their angles; the sign of order m is (−1)^m."""
    x, y, z = directions.T
    angle, columns = np.arctan2(y, x), []
    for band in range(round(count**0.5)):
        for m in range(-band, band + 1):
            order = abs(m)
            factor = math.factorial(band - order) / math.factorial(band + order)
            scale = math.sqrt((2 - (m == 0)) * (2 * band + 1) / (4 * math.pi) * factor)
            wave = np.sin(order * angle) if m < 0 else np.cos(order * angle)
            columns.append((-1) ** order * scale * legendre(band, order, z) * wave)
    return np.array(columns).T


def render(splats, camera, pixels=64, focal=1.6):
    """(pixels, pixels, 3) picture by a camera, (4, 4) world → camera, that looks along its −z."""
    turn, shift = camera[:3, :3], camera[:3, 3]
    centers = np.asarray(splats.centers, float)
    eye = -turn.T @ shift
    seen = centers @ turn.T + shift
    depth = -seen[:, 2]
    flat = focal * seen[:, :2] / depth[:, None]
    slope = np.zeros((len(seen), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = focal / depth
    slope[:, 0, 2], slope[:, 1, 2] = focal * seen[:, 0] / depth**2, focal * seen[:, 1] / depth**2
    slope = slope @ turn
    inverse = np.linalg.inv(slope @ covariances(splats) @ slope.swapaxes(1, 2) + 1e-5 * np.eye(2))
    colours = np.asarray(splats.harmonics, float)
    away = (centers - eye) / np.linalg.norm(centers - eye, axis=1, keepdims=True)
    colours = np.maximum(0.5 + np.einsum("nk,nkc->nc", harmonics(away, colours.shape[1]), colours), 0)
    steps = (np.arange(pixels) + 0.5) / pixels * 2 - 1
    grid = np.stack(np.meshgrid(steps, -steps), -1)
    image, left = np.zeros((pixels, pixels, 3)), np.ones((pixels, pixels))
    for i in np.argsort(depth, kind="stable"):
        offset = grid - flat[i]
        power = np.einsum("ijk,kl,ijl->ij", offset, inverse[i], offset)
        alpha = np.minimum(splats.opacities[i] * np.exp(-0.5 * power), 0.99)
        image += (left * alpha)[..., None] * colours[i]
        left *= 1 - alpha
    return image


def psnr(one, other):
    return -10 * np.log10(max(np.mean((one - other) ** 2), 1e-20))
