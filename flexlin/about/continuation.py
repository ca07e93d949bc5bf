"""Continuation in speed: from the arm at rest in every place of its path to the motion at full speed."""

import numpy as np

from flexlin.about.harmonic_balance import Solver, lost
from flexlin.checks import Array
from flexlin.errors import NumericalError

FIRST, LEAST, GROWTH = 0.25, 1e-3, 1.5
"""The first step in speed, as a part of the full one; the least that is tried; by how much a step grows after one that succeeds."""
STEPS, HALVINGS = 12, 10
"""Steps of Newton's method at each speed; halvings of the interval in which the inverse becomes singular."""


def continue_in_speed(solver: Solver) -> Array:
    """The solution under an exact closing at full speed, followed from rest: s'' and s' count for little at first.

        F(y, sigma y', sigma^2 y'', torque; q, sigma q', sigma^2 q'') = 0,   sigma from 0 to 1

    Raises: NumericalError naming the speed that was reached, and why it goes no further.
    Source: Allgower, Georg, Introduction to Numerical Continuation Methods (2003), ch. 2.
    """
    found = solver.solve(None, 0.0)
    if found is None:
        raise lost(
            "Newton's method did not settle, nor does it for the arm at rest in the places of its path",
            "stiffen the links or lighten the load: gravity alone bends them too far",
        )
    passed, step = [(0.0, found[0])], FIRST
    while passed[-1][0] < 1.0:
        if step < LEAST:
            raise refuse(solver, passed)
        reached, z = passed[-1]
        trial = min(1.0, reached + step)
        found = solver.solve(z, trial, STEPS)
        step = step / 2 if found is None else GROWTH * step
        passed += [] if found is None else [(trial, found[0])]
    return passed[-1][1]


def refuse(solver: Solver, passed: list[tuple[float, Array]]) -> NumericalError:
    """What ended the branch, from the speeds that were passed and their solutions."""
    about, (reached, z) = solver.about, passed[-1]
    deviation = np.abs(z[:, : about.n]).max(axis=0)
    worst = int(np.argmax(deviation))
    where = about.arm.coordinates[about.kept[worst]]
    far = f"the largest deviation there is {deviation[worst]:.3g} {where.unit} in {where.name}"
    got = f"followed from rest, Newton's method ends at {reached:.3g} of the speed; {far}"
    return explain(
        got, f"move at most {reached:.2g} times as fast, or lower the amplitude", *find_singular(solver, passed)
    )


def explain_loss(solver: Solver, start: Array) -> NumericalError:
    """What to say where a solution on fewer points, at the times of the solver, leads to none."""
    got, rest = f"Newton's method did not settle on {solver.points} points", solver.solve(None, 0.0)
    passed = [] if rest is None else [(0.0, rest[0])]
    todo = "slow the motion down, lower its amplitude or stiffen the links"
    return explain(got, todo, *find_singular(solver, [*passed, (1.0, start)]))


def explain(got: str, todo: str, speed: float, t: float | None) -> NumericalError:
    """The error, with the speed from which on the inverse is singular and the time, if it is."""
    if t is None:
        return lost(got, todo)
    since = f"from {speed:.3g} of it on" if speed > 0 else "at any speed"
    todo = f"move at most {speed:.2g} times as fast, lower the amplitude, or stiffen the links"
    other = "use joint-exact, give the links fewer modes, or choose a path that stays away from there"
    return lost(f"{got}; {since} {describe_singular(t)}", todo if speed > 0 else other)


def find_singular(solver: Solver, passed: list[tuple[float, Array]]) -> tuple[float, float | None]:
    """The speed from which on the inverse is singular somewhere, by bisection, and the time; none where it never is."""
    times = [solver.singular_time(z) for _, z in passed]
    first = next((i for i, t in enumerate(times) if t is not None), None)
    if not first:
        return 0.0, None if first is None else times[0]
    (low, z), high, t = passed[first - 1], passed[first][0], times[first]
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        found = solver.solve(z, middle, STEPS)
        at = None if found is None else solver.singular_time(found[0])
        if found is not None and at is None:
            low, z = middle, found[0]
        else:
            high, t = middle, t if at is None else at
    return high, t


def describe_singular(t: float) -> str:
    """Why an exact closing may have no smooth solution."""
    where = f"the arm's inertia, its tip held on its line, is singular about t = {t:.3g} s"
    return f"{where}: accelerations and torque are not determined there"
