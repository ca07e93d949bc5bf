"""The advice of a report: what a control engineer should do with the result."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from flexlin.analyses.analysis import Analysis
from flexlin.analyses.judging import REPEATABILITY, Loop
from flexlin.checks import SUM_ROUNDING
from flexlin.control.drives import Demand, DriveLoad
from flexlin.plots.scales import write_powers
from flexlin.report.wording import (
    caution,
    describe_pace,
    doubt,
    format_decimal,
    format_quantity,
    is_dimensionless,
    reason,
    with_unit,
)
from flexlin.simulation.result import OUTGROWN, Simulation, say_beyond

WORTHWHILE = 1.05
"""Factor from which on one figure counts as better, or worse, than another."""


def advise(analysis: Analysis) -> list[str]:
    """What to do, most urgent first."""
    comments = (
        *(comment_on_model, comment_on_stability, comment_on_elastic_motion, comment_on_sampling, comment_on_drives),
        *(comment_on_designs, comment_on_tip, comment_on_zeros, comment_on_trust),
    )
    return [said for comment in comments for said in comment(analysis)]


def comment_on_model(a: Analysis) -> Iterator[str]:
    """What to do where the linear model itself does not hold along the motion: its verdict then says little."""
    found = a.validity(a.own)
    if found.verdict == "invalid" and a.own.floquet is not None:
        remedies = [*["slow the motion down"] * (not stays(a)), "stiffen the links", "lower the payload"]
        what = "" if found.reason is None else found.reason.what
        held = a.plant.inputs and what != "bending"  # which gains do not lessen
        remedies += [("add feedback" if a.own.kind == "open" else "raise the gains")] * bool(held)
        remedy = f"{', '.join(remedies[:-1])} or {remedies[-1]}"
        if what == "difference" and a.simulation is not None and a.simulation.sticking:
            remedy = "joints come to rest in friction, which it does not know: trust the simulation only"
        yield (
            f"The linear model does not hold along this motion: {reason(found)}. The verdict is about that model alone, so this is no "
            f"prediction of the arm; {remedy}."
        )


def comment_on_stability(a: Analysis) -> Iterator[str]:
    """What to do where the own loop is unstable, undecided, or hardly stable."""
    free, condition = a.own.kind == "open", name_condition(a.own)
    add = "feedback or damping" if a.plant.inputs else "damping"
    if a.own.floquet is None:
        yield f"There is no verdict {condition}: {a.own.problem}."
    elif a.own.verdict == "undecided":
        yield (
            "The growth rate cannot be distinguished from zero, as for a mode that is free or undamped: "
            f"add {add}, or treat the motion as marginal."
        )
    elif a.own.verdict != "stable":
        better = [f"use the design “{loop.name}”, which is" for loop in a.designs if trusts(a, loop)]
        change = "change" if not a.plant.inputs else "add feedback, or change" if free else "change its gains,"
        remedy = [*better, f"{change} the speed or the payload until it is"][0]
        yield f"The arm is unstable along this motion {condition}: {remedy} stable."
        yield from comment_on_cause(a)
    elif weak := caution(a.own, a.plant.period):
        add = add if free else "damping, or gain on the mode that is slow"
        yield f"The arm is stable only in the mathematical sense, {weak}: add {add}, and do not count on this verdict as a margin."


def comment_on_cause(a: Analysis) -> Iterator[str]:
    """The resonances behind an instability, as far as they are clear."""
    if "resonances" in a.problems:
        yield f"What is behind it was not found: {a.problems['resonances']}."
        return
    base = 1 / a.plant.period
    for found in a.resonances:
        if found.kind != "average" and found.detuning < 0.2 * 2 * np.pi * base and min(found.frequencies) > 0:
            high, low = (f"{w / (2 * np.pi):.4g}" for w in found.frequencies)
            rule = {"principal": f"2 × {high}", "sum": f"{high} + {low}", "difference": f"{high} − {low}"}[found.kind]
            own, motion = with_unit(rule, "Hz"), with_unit(f"{found.order} × {base:.4g}", "Hz")
            yield (
                f"Behind it is a parametric resonance: {own} of the averaged arm is near {motion} of the motion. "
                "Move the motion's frequency or the natural frequencies apart, or add damping."
            )


def find_fastest_mode(a: Analysis) -> float:
    """The largest natural frequency of the averaged arm, in rad/s."""
    M, K = (matrix.mean(axis=0) for matrix in (a.coefficients.M, a.coefficients.K))
    return float(np.sqrt(np.abs(np.linalg.eigvals(np.linalg.solve(M, K))).max()))


def comment_on_zeros(a: Analysis) -> Iterator[str]:
    """What no controller of the tip can overcome: a bandwidth above half the slowest zero, where the arm has modes that far.

    Source: Skogestad, Postlethwaite, Multivariable Feedback Control (2005), section 5.7.
    """
    if a.zeros is None or a.zeros.verdict != "non-minimum phase":
        return
    real = a.zeros.exponents.real
    slowest = real[real > a.zeros.errors].min()
    if slowest / 2 < find_fastest_mode(a):
        rate = with_unit(format_decimal(slowest, 3), "1/s")
        yield (
            f"From motors to tip the arm is non-minimum phase, with a zero at {rate}: whatever the controller, "
            f"the tip first moves the wrong way, and does not follow in much less than {format_quantity(1 / slowest, 's')}."
        )


def comment_on_elastic_motion(a: Analysis) -> Iterator[str]:
    """How much the verdict moves when the loop is linearized about the elastic motion."""
    if a.elastic is not None and a.elastic.floquet is not None:
        moved = with_unit(f"moves the growth rate from {a.own.growth[0]:.4g} to {a.elastic.growth[0]:.4g}", "1/s")
        same = a.elastic.verdict == a.own.verdict
        trust = "the verdict stands" if same else f"the verdict becomes {a.elastic.verdict}: believe this one"
        yield f"Linearizing about the elastic motion instead of the rigid one {moved}; {trust}."


def comment_on_sampling(a: Analysis) -> Iterator[str]:
    """Which loops are stable only as long as nothing samples them."""
    sampling, continuous = a.scene.control.sampling, {loop.name: loop for loop in (a.own, *a.designs)}
    for loop in a.sampled:
        base = continuous[loop.name.removesuffix(", sampled")]
        if sampling is not None and base.verdict == "stable" and loop.verdict != "stable":
            late = f" and {format_quantity(sampling.delay, 's')} late" if sampling.delay else ""
            yield (
                f"Sampled every {format_quantity(sampling.period, 's')}{late}, {name_loop(base)} is {loop.verdict}, though stable when "
                "continuous: sample faster, or lower the gains."
            )


@dataclass(frozen=True)
class Trade:
    """A design beside the own loop: what it does clearly better and what clearly worse, in words, how much longer it takes to settle, and
    what is not known of one of the two."""

    loop: Loop
    better: list[str]
    worse: list[str]
    settling: float
    missing: list[str]


def weigh_design(a: Analysis, loop: Loop) -> Trade:
    """The figures of a stable design beside those of the own loop, as far as both are known: ratios below 1 where the design is better."""
    pace = a.own.growth[0] / loop.growth[0]
    times = f"{format_decimal(max(pace, 1 / pace), 3)} times as"
    settling = f"settles {times} fast" if pace <= 1 else f"takes {times} long to settle"
    figures = [(pace, f"it {settling}")]
    before, after = largest_figures(a, a.own), largest_figures(a, loop)
    for (what, unit), own in before.items():
        design = after.get((what, unit), float("nan"))
        if np.isfinite(own) and np.isfinite(design) and max(own, design) > 0:
            ratio = design / own if own else float("inf")
            sizes = f"{format_quantity(design, unit)} instead of {format_quantity(own, unit)}"
            figures.append((ratio, f"its {what} is {sizes}"))
    known = {what for what, _ in before} & {what for what, _ in after}
    asked = ("tip error",) * bool(np.isfinite(a.length)) + ("peak torque", "peak power") * bool(a.plant.about.m)
    better, worse = [words for r, words in figures if r * WORTHWHILE < 1], [w for r, w in figures if r > WORTHWHILE]
    return Trade(loop, better, worse, pace, [what for what in asked if what not in known])


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
    return min(known or free or better or trades, key=lambda trade: trade.settling)


def describe_trade(trade: Trade, own: str) -> str:
    """What the design buys, and what it costs, in one sentence."""
    better, worse, named = join_words(trade.better), join_words(trade.worse), f"The design “{trade.loop.name}” is"
    rest = f"; {join_words(trade.missing)} could not be compared" if trade.missing else ""
    if better and worse:
        return f"{named} a trade against {own}: {better}, but {worse}{rest}."
    if better and rest:
        return f"{named} better than {own} as far as is known: {better}{rest}, and may be worse."
    if better:
        return f"{named} better than {own}: {better}, and nothing else compared is worse."
    if rest:
        return f"No design was found to be better than {own}{rest}."
    return f"No design is better than {own}: change the weights, or keep the loop you have."


def join_words(parts: list[str]) -> str:
    """Several facts as one."""
    return ", ".join(parts[:-1]) + " and " + parts[-1] if len(parts) > 1 else "".join(parts)


def comment_on_designs(a: Analysis) -> Iterator[str]:
    """Which designed controller is worth a try, and which is not."""
    stable = [loop for loop in a.designs if trusts(a, loop)]
    yield from (warn_of_design(a, loop) for loop in a.designs if not trusts(a, loop) and not loop.ends)
    if stable and a.own.verdict == "stable":
        best = choose_trade([weigh_design(a, loop) for loop in stable])
        room = f" As to the drives, {comment_on_gains(a, best.loop)}." if best.better else ""
        yield describe_trade(best, name_loop(a.own)) + room


def largest(load: DriveLoad | None, what: str) -> str:
    """The largest figure of all joints, such as the peak torque; a dash where there is none."""
    if load is None:
        return "–"
    found = [demand for demand in load.demands if demand.what == what]
    units = {demand.unit for demand in found}
    return " and ".join(sorted(format_quantity(max(d.value for d in found if d.unit == unit), unit) for unit in units))


def describe_demand(demand: Demand) -> str:
    """One demand above its limit: peak torque of q1 1.28 N m, limit 0.4 N m."""
    value = format_quantity(demand.value, demand.unit)
    limit = "" if demand.limit is None else f", limit {format_quantity(demand.limit, demand.unit)}"
    return f"{demand.what} of {demand.joint} {value}{limit}"


def drive_line(a: Analysis, loop: Loop) -> str:
    """What a loop asks beyond its drives, in one line; nothing where it does not."""
    load = a.load(loop)
    return "" if load is None or not load.exceeded else f"above the drive: {describe_demand(load.exceeded[0])}"


def comment_on_drives(a: Analysis) -> Iterator[str]:
    """Which loops ask more than the drives give."""
    for loop in a.loops if a.scene.drives is not None else ():
        load = a.load(loop)
        if load is not None and load.exceeded:
            more = f" ({len(load.exceeded)} limits in all)" if len(load.exceeded) > 1 else ""
            yield (
                f"In steady motion {name_loop(loop)} asks more than the drives give: {describe_demand(load.exceeded[0])}{more}. "
                "Slow down, lower the payload, or take a stronger drive."
            )


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


def first_sentence(a: Analysis) -> tuple[str, str]:
    """The report's first sentence: the verdict, with doubt where there is one, and what it means for a disturbance."""
    own, period = a.own, a.plant.period
    model = a.validity(own)
    doubted, why = doubt(own, period, model), reason(model)
    verdict = own.verdict.capitalize() + (f", {doubted}" if doubted else "")
    pace = (f"{why}. In the linear model " if why else "") + describe_pace(own, period)
    return verdict, f"{name_condition(own)}: {pace}."


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


