"""CasADi functions as machine code, for integrators that call one point after another."""

import shutil
import subprocess
import tempfile
from functools import lru_cache
from pathlib import Path

import casadi as ca

from flexlin.linearization.free import ParametricLoop
from outside.scipy_ode import derive_product


def compile_function(function: ca.Function) -> ca.Function | None:
    """The function as C with its Jacobian, compiled with optimization and loaded; None where there is no C compiler."""
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        return None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        code = ca.CodeGenerator(f"{function.name()}.c")
        code.add(function)
        code.add(function.jacobian())  # found by its name when a derivative of the loaded function is asked for
        source, library = code.generate(f"{folder}/"), str(Path(folder) / f"{function.name()}.so")
        subprocess.run([compiler, "-O2", "-w", "-shared", "-fPIC", source, "-o", library], check=True)
        return ca.external(function.name(), library)


@lru_cache(maxsize=4)
def compile_product(loop: ParametricLoop) -> ca.Function:
    """(phase, columns of X, p) -> the columns of T A X as machine code where there is a compiler, kept for all tolerances."""
    product = derive_product(loop)
    return compile_function(product) or product
