"""CasADi functions that are built when they are first asked for."""

from collections.abc import Callable, Iterator, Mapping

import casadi as ca


class NamedFunctions(Mapping[str, ca.Function]):
    """CasADi functions by name, from (named inputs, maker of the output), each built at its first use."""

    def __init__(self, table: dict[str, tuple[dict[str, ca.SX], Callable[[], ca.SX]]]):
        self._table, self._built = table, dict[str, ca.Function]()

    def __getitem__(self, name: str) -> ca.Function:
        if name not in self._built:
            inputs, output = self._table[name]
            self._built[name] = ca.Function(name, list(inputs.values()), [ca.densify(output())], list(inputs), [name])
        return self._built[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._table)

    def __len__(self) -> int:
        return len(self._table)
