"""The terms of a joint model, and its bias.

A joint model is linear in its parameters (6.8), and each of its terms is linear in acceleration:

    tau = sum_i theta_i phi_i,        phi_i = a_i ddq + b_i(q, dq)

One tuple of terms therefore gives the regressor for identification, and inertia, bias and its derivatives for the
filter.  b_i is a linear combination of the functions `COEFFICIENTS`, and so is the bias of a joint:

    b(q, dq) = c_1 + c_s sin q + c_c cos q + c_q q + c_v dq + c_f sign(dq) + c_z z                     (7.15), (7.16)

z is the deflection of the presliding friction, which follows from the measured motion (Dahl 1968):

    z+ = s - (s - z) exp(-|dq| T_s / x_0),        s = sign(dq)

This is exact for constant velocity over a sample.  `bias` is for arrays of samples; `filters.sample` has that of one.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import GRAVITY

COEFFICIENTS = ("1", "sin q", "cos q", "q", "dq", "sign(dq)", "z")
VISCOUS, COULOMB = COEFFICIENTS.index("dq"), COEFFICIENTS.index("sign(dq)")
Coefficients = tuple[float, ...]
SIGN = 'op("sign")(dot(q))'
# Terms whose z depends on position and velocity only: name, phi in Typst's maths, unit, name of z, z.
_OF_MOTION: tuple[tuple[str, str, str, str, Callable[[Array, Array], Array]], ...] = (
    ("viscous friction, difference", "abs(dot(q))", "{effort} s/{position}", "|dq|", lambda q, dq: np.abs(dq)),
    ("quadratic friction", "abs(dot(q)) dot(q)", "{effort} s^2/{position}^2", "|dq| dq", lambda q, dq: np.abs(dq) * dq),
    ("viscous friction, slope", "q dot(q)", "{effort} s/{position}^2", "q dq", lambda q, dq: q * dq),
    ("Coulomb friction, slope", f"q {SIGN}", "{effort}/{position}", "q sign(dq)", lambda q, dq: q * np.sign(dq)),
    (
        "Coulomb friction, curvature", f"q^2 {SIGN}", "{effort}/{position}^2", "q^2 sign(dq)",
        lambda q, dq: q**2 * np.sign(dq),
    ),
    ("stiffness, slope", "q^2", "{effort}/{position}^2", "q^2", lambda q, dq: q**2),
    ("stiffness, curvature", "q^3", "{effort}/{position}^3", "q^3", lambda q, dq: q**3),
    ("second harmonic, sine", "sin(2 q)", "{effort}", "sin 2q", lambda q, dq: np.sin(2.0 * q)),
    ("second harmonic, cosine", "cos(2 q)", "{effort}", "cos 2q", lambda q, dq: np.cos(2.0 * q)),
    ("third harmonic, sine", "sin(3 q)", "{effort}", "sin 3q", lambda q, dq: np.sin(3.0 * q)),
    ("third harmonic, cosine", "cos(3 q)", "{effort}", "cos 3q", lambda q, dq: np.cos(3.0 * q)),
)  # fmt: skip
Z_OF_MOTION = {function: z for *_, function, z in _OF_MOTION}


def bias(c: Coefficients, q: Any, dq: Any, z: Any) -> tuple[Any, Any, Any]:
    """b and its derivatives by q and dq, for floats or arrays of one shape; c in the order of `COEFFICIENTS`.

    The derivative of sign(dq) is taken as zero, as in section 7.1.2.
    """
    sine, cosine = np.sin(q), np.cos(q)
    b = c[0] + c[1] * sine + c[2] * cosine + c[3] * q + c[4] * dq + c[5] * np.sign(dq) + c[6] * z
    return b, c[1] * cosine - c[2] * sine + c[3], c[4]


def deflect(z: Any, dq: Any, T_s: float, x_0: float) -> Any:
    """The deflection z, -1 to 1, one sampling time T_s [s] later; it reverses within the displacement `x_0`."""
    sign = np.sign(dq)
    return sign - (sign - z) * np.exp(-np.abs(dq) * T_s / x_0)


@dataclass(frozen=True)
class Term:
    """One column of the regressor: phi = a ddq + sum of b[f] f(q, dq) over functions f of `COEFFICIENTS`.

    `unit` is the parameter's unit: the joint fills {inertia}, {mass_moment}, {effort} and {position}.  `typst` is phi
    in Typst's maths.  By physics, a `positive` parameter is not negative.  A term of z (`friction_state`) has either
    one scale in the joint's units or a function of the motion.  The scale is the `displacement` of a deflection, the
    `width` of a smooth sign [velocity], or the `decay_velocity` of Stribeck's peak.  `of_motion` names the function in
    `Z_OF_MOTION`.
    """

    name: str
    typst: str
    unit: str
    a: float = 0.0
    b: Mapping[str, float] = field(default_factory=dict, hash=False)
    positive: bool = False
    displacement: float = 0.0
    width: float = 0.0
    decay_velocity: float = 0.0
    of_motion: str = ""

    def __post_init__(self) -> None:
        if unknown := sorted(set(self.b) - set(COEFFICIENTS)):
            raise ValueError(f"term {self.name!r}: no functions {unknown}; there are {', '.join(COEFFICIENTS)}")
        scales = (self.displacement, self.width, self.decay_velocity)
        if sum(scale > 0 for scale in scales) + (self.of_motion in Z_OF_MOTION) != int(self.has_z):
            message = "a term of z needs one displacement, width or velocity above 0, or one function of the motion"
            raise ValueError(f"term {self.name!r}: {message}")

    @property
    def has_z(self) -> bool:
        """Whether it is a term of z, which a filter takes as known from the measured motion."""
        return "z" in self.b

    @property
    def scale(self) -> float:
        """The displacement or velocity that z depends on, in the joint's units; 0 for a term without."""
        return self.displacement or self.width or self.decay_velocity

    def with_scale(self, scale: float) -> "Term":
        """Return the term with another scale."""
        changed: dict[str, Any] = {x: scale for x in ("displacement", "width", "decay_velocity") if getattr(self, x)}
        return replace(self, **changed)

    @property
    def coefficients(self) -> Coefficients:
        """The coefficients of b, for `bias`."""
        return tuple(self.b.get(name, 0.0) for name in COEFFICIENTS)


