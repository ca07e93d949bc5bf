"""The root of all errors, and the one for requests without measure."""

from typing import Any


class FlexlinError(Exception):
    """The root of all errors that flexlin raises on purpose.

    The message reads: what happened; got ..., expected ...; what to do.

    Parameters
    ----------
    what : str
        What happened.
    got : object, optional
        What was given or found.
    expected : str, optional
        What was expected.
    todo : str, optional
        What to do about it.

    Examples
    --------
    >>> from flexlin.errors import FlexlinError, InputError, NumericalError
    >>> print(FlexlinError("the gain does not fit", got=(1, 2), expected="(1, 4)", todo="give one entry for each state"))
    the gain does not fit; got (1, 2), expected (1, 4); give one entry for each state
    >>> issubclass(InputError, ValueError), issubclass(NumericalError, ArithmeticError)
    (True, True)
    """

    def __init__(self, what: str, *, got: object = None, expected: str | None = None, todo: str | None = None):
        self.what, self.got, self.expected, self.todo = what, got, expected, todo
        parts = [what]
        if got is not None or expected is not None:
            facts = [f"got {got}"] if got is not None else []
            facts += [f"expected {expected}"] if expected is not None else []
            parts.append(", ".join(facts))
        if todo is not None:
            parts.append(todo)
        super().__init__("; ".join(parts))

    def __reduce__(self) -> tuple[Any, ...]:
        return restore_error, (type(self), str(self), vars(self))


def restore_error(kind: type[FlexlinError], message: str, facts: dict[str, Any]) -> FlexlinError:
    """An error as it was in another process, whatever its class is made from."""
    base: Any = kind.__base__  # kind's own __new__ may be MemoryError's, which makes no other class
    error: FlexlinError = base.__new__(kind, message)
    vars(error).update(facts)
    return error


class TooLarge(FlexlinError, MemoryError):
    """A request whose size in bytes would be unreasonable; nothing was allocated.

    Examples
    --------
    >>> import flexlin as fl
    >>> scene = fl.load_scene("single-link")
    >>> lin = fl.linearize(fl.build_manipulator(scene), scene.motion, scene.control)
    >>> fl.simulate(lin, periods=1e9)
    Traceback (most recent call last):
        ...
    flexlin.errors.TooLarge: a simulation of 1e+09 periods is too large...
    """


NO_MEMORY = (
    "std::bad_alloc",
    "failed to map segment",
    "Cannot allocate memory",
    "can't start new thread",
    "Unable to allocate",
)
"""How libraries say that there is no memory, in errors of other kinds."""


def lacks_memory(error: BaseException) -> bool:
    """Whether an error is due to memory that gave out, by its kind or by its words; so are those that came of it."""
    known = list[BaseException]()
    while error not in known:
        known.append(error)
        error = error.__cause__ or error.__context__ or error
    return any(isinstance(one, MemoryError) or any(words in str(one) for words in NO_MEMORY) for one in known)