def comment_on_tip(a: Analysis) -> Iterator[str]:
    """Where the steady tip error comes from, and what lowers it, if it is worth lowering."""
    if a.response is None:
        yield f"No periodic response was found: {a.problems['response']}."
        return
    if a.own.verdict == "unstable":
        yield "The periodic response shown here exists but is unstable: the arm leaves it."
        return
    largest, model = float(a.response.tip_error.max()), a.validity(a.own)
    said_before = any(found.against and found.what in ("bending", "tip") for found in model.evidence)
    missed = model.verdict == "invalid" and a.simulation is not None and a.simulation.difference > largest
    if not np.isfinite(largest) or largest == 0 or said_before or missed:
        return
    size = format_quantity(largest, "m")
    if largest <= REPEATABILITY * a.length:
        yield f"In steady motion the tip stays within {size} of its rigid path: nothing has to be done about it."
    else:
        yield f"In steady motion the tip stays up to {size} away from its rigid path, {explain_tip_error(a, largest)}."


def stays(a: Analysis) -> bool:
    """Whether most of the tip error stays however slow the motion is."""
    return a.response is not None and a.response.at_rest > a.response.sizes[1] / 2


ELASTIC = 'feed forward the elastic motion too (control.feedforward = "{}")'


def explain_tip_error(a: Analysis, largest: float) -> str:
    """What makes most of a tip error, and what lowers it: what the scene does already is no advice."""
    assert a.response is not None
    forward, slower = a.scene.control.feedforward, "" if stays(a) else "slow down, or "
    if not a.plant.inputs:
        return f"by bending alone: {slower}stiffen the links"
    if a.response.law is not None:
        return f"with the {forward} feedforward: what is left is what it does not close"
    kinds, sizes = np.array([one.kind for one in a.plant.coordinates]), np.abs(a.response.states).max(axis=0)
    joints, motors = (sizes[: a.plant.n][kinds == kind].max(initial=0.0) for kind in ("joint", "motor"))
    planar = a.response.tip.shape[1] == 2
    remedy = slower + (ELASTIC.format("tip-exact") if planar else "stiffen them")
    if np.linalg.norm(a.response.tip_by_bending, axis=1).max() > largest / 2:
        return f"most of it the links' bending, which no joint feedback removes: {remedy}"
    if "motor" in kinds and motors < joints / 2:
        return f"most of it the give of flexible joints, which no motor's feedback removes: {remedy}"
    gains = "add feedback" if a.own.kind == "open" else "raise the gains"
    rigid = f'feed the rigid torque forward (control.feedforward = "rigid"), or {gains}'
    exact = f"{gains}, or {ELASTIC.format('tip-exact' if planar else 'joint-exact')}"
    return f"most of it the joints' error: {rigid if forward == 'none' else exact}"


