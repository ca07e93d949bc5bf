"""What does a Taylor polynomial of a closed loop cost, by route and order?

The inverse kinematics of a planar 5-bar (2 inputs, 4 outputs), all derivatives at one point, by: nested CasADi Jacobians; nested
Jacobians of a CasADi rootfinder; the power-series engine in numbers; the same unrolled to a casadi.Function and compiled as C; Newton's
method in daceypy's truncated polynomials (where installed). Error and memory by order, times as ratios of one run.
Twelve variables instead of two: `taylor_variables.py`.

Run: python studies/taylor_cost.py [--size small] [--out DIR]
"""

import resource
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import casadi as ca
import numpy as np
from shared.running import run_study

import flexlin as fl
from flexlin.mechanics.closure import five_bar
from flexlin.series import c_code

LOOP, INVERSE = five_bar(0.25, (0.3, 0.4), (0.3, 0.4)), (4, 5)
S0 = LOOP.close([2.3, -1.6, 0.8, 1.6, 0.125, 0.45], INVERSE)
V0, U0, DU = S0[:4], S0[4:], np.array([0.03, -0.04])
HARNESS = """
#include <stdio.h>
#include <time.h>
int %(name)s(const double** arg, double** res, long long int* iw, double* w, int mem);
int main(void) {
  static double x[] = {%(values)s}, res[%(rows)d], w[%(work)d];
  const double* arg[] = {%(pointers)s}; double* out[] = {res}; long long int iw[8]; struct timespec a, b; double best = 1e9;
  for (int j = 0; j < 20; ++j) {
    clock_gettime(CLOCK_MONOTONIC, &a);
    for (int i = 0; i < 20000; ++i) %(name)s(arg, out, iw, w, 0);
    clock_gettime(CLOCK_MONOTONIC, &b);
    double t = ((b.tv_sec - a.tv_sec) + 1e-9 * (b.tv_nsec - a.tv_nsec)) / 20000;
    if (t < best) best = t;
  }
  printf("%%.9g\\n", best);
  for (int i = 0; i < %(rows)d; ++i) printf("%%.17g\\n", res[i]);
  return 0;
}
"""
Prepared = tuple[Callable[[], float], np.ndarray]
"""What a route builds: a call that returns the seconds of one evaluation, and v(u0 + du)."""


@dataclass(frozen=True)
class Cost:
    """One route at one order: seconds to build and to evaluate, bytes the process grew by, error of v(u0 + du) in rad."""

    route: str
    order: int
    build: float
    evaluate: float
    bytes: int
    error: float


def best_time(call: Callable[[], object], budget: float = 0.3) -> float:
    """Return the shortest time of one call among as many as fit into the budget."""
    times, end = [], time.perf_counter() + budget
    while not times or time.perf_counter() < end:
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return min(times)


def by_map(function: ca.Function, *arguments: np.ndarray) -> Prepared:
    """Time a casadi.Function, evaluated 1000 times in one call so that Python's part is not counted."""
    many, inputs = function.map(1000), [ca.repmat(ca.DM(a), 1, 1000) for a in arguments]
    return lambda: best_time(lambda: many(*inputs)) / 1000, np.array(function(*arguments)).ravel()


def by_c(function: ca.Function, *arguments: np.ndarray) -> Prepared:
    """Time a casadi.Function compiled by gcc, called from C; the caller cannot be inlined."""
    offsets = np.cumsum([0] + [len(a) for a in arguments[:-1]])
    facts = {
        "name": function.name(),
        "values": ", ".join(map(repr, np.concatenate(arguments).tolist())),
        "rows": function.numel_out(0),
        "work": function.sz_w() + 1,
        "pointers": ", ".join(f"x + {offset}" for offset in offsets),
    }
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "f.c").write_text(c_code(function))
        Path(folder, "main.c").write_text(HARNESS % facts)
        subprocess.run(["gcc", "-O2", "-w", "f.c", "main.c", "-o", "f", "-lm"], cwd=folder, check=True)
        lines = subprocess.run([Path(folder, "f")], capture_output=True, text=True, check=True).stdout.split()
    return lambda: float(lines[0]), np.array(lines[1:], dtype=float)


def nested_function(order: int) -> ca.Function:
    """C_1 = -V^-1 U, C_(k+1) = D_u C_k + D_v C_k (E (x) C_1), symbolic."""
    f, u, v = LOOP.equations(INVERSE)
    C = [-ca.solve(ca.jacobian(f, v), ca.jacobian(f, u))]
    for _ in range(1, order):
        inner = fl.kronecker.chain_rule(fl.kronecker.derivative(C[-1], v), C[0])
        C.append(fl.kronecker.derivative(C[-1], u) + inner)
    terms = [
        V0,
        *[fl.kronecker.kronecker_power(DU[:, None], k) / np.prod(np.arange(1.0, k + 1)) for k in range(1, order + 1)],
    ]
    return ca.Function("nested", [u, v], [terms[0] + sum(Ck @ term for Ck, term in zip(C, terms[1:], strict=True))])


def nested_jacobians(order: int) -> Prepared:
    return by_map(nested_function(order), U0, V0)


def rootfinder(order: int) -> Prepared:
    """Derivatives of CasADi's own implicit function, in the direction du only."""
    f, u, v = LOOP.equations(INVERSE)
    solver = ca.rootfinder("solver", "newton", {"x": v, "p": u, "g": f}, {"abstol": 1e-13})
    t = ca.MX.sym("t")
    derivatives = [solver(x0=V0, p=U0 + t * DU)["x"]]
    for _ in range(order):
        derivatives.append(ca.jacobian(derivatives[-1], t))
    factors = 1 / np.cumprod(np.maximum(1, np.arange(order + 1.0)))
    total = sum(factor * d for factor, d in zip(factors, derivatives, strict=True))
    function = ca.Function("rootfinder", [t], [total])
    return lambda: best_time(lambda: function(0.0)), np.array(function(0.0)).ravel()


