"""What a control engineer should do with the result."""

from dataclasses import dataclass, replace

import numpy as np

from flexlin.answers.analysis import Analysis
from flexlin.answers.judging import Loop
from flexlin.answers.validity import REPEATABLE
from flexlin.control.drives import Demand, DriveLoad
from flexlin.plots.scales import write_powers
from flexlin.report.wording import (
    caution,
    format_quantity,
    is_dimensionless,
    reason,
)
from flexlin.simulation.result import OUTGROWN, Simulation

WORTHWHILE = 1.05
"""Factor from which on one figure counts as better, or worse, than another."""


@dataclass(frozen=True)
class Trade:
    """A design beside the own loop: ratios of its figures, each below 1 where the design is better, and each in words;
    missing: what is not known of one of the two."""

    loop: Loop
    ratios: dict[str, float]
    words: dict[str, str]
    missing: tuple[str, ...] = ()

    @property
    def better(self) -> list[str]:
        """In words, what the design does clearly better."""
        return [self.words[key] for key, ratio in self.ratios.items() if ratio * WORTHWHILE < 1]

    @property
    def worse(self) -> list[str]:
        """In words, what it does clearly worse."""
        return [self.words[key] for key, ratio in self.ratios.items() if ratio > WORTHWHILE]


def weigh_design(a: Analysis, loop: Loop) -> Trade:
    """The figures of a stable design beside those of the own loop, as far as both are known."""
    pace = a.own.growth[0] / loop.growth[0]
    settling = (
        f"it settles {1 / pace:.3g} times as fast" if pace <= 1 else f"it takes {pace:.3g} times as long to settle"
    )
    ratios, words = {"settling": pace}, {"settling": settling}
    before, after = largest_figures(a, replace(a.own, response=a.response)), largest_figures(a, loop)
    for (what, unit), own in before.items():
        design = after.get((what, unit), float("nan"))
        if np.isfinite(own) and np.isfinite(design) and max(own, design) > 0:
            ratios[what + unit] = design / own if own else float("inf")
            words[what + unit] = (
                f"its {what} is {format_quantity(design, unit)} instead of {format_quantity(own, unit)}"
            )
    known = {what for what, _ in before} & {what for what, _ in after}
    asked = ("tip error",) * bool(np.isfinite(a.length)) + ("peak torque", "peak power") * bool(a.plant.about.m)
    return Trade(loop, ratios, words, tuple(what for what in asked if what not in known))


def largest_figures(a: Analysis, loop: Loop) -> dict[tuple[str, str], float]:
    """The tip error, and the largest peak torque and power of all joints, by unit, in the loop's steady motion."""
    found, load = dict[tuple[str, str], float](), a.load(loop)
    if loop.response is not None:
        found["tip error", "m"] = float(loop.response.tip_error.max())
    for demand in () if load is None else load.demands:
        if demand.what in ("peak torque", "peak power"):
            key = demand.what, demand.unit
            found[key] = max(found.get(key, 0.0), demand.value)
    return found


def choose_trade(trades: list[Trade]) -> Trade:
    """The design that is better and nowhere worse, those that are known in full first; else the one that settles fastest."""
    better = [trade for trade in trades if trade.better]
    free = [trade for trade in better if not trade.worse]
    known = [trade for trade in free if not trade.missing]
    return min(known or free or better or trades, key=lambda trade: trade.ratios["settling"])


def describe_trade(trade: Trade, own: str) -> str:
    """What the design buys, and what it costs, in one sentence."""
    better, worse = trade.better, trade.worse
    rest = f"; {join_words(list(trade.missing))} could not be compared" if trade.missing else ""
    if better and worse:
        return f"The design “{trade.loop.name}” is a trade against {own}: {join_words(better)}, but {join_words(worse)}{rest}."
    if better and rest:
        return f"The design “{trade.loop.name}” is better than {own} as far as is known: {join_words(better)}{rest}, and may be worse."
    if better:
        return f"The design “{trade.loop.name}” is better than {own}: {join_words(better)}, and nothing else compared is worse."
    if rest:
        return f"No design was found to be better than {own}{rest}."
    return f"No design is better than {own}: change the weights, or keep the loop you have."


