"""What a control engineer should do with the result."""

import numpy as np

from flexlin.answers.analysis import Analysis, Loop
from flexlin.report.wording import caution, format_quantity
from flexlin.simulation import Simulation

NEAR = 0.2
"""A resonance is named when it is detuned by less than this share of the motion's frequency."""
NEGLIGIBLE, SMALL = 1e-5, 0.2
"""Shares of the arm's length: the first is of the order in which good arms repeat a motion (some 0.01 mm for 1 m, ISO 9283), so that
nothing is gained below it; beyond the second a deflection is not small."""
BEYOND = 0.2
"""A share of the largest deviation by which the linear answer may miss."""
WORTHWHILE = 1.05
"""A design counts as faster when it settles this many times as fast as the scene's own loop."""


def advise(analysis: Analysis) -> list[str]:
    """What to do, most urgent first."""
    return [
        *comment_on_verdict(analysis),
        *comment_on_elastic_motion(analysis),
        *comment_on_designs(analysis),
        *comment_on_tip(analysis),
        *comment_on_trust(analysis),
    ]


def comment_on_verdict(a: Analysis) -> list[str]:
    """What the verdict on the own loop asks for."""
    if a.own.floquet is None:
        return [f"There is no verdict {name_condition(a.own)}: {a.own.problem}."]
    if a.own.verdict == "undecided":
        return [
            "The growth rate cannot be distinguished from zero, as for a mode that is free or undamped: "
            "add feedback or damping, or treat the motion as marginal."
        ]
    if a.own.verdict == "stable":
        return comment_on_slowness(a)
    better = [loop for loop in a.designs if loop.verdict == "stable"]
    change = "add feedback" if a.own.kind == "open" else "change its gains"
    remedy = (
        f"use the design “{better[0].name}”, which is" if better else f"{change}, the speed or the payload until it is"
    )
    return [f"The arm is unstable along this motion {name_condition(a.own)}: {remedy} stable.", *comment_on_cause(a)]


def comment_on_slowness(a: Analysis) -> list[str]:
    """What a decay asks for that is too slow to be felt."""
    weak = caution(a.own, a.plant.period)
    if not weak:
        return []
    add = "feedback or damping" if a.own.kind == "open" else "damping, or gain on the mode that is slow"
    return [
        f"The arm is stable only in the mathematical sense, {weak}: add {add}, and do not count on this verdict as a margin."
    ]


def comment_on_cause(a: Analysis) -> list[str]:
    """The resonances behind an instability, as far as they are clear."""
    base = 1 / a.plant.period
    clear = [
        r
        for r in a.resonances
        if r.kind != "average" and r.detuning < NEAR * 2 * np.pi * base and min(r.frequencies) > 0
    ]
    advice = []
    for resonance in clear:
        high, low = (f"{w / (2 * np.pi):.4g}" for w in resonance.frequencies)
        rule = {"principal": f"2 × {high}", "sum": f"{high} + {low}", "difference": f"{high} − {low}"}[resonance.kind]
        advice.append(
            f"Behind it is a parametric resonance: {rule} Hz of the averaged arm is near {resonance.order} × {base:.4g} Hz of the motion. "
            "Move the motion's frequency or the natural frequencies apart, or add damping."
        )
    return advice


def comment_on_elastic_motion(a: Analysis) -> list[str]:
    """How much the verdict moves when the loop is linearized about the elastic motion."""
    if a.elastic is None or a.elastic.floquet is None:
        return []
    (rigid, _), (elastic, _) = a.own.growth, a.elastic.growth
    moved = f"moves the growth rate from {rigid:.4g} to {elastic:.4g} 1/s"
    same = a.elastic.verdict == a.own.verdict
    trust = "the verdict stands" if same else f"the verdict becomes {a.elastic.verdict}: believe this one"
    return [f"Linearizing about the elastic motion instead of the rigid one {moved}; {trust}."]


def comment_on_designs(a: Analysis) -> list[str]:
    """Which designed controller is worth a try, and which is not."""
    said = [warn_of_design(loop) for loop in a.designs if loop.verdict != "stable"]
    stable = [loop for loop in a.designs if loop.verdict == "stable"]
    if not stable or a.own.verdict != "stable":
        return said
    best = min(stable, key=lambda loop: loop.growth[0])
    gain = best.growth[0] / a.own.growth[0]
    if gain > WORTHWHILE:
        return [
            *said,
            f"The design “{best.name}” settles {gain:.3g} times as fast as {name_loop(a.own)}: "
            "compare its gains with what the drive allows.",
        ]
    return [*said, f"No design settles faster than {name_loop(a.own)}: change the weights, or keep the loop you have."]


def name_loop(loop: Loop) -> str:
    """A loop within a sentence."""
    return "the arm without feedback" if loop.kind == "open" else f"the {loop.name}"


