"""The example in docs/taylor.md runs as it is printed, and means what it says."""

import re
from pathlib import Path

import numpy as np
import pytest

DOCS = Path(__file__).parents[2] / "docs" / "taylor.md"


def test_example():
    (example,) = re.findall(r"```python\n(.*?)```", DOCS.read_text(encoding="utf-8"), re.DOTALL)
    names = {}
    exec(compile(example, str(DOCS), "exec"), names)
    c, du = names["c"], np.array([0.05, -0.02])
    assert c.error(du) == pytest.approx(np.linalg.norm(c(du) - c.refined(du)), rel=0.05)
    assert names["r"].kind == "real singularity"
    u0 = names["u0"]
    assert float(names["r"]) == pytest.approx(
        np.sqrt(4 - u0[1] ** 2) - u0[0], abs=1e-9
    )  # the arm is stretched at |u| = 2
