"""The model of coupled joints: the arm's links, drives and cables, and the friction of each joint.

    tau = Y_b(q, dq, ddq) beta + sum of friction,    beta = K pi                                   (4.27), (4.38), (6.3)

pi are the inertial parameters of all links, and a rotor inertia, a spring and an offset for every joint.  beta are
the identifiable combinations of pi.  A counterweight is a link like any other.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from davinci_forces.maths.arrays import Array, Integers
from davinci_forces.maths.mechanics.bodies import PARAMETERS, RANDOM_SAMPLES, BaseParameters, Bodies, base_parameters
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import evaluate_in_blocks
from davinci_forces.maths.mechanics.rigid_body import regressor
from davinci_forces.maths.models.memory import efforts, friction_state
from davinci_forces.maths.models.model import ArmMotion, JointDynamics, Mechanism, Parameter, Regressor
from davinci_forces.maths.models.terms import COULOMB, VISCOUS, Term

ADDED = ("rotor inertia", "spring", "offset")  # parameters of the drive and the cables of each joint
NOT_NEGATIVE = (True, True, False)  # of `ADDED`: a spring pulls back, and an offset has either sign
LINK_UNITS = ("kg", *["kg m"] * 3, *["kg m^2"] * 6)
ADDED_UNITS = ("{inertia}", "{effort}/{position}", "{effort}")
FACTOR_ROUNDING = 1e-9  # of a factor that is 0
LINK_SAMPLES = 1 << 12  # whose regressor of all links is in memory at once; few of its columns are used


@dataclass(frozen=True)
class CoupledArm:
    """Joints whose efforts depend on the motion of all joints, each with its friction.

    `rows` are the indices of the joints whose effort the model gives.  `friction` and `units` have one entry a row.
    A model with one row describes one joint of a coupled arm.
    """

    group: str
    joints: tuple[str, ...]  # the first n coordinates of the chain
    rows: tuple[int, ...]
    chain: Chain
    friction: tuple[tuple[Term, ...], ...]
    units: tuple[dict[str, str], ...]  # for each row, the units of {inertia}, {effort}, {position} and {gain}
    name: str = "coupled"

    @property
    def efforts(self) -> tuple[str, ...]:
        """The joints of the rows."""
        return tuple(self.joints[row] for row in self.rows)

    @property
    def base(self) -> BaseParameters:
        """The parameters of links and drives that the rows' efforts identify under a rich motion of all joints."""
        return arm_base_parameters(self.chain, len(self.joints), self.rows)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The base parameters, each named by the column of pi that it leads with, then the friction of each row."""
        L, base = 10 * len(self.chain.links), self.base
        columns = range(base.combination.shape[1])
        of_columns = [self._link_parameter(c) if c < L else self._added_parameter(c - L) for c in columns]
        sums = [combination(row, of_columns) for row in base.combination]
        leading = [of_columns[c]._replace(combination=text) for c, text in zip(base.columns, sums, strict=True)]
        return (
            *leading,
            *(self._friction_parameter(i, term) for i, terms in enumerate(self.friction) for term in terms),
        )

    def of_bodies(self, bodies: Bodies) -> Array:
        """The parameters (p,) of an arm with these bodies, without rotors; NaN for drives, cables and friction."""
        L, base = 10 * len(self.chain.links), self.base
        values = base.combination[:, :L] @ bodies.parameters(len(self.joints))
        described, theta = base.columns < L, np.full(len(self.parameters), np.nan)
        theta[: len(values)][described] = np.where(np.abs(values) > FACTOR_ROUNDING, values, 0.0)[described]
        return theta

    @property
    def displacements(self) -> set[tuple[int, float]]:
        """The joint and the displacement of each presliding friction."""
        return {(joint, term.displacement) for _, joint, term, _ in self._frictions() if term.displacement}

    @property
    def mechanism(self) -> Mechanism:
        """Base parameters as combinations of pi; friction parameters enter unchanged."""
        K, L, terms = self.base.combination, len(self.chain.links), [term for row in self.friction for term in row]
        A = np.zeros((len(K) + len(terms), K.shape[1] + len(terms)))
        A[: len(K), : K.shape[1]], A[len(K) :, K.shape[1] :] = K, np.eye(len(terms))
        added = np.repeat(NOT_NEGATIVE, len(self.rows))
        return Mechanism(A, L, np.r_[np.zeros(10 * L, np.bool_), added, np.array([t.positive for t in terms], bool)])

    def regressor(self, motion: ArmMotion) -> Regressor:
        """Phi (N, m, p).  (6.3), (6.9)"""
        N, b = len(motion.q), len(self.base.columns)
        Phi, valid = np.zeros((N, len(self.rows), b + sum(map(len, self.friction)))), np.ones(N, np.bool_)
        for samples in (slice(i, i + LINK_SAMPLES) for i in range(0, N, LINK_SAMPLES)):
            q, dq, ddq = (x[samples] for x in motion[:3])
            Phi[samples, :, :b] = of_links(self.chain, self.rows, q, dq, ddq, self.base.columns)
        for row, joint, term, column in self._frictions():
            z, z_valid = friction_state(motion, joint, term)
            valid &= z_valid
            c, dq = term.coefficients, motion.dq[:, joint]
            Phi[:, row, column] = c[VISCOUS] * dq + c[COULOMB] * np.sign(dq) + term.has_z * z
        return Regressor(Phi, valid)

    def inertia(self, theta: Array, q: Array) -> Array:
        """M (N, m, m) at q (N, n).  (4.38)"""
        return evaluate_in_blocks(lambda block: self.inertia_columns(block) @ theta, q)

    def inertia_columns(self, q: Array) -> Array:
        """Derivatives (N, m, m, p) of M at q (N, n) by the parameters; M is linear in them."""
        still, base = np.zeros_like(q), self.base.columns
        columns = np.zeros((len(q), len(self.rows), len(self.rows), len(self.parameters)))
        gravity = of_links(self.chain, self.rows, q, still, still, base)
        for j, row in enumerate(self.rows):
            unit = still + np.eye(q.shape[1])[row]
            columns[:, :, j, : len(base)] = of_links(self.chain, self.rows, q, still, unit, base) - gravity
        return columns

    def joint_dynamics(self, theta: Array, motion: ArmMotion) -> tuple[JointDynamics, ...]:
        """For each row its inertia, viscous and Coulomb friction; all other effort is known from the motion."""
        M, tau = self.inertia(theta, motion.q), efforts(self, theta, motion)
        dynamics = []
        for i, joint in enumerate(self.rows):
            of_row = [(float(theta[column]), term) for row, _, term, column in self._frictions() if row == i]
            viscous = sum(value * term.coefficients[VISCOUS] for value, term in of_row)
            coulomb = sum(value * term.coefficients[COULOMB] for value, term in of_row)
            ddq, dq = motion.ddq[:, joint], motion.dq[:, joint]
            known_effort = tau[:, i] - M[:, i, i] * ddq - viscous * dq - coulomb * np.sign(dq)
            dynamics.append(JointDynamics(M[:, i, i], (0.0, 0.0, 0.0, 0.0, viscous, coulomb, 0.0), known_effort))
        return tuple(dynamics)

    def _frictions(self) -> list[tuple[int, int, Term, int]]:
        """The row, the joint, the term and its column of Phi, for every friction term."""
        pairs = [(i, joint, term) for i, joint in enumerate(self.rows) for term in self.friction[i]]
        return [(*pair, len(self.base.columns) + k) for k, pair in enumerate(pairs)]

    def _of(self, row: int) -> str:
        """The suffix of a row's parameter names; "" if there is only one row."""
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


