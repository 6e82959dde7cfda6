"""An independent solution of linear differential equations on a closed line: Chebyshev collocation
of the first-order system.

It shares the differential equation with the package and nothing of its solution: no roots, no
Fourier modes, no transfer functions.
"""

from __future__ import annotations

import itertools

import numpy as np


def chebyshev(n: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes on [-1, 1], ascending, and the differentiation matrix (n + 1, n + 1)."""
    x = np.cos(np.pi * np.arange(n + 1) / n)[::-1]
    c = np.where((np.arange(n + 1) == 0) | (np.arange(n + 1) == n), 2.0, 1.0) * (-1.0) ** np.arange(
        n + 1
    )
    gap = x[:, None] - x[None, :] + np.eye(n + 1)
    matrix = np.outer(c, 1.0 / c) / gap
    matrix -= np.diag(matrix.sum(axis=1))
    return x, matrix


def solve_closed_line(coefficients, edges, load, scale=1.0, n=48):
    """u and its derivatives below the order, periodic from edges[0] to edges[-1]: sum_j
    coefficients[j] u^(j) = load(x, piece).

    `edges` split the line where the load has a kink; `scale` [1/length] balances the derivatives.
    Returns x (pieces, n + 1) and u (order, pieces, n + 1).
    """
    order, pieces = len(coefficients) - 1, len(edges) - 1
    nodes, d = chebyshev(n)
    size = (n + 1) * order
    system, right = np.zeros((pieces * size, pieces * size)), np.zeros(pieces * size)
    x = np.array([0.5 * (b - a) * (nodes + 1.0) + a for a, b in itertools.pairwise(edges)])

    def at(piece, derivative, node):
        return piece * size + derivative * (n + 1) + node

    for piece in range(pieces):
        slope = d * (2.0 / (edges[piece + 1] - edges[piece])) / scale
        for derivative in range(order):
            for node in range(1, n + 1):
                row = at(piece, derivative, node)
                system[row, at(piece, derivative, 0) : at(piece, derivative, 0) + n + 1] = slope[
                    node
                ]
                if derivative < order - 1:
                    system[row, at(piece, derivative + 1, node)] -= 1.0
                    continue
                lead = coefficients[order] * scale**order
                for lower in range(order):
                    system[row, at(piece, lower, node)] += coefficients[lower] * scale**lower / lead
                right[row] = load(x[piece, node], piece) / lead
            before = (piece - 1) % pieces
            row = at(piece, derivative, 0)
            system[row, at(piece, derivative, 0)] = 1.0
            system[row, at(before, derivative, n)] = -1.0
    u = np.linalg.solve(system, right).reshape(pieces, order, n + 1).transpose(1, 0, 2)
    return x, u * scale ** np.arange(order)[:, None, None]
