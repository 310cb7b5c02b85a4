import numpy as np
import pytest

from mlci.control.riccati import _diagonalize


@pytest.mark.parametrize("m", [1, 2, 3, 5])
def test_rotations_find_the_eigenvalues_and_vectors(m):
    root = np.random.default_rng(m).normal(size=(m, m))
    matrix, vectors = root + root.T, np.empty((m, m))
    values = matrix.copy()
    _diagonalize(values, vectors)
    np.testing.assert_allclose(values, np.diag(np.diag(values)), atol=1e-14)
    np.testing.assert_allclose(np.sort(np.diag(values)), np.linalg.eigvalsh(matrix), atol=1e-13)
    np.testing.assert_allclose((vectors * np.diag(values)) @ vectors.T, matrix, atol=1e-13)
