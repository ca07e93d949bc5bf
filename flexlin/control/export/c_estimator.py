"""C source of an estimator: its rate, and a step of it between two samples."""

from collections.abc import Sequence
from pathlib import Path

import flexlin
from flexlin.arguments import checked
from flexlin.checks import c_name
from flexlin.control.estimator import Estimator
from flexlin.control.export.c_gain import BEYOND, WITHIN, listed, write_c
from flexlin.control.export.c_series import PRODUCT, SAMPLES, Form, write_series
from flexlin.control.export.files import Labels
from flexlin.errors import ArgumentError
from flexlin.files import results
from flexlin.linearization.linearization import Linearization
from flexlin.periodic.system import MatrixFunction, corners_of

HEADER = """\
/* A Kalman filter, written by flexlin {version}. C99, needs libm only; no memory is allocated.

   {name}_rate(phase, estimate, measurement, torque, rate)    rate = (A - L C) estimate + B torque + L measurement
   {name}_step(phase, step, measurement, torque, estimate)    moves the estimate by step s; measurement and torque are held;
                                                              returns 0, or 1 when the step cannot be made

   phase: t / T with T = {period!r} s at the beginning of the step; {beyond}
   measurement, its deviation from what the rigid motion would give:
{sensors}
   torque, what is added to the feedforward:
{inputs}
   estimate, of the deviation from the rigid motion:
{states}
   A step is made by Gauss collocation with two stages: order 4, and stable however fast a mode decays.
   Largest error of A - L C, B, L against flexlin's, relative to the largest entry: {error:.1e}. */
#ifndef FLEXLIN_{guard}_H
#define FLEXLIN_{guard}_H
#define {guard}_STATES {n}
#define {guard}_INPUTS {m}
#define {guard}_MEASUREMENTS {p}
#define {guard}_PERIOD {period!r}
void {name}_rate(double phase, const double *estimate, const double *measurement, const double *torque, double *rate);
int {name}_step(double phase, double step, const double *measurement, const double *torque, double *estimate);
#endif
"""
SOURCE = """\
#include <math.h>
#include "{name}.h"

enum {{ N = {n}, M = {m}, P = {p} }};

{series}
static double within(double phase) {{ return {within}; }}

/* A - L C at a phase, and what the measurement and the torque add. */
static void parts(double phase, const double *measurement, const double *torque, double *A, double *push) {{
  double B[N * M + 1] = {{0.0}}, L[N * P];
  int i;
  A_of(within(phase), A);
  {read_B}
  L_of(within(phase), L);
  for (i = 0; i < N; ++i) push[i] = 0.0;
  add(N, M, 1.0, B, torque, push);
  add(N, P, 1.0, L, measurement, push);
}}

void {name}_rate(double phase, const double *estimate, const double *measurement, const double *torque, double *rate) {{
  double A[N * N];
  parts(phase, measurement, torque, A, rate);
  add(N, N, 1.0, A, estimate, rate);
}}

/* Solves S k = r (2N unknowns) by elimination with row exchanges; r becomes k. */
static int solve(double S[2 * N][2 * N], double *r) {{
  int i, j, k, pivot;
  double factor, swap;
  for (k = 0; k < 2 * N; ++k) {{
    for (pivot = k, i = k + 1; i < 2 * N; ++i) if (fabs(S[i][k]) > fabs(S[pivot][k])) pivot = i;
    if (!(fabs(S[pivot][k]) > 0.0)) return 1;
    for (j = k; j < 2 * N; ++j) {{ swap = S[k][j]; S[k][j] = S[pivot][j]; S[pivot][j] = swap; }}
    swap = r[k]; r[k] = r[pivot]; r[pivot] = swap;
    for (i = k + 1; i < 2 * N; ++i) {{
      factor = S[i][k] / S[k][k];
      for (j = k; j < 2 * N; ++j) S[i][j] -= factor * S[k][j];
      r[i] -= factor * r[k];
    }}
  }}
  for (k = 2 * N - 1; k >= 0; --k) {{
    for (j = k + 1; j < 2 * N; ++j) r[k] -= S[k][j] * r[j];
    r[k] /= S[k][k];
  }}
  return 0;
}}

int {name}_step(double phase, double step, const double *measurement, const double *torque, double *estimate) {{
  static const double c[2] = {{0.21132486540518711775, 0.78867513459481288225}};
  static const double a[2][2] = {{{{0.25, -0.038675134594812882255}}, {{0.53867513459481288225, 0.25}}}};
  double A[N * N], S[2 * N][2 * N], k[2 * N];
  int s, q, i, j;
  for (s = 0; s < 2; ++s) {{
    parts(phase + c[s] * step / {period!r}, measurement, torque, A, k + N * s);
    add(N, N, 1.0, A, estimate, k + N * s);
    for (q = 0; q < 2; ++q)
      for (i = 0; i < N; ++i)
        for (j = 0; j < N; ++j) S[N * s + i][N * q + j] = (s == q && i == j) - step * a[s][q] * A[N * i + j];
  }}
  if (solve(S, k)) return 1;
  for (i = 0; i < N; ++i) estimate[i] += step * 0.5 * (k[i] + k[N + i]);
  return 0;
}}
"""