def join_words(parts: list[str]) -> str:
    """Several facts as one."""
    return ", ".join(parts[:-1]) + " and " + parts[-1] if len(parts) > 1 else parts[0]


NEAR = 0.2
"""A resonance is named when it is detuned by less than this share of the motion's frequency."""


def advise(analysis: Analysis) -> list[str]:
    """What to do, most urgent first."""
    return [
        *comment_on_model(analysis),
        *comment_on_verdict(analysis),
        *comment_on_elastic_motion(analysis),
        *comment_on_sampling(analysis),
        *comment_on_drives(analysis),
        *comment_on_designs(analysis),
        *comment_on_tip(analysis),
        *comment_on_zeros(analysis),
        *comment_on_trust(analysis),
    ]


def comment_on_model(a: Analysis) -> list[str]:
    """What to do where the linear model itself does not hold along the motion: its verdict then says little."""
    found = a.validity(a.own)
    if found.verdict != "invalid" or a.own.floquet is None:
        return []
    remedies = ["slow the motion down", "stiffen the links", "lower the payload"]
    remedies += [("add feedback" if a.own.kind == "open" else "raise the gains")] if a.plant.inputs else []
    return [
        f"The linear model does not hold along this motion: {reason(found)}. The verdict is about that model alone, so this is no "
        f"prediction of the arm; {', '.join(remedies[:-1])} or {remedies[-1]}."
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
    better = [loop for loop in a.designs if trusts(a, loop)]
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
    if "resonances" in a.problems:
        return [f"What is behind it was not found: {a.problems['resonances']}."]
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


def comment_on_zeros(a: Analysis) -> list[str]:
    """What no controller of the tip can overcome."""
    if a.zeros is None or a.zeros.verdict != "non-minimum phase":
        return []
    slowest = min(z.real for z in a.zeros.exponents if z.real > 0)
    return [
        f"From motors to tip the arm is non-minimum phase, with a zero at {slowest:.3g} 1/s: whatever the controller, the tip first moves "
        f"the wrong way, and does not follow in much less than {format_quantity(1 / slowest, 's')}."
    ]


def comment_on_elastic_motion(a: Analysis) -> list[str]:
    """How much the verdict moves when the loop is linearized about the elastic motion."""
    if a.elastic is None or a.elastic.floquet is None:
        return []
    (rigid, _), (elastic, _) = a.own.growth, a.elastic.growth
    moved = f"moves the growth rate from {rigid:.4g} to {elastic:.4g} 1/s"
    same = a.elastic.verdict == a.own.verdict
    trust = "the verdict stands" if same else f"the verdict becomes {a.elastic.verdict}: believe this one"
    return [f"Linearizing about the elastic motion instead of the rigid one {moved}; {trust}."]


def comment_on_sampling(a: Analysis) -> list[str]:
    """Which loops are stable only as long as nothing samples them."""
    sampling, continuous = a.scene.control.sampling, {loop.name: loop for loop in (a.own, *a.designs)}
    said = []
    for loop in a.sampled if sampling is not None else ():
        base = continuous[loop.name.removesuffix(", sampled")]
        if sampling is not None and base.verdict == "stable" and loop.verdict != "stable":
            late = f" and {format_quantity(sampling.delay, 's')} late" if sampling.delay else ""
            said.append(
                f"Sampled every {format_quantity(sampling.period, 's')}{late}, {name_loop(base)} is {loop.verdict}, though stable when "
                "continuous: sample faster, or lower the gains."
            )
    return said


def comment_on_designs(a: Analysis) -> list[str]:
    """Which designed controller is worth a try, and which is not."""
    stable = [loop for loop in a.designs if trusts(a, loop)]
    said = [warn_of_design(a, loop) for loop in a.designs if not trusts(a, loop) and not loop.ends]
    if not stable or a.own.verdict != "stable":
        return said
    best = choose_trade([weigh_design(a, loop) for loop in stable])
    room = f" As to the drives, {comment_on_gains(a, best.loop)}." if best.better else ""
    return [*said, describe_trade(best, name_loop(a.own)) + room]


def largest(load: DriveLoad, what: str) -> str:
    """The largest figure of all joints, such as the peak torque."""
    found = [demand for demand in load.demands if demand.what == what]
    units = {demand.unit for demand in found}
    return " and ".join(sorted(format_quantity(max(d.value for d in found if d.unit == unit), unit) for unit in units))


def drive_cells(a: Analysis, loop: Loop) -> dict[str, str]:
    """The cells of a loop in the comparison."""
    load = a.load(loop)
    if load is None:
        return {"torque": "–", "rms": "–", "power": "–", "over": ""}
    over = "; ".join(f"above the drive: {describe_demand(demand)}" for demand in load.exceeded)
    cells = {"torque": "peak torque", "rms": "RMS torque", "power": "peak power"}
    return {key: largest(load, what) for key, what in cells.items()} | {"over": over}


def describe_demand(demand: Demand) -> str:
    """One demand above its limit: peak torque of q1 1.28 N m, limit 0.4 N m."""
    value = format_quantity(demand.value, demand.unit)
    limit = "" if demand.limit is None else f", limit {format_quantity(demand.limit, demand.unit)}"
    return f"{demand.what} of {demand.joint} {value}{limit}"


def drive_line(a: Analysis, loop: Loop) -> str:
    """What a loop asks beyond its drives, in one line; nothing where it does not."""
    load = a.load(loop)
    return "" if load is None or not load.exceeded else f"above the drive: {describe_demand(load.exceeded[0])}"


def comment_on_drives(a: Analysis) -> list[str]:
    """Which loops ask more than the drives give, and how much room the others leave."""
    if a.scene.drives is None:
        return []
    said = []
    for loop in a.loops:
        load = a.load(loop)
        if load is not None and load.exceeded:
            worst = load.exceeded[0]
            more = f" ({len(load.exceeded)} limits in all)" if len(load.exceeded) > 1 else ""
            said.append(
                f"In steady motion {name_loop(loop)} asks more than the drives give: {describe_demand(worst)}{more}. "
                "Slow down, lower the payload, or take a stronger drive."
            )
    return said


def comment_on_gains(a: Analysis, loop: Loop) -> str:
    """What a faster design takes of the drives, as far as limits are known."""
    load = a.load(loop)
    if load is None:
        return "compare its gains with what the drive allows"
    torque = f"in steady motion it asks for {largest(load, 'peak torque')} at most"
    if a.scene.drives is None:
        return f"{torque}; give [drives] limits to have it held against them"
    return f"{torque}, {'more than' if load.exceeded else 'within what'} the drives give"


def name_loop(loop: Loop) -> str:
    """A loop within a sentence."""
    return "the arm without feedback" if loop.kind == "open" else f"the {loop.name}"


def name_condition(loop: Loop) -> str:
    """The words for a loop behind a verdict."""
    return "without feedback" if loop.kind == "open" else f"under the {loop.name}"


def trusts(a: Analysis, loop: Loop) -> bool:
    """Whether a loop is stable in a linear model that holds for it, as far as is known."""
    return loop.verdict == "stable" and a.validity(loop).verdict != "invalid"


def warn_of_design(a: Analysis, loop: Loop) -> str:
    """Why a design should not be used."""
    if loop.floquet is None:
        return f"The design “{loop.name}” has no answer: {loop.problem}."
    if loop.verdict == "stable":
        return f"The design “{loop.name}” is stable, but the linear model does not hold under it: {reason(a.validity(loop))}."
    return f"The design “{loop.name}” is {loop.verdict} along this motion: do not use it as it is."


def comment_on_tip(a: Analysis) -> list[str]:
    """Where the steady tip error comes from, and what lowers it, if it is worth lowering."""
    if a.response is None:
        return [f"No periodic response was found: {a.problems['response']}."]
    if a.own.verdict == "unstable":
        return ["The periodic response shown here exists but is unstable: the arm leaves it."]
    largest = float(a.response.tip_error.max())
    if not np.isfinite(largest) or largest == 0 or not_small(a):
        return []
    if largest <= REPEATABLE * a.length:
        return [
            f"In steady motion the tip stays within {format_quantity(largest, 'm')} of its rigid path: nothing has to be done about it."
        ]
    found = f"In steady motion the tip stays up to {format_quantity(largest, 'm')} away from its rigid path"
    if not a.plant.inputs:
        return [f"{found}, by bending alone: slow down, or stiffen the links."]
    if a.response.law is not None:
        return [f"{found}, with the {a.scene.control.feedforward} feedforward: what is left is what it does not close."]
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


def not_small(a: Analysis) -> bool:
    """Whether the steady deflections are too large for the linear model, which has been said then."""
    return any(found.against and found.what in ("bending", "tip") for found in a.validity(a.own).evidence)


def comment_on_trust(a: Analysis) -> list[str]:
    """How far the linear numbers can be trusted."""
    said = [] if a.linear_range is None else [without_metres(a.linear_range.status)]
    if a.simulation is None:
        return [f"The nonlinear simulation has no answer: {a.problems['simulation']}.", *map(sentence, said)]
    return [sentence(status) for status in (agreement(a, a.simulation), *said)]


def agreement(a: Analysis, simulation: Simulation) -> str:
    """How far the linear answer is from the nonlinear one on this motion."""
    if simulation.is_lost:
        return f"{OUTGROWN}: {holds(a, simulation)}"
    (what, apart, largest, error), unit = simulation.apart, "" if is_dimensionless() else simulation.unit
    if apart <= error:
        agree = f"agree to the error of the integration, {error:.0e}{unit}" if error else "are the same"
        return f"linear and nonlinear {what} {agree}: {holds(a, simulation)}"
    if apart <= REPEATABLE * (a.length if np.isfinite(a.length) else 1.0):
        facts = f"linear and nonlinear {what} differ by no more than {format_quantity(apart, simulation.unit.strip())}".rstrip()
        return f"{facts}: {holds(a, simulation)}"
    share = f"{100 * apart / largest:.2g} % of the largest deviation"
    facts = f"linear and nonlinear {what} differ by {format_quantity(apart, unit.strip())}, {share}".replace(" ,", ",")
    return f"{facts}: {holds(a, simulation)}"


def holds(a: Analysis, simulation: Simulation) -> str:
    """What the comparison says of the linear model: that it holds on this motion, unless the figures speak against it or the motion
    itself goes beyond what the equations allow along the slowest modes."""
    found = a.validity(a.own)
    if found.verdict == "invalid":
        assert found.reason is not None
        apart = found.reason.what == "difference"
        return (
            "beyond the linear model; reduce speed, payload or disturbance, or trust the simulation only"
            if apart
            else "both rest on equations of small deflections, and these are large"
        )
    if a.linear_range is None:
        return "the linear model is close on this motion; how far it holds beside it is not known"
    outgrown = largest_beyond_range(a, simulation)
    if not outgrown:
        return "the linear model holds for this motion"
    return f"the linear model is close on this motion, but a disturbance as large as the motion's own deviation, {outgrown}, may leave it"


def largest_beyond_range(a: Analysis, simulation: Simulation) -> str:
    """The motion's own deviation in a coordinate along whose slow mode it exceeds what the equations allow; nothing where none does."""
    assert a.linear_range is not None
    for amplitude, at in zip(a.linear_range.amplitudes, a.linear_range.leading, strict=False):
        own = float(simulation.largest.nonlinear[a.plant.names.index(at.name)])
        if own > amplitude:
            return f"{own:.2g} {at.unit} in {at.title}"
    return ""


def without_metres(status: str) -> str:
    """A status about coordinates; on the page of a scene without dimensions it names no metres."""
    return status.replace(" m in ", " in ") if is_dimensionless() else status


def sentence(text: str) -> str:
    """A status as a sentence."""
    return write_powers(text[0].upper() + text[1:]) + "."
