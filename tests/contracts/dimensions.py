"""Dimensions, to compare the unit of a parameter with the term that it multiplies."""

import re
from dataclasses import dataclass
from functools import reduce
from operator import mul

from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.models.terms import Term
from davinci_forces.robots.robot import Kind

Powers = tuple[int, int, int, int]
BASE: dict[str, Powers] = {
    "1": (0, 0, 0, 0), "rad": (0, 0, 0, 0), "kg": (1, 0, 0, 0), "m": (0, 1, 0, 0), "s": (0, 0, 1, 0), "A": (0, 0, 0, 1),
}  # fmt: skip
BASE["N"] = (1, 1, -2, 0)


@dataclass(frozen=True)
class Dimension:
    """Powers of kg, m, s and A; an angle has none, and neither has a bare number."""

    powers: Powers = (0, 0, 0, 0)

    def __mul__(self, other: "Dimension"):
        kg, m, s, A = (a + b for a, b in zip(self.powers, other.powers, strict=True))
        return Dimension((kg, m, s, A))

    def __truediv__(self, other: "Dimension"):
        return self * other**-1

    def __pow__(self, n: int):
        kg, m, s, A = (n * a for a in self.powers)
        return Dimension((kg, m, s, A))

    def __add__(self, other: "Dimension"):
        if self != other:
            raise TypeError(f"{self} and {other} do not add up")
        return self


def of_unit(text: str) -> Dimension:
    """The dimension of a unit such as 'N m s/rad'."""
    above, _, below = text.partition("/")
    return _product(above) / _product(below)


def _product(text: str) -> Dimension:
    found = Dimension()
    for factor in text.split():
        name, _, power = factor.partition("^")
        found *= Dimension(BASE[name]) ** int(power or 1)
    return found


def of_phi(term: Term, kind: Kind) -> Dimension:
    """The dimension of a term for a kind of joint; raises TypeError where it has none."""
    second, position = of_unit("s"), of_unit(kind.unit("{position}"))
    of_sine = {"sin q", "cos q"} & set(term.b) or term.of_motion[:3] in ("sin", "cos")
    angle = Dimension() + position if of_sine else Dimension()  # a length has no sine
    functions = {"1": angle, "sin q": angle, "cos q": angle, "q": position, "dq": position / second}
    if term.of_motion and not of_sine:  # as in "q^2 sign(dq)": a product of powers, and a sign that has no dimension
        powers = re.findall(r"(dq|q)(?:\^(\d))?", re.sub(r"sign\(dq\)", "", term.of_motion))
        functions["z"] = reduce(mul, (functions[name] ** int(power or 1) for name, power in powers))
    # A factor of g has its dimension, and others are bare numbers; sign and deflection are bare numbers, too.
    parts = [
        functions.get(name, Dimension()) * (of_unit("m/s^2") if abs(factor) == GRAVITY else Dimension())
        for name, factor in term.b.items()
    ]
    total, *others = [position / second**2, *parts] if term.a else parts
    for part in others:
        total = total + part
    return total


def has_a_dimension(term: Term, kind: Kind) -> bool:
    """Whether a term means anything for this kind of joint: a length has no sine."""
    try:
        of_phi(term, kind)
    except TypeError:
        return False
    return True


def is_effort(term: Term, kind: Kind, measured: str = "") -> bool:
    """Whether parameter times term is an effort of this kind of joint, as it is measured."""
    effort = of_unit(kind.unit("{effort}", measured))
    return has_a_dimension(term, kind) and of_unit(kind.unit(term.unit, measured)) * of_phi(term, kind) == effort
