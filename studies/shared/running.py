"""The command line of a study, and the time that a call takes."""

import argparse
from collections.abc import Callable, Iterable
from pathlib import Path
from time import process_time
from typing import Any


def run_study(
    main: Callable[..., Any], small: str = "few cases", sizes: Iterable[str] = ("full", "small"), **more: Any
) -> Any:
    """Call a study's main with what its user asks for: --size, --out, and `more` options by name, as argparse takes them."""
    about = main.__globals__["__doc__"]
    parser = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", choices=list(sizes), default="full", help=f"small: {small}")
    parser.add_argument("--out", type=Path, default=Path("out/studies"), help="folder for what it finds and draws")
    for name, options in more.items():
        parser.add_argument(f"--{name}", **options)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    return main(**vars(asked))


def least_time(call: Callable[[], Any], repeats: int, enough: float = 1.0) -> tuple[Any, float]:
    """The result and the least CPU time in s of some calls, fewer where all together take `enough` seconds."""
    times: list[float] = []
    while len(times) < repeats and sum(times) < enough:
        begin = process_time()
        result = call()
        times.append(process_time() - begin)
    return result, min(times)
