"""A controller design: what every kind of design hands back, and the designs whose gains are given, PD and a scene's own feedback."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from flexlin.arguments import checked
from flexlin.checks import Array, at_times, real_array, whole
from flexlin.errors import ArgumentError, DesignError, NotStable, counted
from flexlin.lazy import lazy
from flexlin.linearization.law import Controller, Law
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.coefficients import Constant, combine
from flexlin.periodic.floquet.exponents import floquet
from flexlin.periodic.floquet.result import FloquetResult
from flexlin.periodic.response.forced import label_states
from flexlin.periodic.riccati.linear_quadratic import LinearQuadratic, RiccatiSolution
from flexlin.periodic.riccati.riccati import periodic_lyapunov
from flexlin.periodic.riccati.scattering import symmetrize, transpose
from flexlin.periodic.sampled import sampled_floquet
from flexlin.periodic.system import MatrixFunction, PeriodicSystem
from flexlin.plots.view import Series, Shown, View
from flexlin.summary import immutable

if TYPE_CHECKING:
    import xarray


def running_cost(problem: LinearQuadratic, K: MatrixFunction) -> MatrixFunction:
    """The weight of the states in a closed loop, Q + K' R K - N K - K' N', as a function of time."""
    return combine(weigh_loop, K, problem.Q, problem.R, problem.N)


def weigh_loop(K: Array, Q: Array, R: Array, N: Array) -> Array:
    """The same of the matrices at some times."""
    return symmetrize(Q + transpose(K) @ R @ K - 2 * N @ K)


