"""The terms that a joint model is made of.

A joint model is linear in its parameters (6.8), and each of its terms is linear in acceleration:

    tau = sum_i theta_i phi_i(q, dq, ddq),        phi_i = a_i ddq + b_i(q, dq)

so one tuple of terms gives the regressor for identification, and the inertia, the bias force and its
derivatives for the filter.  The parts of a term are written as expressions in q and dq, because the same
expression has to run on arrays (numpy) and, sample by sample, inside the filter's compiled loop (math).
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Term:
    """One column of the regressor: phi = a ddq + b(q, dq), with the derivatives of b.

    `unit` is that of the parameter, with {inertia}, {effort} and {position} left to the joint; `typst` is phi in
    Typst's maths, for equations.  Expressions may use q, dq, g, sin, cos, tanh, exp, sign and abs.
    """

    name: str
    typst: str
    unit: str
    a: float = 0.0
    b: str = "0.0"
    b_q: str = "0.0"
    b_dq: str = "0.0"


inertia = Term("inertia", "dot.double(q)", "{inertia}", a=1.0)
lifted_mass = Term("lifted mass", "(dot.double(q) - g)", "{inertia}", a=1.0, b="-g")
gravity_sin = Term("gravity, sine", "g sin(q)", "kg m", b="g * sin(q)", b_q="g * cos(q)")
gravity_cos = Term("gravity, cosine", "g cos(q)", "kg m", b="g * cos(q)", b_q="-g * sin(q)")
viscous = Term("viscous friction", "dot(q)", "{effort} s/{position}", b="dq", b_dq="1.0")
# The jump at dq = 0 has no derivative; the filter takes it as zero there, as section 7.1.2 does.
coulomb = Term("Coulomb friction", 'op("sign")(dot(q))', "{effort}", b="sign(dq)")
offset = Term("offset", "1", "{effort}", b="1.0")
stiffness = Term("stiffness", "q", "{effort}/{position}", b="q", b_q="1.0")

TERMS = {
    term.name: term for term in (inertia, lifted_mass, gravity_sin, gravity_cos, viscous, coulomb, offset, stiffness)
}
