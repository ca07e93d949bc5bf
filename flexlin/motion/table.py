"""Motions read from a table of samples, joined by a periodic quintic spline, or found in a measured log."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from flexlin.bounds import IN_RANGE, LARGEST_TABLE, MOST_ROWS, printable, read_number, read_text
from flexlin.checks import Array
from flexlin.errors import MotionError, counted
from flexlin.motion.base import MOST_HARMONICS, Angles, SampledMotion
from flexlin.periodic.circle import count_turns
from flexlin.precision import MINOR
from flexlin.scene.motion import LogMotion, TableMotion

FEWEST_ROWS = 7
MOST_CLOSE = 32
"""Close rows that are named one by one."""
CLOSURE = 1e-6
"""The last row must repeat the first to this share of the joint's range (whole turns apart)."""
ALTERNATING_SHARE = 0.5
"""Share of neighbours of different sign among fourth differences from which on they are noise: four fifths where it is white."""
NOISY_PEAK = 2.0
"""Peak acceleration of the spline over that of the smooth part from which on noise is most of it."""
FEWEST_NOISY = 40
"""Rows from which on differences say what is noise."""


def read_table_motion(table: TableMotion, joints: int, prescribed: tuple[bool, ...]) -> SampledMotion:
    """A periodic motion through the samples of a CSV file: t, q1, q2 ..., the last row closing the period.

    Assumes evenly or unevenly spaced, increasing times; a joint may advance by whole turns over the period.
    Raises: MotionError naming the row or column that does not fit.
    Source: de Boor, A Practical Guide to Splines (2001), through scipy.interpolate.make_interp_spline.
    """
    from scipy.interpolate import make_interp_spline

    t, q = read_angles(Path(table.file), joints)
    period = float(t[-1] - t[0])
    drift = 2 * np.pi * count_turns(q[-1] - q[0]) / period
    residual = q - np.outer(t - t[0], drift)
    refuse_noise(t, residual, table.file)
    check_closure(residual, table.file)
    residual[-1] = residual[0]
    spline = make_interp_spline(t - t[0], residual, k=5, bc_type="periodic")
    harmonics, features = resolution(t)
    sampler = partial(spline_angles, spline, drift, period)
    return SampledMotion(joints, period, prescribed, harmonics=harmonics, features=features, sampler=sampler)


def spline_angles(spline: Callable[..., Array], drift: Array, period: float, t: Array) -> Angles:
    """q, q', q'' of a periodic spline with a steady advance (rad/s) on top."""
    inside = t % period
    return spline(inside) + np.outer(inside, drift), spline(inside, 1) + drift, spline(inside, 2)


def resolution(t: Array) -> tuple[int, tuple[tuple[float, float], ...]]:
    """How many harmonics a spline through samples at these times may have, beside the narrowest rows: (time, half-width) in s.

    Between two rows a spline may swing once. Rows that lie closer than T / 200 in few places are features; where there are many of them
    no row is one, and they count as harmonics.
    """
    period, spacing = float(t[-1] - t[0]), np.diff(t)
    close = spacing < period / 200
    if close.sum() > MOST_CLOSE:
        return int(np.ceil(period / (2 * spacing.min()))), ()
    features = tuple((float(s - t[0]), float(h)) for s, h in zip(t[:-1][close], spacing[close], strict=True))
    return int(np.ceil(period / (2 * spacing[~close].min(initial=period)))), features


