"""The examples of docs/control.md, run one after the other; what they print is what the page says."""

import io
import re
from contextlib import redirect_stdout
from pathlib import Path

import pytest

PAGE = Path(__file__).parents[2] / "docs" / "control.md"


@pytest.mark.slow
def test_examples_print_what_the_page_says():
    code = "\n".join(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.S))
    expected = re.findall(r"# -> (.*)", code)
    said = io.StringIO()
    with redirect_stdout(said):
        exec(compile(code, str(PAGE), "exec"), {})
    assert said.getvalue().split() == " ".join(expected).split()
    assert len(expected) == 12
