"""The texts of exported sources, in C and MATLAB: files in which $name stands for what is filled in."""

from collections.abc import Mapping
from importlib.resources import files
from string import Template


def fill_in(name: str, words: Mapping[str, object]) -> str:
    """The text of a template of this folder with its words; one that is not given is a KeyError."""
    return Template(files(__name__).joinpath(name).read_text(encoding="utf-8")).substitute(words)
