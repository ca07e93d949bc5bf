"""The texts of exported sources, in C and MATLAB: files in which $name stands for what is filled in."""

from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from string import Template


def fill_in(name: str, words: Mapping[str, object]) -> str:
    """The text of a template of this folder with its words; one that is not given is a KeyError."""
    return read_template(name).substitute(words)


@cache
def read_template(name: str) -> Template:
    """A template as it stands in this folder."""
    return Template(files(__name__).joinpath(name).read_text(encoding="utf-8"))
