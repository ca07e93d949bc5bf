"""Tables and numbers as the pages write them."""


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def duration(milliseconds: float) -> str:
    """A time in words, with two digits."""
    unit, scale = ("us", 1e3) if milliseconds < 0.1 else ("ms", 1.0) if milliseconds < 1000 else ("s", 1e-3)
    return f"{two_digits(scale * milliseconds)} {unit}"


def two_digits(value: float) -> str:
    """A number rounded to two digits, without an exponent where it is large."""
    return f"{float(f'{value:.2g}'):.10g}"