@checked
def estimator_source(
    estimator: Estimator,
    folder: str | Path,
    name: str = "estimator",
    samples: int = SAMPLES,
    *,
    lin: Linearization | None = None,
    measurements: Sequence[str] = (),
    form: Form = "series",
) -> list[Path]:
    """Write C source of an estimator: its rate and a step between two samples.

        x_e' = (A - L C) x_e + B u + L measurement

    The files <name>.h, which says order and units, and <name>.c need nothing but a C99 compiler and libm.

    Parameters
    ----------
    estimator : Estimator
        The estimator, of n states, m inputs and p measurements.
    folder : str or Path
        Where the files go, as one set with their checksums; it is made when it does not exist.
    name : str
        Beginning of the names of the functions, and name of the files.
    samples : int
        Samples of a period when the form is "sampled".
    lin : Linearization, optional
        The arm, which gives states and inputs their names and units.
    measurements : sequence of str
        Names and units of the p measurements.
    form : {"series", "sampled"}
        As for `gain_source`.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    ArgumentError
        When the arm or the names do not fit the estimator.
    OutputError
        When the folder cannot be written.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> import flexlin as fl
    >>> system = fl.PeriodicSystem([[0.0, 1.0], [0.0, 0.0]], 1.0, B=[[0.0], [1.0]])
    >>> estimator = fl.control.kalman_filter(system, [[1.0, 0.0]], np.eye(2), np.eye(1))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     print([path.name for path in fl.control.estimator_source(estimator, folder)])
    ['estimator.c', 'estimator.h']
    """
    with results(Path(folder), c_name(name)) as files:
        return files.placed(*write_estimator(estimator, files.stage, name, samples, lin, measurements, form))


def write_estimator(
    estimator: Estimator,
    folder: Path,
    name: str = "estimator",
    samples: int = SAMPLES,
    lin: Linearization | None = None,
    measurements: Sequence[str] = (),
    form: Form = "series",
) -> list[str]:
    """Write `estimator_source` into a folder of a set; returns the names of the files."""
    system = estimator.system
    labels, p = Labels.fitting(lin, system.n, system.m), estimator.L(0.0).shape[1]
    seen = tuple(measurements) or tuple(f"y{i + 1}" for i in range(p))
    if len(seen) != p:
        raise ArgumentError("names do not fit the measurements", got=len(seen), expected=str(p))
    once = lin is not None and not lin.motion.periodic
    functions: dict[str, MatrixFunction] = {"A_of": estimator.closed_loop.A, "L_of": estimator.L}
    if system.B is not None:
        functions["B_of"] = system.B
    breaks = (*corners_of(system), *([0.0] if once else []))
    parts = [write_series(key, f, system.period, breaks, form, samples) for key, f in functions.items()]
    words = {
        "name": name, "guard": name.upper(), "n": system.n, "m": system.m, "p": p, "period": float(system.period),
        "version": flexlin.__version__, "states": listed(labels.states, labels.state_units),
        "inputs": listed(labels.inputs, labels.input_units), "sensors": listed(seen, ("",) * p),
        "series": "\n".join([PRODUCT, *(part.source for part in parts)]), "error": max(part.error for part in parts),
        "read_B": "B_of(within(phase), B);" if system.B is not None else "",
        "within": WITHIN[not once], "beyond": BEYOND[not once],
    }  # fmt: skip
    return write_c(folder, {f"{name}.c": SOURCE, f"{name}.h": HEADER}, words)