def name_condition(loop: Loop) -> str:
    """The words for a loop behind a verdict."""
    return "without feedback" if loop.kind == "open" else f"under the {loop.name}"


def warn_of_design(loop: Loop) -> str:
    """Why a design should not be used."""
    if loop.floquet is None:
        return f"The design “{loop.name}” has no answer: {loop.problem}."
    return f"The design “{loop.name}” is {loop.verdict} along this motion: do not use it as it is."


def comment_on_tip(a: Analysis) -> list[str]:
    """Where the steady tip error comes from, and what lowers it, if it is worth lowering."""
    if a.response is None:
        return [f"There is no periodic response: {a.problems['response']}."]
    if a.own.verdict == "unstable":
        return ["The periodic response shown here exists but is unstable: the arm leaves it."]
    largest, length = float(a.response.tip_error.max()), arm_length(a)
    if not np.isfinite(largest) or largest == 0:
        return []
    if largest <= NEGLIGIBLE * length:
        return [
            f"In steady motion the tip stays within {format_quantity(largest, 'm')} of its rigid path: nothing has to be done about it."
        ]
    if largest > SMALL * length:
        share = f"{100 * largest / length:.3g} % of the arm's length"
        return [
            f"The linear answer puts the tip {format_quantity(largest, 'm')} away from its rigid path, {share}: "
            "deflections are not small, so this is no prediction; slow down, stiffen the links, or raise the gains."
        ]
    found = f"In steady motion the tip stays up to {format_quantity(largest, 'm')} away from its rigid path"
    if not a.plant.inputs:
        return [f"{found}, by bending alone: slow down, or stiffen the links."]
    if np.linalg.norm(a.response.tip_by_bending, axis=1).max() > largest / 2:
        return [
            f"{found}, most of it the links' bending, which no joint feedback removes: slow down, or feed forward the elastic motion too "
            "(flexlin.control.feedforward: joint-exact, tip-exact)."
        ]
    return [f"{found}, most of it the joints' error: {joint_remedy(a)}."]


def joint_remedy(a: Analysis) -> str:
    """What lowers the joints' error: what the scene does already is no advice."""
    gains = "add feedback" if a.own.kind == "open" else "raise the gains"
    if a.scene.control.feedforward == "none":
        return f'feed the rigid torque forward (control.feedforward = "rigid"), or {gains}'
    return f"{gains}, or feed forward the elastic motion too (flexlin.control.feedforward: joint-exact, tip-exact)"


def arm_length(a: Analysis) -> float:
    """The length of the arm from the base over its joints to the tip, in m, as the motion begins; not a number where it has no points."""
    if a.arm.points is None:
        return float("nan")
    points = a.plant.about.of_arm("points", a.t[:1], np.zeros((1, a.plant.n)))[0]
    return float(np.linalg.norm(np.diff(points, axis=1), axis=0).sum())


def comment_on_trust(a: Analysis) -> list[str]:
    """How far the linear numbers can be trusted."""
    said = [] if a.linear_range is None else [a.linear_range.status]
    if a.simulation is None:
        return [f"The nonlinear simulation has no answer: {a.problems['simulation']}.", *map(sentence, said)]
    return [sentence(status) for status in (agreement(a, a.simulation), *said)]


def agreement(a: Analysis, simulation: Simulation) -> str:
    """How far the linear answer is from the nonlinear one on this motion."""
    what, apart, largest, error = simulation.apart
    length = arm_length(a)
    if apart <= error:
        agree = f"agree to the error of the integration, {error:.0e}{simulation.unit}" if error else "are the same"
        return f"linear and nonlinear {what} {agree}: {holds(a, simulation)}"
    if apart <= NEGLIGIBLE * (length if np.isfinite(length) else 1.0):
        facts = f"linear and nonlinear {what} differ by no more than {format_quantity(apart, simulation.unit.strip())}".rstrip()
        return f"{facts}: {holds(a, simulation)}"
    share = f"{100 * apart / largest:.2g} % of the largest deviation"
    facts = f"linear and nonlinear {what} differ by {apart:.3g}{simulation.unit}, {share}"
    if apart > BEYOND * largest:
        return f"{facts}: beyond the linear model; reduce speed, payload or disturbance, or trust the simulation only"
    return f"{facts}: {holds(a, simulation)}"


def holds(a: Analysis, simulation: Simulation) -> str:
    """That the linear model holds on this motion, unless the motion itself goes beyond what the equations allow along the slowest modes."""
    smallest = np.inf if a.linear_range is None else float(a.linear_range.amplitudes.min())
    if simulation.deviation <= smallest:
        return "the linear model holds for this motion"
    return (
        f"the linear model is close on this motion, but a disturbance as large as the motion's own deviation, "
        f"{simulation.deviation:.2g} (rad or m), may leave it"
    )


def sentence(text: str) -> str:
    """A status as a sentence."""
    return text[0].upper() + text[1:] + "."
