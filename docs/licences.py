"""The licences of what flexlin stands on, from the packages' own metadata, for docs/licences.md; the build of the site writes the table."""

import re
import tomllib
from importlib import metadata
from pathlib import Path

ROOT = Path(__file__).parents[1]
ABSENT = {
    "colorama": "BSD-3-Clause",
    "editables": "MIT",
    "hatchling": "MIT",
    "msgspec": "BSD-3-Clause",
    "tomlkit": "MIT",
    "trove-classifiers": "Apache-2.0",
}
"""Packages of the lock that this machine may lack: they belong to another system or Python, or build the wheel alone."""
SPDX = {
    "BSD License": "BSD",
    "MIT License": "MIT",
    "Apache Software License": "Apache-2.0",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "PSFL": "PSF-2.0",
    "GNU General Public License (GPL)": "GPL",
}
LGPL = "GNU Lesser General Public License v3"


def locked() -> list[str]:
    """The packages of requirements/lock.txt."""
    lines = (ROOT / "requirements" / "lock.txt").read_text(encoding="utf-8").splitlines()
    return sorted({line.partition("==")[0] for line in lines if re.match(r"[\w.-]+==", line)})


def needed() -> set[str]:
    """The packages without which flexlin does not run: its dependencies, and theirs."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    found, left = set(), [name_of(requirement) for requirement in project["dependencies"]]
    while left:
        name = left.pop()
        if name not in found:
            found.add(name)
            left += [name_of(one) for one in metadata.requires(name) or () if "extra ==" not in one and applies(one)]
    return found & set(locked())


def applies(requirement: str) -> bool:
    """Whether a requirement of a package holds on this machine."""
    from packaging.requirements import Requirement

    marker = Requirement(requirement).marker
    return marker is None or marker.evaluate()


def name_of(requirement: str) -> str:
    """The package that a requirement asks for, as lock files spell it."""
    return re.sub(r"[-_.]+", "-", re.match(r"[\w.-]+", requirement)[0]).lower()


def licence_of(name: str) -> str:
    """The licence that a package states, in SPDX terms where it states one."""
    try:
        about = metadata.metadata(name)
    except metadata.PackageNotFoundError:
        return ABSENT[name]
    stated = about.get("License-Expression")
    text = (about.get("License") or "").strip()
    classes = [line.rpartition(" :: ")[2] for line in about.get_all("Classifier", []) if line.startswith("License")]
    if stated:
        return stated
    if text.startswith(LGPL):
        return "LGPL-3.0-or-later"
    known = [SPDX[one] for one in classes if one in SPDX]
    text = SPDX.get(text, text)
    return text if re.fullmatch(r"[\w.-]{3,20}", text) else ", ".join(known) or text.splitlines()[0]


def rows() -> list[list[str]]:
    """Every locked package, those that flexlin runs on first."""
    runs = needed()
    return [
        [name, licence_of(name), "to run" if name in runs else "to develop"]
        for name in sorted(locked(), key=lambda n: (n not in runs, n))
    ]