@immutable(eq=False)
class Design(Shown):
    """A linear state feedback u = -K(t) x with its closed loop.

    Attributes
    ----------
    name : str
        Name in reports.
    kind : str
        Kind of the design, such as "periodic-lqr".
    K : function of times (N,) -> (N, m, n)
        The gain.
    closed_loop : PeriodicSystem
        x' = (A - B K) x; of a sampled design the plant, whose input is held.
    error : float
        Relative error of K; `status` says what it means.
    status : str
        What to make of the result.
    controller : Controller or None
        What the design remembers, such as integrals: states behind the plant's n.
    problem : LinearQuadratic or None
        The weights by which the loop is judged, whatever way its gain was found.
    solution : RiccatiSolution or None
        The Riccati solution, when K is the optimal gain of `problem`.
    sample_time : float or None
        Of a design whose input is held from sample to sample, in s.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> design = fl.periodic_lqr(system, np.eye(2), np.eye(1))
    >>> design.K(np.array([0.3])).round(6)
    array([[[1.      , 1.732051]]])
    >>> print(f"{design.cost([1.0, 0.0]):.6f}")
    1.732051
    """

    name: str
    kind: str
    K: MatrixFunction
    closed_loop: PeriodicSystem
    error: float
    status: str
    problem: LinearQuadratic | None = None
    solution: RiccatiSolution | None = None
    controller: Controller | None = None
    sample_time: float | None = None

    def floquet(self, tol: float = 1e-9) -> FloquetResult:
        """Return Floquet's verdict on the loop, with its input held where the design is sampled.

        Parameters
        ----------
        tol : float
            Wanted error of the exponents, in 1/s.

        Returns
        -------
        FloquetResult
            What `floquet` says of the closed loop, or `sampled_floquet` of the gains.
        """
        if self.sample_time is None:
            return floquet(self.closed_loop, tol)
        return sampled_floquet(self.closed_loop, self.K, self.sample_time, tol=tol)

    def to_xarray(self, points: int = 257, names: Sequence[str] = (), inputs: Sequence[str] = ()) -> "xarray.Dataset":
        """Return the gain over a period as a dataset.

        Parameters
        ----------
        points : int
            Times of the period, both ends included.
        names : sequence of str, optional
            Names of the n states; x1, x2 ... by default.
        inputs : sequence of str, optional
            Names of the m inputs; u1, u2 ... by default.

        Returns
        -------
        xarray.Dataset
            `K` by time, input and state; name, kind, error and status as attributes.

        Raises
        ------
        ArgumentError
            When there are not as many names as states or inputs.
        """
        import xarray

        loop, t = self.closed_loop, self._times(whole("points", points, 2))
        states, _ = label_states(loop.n, names, ())
        given = list(inputs) or [f"u{i + 1}" for i in range(loop.m)]
        if len(given) != loop.m:
            raise ArgumentError("inputs do not fit the design", got=len(given), expected=str(loop.m))
        coords = {"time": ("time", t, {"units": "s"}), "input": given, "state": states}
        attributes = {"name": self.name, "kind": self.kind, "error": self.error, "status": self.status}
        return xarray.Dataset({"K": (("time", "input", "state"), self.K(t))}, coords=coords, attrs=attributes)

    def _times(self, points: int) -> Array:
        """Times of a period; the last lies inside it, since a gain of a horizon ends there."""
        t = np.linspace(0.0, self.closed_loop.period, points)
        t[-1] = np.nextafter(t[-1], 0.0)
        return t

    def _view(self) -> View:
        t = self._times(257)
        K = self.K(t)
        series = tuple(
            Series(f"u{i + 1} per x{j + 1}", t, K[:, i, j]) for i in range(K.shape[1]) for j in range(K.shape[2])
        )
        facts = (
            f"{self.kind}, {counted(K.shape[1], 'input')}, {counted(K.shape[2], 'state')}, relative error {self.error:.0e}",
            self.status,
        )
        return View(self.name, "", facts, "time in s", "gains K, in the input's unit per the state's", series)

    @property
    def law(self) -> Law:
        """The design as a control law without feedforward; `law.with_gain(design.K, design.controller)` gives another this gain."""
        n, m = self.closed_loop.n, self.closed_loop.m
        arm = n - (0 if self.controller is None else self.controller.states)
        return Law("none", Constant(np.zeros(m)), self.K, Constant(np.zeros(arm)), self.controller)

    @lazy
    def value(self) -> RiccatiSolution:
        """The cost matrix of this loop: of the Riccati equation when K is optimal, else of the closed loop's Lyapunov equation.

        Raises: DesignError when the design has no weights; NotStable when the loop is unstable.
        """
        if self.solution is not None:
            return self.solution
        problem = self.problem
        if problem is None:
            raise DesignError(
                f"the design {self.name!r} has no cost",
                got="no weights",
                expected="a problem with Q and R",
                todo="give `problem=linear_quadratic(system, Q, R)` when the design is made",
            )
        return periodic_lyapunov(self.closed_loop, running_cost(problem, self.K))

    def X(self, t: ArrayLike) -> Array:
        """Return the cost matrix of the loop.

        Parameters
        ----------
        t : array_like, shape (N,) or ()
            Times in s.

        Returns
        -------
        array, shape (N, n, n) or (n, n)
            X(t): starting at x at time t costs x' X(t) x.

        Raises
        ------
        DesignError
            When the design has no weights.
        NotStable
            When the loop is unstable.
        """
        return at_times(self.value.X, t)

    def cost(self, x0: ArrayLike, t: float = 0.0) -> float:
        """Return the cost of starting at a state.

            x0' X(t) x0 = int_t^inf (x' Q x + 2 x' N u + u' R u) dt

        Parameters
        ----------
        x0 : array_like, shape (n,)
            The state at time t.
        t : float
            The time, in s.

        Returns
        -------
        float
            The cost; infinite when the loop is unstable.

        Raises
        ------
        DesignError
            When the design has no weights.
        """
        start = real_array("x0", x0, (self.closed_loop.n,))
        try:
            X = self.X(np.array([t]))[0]
        except NotStable:
            return float("inf")
        return float(start @ X @ start)


