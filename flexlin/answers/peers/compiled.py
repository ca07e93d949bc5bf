"""CasADi functions as machine code, for integrators that call one point after another."""

import shutil
import subprocess
import tempfile
from pathlib import Path

import casadi as ca


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
