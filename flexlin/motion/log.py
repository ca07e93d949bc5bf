"""Motions found in a measured log: the period, its cycles averaged, and as many harmonics as stand out of the noise."""

from pathlib import Path

import numpy as np

from flexlin.bounds import printable
from flexlin.checks import Array
from flexlin.errors import MotionError
from flexlin.files import read_text
from flexlin.motion.base import Angles, SampledMotion
from flexlin.scene.motion import LogMotion

LIKE = 0.95
"""Correlation of the log with itself a period later, from which on it counts as periodic."""
SPEAKS = 20.0
"""Power of a harmonic, in variances of the noise in one coefficient: noise alone reaches it once in 20,000."""
LARGEST_FILE = 2**26
"""Bytes of a log."""
MOST = 60
"""Harmonics that are looked at."""


def read_log_motion(table: LogMotion, joints: int, prescribed: tuple[bool, ...]) -> SampledMotion:
    """The Fourier series nearest to all whole cycles of a log: q = sum_k c_k exp(2 pi i k t / T), k up to what the noise allows.

    A harmonic is kept as long as its power is above `SPEAKS` times that of the noise. Raises: MotionError for a file without these
    columns, and a log that does not repeat.
    """
    t, q = read_columns(Path(table.file), table, joints)
    period = table.period or find_period(t, q)
    cycles = int((t[-1] - t[0]) / period + 1e-6)
    if cycles < 1:
        todo = "record a whole cycle, or correct motion.period"
        raise MotionError("motion: the log is shorter than its period", got=f"{t[-1] - t[0]:.4g} s", todo=todo)
    kept = t < t[0] + cycles * period
    highest = min(MOST, max(1, int(kept.sum() / cycles / 3)))
    phase = 2 * np.pi * np.outer((t[kept] - t[0]) / period, np.arange(1, highest + 1))
    rows = np.hstack([np.ones((len(phase), 1)), np.cos(phase), np.sin(phase)])
    found, *_ = np.linalg.lstsq(rows, q[kept], rcond=None)
    noise = np.var(q[kept] - rows @ found, axis=0) * 2 / kept.sum()
    power = found[1 : highest + 1] ** 2 + found[highest + 1 :] ** 2
    speaking = np.flatnonzero(np.any(power > SPEAKS * noise + 1e-12 * power.max(), axis=1))
    count = table.harmonics or (int(speaking[-1]) + 1 if len(speaking) else 1)
    c = np.zeros((count + 1, joints), dtype=complex)
    c[0], n = found[0], min(count, highest)
    c[1 : n + 1] = found[1 : n + 1] - 1j * found[highest + 1 : highest + 1 + n]

    def sample(at: Array) -> Angles:
        w = 2j * np.pi * np.arange(count + 1) / period
        wave = np.exp(np.outer(at, w))
        q, rate, acceleration = ((wave @ (c * w[:, None] ** k)).real for k in range(3))
        return q, rate, acceleration

    return SampledMotion(joints, period, prescribed, harmonics=count, sampler=sample)


def find_period(t: Array, q: Array) -> float:
    """The shortest shift after which the log is most like itself. Raises: MotionError where there is none."""
    even = np.linspace(t[0], t[-1], min(len(t), 4096))
    x = np.stack([np.interp(even, t, one) for one in q.T], axis=1)
    x = (x - x.mean(axis=0)) / (x.std(axis=0) + 1e-300)
    shifts = np.arange(len(x) // 50, len(x) * 2 // 3)
    like = np.array([np.mean(x[s:] * x[:-s]) / np.sqrt(np.mean(x[s:] ** 2) * np.mean(x[:-s] ** 2)) for s in shifts])
    peaks = [i for i in range(1, len(like) - 1) if like[i - 1] <= like[i] > like[i + 1] and like[i] > LIKE]
    if not peaks:
        got = f"a likeness of {like.max():.2f} a cycle later"
        todo = "give motion.period, or a log of two cycles and more"
        raise MotionError("motion: the log does not repeat", got=got, expected=f"{LIKE} or more", todo=todo)
    i = next(i for i in peaks if like[i] > max(like[k] for k in peaks) - 0.02)
    bend = like[i - 1] - 2 * like[i] + like[i + 1]
    shift = shifts[i] + 0.5 * (like[i - 1] - like[i + 1]) / bend
    return float(shift * (even[1] - even[0]))


def read_columns(path: Path, table: LogMotion, joints: int) -> tuple[Array, Array]:
    """Times and joint angles by the names of their columns."""
    import io

    name = printable(path)
    if len(table.columns) != joints:
        raise MotionError("motion.columns: one name a joint", got=len(table.columns), expected=str(joints))
    try:
        data = np.genfromtxt(io.StringIO(read_text(path, LARGEST_FILE)), delimiter=",", names=True, deletechars="")
    except (OSError, ValueError) as error:
        raise MotionError(f"motion.file: the log {name} cannot be read", got=printable(error)[:120]) from None
    missing = [column for column in (table.time, *table.columns) if column not in (data.dtype.names or ())]
    if missing:
        raise MotionError(
            f"motion: the log {name} lacks columns", got=", ".join(data.dtype.names or ()), expected=", ".join(missing)
        )
    t, q = data[table.time], np.stack([data[column] for column in table.columns], axis=1)
    known = np.isfinite(t) & np.isfinite(q).all(axis=1)
    if known.sum() < 20 or np.any(np.diff(t[known]) <= 0):
        raise MotionError(
            f"motion: the log {name} is too short, or its times do not increase", got=f"{known.sum()} rows"
        )
    return t[known], q[known]
