"""What hatchling calls before it packs flexlin: the compiled core is built into flexlin/_core/built, in a checkout as for a wheel."""

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

NO_COMPILER = "flexlin is installed from its sources, and there is no C compiler"
"""What CMakeLists.txt says where there is none."""


class CoreBuild(BuildHookInterface):
    """CMake and Ninja build the core; a wheel of it serves every Python of its platform."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Build, incrementally where it has been built before; CMAKE_ARGS are further arguments of CMake."""
        folder, more = Path(self.root) / "build" / "core", shlex.split(os.environ.get("CMAKE_ARGS", ""))
        run(
            [
                find("cmake"),
                "-S",
                self.root,
                "-B",
                str(folder),
                "-G",
                "Ninja",
                f"-DCMAKE_MAKE_PROGRAM={find('ninja')}",
                *more,
            ]
        )
        run([find("cmake"), "--build", str(folder)])
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["pure_python"] = False
        build_data["tag"] = f"py3-none-{platform}"
        build_data["artifacts"] += [f"/flexlin/_core/built/{path.name}" for path in find_variants(Path(self.root))]


def find_variants(root: Path) -> list[Path]:
    """The variants of the library that users get."""
    return sorted(path for path in (root / "flexlin" / "_core" / "built").glob("*.so") if path.stem != "sanitized")


def find(program: str) -> str:
    """A program beside this Python, or on the path."""
    places = os.pathsep.join([sysconfig.get_path("scripts"), os.environ.get("PATH", os.defpath)])
    return shutil.which(program, path=places) or program


def run(command: list[str]) -> None:
    """Run it; where it fails, say what it said, and first of all whether there is no compiler."""
    try:
        done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        said, failed = done.stdout, done.returncode
    except OSError as error:
        said, failed = str(error), 1
    if failed:
        plain = f"{NO_COMPILER}: install gcc or clang, or a wheel of flexlin."
        sys.exit(plain if NO_COMPILER in " ".join(said.split()) else f"the compiled core cannot be built:\n{said}")
