"""C source of the linearization and of a gain schedule, through CasADi's code generator, with a small program around it."""

from pathlib import Path

import casadi as ca
import numpy as np

from flexlin.about.linearization import Linearization
from flexlin.control.designed_loop import Design
from flexlin.errors import ArgumentError
from flexlin.motion import SymbolicMotion

KNOTS = 256
"""Knots of the gain's cubic spline over a period."""

MAIN = """\
/* Prints every output of a function at a phase in [0, 1): name, then its numbers column by column.
   usage: {name} PHASE */
#include <stdio.h>
#include <stdlib.h>
#include <math.h>
#include "{name}.h"

int main(int argc, char **argv) {{
  casadi_int sz_arg, sz_res, sz_iw, sz_w, i, j;
  double in[{inputs}] = {{0}}, out[{outputs}], phase;
  const double parameters[] = {{{parameters}}};
  if (argc != 2) {{ fprintf(stderr, "usage: %s PHASE\\n", argv[0]); return 2; }}
  phase = atof(argv[1]);
  in[0] = phase - floor(phase);
  for (i = 0; i < {count}; ++i) in[1 + i] = parameters[i];
  {name}_work(&sz_arg, &sz_res, &sz_iw, &sz_w);
  const double **arg = malloc(sz_arg * sizeof(*arg));
  double **res = malloc(sz_res * sizeof(*res)), *w = malloc((sz_w + 1) * sizeof(*w)), *to = out;
  casadi_int *iw = malloc((sz_iw + 1) * sizeof(*iw));
  arg[0] = in;
  if ({name}_n_in() > 1) arg[1] = in + 1;
  for (i = 0; i < {name}_n_out(); ++i) {{ res[i] = to; to += {name}_sparsity_out(i)[0] * {name}_sparsity_out(i)[1]; }}
  if ({name}(arg, res, iw, w, 0)) return 1;
  for (i = 0; i < {name}_n_out(); ++i) {{
    printf("%s", {name}_name_out(i));
    for (j = 0; j < {name}_sparsity_out(i)[0] * {name}_sparsity_out(i)[1]; ++j) printf(" %.17g", res[i][j]);
    printf("\\n");
  }}
  free(arg); free(res); free(w); free(iw);
  return 0;
}}
"""


def linearization_source(lin: Linearization, folder: str | Path, name: str = "linearization") -> list[Path]:
    """Write C source that evaluates M_L, D_L, K_L, h_L, B_L and the rigid torque at a phase of the motion.

    Files: <name>.c and <name>.h by CasADi, main.c a program `main PHASE` that prints the matrices column by column. They need
    nothing but a C99 compiler and libm:  cc <name>.c main.c -lm
    Parameters: lin: of a motion given by a formula.
    Returns: the paths. Raises: ArgumentError for a motion that is given by numbers.
    """
    if not isinstance(lin.motion, SymbolicMotion):
        raise ArgumentError("a motion given by numbers has no formula to write", expected="another kind of motion")
    return _write(lin.coefficients, np.asarray(lin.arm.parameters.values, dtype=float), Path(folder), name)


def gain_source(made: Design, period: float, folder: str | Path, name: str = "gain", knots: int = KNOTS) -> list[Path]:
    """Write C source of the gain K (m, n) at a phase of the motion: a cubic spline through equally spaced knots.

    Files and use as of `linearization_source`. The spline's error falls with the fourth power of the knots' distance.
    """
    margin = 4
    phase = np.arange(-margin, knots + margin + 1) / knots
    gains = made.K(np.mod(phase, 1.0) * period)
    shape = gains.shape[1:]
    table = gains.transpose(0, 2, 1).reshape(len(phase), -1)
    spline = ca.interpolant("K", "bspline", [phase.tolist()], table.ravel().tolist(), {"inline": False})
    where = ca.MX.sym("phase")
    K = ca.reshape(spline(where), shape[0], shape[1])
    return _write(ca.Function(name, [where], [ca.densify(K)], ["phase"], ["K"]), np.zeros(0), Path(folder), name)


def _write(function: ca.Function, parameters: np.ndarray, folder: Path, name: str) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    inputs = function.mx_in()
    named = ca.Function(name, inputs, function.call(inputs), function.name_in(), function.name_out())
    generator = ca.CodeGenerator(f"{name}.c", {"with_header": True})
    generator.add(named)
    generator.generate(str(folder) + "/")
    values = ", ".join(repr(float(value)) for value in parameters) or "0"
    main = MAIN.format(
        name=name,
        inputs=1 + max(1, len(parameters)),
        outputs=sum(function.numel_out(i) for i in range(function.n_out())),
        parameters=values,
        count=len(parameters),
    )
    (folder / "main.c").write_text(main)
    return [folder / f"{name}.c", folder / f"{name}.h", folder / "main.c"]