inertia = Term("inertia", "dot.double(q)", "{inertia}", a=1.0, positive=True)
lifted_mass = Term("lifted mass", "(dot.double(q) - g)", "{inertia}", a=1.0, b={"1": -GRAVITY}, positive=True)
gravity_sin = Term("gravity, sine", "g sin(q)", "{mass_moment}", b={"sin q": GRAVITY})
gravity_cos = Term("gravity, cosine", "g cos(q)", "{mass_moment}", b={"cos q": GRAVITY})
viscous = Term("viscous friction", "dot(q)", "{effort} s/{position}", b={"dq": 1.0}, positive=True)
coulomb = Term("Coulomb friction", SIGN, "{effort}", b={"sign(dq)": 1.0}, positive=True)
offset = Term("offset", "1", "{effort}", b={"1": 1.0})
stiffness = Term("stiffness", "q", "{effort}/{position}", b={"q": 1.0})


def presliding_friction(displacement: float, number: int = 1) -> Term:
    """The share of Coulomb friction that reverses within a displacement in the joint's units; 0 far from a reversal."""
    name, phi = f"presliding friction {number}", f"(z_{number} - {SIGN})"
    return Term(name, phi, "{effort}", b={"z": 1.0, "sign(dq)": -1.0}, displacement=displacement)


def smooth_sign(width: float) -> Term:
    """The share of Coulomb friction that reverses within velocities of +- `width`, not at once; 0 at higher speed."""
    phi = f'(tanh(dot(q) \\/ dot(q)_"w") - {SIGN})'
    return Term("smooth friction", phi, "{effort}", b={"z": 1.0, "sign(dq)": -1.0}, width=width)


def stribeck(decay_velocity: float) -> Term:
    """Additional friction near standstill, which decays e-fold at `decay_velocity`, in the joint's units."""
    phi = f'{SIGN} e^(-(dot(q) \\/ dot(q)_"s")^2)'
    return Term("Stribeck friction", phi, "{effort}", b={"z": 1.0}, decay_velocity=decay_velocity)


OF_MOTION = {
    name: Term(name, typst, unit, b={"z": 1.0}, of_motion=function) for name, typst, unit, function, _ in _OF_MOTION
}

TERMS = {t.name: t for t in (inertia, lifted_mass, gravity_sin, gravity_cos, viscous, coulomb, offset, stiffness)}
