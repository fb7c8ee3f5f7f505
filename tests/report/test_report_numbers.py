"""Numbers as they are printed, against the numbers that were put in."""

import math
import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from davinci_forces.report.content.number import MISSING, Number

PLAIN = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")
sizes = st.builds(lambda m, e: m * 10.0**e, st.floats(1, 9.999), st.integers(-25, 25))
values = st.one_of(sizes, sizes.map(lambda x: -x), st.just(0.0))


def read(text: str) -> list[str]:
    """The printed value, and the deviation where there is one, as Python writes them."""
    mantissas, _, power = text.translate(PLAIN).partition(" × 10")
    return [f"{part}e{power or 0}" for part in mantissas.strip("()").split(" ± ")]


@given(values, st.integers(1, 8))
def test_a_number_is_printed_with_its_significant_digits(value: float, digits: int) -> None:
    (printed,) = read(Number(value, digits=digits).text)
    assert math.isclose(float(printed), value, rel_tol=0.5 * 10.0 ** (1 - digits) * 1.0001)


@given(values, sizes)
def test_a_deviation_has_two_significant_digits_and_its_value_ends_with_them(value: float, std: float) -> None:
    printed, deviation = read(Number(value, "N", std).text)
    assert math.isclose(float(deviation), std, rel_tol=0.0501)
    assert len(re.sub(r"e.*|\.", "", deviation).lstrip("0")) == 2
    assert (
        deviation.partition("e")[0].partition(".")[2].__len__() == printed.partition("e")[0].partition(".")[2].__len__()
    )
    assert abs(float(printed) - value) <= 0.0501 * std + 1e-12 * abs(value)


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (Number(0.12345, "N m", 0.00567), "0.1235 ± 0.0057 N m"),
        (Number(3e-7, "s", 1e-9), "(3.000 ± 0.010) × 10⁻⁷ s"),
        (Number(1234, "N", 250), "(1.23 ± 0.25) × 10³ N"),
        (Number(0.99999, "", 0.0996), "1.00 ± 0.10"),
        (Number(-2.0, "rad"), "−2.000 rad"),
        (Number(0, "N"), "0 N"),
        (Number(99.97, digits=3), "100"),
        (Number(6.4806, "s", 0.0), "6.481 s"),
    ],
)
def test_examples_are_printed_as_a_paper_prints_them(number: Number, text: str) -> None:
    assert str(number) == text


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_a_dash_without_a_unit(value: float) -> None:
    assert str(Number(value, "N", 0.1)) == MISSING
