"""A number that knows how it is printed."""

import math
from dataclasses import dataclass

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
MINUS = "\N{MINUS SIGN}"
MISSING = "–"


@dataclass(frozen=True)
class Number:
    """A value with its unit, standard error and key in results.json.

    Printed as value ± std with two significant digits of std, else with `digits` significant digits; far from one, with
    a power of ten.  What is not finite is printed as a dash, what is below `least` as less than it.
    """

    value: float
    unit: str = ""
    std: float | None = None
    key: str | None = None
    digits: int = 4
    least: float | None = None  # a smaller value is printed as less than this: 0.001 for a probability

    def __str__(self) -> str:
        """The number with its unit."""
        return f"{self.text} {self.unit}" if self.unit and self.text != MISSING else self.text

    @property
    def text(self) -> str:
        """The number without its unit."""
        if not math.isfinite(self.value):
            return MISSING
        if self.least is not None and self.value < self.least:
            return f"< {self.least:g}"
        if self.std is not None and math.isfinite(self.std) and self.std > 0:
            return _with_std(self.value, self.std).replace("-", MINUS)
        return _significant(self.value, self.digits).replace("-", MINUS)


def in_format(value: float, form: str) -> str:
    """A number in a format such as `.1f`: a true minus sign, no sign of a printed zero, a dash if it is not finite."""
    text = f"{value:{form}}" if math.isfinite(value) else MISSING
    return text.replace("-", MINUS) if text == MISSING or float(text) else text.lstrip("+-")


def _with_std(value: float, std: float) -> str:
    exponent = _exponent(max(abs(value), std), 2)
    last = _exponent(std, 2) - 1  # the power of ten of the last printed digit
    if -4 < exponent < 6 and last <= 0:
        return f"{value:.{-last}f} ± {std:.{-last}f}"
    decimals = max(exponent - last, 0)
    scale = 10.0**exponent
    return f"({value / scale:.{decimals}f} ± {std / scale:.{decimals}f}) × {ten_to(exponent)}"


def _significant(value: float, digits: int) -> str:
    if value == 0:
        return "0"
    exponent = _exponent(value, digits)
    if -4 < exponent < 6:
        return f"{value:.{max(digits - 1 - exponent, 0)}f}"
    mantissa, _, power = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa} × {ten_to(int(power))}"


def _exponent(value: float, digits: int) -> int:
    """The power of ten of the first digit once rounded to `digits`: 0.9996 to three is 1.00, so 0."""
    return int(f"{value:.{digits - 1}e}".partition("e")[2]) if value else 0


def ten_to(exponent: int) -> str:
    """A power of ten as it is printed."""
    return f"10{str(exponent).translate(SUPERSCRIPTS)}"
