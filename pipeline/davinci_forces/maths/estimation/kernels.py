"""Compiled loops of estimation; imported where a loop runs, since compiling or loading them takes a moment."""

from typing import Any

import numpy as np

from davinci_forces.maths.compiled import compile_and_store, compile_function, inline

BLOCK_ROWS = 512  # rows of a block, whose columns fit into the processor's nearest cache


@inline
def dot(x: Any, y: Any, n: int) -> float:
    """Product x' y over the first n entries, in four independent sums that the processor computes in parallel."""
    a = b = c = d = 0.0
    whole = n - n % 4
    for i in range(0, whole, 4):
        a += x[i] * y[i]
        b += x[i + 1] * y[i + 1]
        c += x[i + 2] * y[i + 2]
        d += x[i + 3] * y[i + 3]
    for i in range(whole, n):
        a += x[i] * y[i]
    return (a + b) + (c + d)


@compile_and_store
def triangularise(Phi: Any, tau: Any, weight: Any, R: Any) -> None:
    """Write the triangular factor R (p + 1, p + 1) of the rows sqrt(w) [Phi tau], by Householder reflections.

    Each block is stacked below the triangle of the previous blocks: reflection k acts on row k of it and on the block.
    """
    K, p = Phi.shape
    R[:] = 0.0
    A = np.empty((p + 1, BLOCK_ROWS))  # a block's columns
    for start in range(0, K, BLOCK_ROWS):
        n = min(BLOCK_ROWS, K - start)
        for i in range(n):
            root = np.sqrt(weight[start + i])
            for j in range(p):
                A[j, i] = root * Phi[start + i, j]
            A[p, i] = root * tau[start + i]
        for k in range(p + 1):
            v = A[k]
            below = dot(v, v, n)
            if below == 0.0:
                continue
            size = np.sqrt(R[k, k] ** 2 + below)
            first = R[k, k] + (size if R[k, k] > 0 else -size)
            for j in range(k + 1, p + 1):
                factor = (first * R[k, j] + dot(v, A[j], n)) * 2.0 / (first**2 + below)
                R[k, j] -= factor * first
                column = A[j]
                for i in range(n):
                    column[i] -= factor * v[i]
            R[k, k] = -size if first > 0 else size


@inline
def residual_squares(x: Any, factors: Any, C: Any, y: Any, monomials: Any) -> float:
    """Squared error |C m(x) - y|^2 of n parameters x (n + 1,), the last of which is 1; overwrites `monomials` (T,)."""
    for t in range(len(factors)):
        monomials[t] = x[factors[t, 0]] * x[factors[t, 1]] * x[factors[t, 2]]
    total = 0.0
    for i in range(len(y)):
        e = dot(C[i], monomials, len(monomials)) - y[i]
        total += e * e
    return total


@compile_function
def least(costs: Any) -> int:
    """The index of the least cost; `argmin` would take a second to compile."""
    first = 0
    for s in range(1, len(costs)):
        if costs[s] < costs[first]:
            first = s
    return first


@compile_and_store
def fly(
    x: Any, v: Any, best: Any, costs: Any, lower: Any, upper: Any, factors: Any, C: Any, y: Any, r: Any, w: Any,
    cognitive: float, social: float, reflects: bool, history: Any,
) -> None:  # fmt: skip
    """Move particles x (S, n + 1) by velocities v (S, n), I times, with random r (I, S, n, 2) and weights w (I,).

    `best` (S, n + 1) and `costs` (S,) are those of each particle; `history` (I,) gets the least cost after each move.
    """
    S, n = v.shape
    monomials, leader, first = np.empty(len(factors)), np.empty(n), least(costs)
    for k in range(len(w)):
        for i in range(n):
            leader[i] = best[first, i]
        for s in range(S):
            for i in range(n):
                towards = cognitive * r[k, s, i, 0] * (best[s, i] - x[s, i])
                v[s, i] = w[k] * v[s, i] + towards + social * r[k, s, i, 1] * (leader[i] - x[s, i])
                x[s, i] += v[s, i]
                if x[s, i] < lower[i] or x[s, i] > upper[i]:
                    wall = lower[i] if x[s, i] < lower[i] else upper[i]
                    if reflects:
                        x[s, i] = 2.0 * wall - x[s, i]
                        v[s, i] = -v[s, i]
                    x[s, i] = min(max(x[s, i], lower[i]), upper[i])
            cost = residual_squares(x[s], factors, C, y, monomials)
            if cost < costs[s]:
                costs[s] = cost
                for i in range(n):
                    best[s, i] = x[s, i]
        first = least(costs)
        history[k] = costs[first]
