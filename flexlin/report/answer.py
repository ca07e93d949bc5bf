"""The answer to a disturbance as lines, data and a picture."""

from typing import Any

import numpy as np

from flexlin.answers.disturbed.noise import NoiseAnswer
from flexlin.answers.disturbed.respond import DisturbanceAnswer
from flexlin.report.drive_words import describe_demand
from flexlin.report.figures.comparison import describe_answer, describe_noise, draw_answer, draw_noise
from flexlin.report.figures.style import Picture
from flexlin.report.numbers import record_number, record_numbers

Answer = DisturbanceAnswer | NoiseAnswer


def draw(answer: Answer) -> Picture:
    """The picture of an answer."""
    return draw_noise(answer) if isinstance(answer, NoiseAnswer) else draw_answer(answer)


def answer_lines(answer: Answer) -> list[str]:
    """The answer in words, and which limits of the drives it exceeds."""
    if isinstance(answer, NoiseAnswer):
        return [describe_noise(answer)]
    over = [] if answer.load is None else [d for d in answer.load.exceeded if d.what.startswith("peak")]
    return [describe_answer(answer), *(f"above the drive: {describe_demand(demand)}" for demand in over)]


def answer_record(title: str, answer: Answer) -> dict[str, Any]:
    """The answer as data that JSON can hold."""
    head: dict[str, Any] = {"schema": 1, "title": title, "disturbance": answer.words, "t": record_numbers(answer.t)}
    if isinstance(answer, NoiseAnswer):
        return head | {
            "rms_states": record_numbers(answer.states),
            "rms_tip": record_numbers(answer.tip),
            "error": record_number(answer.error),
        }
    load = answer.load
    return head | {
        "seen": answer.seen,
        "unit": answer.unit,
        "phases": record_numbers(answer.phases),
        "linear": record_numbers(answer.linear),
        "settling": record_numbers(answer.settling),
        "overshoot": record_numbers(answer.overshoot),
        "worst_phase": float(answer.phases[answer.worst]),
        "peak": answer.peak,
        "nonlinear": None if answer.nonlinear is None else record_numbers(answer.nonlinear),
        "difference": record_number(answer.difference),
        "problem": answer.problem,
        "peak_torque": None if load is None else np.abs(load.torque).max(axis=0).tolist(),
    }
