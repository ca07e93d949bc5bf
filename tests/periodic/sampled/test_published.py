"""Published discrete-time periodic problems, also in the tests of PeriodicSystems.jl (Varga), beside routes that share nothing."""

import numpy as np
from scipy.linalg import expm, solve_discrete_are

from flexlin.periodic.sampled_cost import SampledProblem, solve_samples


def pose(F, G, Q, R):
    n, m = np.shape(G)[1:]
    none = np.zeros((len(F), n, m))
    return SampledProblem(*(np.array(part, dtype=float) for part in (F, G, Q)), none, np.array(R, dtype=float), none)


def test_hench_and_laubs_example():
    """Hench, Laub, IEEE Trans. Automat. Control 39 (1994) 1197, example 2; beside many rounds of the recursion itself."""
    F = [
        [[-3, 2, 9], [0, 0, -4], [3, -2, 3]],
        [[6, -3, 0], [4, -2, 2], [2, -1, 4]],
        [[2, -3, -3], [4, -15, -3], [-2, 9, 1]],
    ]
    G = [[[1], [1], [0]], [[0], [1], [0]], [[0], [1], [1]]]
    Q = [np.outer(row, row) for row in np.eye(3)]
    problem = pose(F, G, Q, np.ones((3, 1, 1)))
    X, K = solve_samples(problem)
    known = np.eye(3)
    for k in reversed(range(600)):
        A, B = problem.F[k % 3], problem.G[k % 3]
        gain = np.linalg.solve(1 + B.T @ known @ B, B.T @ known @ A)
        closed = A - B @ gain
        known = problem.Q[k % 3] + closed.T @ known @ closed + gain.T @ gain
    np.testing.assert_allclose(X[0], known, rtol=0, atol=1e-9 * np.abs(known).max())
    loop = np.linalg.multi_dot([problem.F[k] - problem.G[k] @ K[k] for k in (2, 1, 0)])
    assert np.abs(np.linalg.eigvals(loop)).max() < 1


def test_pittelkaus_satellite():
    """Pittelkau, J. Guidance Control Dynamics 16 (1993) 1078: roll and yaw by magnetic torque, 120 samples an orbit; beside SciPy's
    equation of the orbit lifted into one step."""
    w, count = 0.00103448, 120
    A = np.zeros((4, 4))
    A[0, 2] = A[1, 3] = 5.318064566757217e-02
    A[2, 0], A[2, 3] = -1.352134256362805e-03, -7.099273035392090e-02
    A[3, 1], A[3, 2] = -7.557182037479544e-04, 3.781555288420663e-02
    h = 2 * np.pi / w / count
    wide = np.zeros((6, 6))  # [x; sin; cos]
    wide[:4, :4], wide[4, 5], wide[5, 4] = A, w, -w
    wide[2, 4], wide[3, 5] = 0.1389735e-6, -0.3701336e-7
    step = expm(h * wide)
    F = np.tile(step[:4, :4], (count, 1, 1))
    angle = w * h * np.arange(count)
    G = (np.stack([np.sin(angle), np.cos(angle)], axis=1) @ step[:4, 4:].T)[:, :, None]
    Q, r = np.diag([2.0, 1.0, 0.0, 0.0]), 1e-11
    X, K = solve_samples(pose(F, G, np.tile(Q, (count, 1, 1)), np.full((count, 1, 1), r)))
    now, cost = np.eye(4, 4 + count), np.zeros((4 + count, 4 + count))
    for k in range(count):
        cost += now.T @ Q @ now
        cost[4 + k, 4 + k] += r
        now = F[k] @ now
        now[:, 4 + k] += G[k, :, 0]
    known = solve_discrete_are(now[:, :4], now[:, 4:], cost[:4, :4], cost[4:, 4:], s=cost[:4, 4:])
    np.testing.assert_allclose(X[0], known, rtol=0, atol=1e-8 * np.abs(known).max())
    loop = np.eye(4)
    for k in range(count):
        loop = (F[k] - G[k] @ K[k]) @ loop
    assert np.abs(np.linalg.eigvals(loop)).max() < 1