def read_angles(path: Path, joints: int) -> tuple[Array, Array]:
    """Times (N,) and angles (N, joints) of a CSV file with or without a line of names."""
    name, (names, rows) = printable(path), read_rows(path)
    if len(rows) > MOST_ROWS:
        what, got, expected = f"motion.file: the table {name} is too long", f"{len(rows)} rows", f"at most {MOST_ROWS}"
        raise MotionError(what, got=got, expected=expected, todo="take fewer samples")
    lost = [number for number, row in enumerate(rows, start=2 if names else 1) if np.isnan(row).any()]
    if lost:  # what stands there is not repeated: the file may be none of ours
        what = f"motion.file: {name}, row {lost[0]} is not numeric"
        raise MotionError(what, got="a cell that is none", expected=IN_RANGE)
    widths = {len(row) for row in rows}
    if len(rows) < FEWEST_ROWS or widths != {joints + 1}:
        raise MotionError(
            f"motion.file: {name} has the wrong shape",
            got=f"{counted(len(rows), 'row')} of {sorted(widths)} columns",
            expected=f"{FEWEST_ROWS} rows or more of {joints + 1} columns (t and one angle a joint)",
        )
    data = np.array(rows)
    if not np.all(np.diff(data[:, 0]) > 0):
        got = f"row {int(np.argmin(np.diff(data[:, 0]))) + 2}"
        raise MotionError(f"motion.file: the times in {name} do not increase", got=got)
    return data[:, 0], data[:, 1:]