@checked
def pd_feedback(
    system: PeriodicSystem,
    joints: Sequence[int],
    kp: Sequence[float],
    kd: Sequence[float],
    problem: LinearQuadratic | None = None,
    name: str = "PD",
) -> Design:
    """Close independent PD loops about the joints of a second-order system.

        u_i = -kp_i y_(j_i) - kd_i y'_(j_i)

    Parameters
    ----------
    system : PeriodicSystem
        The plant, x = [y; y'], with one input a joint.
    joints : sequence of int
        Number j_i of the coordinate that each input moves.
    kp : sequence of float
        Gains on the angles, in N m/rad.
    kd : sequence of float
        Gains on the rates, in N m s/rad.
    problem : LinearQuadratic, optional
        Weights by which the loop's cost is judged, if it is to be compared.
    name : str
        Name of the design in reports.

    Returns
    -------
    Design
        A constant gain, which is exact: error 0.

    Raises
    ------
    ArgumentError
        When the numbers of joints, inputs and gains differ.

    Examples
    --------
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> made = fl.control.pd_feedback(system, [0], [2.0], [3.0])
    >>> fl.floquet(made.closed_loop).exponents.real.round(6).tolist()
    [-1.0, -2.0]
    """
    n = system.n // 2
    wanted = f"{system.m}: one for each input"
    places = real_array("joints", joints, (None,))
    if not all(place == int(place) and 0 <= place < n for place in places):
        raise ArgumentError(
            "joints are no coordinates", got=places.tolist(), expected=f"whole numbers from 0 to {n - 1}"
        )
    stiffness, damping = real_array("kp", kp, (None,)), real_array("kd", kd, (None,))
    for what, values in (("joints", places), ("kp", stiffness), ("kd", damping)):
        if len(values) != system.m:
            raise ArgumentError(f"{what} has the wrong length", got=len(values), expected=wanted)
    K = np.zeros((system.m, system.n))
    rows, columns = np.arange(system.m), places.astype(int)
    K[rows, columns] = stiffness
    K[rows, n + columns] = damping
    gain = Constant(K)
    return Design(name, "pd", gain, system.feedback(gain), 0.0, "constant gains as given", problem)


@checked
def scene_feedback(closed: Linearization, name: str = "the scene's own") -> Design:
    """Return the feedback of a scene's own loop, PD or PID with filters, as a design.

        u = -K [y; y'; z],   z' = rates [y; y'; z]

    Assumes continuous time: sampling, saturation and limited rates of `[control]` are left to whoever calls the gain.

    Parameters
    ----------
    closed : Linearization
        The arm with its loop: fl.linearize(arm, scene.motion, scene.control).
    name : str
        Name of the design.

    Returns
    -------
    Design
        Constant gains, which are exact: error 0; its `controller` holds integrals and filters.

    Raises
    ------
    ArgumentError
        For an arm that was linearized without its loop.

    Examples
    --------
    >>> import numpy as np
    >>> import flexlin as fl
    >>> pid = {"kind": "pid", "kp": [3.0], "kd": [0.5], "ki": [2.0]}
    >>> scene = fl.load_scene("single-link", {"control.feedback": pid, "designs": []})
    >>> made = fl.control.scene_feedback(fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control))
    >>> made.K(np.zeros(1))[0].tolist(), made.controller.names
    ([[3.0, 0.0, 0.0, 0.5, 0.0, 0.0, 2.0]], ('q1_integral',))
    """
    if closed.control is None:
        todo = "linearize the arm with it: fl.linearize(arm, scene.motion, scene.control)"
        raise ArgumentError("these equations hold no feedback", got="control = None", todo=todo)
    law = closed.law
    loop = PeriodicSystem(closed.A, closed.period, closed.input_matrix, closed.breaks)
    return Design(
        name, "scene", law.gain, loop, 0.0, "constant gains as the scene gives them", controller=law.controller
    )
