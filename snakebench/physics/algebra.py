"""Cholesky's factorisation for compiled code, without roots: L D L' of a symmetric matrix whose lower half counts.

For the ten rows of a snake's mass matrix this costs less than LAPACK, which numba calls with copies.
"""

from snakebench.compilation import njit
from snakebench.value import FloatArray


@njit(error_model="numpy")
def factorise(matrix: FloatArray, n: int) -> None:
    """Replace the first n rows of a matrix by its factors: L below the diagonal, 1/D on it."""
    for i in range(n):
        pivot = matrix[i, i]
        for j in range(i):
            entry = matrix[i, j]
            for k in range(j):
                entry -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = entry  # L D for now
        for j in range(i):
            factor = matrix[i, j] * matrix[j, j]
            pivot -= factor * matrix[i, j]
            matrix[i, j] = factor
        matrix[i, i] = 1 / pivot


@njit(error_model="numpy")
def solve(factors: FloatArray, values: FloatArray, n: int, zeros: int = 0) -> None:
    """Replace the first n values by the solution x of matrix x = values, given what `factorise` made of the matrix.

    The first `zeros` of the values are zero.
    """
    for i in range(zeros, n):
        for j in range(zeros, i):
            values[i] -= factors[i, j] * values[j]
    for i in range(n):
        values[i] *= factors[i, i]
    for i in range(n - 1, 0, -1):
        for j in range(i):
            values[j] -= factors[i, j] * values[i]
