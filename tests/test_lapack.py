"""LAPACK without the rest of scipy.linalg: the same wrappers, the same answers, and nothing that a report loads asks for the rest."""

import subprocess
import sys

import numpy as np
import pytest
import scipy.linalg

from flexlin import lapack


def test_schur_forms_and_pencils_are_those_of_scipy():
    rng = np.random.default_rng(3)
    for n in (1, 2, 6, 70):
        A = rng.standard_normal((n, n))
        for given in (A, A + 1j * rng.standard_normal((n, n))):
            T, Z = lapack.complex_schur(given)
            assert np.abs(Z @ T @ Z.conj().T - given).max() < 1e-13 * n
            assert not np.tril(T, -1).any()
            assert np.array_equal(T, scipy.linalg.schur(given, output="complex")[0])
        B = A @ A.T + np.eye(n)
        values, vectors = lapack.symmetric_pencil(A + A.T, B)
        assert np.abs(vectors.T @ B @ vectors - np.eye(n)).max() < 1e-10
        assert np.array_equal(values, scipy.linalg.eigh(A + A.T, B)[0])


def test_what_has_no_answer_is_refused():
    with pytest.raises(ValueError, match="infs or NaNs"):
        lapack.complex_schur(np.full((2, 2), np.nan))
    with pytest.raises(ValueError, match="infs or NaNs"):
        lapack.symmetric_pencil(np.eye(2), np.full((2, 2), np.inf))
    with pytest.raises(np.linalg.LinAlgError):
        lapack.symmetric_pencil(np.eye(2), -np.eye(2))


def test_where_scipy_keeps_its_wrappers_elsewhere_all_of_it_is_loaded(monkeypatch):
    monkeypatch.setattr(lapack, "WRAPPED", "scipy.linalg._elsewhere")
    assert lapack.find_lapack() is scipy.linalg.lapack


def test_a_report_loads_the_wrappers_alone_and_scipy_takes_the_same_ones():
    code = (
        "import sys, flexlin.answers.analysis, flexlin.answers.margins, flexlin.report.page\n"
        "assert 'scipy.linalg' not in sys.modules\n"
        "from flexlin.lapack import LAPACK\n"
        "import scipy.linalg\n"
        "assert scipy.linalg.lapack.dgees is LAPACK.dgees\n"
        "assert abs(scipy.linalg.solve_continuous_are(1.0, 1.0, 3.0, 1.0)[0, 0] - 3) < 1e-14\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)
