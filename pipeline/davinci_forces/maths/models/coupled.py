"""The model of joints that move together: the arm's links, what its drives add, and the friction of each joint.

    tau = Y_b(q, dq, ddq) beta + sum of friction,    beta = K pi                                   (4.27), (4.38), (6.3)

pi are the inertial parameters of all links and, of every joint, a rotor's inertia, a spring and an offset; beta are the
combinations of them that motion can tell.  A counterweight is a link like any other.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.maths.mechanics.bodies import PARAMETERS, BaseParameters, base_parameters
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.rigid_body import regressor
from davinci_forces.maths.models.bias import COULOMB, VISCOUS
from davinci_forces.maths.models.memory import SAMPLES, driven, efforts
from davinci_forces.maths.models.model import ArmMotion, JointDynamics, Mechanism, Parameter, Regressor
from davinci_forces.maths.models.terms import Term

RICH = 200  # random poses, velocities and accelerations that tell the base parameters
ADDED = ("rotor inertia", "spring", "offset")  # that the drive and the cables of each joint add to its links
NOT_NEGATIVE = (True, True, False)  # of which physics knows the sign: a spring pulls back
LINK_UNITS = ("kg", *["kg m"] * 3, *["kg m^2"] * 6)
ADDED_UNITS = ("{inertia}", "{effort}/{position}", "{effort}")


@dataclass(frozen=True)
class CoupledArm:
    """Joints whose efforts depend on the motion of all of them, and each one's own friction.

    `rows` are the joints (indices) whose effort the model gives, `friction` the terms of each of them, and `units` fill
    in the units of each of them.  With one row it is that joint of a coupled arm, whose parameters no other shares.
    """

    group: str
    joints: tuple[str, ...]  # the first n coordinates of the chain
    rows: tuple[int, ...]
    chain: Chain
    friction: tuple[tuple[Term, ...], ...]
    units: tuple[dict[str, str], ...]  # of a row: what {inertia}, {effort}, {position} and {gain} are
    name: str = "coupled"

    @property
    def efforts(self) -> tuple[str, ...]:
        """The joints of the rows."""
        return tuple(self.joints[row] for row in self.rows)

    @property
    def base(self) -> BaseParameters:
        """What a rich motion of all joints can tell of the links and drives, from the efforts of the rows."""
        return told(self.chain, len(self.joints), self.rows)

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The base parameters by the one that leads each, then the friction of each row."""
        L = 10 * len(self.chain.links)
        led = [self._link_parameter(c) if c < L else self._added_parameter(c - L) for c in self.base.columns.tolist()]
        return (*led, *(self._friction_parameter(i, term) for i, terms in enumerate(self.friction) for term in terms))

    @property
    def displacements(self) -> set[tuple[int, float]]:
        """Those of its friction."""
        return {(joint, term.displacement) for _, joint, term, _ in self._frictions() if term.displacement}

    @property
    def mechanism(self) -> Mechanism:
        """Base parameters by all links' and what is added to each row; friction by itself."""
        K, L, terms = self.base.combination, len(self.chain.links), [term for own in self.friction for term in own]
        A = np.zeros((len(K) + len(terms), K.shape[1] + len(terms)))
        A[: len(K), : K.shape[1]], A[len(K) :, K.shape[1] :] = K, np.eye(len(terms))
        added = np.repeat(NOT_NEGATIVE, len(self.rows))
        return Mechanism(A, L, np.r_[np.zeros(10 * L, np.bool_), added, np.array([t.positive for t in terms], bool)])

    def regressor(self, motion: ArmMotion) -> Regressor:
        """Phi (N, m, p).  (6.3), (6.9)"""
        N, b = len(motion.q), len(self.base.columns)
        Phi, known = np.zeros((N, len(self.rows), b + sum(map(len, self.friction)))), np.ones(N, np.bool_)
        Phi[:, :, :b] = of_links(self.chain, self.rows, motion.q, motion.dq, motion.ddq)[:, :, self.base.columns]
        for row, joint, term, column in self._frictions():
            z, started = driven(motion, joint, term)
            known &= started
            _, _, _, _, viscous, coulomb, of_z = term.coefficients
            dq = motion.dq[:, joint]
            Phi[:, row, column] = viscous * dq + coulomb * np.sign(dq) + of_z * z
        return Regressor(Phi, known)

    def inertia(self, theta: Array, q: Array) -> Array:
        """M (N, m, m) at q (N, n).  (4.38)"""
        parts = [self.inertia_columns(q[i : i + SAMPLES]) @ theta for i in range(0, max(len(q), 1), SAMPLES)]
        return np.concatenate(parts)

    def inertia_columns(self, q: Array) -> Array:
        """What the parameters (p,) make of M at q (N, n), (N, m, m, p): M is linear in them."""
        still, base = np.zeros_like(q), self.base.columns
        columns = np.zeros((len(q), len(self.rows), len(self.rows), len(self.parameters)))
        gravity = of_links(self.chain, self.rows, q, still, still)[:, :, base]
        for j, row in enumerate(self.rows):
            unit = still + np.eye(q.shape[1])[row]
            columns[:, :, j, : len(base)] = of_links(self.chain, self.rows, q, still, unit)[:, :, base] - gravity
        return columns

    def bias(self, theta: Array, motion: ArmMotion) -> Array:
        """The effort (N, m) of this motion without what accelerates it.  (4.38)"""
        return efforts(self, theta, motion._replace(ddq=np.zeros_like(motion.ddq)))

    def joint_dynamics(self, theta: Array, motion: ArmMotion) -> tuple[JointDynamics, ...]:
        """Each row with its own inertia, viscous and Coulomb friction; all else is known from the motion."""
        M, tau = self.inertia(theta, motion.q), efforts(self, theta, motion)
        views = []
        for i, joint in enumerate(self.rows):
            of_row = [(float(theta[column]), term) for row, _, term, column in self._frictions() if row == i]
            viscous = sum(value * term.coefficients[VISCOUS] for value, term in of_row)
            coulomb = sum(value * term.coefficients[COULOMB] for value, term in of_row)
            ddq, dq = motion.ddq[:, joint], motion.dq[:, joint]
            known = tau[:, i] - M[:, i, i] * ddq - viscous * dq - coulomb * np.sign(dq)
            views.append(JointDynamics(M[:, i, i], (0.0, 0.0, 0.0, 0.0, viscous, coulomb, 0.0), known))
        return tuple(views)

    def _frictions(self) -> list[tuple[int, int, Term, int]]:
        """Row, joint, term and column of Phi of every term of friction."""
        pairs = [(i, joint, term) for i, joint in enumerate(self.rows) for term in self.friction[i]]
        return [(*pair, len(self.base.columns) + k) for k, pair in enumerate(pairs)]

    def _of(self, row: int) -> str:
        """What tells a joint's own parameters from those of the others."""
        return f" of {self.efforts[row]}" if len(self.rows) > 1 else ""

    def _link_parameter(self, column: int) -> Parameter:
        link, which = self.chain.links[column // 10], PARAMETERS[column % 10]
        symbol = f'{which[0]}_({which[1:]},"{link}")' if which != "m" else f'm_"{link}"'
        unit = LINK_UNITS[column % 10] + self.units[0]["gain"]
        return Parameter(f"{which} of {link}", f"partial tau \\/ partial {symbol}", unit, False)

    def _added_parameter(self, column: int) -> Parameter:
        which, row = divmod(column, len(self.rows))
        phi = ("dot.double(q)", "q", "1")[which]
        return Parameter(f"{ADDED[which]}{self._of(row)}", phi, ADDED_UNITS[which].format(**self.units[row]), False)

    def _friction_parameter(self, row: int, term: Term) -> Parameter:
        unit = term.unit.format(**self.units[row])
        return Parameter(f"{term.name}{self._of(row)}", term.typst, unit, term.positive, term.scale)


def of_links(chain: Chain, rows: tuple[int, ...], q: Array, dq: Array, ddq: Array) -> Array:
    """The columns (N, m, 10 L + 3 m) of all links' parameters, and of what drives and cables add to each row."""
    each = list(rows)
    Y, own = regressor(chain, q, dq, ddq)[:, each], np.eye(len(each))
    added = (x[:, :, None] * own for x in (ddq[:, each], q[:, each], np.ones_like(q[:, each])))
    return np.concatenate([Y, *added], axis=2)


@cache
def told(chain: Chain, n: int, rows: tuple[int, ...]) -> BaseParameters:
    """The base parameters of the first n coordinates of a chain, from the efforts of some of them."""
    random = np.random.default_rng(0)
    q, dq, ddq = (random.uniform(-1.0, 1.0, (RICH, n)) for _ in range(3))
    slides = chain.slides[[int(np.flatnonzero(chain.coordinate == i)[0]) for i in range(n)]]
    return base_parameters(of_links(chain, rows, q * np.where(slides, 0.2, 1.0), 2.0 * dq, 5.0 * ddq))
