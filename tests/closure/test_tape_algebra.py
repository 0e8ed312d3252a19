"""Linear algebra on tapes against LAPACK, and tapes against Pinocchio."""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import pytest

import closedchain as cc
from closedchain.closure.tape.cholesky import cholesky, gram
from closedchain.closure.tape.dense import (
    bidiagonal,
    determinant,
    gram_root,
    over_triangle,
    triangle,
)
from closedchain.closure.tape.expression import Expr, Graph
from closedchain.closure.tape.extremes import Bidiagonal, Tridiagonal, step
from closedchain.closure.tape.numbers import evaluate
from closedchain.closure.tape.verified import TapeError, agree, verify

Array = np.ndarray


def inputs(g: Graph, shape: tuple[int, int], first: int = 0) -> list[list[Expr]]:
    """A matrix of inputs."""
    return [g.inputs(first + i * shape[1], shape[1]) for i in range(shape[0])]


def numbers(g: Graph, outputs: Sequence[Expr], *matrices: Array) -> Array:
    """Values of outputs where the inputs are the entries of matrices."""
    flat = [float(x) for m in matrices for x in np.ravel(m)]
    return np.array(evaluate(g.tape(outputs, len(flat)), flat), dtype=float)


def sparse(g: Graph, matrix: Array) -> list[dict[int, Expr]]:
    """Rows of inputs where a matrix has entries."""
    columns = matrix.shape[1]
    return [
        {c: g.input(r * columns + c) for c in range(columns) if matrix[r, c] != 0.0}
        for r in range(len(matrix))
    ]


@pytest.mark.parametrize("n", [1, 2, 5])
def test_determinants_need_no_pivot_on_the_diagonal(n: int) -> None:
    rng = np.random.default_rng(n)
    cases = [rng.standard_normal((n, n)), np.flip(np.eye(n), axis=0), np.zeros((n, n))]
    for matrix in cases:
        g = Graph()
        found = numbers(g, [determinant(g, inputs(g, (n, n)))], matrix)
        assert abs(found[0] - np.linalg.det(matrix)) < 1e-13


def test_triangle_and_what_is_divided_by_it() -> None:
    rng = np.random.default_rng(0)
    a, x = rng.standard_normal((12, 4)), rng.standard_normal((3, 4))
    g = Graph()
    columns = inputs(g, (4, 12))
    upper = triangle(g, columns)
    divided = over_triangle(g, inputs(g, (3, 4), 48), upper)
    flat = [e for row in upper + divided for e in row]
    found = numbers(g, flat, a.T, x)
    r = found[:16].reshape(4, 4)
    np.testing.assert_allclose(r.T @ r, a.T @ a, atol=1e-13)
    np.testing.assert_allclose(found[16:].reshape(3, 4), x @ np.linalg.inv(r), atol=1e-13)


@pytest.mark.parametrize("shape", [(1, 1), (1, 4), (3, 3), (3, 5), (5, 3)])
def test_bidiagonal_forms_keep_the_singular_values(shape: tuple[int, int]) -> None:
    rng = np.random.default_rng(1)
    for matrix in (rng.standard_normal(shape), np.ones(shape), np.zeros(shape)):
        g = Graph()
        diagonal, beside = bidiagonal(g, inputs(g, shape))
        d, b = np.split(np.sqrt(numbers(g, [*diagonal, *beside], matrix)), [len(diagonal)])
        form = np.diag(d) + np.diag(b, 1)
        expected = np.linalg.svd(matrix, compute_uv=False)
        np.testing.assert_allclose(np.linalg.svd(form, compute_uv=False), expected, atol=1e-14)


def test_cholesky_of_a_sparse_gram_matrix() -> None:
    rng = np.random.default_rng(2)
    rows = rng.standard_normal((9, 14)) * (rng.random((9, 14)) < 0.4) + np.eye(9, 14)
    right = rng.standard_normal(9)
    g = Graph()
    factors = cholesky(g, gram(g, sparse(g, rows)))
    found = numbers(g, factors.solve(g.inputs(rows.size, 9)), rows, right)
    np.testing.assert_allclose(rows @ rows.T @ found, right, atol=1e-11)
    g = Graph()
    found = numbers(g, [gram_root(g, sparse(g, rows))], rows)
    expected = np.sqrt(np.linalg.det(np.eye(9) + rows @ rows.T))
    np.testing.assert_allclose(found, expected, rtol=1e-13)


@pytest.mark.parametrize("coincident", [False, True])
def test_extreme_eigenvalues_come_from_one_side(coincident: bool) -> None:
    rng = np.random.default_rng(3)
    q, e = rng.random(6) + 0.1, np.zeros(5) if coincident else rng.random(5)
    if coincident:
        q = np.array([2.0, 1.0, 2.0, 1.0, 1.5, 1.2])
    values = np.linalg.svd(np.diag(np.sqrt(q)) + np.diag(np.sqrt(e), 1), compute_uv=False) ** 2
    diagonal = q + np.append(0.0, e)
    for upward, expected in ((True, values[-1]), (False, values[0])):
        for form in (Bidiagonal, Tridiagonal):
            if form is Tridiagonal and upward:
                continue
            g = Graph()
            x = g.input(11)
            parts = (g.inputs(0, 6), g.inputs(6, 5))
            new, further = step(x, form(g, *parts).slopes(x), 6, upward)
            tape = g.tape([new, further], 12)
            squares = (q, e) if form is Bidiagonal else (diagonal, q[:-1] * e)
            at, on = (0.0 if upward else float(diagonal.sum()) * 1.0001), True
            for _ in range(100):
                if not on:
                    break
                with np.errstate(all="ignore"):
                    after, on = evaluate(tape, [*np.concatenate(squares), np.float64(at)])
                assert after >= at if upward else after <= at
                at = float(after)
            assert not on
            assert abs(at / expected - 1.0) < 1e-10


def test_the_smallest_eigenvalue_keeps_its_digits() -> None:
    """Graded: 1e-24 beside 1, as exact as the entries."""
    q, e = np.array([1.0, 1e-12, 1e-24]), np.array([1e-3, 1e-15])
    g = Graph()
    x = g.input(5)
    new, _ = step(x, Bidiagonal(g, g.inputs(0, 3), g.inputs(3, 2)).slopes(x), 3, True)
    tape, at = g.tape([new], 6), 0.0
    with np.errstate(all="ignore"):
        for _ in range(12):
            at = float(evaluate(tape, [*q, *e, np.float64(at)])[0])
    # one step of Newton's method in exact numbers
    a, b = [Fraction(x) for x in q], [Fraction(x) for x in e]
    lam = Fraction(at)
    p0 = a[0] - lam
    p1 = (a[1] + b[0] - lam) * p0 - a[0] * b[0]
    p2 = (a[2] + b[1] - lam) * p1 - a[1] * b[1] * p0
    slope = -a[0] * (a[1] + a[2] + b[1])  # of det at 0, nearly
    assert abs(float(p2 / slope)) < 1e-12 * at


@pytest.mark.parametrize("robot", cc.robots("papers"))
def test_tapes_agree_with_pinocchio(robot: str) -> None:
    m = cc.load(robot)
    verify(m, m.required_task().outputs)


def test_what_differs_does_not_serve() -> None:
    agree("same", np.array([1.0, 1e6]), np.array([1.0 + 1e-11, 1e6 + 1e-5]))
    for wrong in (1.0 + 1e-9, np.nan):
        with pytest.raises(TapeError, match="numbers differ"):
            agree("numbers", np.array([wrong]), np.array([1.0]))
