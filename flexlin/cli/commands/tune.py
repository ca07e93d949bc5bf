"""`flexlin tune`: find the gains that make the slowest decay over all scenarios as fast as possible."""

import argparse
from functools import partial

from flexlin.cli.options import LIMITS, SCENE
from flexlin.cli.shared import loaded, print_paths
from flexlin.errors import ArgumentError

PURPOSE = "find the gains that decay fastest in all scenarios"
TAKES = (*SCENE, *LIMITS, "vary", "gain")
USUAL = 600.0
"""Limit in s where nobody states one: a search over many scenarios takes minutes."""
USED = 0.9
"""Share of the time that the search plans with: a spectrum may take longer than those before it."""


def run(options: argparse.Namespace) -> int:
    scene = loaded(options, USUAL)
    spans = [*options.vary, *options.gain]
    if len({key for key, *_ in spans}) < len(spans):
        raise ArgumentError("a number is named twice", got=", ".join(key for key, *_ in spans), expected="each once")
    from flexlin.report.progress import Progress

    with Progress() as progress:
        progress("load the numerical libraries")
        from flexlin.answers.clock import Budget, Clock
        from flexlin.answers.tuning.tune import tune
        from flexlin.files import results
        from flexlin.report.terminal import say
        from flexlin.scene.revised import raw_tables
        from flexlin.scene.toml import write_toml

        limits = {key: (low, high) for key, low, high, _ in options.gain}
        vary = {key: (low, high) for key, low, high, _ in options.vary}
        clock, name = Clock(progress, budget=Budget(options.watch)), "tune the gains"
        seconds = USED * clock.budget.allow(name, scene.accuracy).seconds
        work = partial(tune, scene, list(limits) or None, vary, limits, seconds=seconds)
        found = clock.stage(name, scene.accuracy, work)
    say(f"{scene.title}: {found.status}")
    for path, value in found.gains.items():
        say(f"  {path} = {value:.6g}")
    for one in found.active[:6]:
        place = ", ".join(f"{path} = {value:.4g}" for path, value in one.scenario.items())
        say(f"  active: {one.exponent.real:.6g} {one.exponent.imag:+.6g}i 1/s at {place}")
    with results(options.out, "tune") as made:
        assert found.scene is not None
        (made / "tuned.toml").write_text(write_toml(raw_tables(found.scene)), encoding="utf-8")
    return print_paths(made.placed("tuned.toml"))