def comment_on_trust(a: Analysis) -> Iterator[str]:
    """How far the linear numbers can be trusted."""
    if a.simulation is None:
        yield f"The nonlinear simulation has no answer: {a.problems['simulation']}."
    else:
        yield sentence(agreement(a, a.simulation))
    if a.linear_range is not None:
        status = a.linear_range.status
        yield sentence(status.replace(" m in ", " in ") if is_dimensionless() else status)


def agreement(a: Analysis, simulation: Simulation) -> str:
    """How far the linear answer is from the nonlinear one on this motion."""
    if simulation.is_unresolved:
        return simulation.unresolved
    (what, apart, largest, error), unit = simulation.apart, simulation.unit
    answers, length = f"linear and nonlinear {what}", a.length if np.isfinite(a.length) else 1.0
    if simulation.is_lost:
        facts = OUTGROWN
    elif apart <= max(error, SUM_ROUNDING * length):
        bound = f"{error:.0e}{'' if is_dimensionless() else unit}"
        facts = f"{answers} {f'agree to the error of the integration, {bound}' if error and apart <= error else 'are the same'}"
    elif apart <= REPEATABILITY * length:
        facts = f"{answers} differ by no more than {format_quantity(apart, unit.strip())}".rstrip()
    else:
        judged = next((one for one in a.validity(a.own).evidence if one.what == "difference"), None)
        whole = largest if judged is None else judged.whole
        share = f"{100 * apart / whole:.2g} % of the " + ("links' bending" if whole > largest else "largest deviation")
        facts = f"{answers} differ by {format_quantity(apart, unit.strip()).rstrip()}, {share}"
    return f"{facts}: {holds(a, simulation)}"


def holds(a: Analysis, simulation: Simulation) -> str:
    """What the comparison says of the linear model: that it holds on this motion, unless the figures speak against it or the motion
    itself goes beyond what the equations allow along the slowest modes."""
    found = a.validity(a.own)
    if found.verdict == "invalid":
        assert found.reason is not None
        if found.reason.what == "difference":
            return say_beyond(simulation)
        return "both rest on equations of small deflections, and these are large"
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


def sentence(text: str) -> str:
    """A status as a sentence."""
    return write_powers(text[0].upper() + text[1:]) + "."
