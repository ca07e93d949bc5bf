"""What the tables of a scene say about their keys: the docstrings below them, read only where somebody asks for the schema."""

import ast
import inspect
import textwrap
from collections.abc import Iterator
from functools import cache
from itertools import pairwise
from typing import Any

from pydantic import BaseModel

from flexlin.scene.base import Table


def describe_keys(schema: dict[str, Any], table: type[BaseModel]) -> None:
    """Put into a table's JSON schema and its definitions what the tables say about their keys, where nothing is said yet."""
    known: dict[str, type[BaseModel]] = {one.__name__: one for one in list_tables(Table)}
    nodes = [(table, schema), *((known.get(name), node) for name, node in schema.get("$defs", {}).items())]
    for kind, node in nodes:
        if kind is None:
            continue
        said, keys = read_key_docs(kind), node.get("properties", {})
        for name, field in kind.model_fields.items():
            key = field.alias or name
            if name in said and key in keys:
                keys[key].setdefault("description", said[name])


def list_tables(base: type[Table]) -> Iterator[type[Table]]:
    """All kinds of tables that are known."""
    for table in base.__subclasses__():
        yield table
        yield from list_tables(table)


@cache
def read_key_docs(table: type[BaseModel]) -> dict[str, str]:
    """The docstring below each key of a table and of the tables that it extends; none where there is no source."""
    said: dict[str, str] = {}
    for kind in reversed(table.__mro__[: table.__mro__.index(BaseModel)]):
        try:
            tree = ast.parse(textwrap.dedent(inspect.getsource(kind)))
        except (OSError, TypeError, SyntaxError):
            continue
        body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
        for key, below in pairwise(body):
            if isinstance(key, ast.AnnAssign) and isinstance(key.target, ast.Name) and isinstance(below, ast.Expr):
                text = below.value.value if isinstance(below.value, ast.Constant) else None
                said |= {key.target.id: inspect.cleandoc(text)} if isinstance(text, str) else {}
    return said
