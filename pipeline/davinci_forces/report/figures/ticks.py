"""An axis: its range, round numbers along it, and their text; the axis label states their common power of ten."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.content.number import in_format, ten_to

FEW_DECADES = 3  # axes of fewer decades are also numbered at 2 and 5
PLAIN_RANGE = (2e-3, 2e4)  # no power of ten is taken out if the largest magnitude is in this range
ROUND_STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # round steps between numbers
ROUNDING = 1e-9  # of a step


@dataclass(frozen=True)
class Axis:
    """A range, logarithmic if `log`, with `texts` at `values`; `label` has the power of ten that the texts omit."""

    low: float
    high: float
    log: bool
    label: str
    values: tuple[float, ...] = ()
    texts: tuple[str, ...] = ()
    whole: bool = False  # it counts, so it is numbered at whole numbers

    def share(self, x: Array | Sequence[float]) -> Array:
        """The place of each value along the axis: 0 at its lower end, 1 at its upper end."""
        if not self.log:
            return (np.asarray(x, float) - self.low) / (self.high - self.low)
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.log10(np.asarray(x, float) / self.low) / math.log10(self.high / self.low)

    def with_numbers(self, most: int, capacity: float = math.inf) -> "Axis":
        """The axis with round numbers in at most `most` intervals, and few enough that they do not touch.

        `capacity` is the length of the axis in characters.
        """
        if self.log:
            return self._with_decades()
        exponent = power_of_ten(max(abs(self.low), abs(self.high)))
        scale = 10.0**exponent
        most = min(most, max(math.ceil(self.high - self.low), 1)) if self.whole else most
        for intervals in range(most, 0, -1):
            values, step = round_values(self.low / scale, self.high / scale, intervals)
            texts = in_digits(values, step)
            widest = 1 + max((len(text.replace(".", "")) for text in texts), default=0)  # a point is narrow
            fits = len(values) < 3 or widest <= capacity * step * scale / (self.high - self.low)
            if fits and not (self.whole and step * scale % 1.0):
                break
        places = tuple((values * scale).tolist())
        return replace(self, label=with_power(self.label, exponent), values=places, texts=texts)

    def with_dates(self, most: int) -> "Axis":
        """The axis with dates at whole days, or times at round parts of a day; it is in days since 1970."""
        values, step = round_values(self.low, self.high, most)
        if step >= 1.0:
            values = np.unique(np.round(values))
        times = (np.datetime64("1970-01-01T00:00") + np.round(values * 1440).astype("timedelta64[m]")).tolist()
        form = "%m-%d\n%Y" if step >= 1.0 else "%H:%M\n%Y-%m-%d"
        return replace(self, values=tuple(values.tolist()), texts=tuple(time.strftime(form) for time in times))

    def _with_decades(self) -> "Axis":
        """Numbers at 1, 2 and 5 of each decade, or at powers of ten on a long axis."""
        low, high = math.log10(self.low), math.log10(self.high)
        first, last = math.ceil(low), math.floor(high)
        if last - first < FEW_DECADES:
            values = [digit * 10.0**n for n in range(first - 1, last + 1) for digit in (1, 2, 5)]
            inside = tuple(value for value in values if low <= math.log10(value) <= high)
            return replace(self, values=inside, texts=tuple(f"{value:g}" for value in inside))
        powers = range(first, last + 1, math.ceil((last - first) / FEW_DECADES))
        return replace(self, values=tuple(10.0**n for n in powers), texts=tuple(map(ten_to, powers)))

    def with_names(self, names: Sequence[str]) -> "Axis":
        """The axis with names at 0, 1, 2, ..."""
        return replace(self, values=tuple(map(float, range(len(names)))), texts=tuple(names))

    @property
    def characters(self) -> int:
        """Characters of its longest text."""
        return max((len(line) for text in self.texts for line in text.split("\n")), default=0)

    @property
    def lines(self) -> int:
        """Lines of its tallest text."""
        return max((text.count("\n") + 1 for text in self.texts), default=1)


def axis_over(columns: Iterable[Array], margins: tuple[float, float], log: bool, label: str) -> Axis:
    """An axis over all finite values, widened below and above by `margins` as shares of their range."""
    values = np.concatenate([np.zeros(0), *columns])
    values = values[np.isfinite(values) & ((values > 0) | (not log))]
    low, high = (float(values.min()), float(values.max())) if len(values) else (1.0, 10.0) if log else (0.0, 1.0)
    if low == high:
        low, high = (low / 2, 2 * high) if log else (low - (abs(low) or 1.0) / 20, high + (abs(high) or 1.0) / 20)
    below, above = margins
    if log:
        return Axis(low * (low / high) ** below, high * (high / low) ** above, log, label)
    whole = "[" not in label and bool((values % 1.0 == 0.0).all())
    return Axis(low - below * (high - low), high + above * (high - low), log, label, whole=whole)


def round_values(low: float, high: float, intervals: int) -> tuple[Array, float]:
    """Multiples of a round step from low to high in at most `intervals` intervals, and the step."""
    least = (high - low) / intervals
    base = 10.0 ** math.floor(math.log10(least))
    step = next(base * factor for factor in ROUND_STEPS if base * factor >= least * (1 - ROUNDING))
    first, last = math.ceil(low / step - ROUNDING), math.floor(high / step + ROUNDING)
    return np.arange(first, last + 1, dtype=np.float64) * step, step


def in_digits(values: Array, step: float) -> tuple[str, ...]:
    """Numbers in as many decimals as their step needs."""
    decimals = next((d for d in range(9) if abs(round(step, d) - step) < ROUNDING * step), 9)
    return tuple(in_format(value, f".{decimals}f") for value in np.round(values, decimals).tolist())


def power_of_ten(greatest: float) -> int:
    """The exponent, a multiple of three, that leaves numbers from 1 to 1000; 0 if `greatest` needs no power of ten."""
    if greatest == 0 or PLAIN_RANGE[0] <= greatest < PLAIN_RANGE[1]:
        return 0
    return 3 * math.floor(math.log10(greatest) / 3)


def with_power(label: str, exponent: int) -> str:
    """An axis label with the power of ten that its numbers omit, before the unit."""
    if exponent == 0:
        return label
    meaning, bracket, unit = label.rpartition("[")
    return f"{meaning}[{ten_to(exponent)} {unit}" if bracket else f"{label} [{ten_to(exponent)}]"