def read_rows(path: Path) -> tuple[list[str], list[list[float]]]:
    """The names of a table's columns, none where it begins with numbers, and its rows; not a number where a cell is none within bounds.

    Raises: MotionError for what is no text, or separates its cells by other signs than commas.
    """
    name = printable(path)
    try:
        text = read_text(path, LARGEST_TABLE)
    except OSError as error:
        got = printable(error.strerror or error)
        raise MotionError(f"motion.file: the table {name} cannot be read", got=got, expected="a CSV file") from None
    lines = [line.split(",") for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if lines and len(lines[0]) == 1 and (";" in lines[0][0] or "\t" in lines[0][0]):
        got = "semicolons" if ";" in lines[0][0] else "tabs"
        raise MotionError(f"motion.file: {name} does not separate its columns by commas", got=got, expected="a,b,c")
    rows = [[as_number(cell) for cell in line] for line in lines]
    named = bool(rows) and bool(np.isnan(rows[0]).all())
    return [cell.strip() for cell in lines[0]] if named else [], rows[named:]


def as_number(cell: str) -> float:
    """A cell of a table as a number within bounds; not a number where it is none."""
    try:
        return read_number(cell)
    except ValueError:
        return np.nan


def check_closure(residual: Array, file: str) -> None:
    """Refuse angles, whole turns taken away, that do not end where they began."""
    gap = np.abs(residual[-1] - residual[0])
    scale = np.maximum(np.ptp(residual, axis=0), 1e-9)
    if np.any(gap > CLOSURE * scale):
        joint = int(np.argmax(gap / scale))
        raise MotionError(
            f"motion.file: the table motion of {printable(file)} is not periodic",
            got=f"joint {joint + 1} ends {gap[joint]:.3g} rad from where it began",
            expected="a last row that repeats the first, whole turns apart",
        )


def refuse_noise(t: Array, q: Array, file: str) -> None:
    """Refuse angles whose noise a spline through them would turn into most of the acceleration.

    Of white noise, four of five neighbours among the fourth divided differences differ in sign; of a motion few do, beside those near 0.
    """
    slope, count = q, len(t)
    for k in range(1, 5):
        slope = np.diff(slope, axis=0) / (t[k:] - t[:-k])[:, None]
    sides = np.sign(slope) * (np.abs(slope) > 0.1 * np.sqrt(np.mean(slope**2, axis=0)))
    turns = np.mean(sides[1:] * sides[:-1] < 0, axis=0)
    if count < FEWEST_NOISY or not np.any(turns > ALTERNATING_SHARE):
        return
    from scipy.interpolate import make_interp_spline

    period = float(t[-1] - t[0])
    peaks = np.abs(make_interp_spline(t, q, k=5)(t, 2)).max(axis=0)
    smooth = np.abs(series_angles(fit_cycles(t[:-1], q[:-1], period, 1)[0], period, t - t[0])[2]).max(axis=0)
    noisy = np.flatnonzero((turns > ALTERNATING_SHARE) & (peaks > NOISY_PEAK * smooth.max()))
    if len(noisy):
        j = int(noisy[np.argmax(peaks[noisy])])
        raise MotionError(
            f"motion.file: the table {printable(file)} is noisy",
            got=f"a peak acceleration of {peaks[j]:.3g} rad/s^2 of joint {j + 1}, of its smooth part {smooth[j]:.3g}",
            expected=f"at most {NOISY_PEAK:g} times that of the smooth part",
            todo="read it with kind = 'log', which keeps the harmonics that stand out of the noise",
        )


PERIODIC_CORRELATION = 0.95
"""Correlation of the log with itself a period later, from which on it counts as periodic."""
HARMONIC_POWER = 20.0
"""Power of a harmonic, in variances of the noise in one coefficient: noise alone reaches it once in 20,000."""
UNREPEATED_SHARE = 0.5
"""Share of the log's power that the series of a period leaves over, from which on the log does not repeat with it."""


def read_log_motion(table: LogMotion, joints: int, prescribed: tuple[bool, ...]) -> SampledMotion:
    """The Fourier series nearest to all whole cycles of a log: q = sum_k c_k exp(2 pi i k t / T), k up to what the noise allows.

    A harmonic is kept as long as its power is above `HARMONIC_POWER` times that of the noise. Raises: MotionError for a file without these
    columns, and a log that does not repeat.
    """
    t, q, lost = read_columns(Path(table.file), table, joints)
    period = table.period or find_period(t, q)
    cycles = int((t[-1] - t[0]) / period + 1e-6)
    if cycles < 1:
        todo = "record a whole cycle, or correct motion.period"
        raise MotionError("motion: the log is shorter than its period", got=f"{t[-1] - t[0]:.4g} s", todo=todo)
    kept = t < t[0] + cycles * period
    c, left = fit_cycles(t[kept], q[kept], period, cycles, table.harmonics)
    if left > UNREPEATED_SHARE:
        got, todo = f"{100 * left:.0f} % of the motion is left over", "correct motion.period, or leave it out"
        raise MotionError(f"motion: the log does not repeat every {period:.6g} s", got=got, todo=todo)
    sampler = partial(series_angles, c, period)
    remains = np.sqrt(np.mean((q[kept] - sampler(t[kept] - t[0])[0]) ** 2, axis=0)).max()
    origin = (
        f"{counted(cycles, 'cycle')} of {period:.6g} s of the log, averaged; {counted(len(c) - 1, 'harmonic')} kept, "
        f"{remains:.2g} RMS left out as noise (rad or m, the worst joint)"
    )
    origin += f"; {lost} of {lost + len(t)} rows left out, which hold no numbers" if lost else ""
    return SampledMotion(joints, period, prescribed, harmonics=len(c) - 1, origin=origin, sampler=sampler)


def fit_cycles(t: Array, q: Array, period: float, cycles: int, harmonics: int | None = None) -> tuple[Array, float]:
    """Fourier coefficients c_k (count + 1, joints) nearest to whole cycles, those that noise hides left out where no number is given; and
    the share of the power that the series of all leaves over."""
    highest = min(MOST_HARMONICS, max(1, int(len(t) / cycles / 3)))
    phase = 2 * np.pi * np.outer((t - t[0]) / period, np.arange(1, highest + 1))
    rows = np.hstack([np.ones((len(phase), 1)), np.cos(phase), np.sin(phase)])
    found, *_ = np.linalg.lstsq(rows, q, rcond=None)
    residual = np.var(q - rows @ found, axis=0)
    left = residual.sum() / max(np.var(q, axis=0).sum(), 1e-300)
    power = found[1 : highest + 1] ** 2 + found[highest + 1 :] ** 2
    speaking = np.flatnonzero(np.any(power > HARMONIC_POWER * residual * 2 / len(t) + 1e-12 * power.max(), axis=1))
    count = harmonics or (int(speaking[-1]) + 1 if len(speaking) else 1)
    c = np.zeros((count + 1, q.shape[1]), dtype=complex)
    c[0], n = found[0], min(count, highest)
    c[1 : n + 1] = found[1 : n + 1] - 1j * found[highest + 1 : highest + 1 + n]
    return c, float(left)


def series_angles(c: Array, period: float, t: Array) -> Angles:
    """q, q', q'' of a series, the real part of sum_k c_k exp(2 pi i k t / T)."""
    w = 2j * np.pi * np.arange(len(c)) / period
    wave = np.exp(np.outer(t, w))
    q, rate, acceleration = ((wave @ (c * w[:, None] ** k)).real for k in range(3))
    return q, rate, acceleration


def find_period(t: Array, q: Array) -> float:
    """The shortest shift after which the log is most like itself. Raises: MotionError where there is none."""
    even = np.linspace(t[0], t[-1], min(len(t), 4096))
    x = np.stack([np.interp(even, t, one) for one in q.T], axis=1)
    x = (x - x.mean(axis=0)) / (x.std(axis=0) + 1e-300)
    shifts = np.arange(len(x) // 50, len(x) * 2 // 3)
    like = np.array([np.mean(x[s:] * x[:-s]) / np.sqrt(np.mean(x[s:] ** 2) * np.mean(x[:-s] ** 2)) for s in shifts])
    peaks = [
        i for i in range(1, len(like) - 1) if like[i - 1] <= like[i] > like[i + 1] and like[i] > PERIODIC_CORRELATION
    ]
    if not peaks:
        short = like.argmax() in (0, len(like) - 1) and like.max() > PERIODIC_CORRELATION
        got = "less than two cycles" if short else f"a likeness of {like.max():.2f} a cycle later"
        todo = "give motion.period, or a log of two cycles and more"
        expected = None if short else f"{PERIODIC_CORRELATION} or more"
        raise MotionError("motion: the log does not repeat", got=got, expected=expected, todo=todo)
    i = next(i for i in peaks if like[i] > max(like[k] for k in peaks) - 0.02)
    bend = like[i - 1] - 2 * like[i] + like[i + 1]
    shift = shifts[i] + 0.5 * (like[i - 1] - like[i + 1]) / bend
    return float(shift * (even[1] - even[0]))


def read_columns(path: Path, table: LogMotion, joints: int) -> tuple[Array, Array, int]:
    """Times and joint angles by the names of their columns, and how many rows were left out."""
    name, (names, rows) = printable(path), read_rows(path)
    if len(table.columns) != joints:
        raise MotionError("motion.columns: one name a joint", got=len(table.columns), expected=str(joints))
    missing = [column for column in (table.time, *table.columns) if column not in names]
    if missing:
        raise MotionError(f"motion: the log {name} lacks columns", got=", ".join(names), expected=", ".join(missing))
    widths = {len(row) for row in rows} | {len(names)}
    if len(widths) > 1:
        raise MotionError(f"motion.file: the log {name} cannot be read", got=f"rows of {sorted(widths)} columns")
    data = dict(zip(names, np.array(rows).reshape(-1, len(names)).T, strict=True))
    t, q = data[table.time], np.stack([data[column] for column in table.columns], axis=1)
    known = np.isfinite(t) & np.isfinite(q).all(axis=1)
    if (~known).mean() > MINOR:  # a gap is left out, a log that is mostly gaps is none
        got, expected = f"{(~known).sum()} of {len(known)} rows that are not", "numbers, with a few gaps at the most"
        raise MotionError(f"motion.file: the log {name} is not numeric", got=got, expected=expected)
    if known.sum() < 20 or np.any(np.diff(t[known]) <= 0):
        raise MotionError(
            f"motion: the log {name} is too short, or its times do not increase", got=counted(known.sum(), "row")
        )
    return t[known], q[known], int((~known).sum())
