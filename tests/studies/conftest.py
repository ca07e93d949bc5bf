"""Studies are scripts: load one by its file name; look at what they draw instead of at the size of a file."""

import importlib.util
import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

STUDIES = Path(__file__).parents[2] / "studies"
sys.path.append(str(STUDIES))  # as for a script that is run there


@cache
def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"study_{name}", STUDIES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def study() -> Callable[[str], ModuleType]:
    return load


class Pictures(dict):
    """The figures that were saved, by file name; none is rendered, but their formulas are parsed."""

    def keep(self, figure, path, **_) -> None:
        from matplotlib.mathtext import MathTextParser
        from matplotlib.text import Text

        for text in figure.findobj(Text):
            if "$" in text.get_text():
                MathTextParser("path").parse(text.get_text())
        self[Path(path).name] = figure

    def curves(self, name: str, panel: int = 0) -> dict[str, np.ndarray]:
        """The points (2, N) of each curve with a label; panels in the order of their making, each with labelled axes."""
        axes = self[name].axes[panel]
        assert axes.get_title() or axes.get_ylabel()
        return {line.get_label(): np.array(line.get_data(), dtype=float) for line in axes.lines}

    def compare(self, name: str, panel: int, known: dict[str, list]) -> None:
        """Whether these curves of a panel show what is known."""
        for label, points in known.items():
            np.testing.assert_array_equal(self.curves(name, panel)[label], points)


@pytest.fixture(scope="module")
def pictures() -> Iterator[Pictures]:
    """What a study would save."""
    drawn = Pictures()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("matplotlib.figure.Figure.savefig", lambda figure, path, **_: drawn.keep(figure, path))
        yield drawn