def of_links(
    chain: Chain, rows: tuple[int, ...], q: Array, dq: Array, ddq: Array, columns: Integers | None = None
) -> Array:
    """The regressor (N, m, 10 L + 3 m) of all links, and of the drives and cables of each row; or some columns."""
    joints, L = list(rows), 10 * len(chain.parent)
    identity, columns = np.eye(len(joints)), np.arange(L + 3 * len(joints)) if columns is None else columns
    of_bodies = columns[columns < L]  # the links after the last of them are not computed
    Y = regressor(chain, q, dq, ddq, joints, int(of_bodies.max(initial=-1)) // 10 + 1)[:, :, of_bodies]
    added = [x[:, :, None] * identity for x in (ddq[:, joints], q[:, joints], np.ones_like(q[:, joints]))]
    return np.concatenate([Y, np.concatenate(added, axis=2)[:, :, columns[columns >= L] - L]], axis=2)


def combination(factors: Array, parameters: Sequence[Parameter]) -> str:
    """The sum of parameters, each times its factor, as text; "" of a single one."""
    terms = [
        f"{c:+.4g} {p.name}" for c, p in zip(factors.tolist(), parameters, strict=True) if abs(c) > FACTOR_ROUNDING
    ]
    return " ".join(terms) if terms[1:] else ""


@cache
def arm_base_parameters(chain: Chain, n: int, rows: tuple[int, ...]) -> BaseParameters:
    """The base parameters of a chain with n coordinates that the efforts of the joints `rows` identify."""
    random = np.random.default_rng(0)
    q, dq, ddq = (random.uniform(-1.0, 1.0, (RANDOM_SAMPLES, n)) for _ in range(3))
    slides = chain.slides[[int(np.flatnonzero(chain.coordinate == i)[0]) for i in range(n)]]
    return base_parameters(of_links(chain, rows, q * np.where(slides, 0.2, 1.0), 2.0 * dq, 5.0 * ddq))
