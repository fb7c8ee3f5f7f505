"""Short numbers on the axes of figures; the axis label states their common power of ten."""

import math
from typing import TYPE_CHECKING

from davinci_forces.report.content.number import MINUS, SUPERSCRIPTS

if TYPE_CHECKING:
    from matplotlib.axis import Axis

FEW_DECADES = 3  # axes of fewer decades are also numbered at 2 and 5
PLAIN_RANGE = (2e-3, 2e4)  # no power of ten is taken out if the largest magnitude is in this range


def power_of_ten(greatest: float) -> int:
    """The exponent, a multiple of three, that leaves numbers from 1 to 1000; 0 if `greatest` needs no power of ten."""
    if greatest == 0 or PLAIN_RANGE[0] <= greatest < PLAIN_RANGE[1]:
        return 0
    return 3 * math.floor(math.log10(greatest) / 3)


def scale_ticks(axis: "Axis", label: str) -> str:
    """Divide the numbers on an axis by a power of ten that suits its range, and return the label with this power."""
    from matplotlib.ticker import FuncFormatter

    # By default, matplotlib writes the power at the end of the axis, where the legend is.
    exponent = power_of_ten(float(max(abs(limit) for limit in axis.get_view_interval())))
    if exponent == 0:
        return label
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value / 10.0**exponent:.6g}".replace("-", MINUS)))
    ten = f"10{str(exponent).translate(SUPERSCRIPTS)}"
    meaning, bracket, unit = label.rpartition("[")
    return f"{meaning}[{ten} {unit}" if bracket else f"{label} [{ten}]"


def spread_ticks(axis: "Axis", capacity: float) -> None:
    """Use fewer numbers on a linear axis, which is `capacity` characters long, until no two of them touch."""
    from matplotlib.ticker import MaxNLocator

    locator, (low, high) = axis.get_major_locator(), axis.get_view_interval()
    while isinstance(locator, MaxNLocator):
        values = [value for value in locator() if low <= value <= high]
        numbers = axis.get_major_formatter().format_ticks(values)
        characters = 1 + max((len(number.replace(".", "")) for number in numbers), default=0)
        if len(values) < 3 or characters <= capacity * (values[1] - values[0]) / (high - low):
            break
        locator.set_params(nbins=len(values) - 2)


def set_log_ticks(axis: "Axis") -> None:
    """Number a logarithmic axis of a given range at 1, 2 and 5 of each decade, or at powers of ten if it is long."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, NullFormatter, NullLocator

    low, high = sorted(math.log10(limit) for limit in axis.get_view_interval())
    first, last = math.ceil(low), math.floor(high)
    if last - first < FEW_DECADES:
        values = [digit * 10.0**n for n in range(first - 1, last + 1) for digit in (1, 2, 5)]
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    else:
        values = [10.0**n for n in range(first, last + 1, math.ceil((last - first) / FEW_DECADES))]
        axis.set_major_formatter(
            FuncFormatter(lambda value, _: f"10{str(round(math.log10(value))).translate(SUPERSCRIPTS)}")
        )
    axis.set_major_locator(FixedLocator([value for value in values if low <= math.log10(value) <= high]))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