def series_in_numbers(order: int) -> Prepared:
    equations = LOOP.equations(INVERSE)
    return lambda: best_time(lambda: fl.implicit_taylor(*equations, U0, V0, order)), LOOP.taylor(S0, INVERSE, order)(DU)


def series_unrolled(order: int) -> Prepared:
    return by_map(LOOP.taylor(S0, INVERSE, order).moving, U0, V0, DU)


def series_in_c(order: int) -> Prepared:
    return by_c(LOOP.taylor(S0, INVERSE, order).moving, U0, V0, DU)


def fixed_point_map(order: int) -> Prepared:
    return by_map(LOOP.taylor(S0, INVERSE, order).function(), DU)


def fixed_point_map_in_c(order: int) -> Prepared:
    return by_c(LOOP.taylor(S0, INVERSE, order).function(), DU)


def daceypy_newton(order: int) -> Prepared:
    """Newton's method on truncated polynomials in two variables, with the constant V."""
    from daceypy import DA

    DA.init(order, 2)
    f, u, v = LOOP.equations(INVERSE)
    W = np.linalg.inv(np.array(ca.Function("V", [u, v], [ca.jacobian(f, v)])(U0, V0)))

    def arms(q: list) -> list:
        sides = []
        for origin, (i, j) in ((0.0, (0, 1)), (0.25, (2, 3))):
            both = q[i] + q[j]
            sides += [origin + 0.3 * q[i].cos() + 0.4 * both.cos(), 0.3 * q[i].sin() + 0.4 * both.sin()]
        return sides

    def expand() -> list:
        x = [U0[0] + DA(1), U0[1] + DA(2)]
        q = [DA(1) * 0 + value for value in V0]
        for _ in range(order):
            gap = [x[i % 2] - tip for i, tip in enumerate(arms(q))]
            q = [q[i] - sum(W[i, j] * gap[j] for j in range(4)) for i in range(4)]
        return q

    return lambda: best_time(expand), np.array([one.eval(DU) for one in expand()]).ravel()


ROUTES: dict[str, tuple[Callable[[int], Prepared], int]] = {
    "nested CasADi": (nested_jacobians, 6),
    "CasADi rootfinder": (rootfinder, 4),
    "daceypy": (daceypy_newton, 8),
    "series, numbers": (series_in_numbers, 8),
    "series, casadi.Function": (series_unrolled, 8),
    "series, C": (series_in_c, 8),
    "fixed point, casadi.Function": (fixed_point_map, 8),
    "fixed point, C": (fixed_point_map_in_c, 8),
}
"""Each route with the highest order that it is asked for."""


def measure(route: str, order: int) -> Cost:
    """Run one route at one order; build is everything but the timing loop (for C: code, gcc and one run)."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.perf_counter()
    evaluate, value = ROUTES[route][0](order)
    build = time.perf_counter() - begin
    grown = 1024 * (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)
    exact = LOOP.taylor(S0, INVERSE, 1).refined(DU)
    return Cost(route, order, build, evaluate(), grown, float(np.linalg.norm(value - exact)))


def available(route: str) -> bool:
    """Return whether this machine has what a route needs."""
    if route == "daceypy":
        from importlib.util import find_spec

        return find_spec("daceypy") is not None
    return not route.endswith(" C") or shutil.which("gcc") is not None


def main(size: str = "full", out: Path | None = None) -> list[Cost]:
    """Measure all routes; `full` runs each in a process of its own, so that memory is its own too."""
    routes = [route for route in ROUTES if available(route)]
    if size == "small":
        costs = [measure(route, 3) for route in routes]
    else:
        costs = []
        for route in routes:
            for order in (1, 2, 3, 4, 5, 6, 8):
                if order <= ROUTES[route][1]:
                    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
                        costs.append(pool.submit(measure, route, order).result())
    if out is not None:
        draw(costs, Path(out))
    return costs


def draw(costs: list[Cost], out: Path) -> None:
    """Draw error against time and against memory."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 5.5), layout="constrained")
    axes = figure.subplots(1, 2, sharey=True)
    for route in dict.fromkeys(cost.route for cost in costs):
        mine = [cost for cost in costs if cost.route == route]
        errors = [cost.error for cost in mine]
        axes[0].loglog([cost.evaluate for cost in mine], errors, "o-", label=route)
        axes[1].loglog([max(cost.bytes, 4096) for cost in mine], errors, "o-", label=route)
    axes[0].set(xlabel="seconds for one evaluation", ylabel="error of v in rad at |du| = 0.05 m")
    axes[1].set(xlabel="bytes the process grew by, building included")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    figure.savefig(out / "taylor_cost.png", dpi=110)


if __name__ == "__main__":
    answer = run_study(main)
    reference = {cost.order: cost.evaluate for cost in answer if cost.route == "series, casadi.Function"}
    print(f"{'route':30s} order   build s    evaluate us   ratio      MB       error")
    for cost in answer:
        numbers = f"{cost.build:9.3f} {1e6 * cost.evaluate:14.3f} {cost.evaluate / reference[cost.order]:7.2f}"
        print(f"{cost.route:30s} {cost.order:5d} {numbers} {cost.bytes / 1e6:8.1f}  {cost.error:.2e}")
