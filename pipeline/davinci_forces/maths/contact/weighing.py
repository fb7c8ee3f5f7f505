"""Estimate the mass whose gravity and inertia explain external efforts best, and its standard error.

    y_j = m x_j + b_j + e_j,    m = sum_j w_j x_j' y_j / sum_j w_j x_j' x_j,    w_j = 1 / sigma_j^2

x_j is the effort of joint j per kilogram, and b_j its day offset, a constant effort that differs from day to day.  The
offset removes the mean of both.  A joint has an offset only if x_j varies enough to be distinguished from a constant.

The mass is a point fixed to one of the arm's links.  Section 7.5

    tau_load = m (J' (a + g up)),    a = J ddq + dJ/dt dq                                          (4.27), (7.30)

Positions are in metres from the remote centre, in axes fixed to the link; at q = 0 they are the base axes.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import chdtrc

from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.mechanics.bodies import Bodies
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import frames, remote_centre, to_base
from davinci_forces.maths.mechanics.rigid_body import inverse_dynamics
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean, of_left_out
from davinci_forces.maths.uncertainty.error_band import NORMAL_95, students_95

SAME_SQUARES = 1e-3  # of what is left of the efforts: models that leave as much are not told apart
PARTS = 6  # number of blocks of a path, as in the cross-validation of models
MIN_DEGREES = 3  # of freedom, with which the spread between periods is known
# If a smaller share of a column's power is variance, an offset more than doubles the standard error.
MIN_VARIANCE_SHARE = 0.25
MIN_AGREEMENT = 0.01  # probability of the joints' chi-square, below which they contradict each other


class Rows(NamedTuple):
    """The samples of one joint of one recording, along its path."""

    x: Array  # (K,) effort per kilogram [effort/kg]
    y: Array  # (K,) external effort
    block: Integers  # (K,) of the path
    sigma: float = 1.0  # standard deviation of the model's error

    @property
    def varies(self) -> bool:
        """Whether the load varies enough to be distinguished from an offset."""
        return bool(np.var(self.x) >= MIN_VARIANCE_SHARE * np.mean(self.x**2))

    def centre(self, which: Booleans | None = None) -> tuple[Array, Array]:
        """Column and effort at some of the rows, without their means if the joint has an offset."""
        x, y = (self.x, self.y) if which is None else (self.x[which], self.y[which])
        return (x - x.mean(), y - y.mean()) if self.varies and len(x) else (x, y)


class MassEstimate(NamedTuple):
    """A mass and its standard error [kg]."""

    mass: float
    std: float


class Agreement(NamedTuple):
    """Whether the masses that joints tell alone agree: the probability of their chi-square if they do."""

    probability: float
    ratio: float  # by which the spread exceeds the standard errors (Birge); 1 if the masses agree
    differing: int  # the mass furthest from the mean, in standard errors


def fit_mass(rows: Sequence[Rows]) -> MassEstimate:
    """Estimate the mass from all joints, with its standard error by the jackknife over sixths of the path.

    The residuals of a model repeat with the path: only its sixths are nearly independent.  Efron and Tibshirani, 1993
    """
    without = np.array([[_mass(rows, block)] for block in range(PARTS)])
    return MassEstimate(_mass(rows), float(of_left_out(without)[0]))


def _mass(rows: Sequence[Rows], without: int | None = None) -> float:
    numerator = denominator = 0.0
    for row in rows:
        x, y = row.centre(None if without is None else row.block != without)
        numerator += float(x @ y) / row.sigma**2
        denominator += float(x @ x) / row.sigma**2
    return numerator / denominator if denominator > 0 else float("nan")


def spread_between(periods: Sequence[Rows]) -> float:
    """Standard deviation of the mass that one joint tells in a period, between periods; 0 with fewer than two."""
    return float(np.std([_mass([period]) for period in periods], ddof=1)) if len(periods) > 1 else 0.0


def error_between(spreads: Sequence[tuple[int, float]], count: int) -> float:
    """Standard error of the mean mass of `count` periods, of which 1.96 make a 95 % interval; 0 if periods are too few.

    Noise that is slower than a sixth of the path shows between periods, and not in the jackknife.  `spreads` has, of
    each log of the joint, the number of periods and their standard deviation.
    """
    degrees = sum(max(n - 1, 0) for n, _ in spreads)
    if degrees < MIN_DEGREES or not count:
        return 0.0
    variance = sum((n - 1) * std**2 for n, std in spreads if n > 1) / degrees
    return float(np.sqrt(variance / count)) * students_95(degrees) / NORMAL_95


def pooled_std(run: MassEstimate, free: Sequence[MassEstimate]) -> float:
    """Standard error of the mass of one joint, of which 1.96 make a 95 % interval.

    The variances of the run and of masses in free motion are averaged, and widened by Student's t: a jackknife over
    `PARTS` has few degrees of freedom.  If masses in free motion, truly 0, exceed it beyond chance, they widen it, too.
    """
    std = float(np.sqrt(np.mean([estimate.std**2 for estimate in (run, *free)])))
    squares = float(np.sum([(estimate.mass / std) ** 2 for estimate in free])) if std > 0 else 0.0
    exceeds = bool(free) and chdtrc(len(free), squares) < MIN_AGREEMENT
    birge = max(1.0, (squares / len(free)) ** 0.5) if exceeds else 1.0
    return birge * std * students_95((PARTS - 1) * (1 + len(free))) / NORMAL_95


def scaled_constant(constant: float, known_mass: float, apparent: MassEstimate) -> tuple[float, float]:
    """The torque constant with which a known mass [kg] has the effort that it showed, and its standard error [N m/A].

    K = K_0 m / m_0,    s_K = |K| s_0 / |m_0|,    m_0 the mass that appears with the constant K_0
    """
    value = constant * known_mass / apparent.mass
    return value, abs(value * apparent.std / apparent.mass)


def agreement(masses: Sequence[MassEstimate]) -> Agreement:
    """Test masses with independent errors against their weighted mean.

    chi^2 = sum_j (m_j - m)^2 / s_j^2,    ratio = sqrt(chi^2 / (J - 1))                                (Birge, 1932)
    """
    mass, std = np.array(masses).T
    weight = 1.0 / np.maximum(std, np.finfo(float).tiny ** 0.25) ** 2
    squares = weight * (mass - weight @ mass / weight.sum()) ** 2
    free = len(masses) - 1
    probability = float(chdtrc(free, squares.sum())) if free else 1.0
    ratio = float(np.sqrt(squares.sum() / free)) if probability < MIN_AGREEMENT else 1.0
    return Agreement(probability, ratio, int(squares.argmax()))


def shares(rows: Sequence[Rows]) -> Array:
    """Share (J,) of each joint in the mass."""
    power = np.array([float(np.sum(row.centre()[0] ** 2)) / row.sigma**2 for row in rows])
    return np.asarray(power / power.sum())


def offset(row: Rows, mass: float) -> float:
    """Offset b of a joint with this mass; 0 if it has none."""
    return float(np.mean(row.y - mass * row.x)) if row.varies else 0.0


def residual(row: Rows, mass: float) -> Array:
    """Residual effort (K,) of a mass and the offset."""
    return np.asarray(row.y - mass * row.x - offset(row, mass))


def model_errors(rows: Sequence[Rows]) -> float:
    """Root mean square of the free-motion residuals of one joint, over its recordings with equal weight."""
    squares = [np.mean(residual(row, 0.0) ** 2) for row in rows]
    floor = 1e-9 * max(float(np.abs(row.x).max()) for row in rows)  # error of a model that fits exactly
    return max(float(np.sqrt(np.mean(squares))), floor)


def offset_std(row: Rows, mass: MassEstimate) -> float:
    """Standard error of a joint's offset, by those of the mean effort and of the mass; NaN if it has none."""
    mean_std = error_of_pooled_mean(row.y - mass.mass * row.x)
    return float(np.hypot(mean_std, mass.std * float(np.mean(row.x)))) if row.varies else float("nan")


def better(rows: Sequence[Rows], others: Sequence[Rows]) -> float:
    """Number of standard errors by which these columns explain the efforts better than others do; < 0 if worse.

    It is 0 where both leave nearly the same, as on a slide that moves up and down, of which mirrored columns are equal.
    """
    squares, of_others = _squares(rows), _squares(others)
    gain = of_others - squares
    spread = np.sqrt(PARTS / (PARTS - 1) * np.sum((gain - gain.mean()) ** 2))
    differ = abs(gain.sum()) > SAME_SQUARES * min(squares.sum(), of_others.sum())
    return float(gain.sum() / spread) if differ and spread > 0 else 0.0


def _squares(rows: Sequence[Rows]) -> Array:
    """Weighted residual squares of the best mass in each block (B,)."""
    mass = _mass(rows)
    return np.asarray(np.sum([np.bincount(r.block, (residual(r, mass) / r.sigma) ** 2, PARTS) for r in rows], axis=0))


def widening_factor(free: Sequence[MassEstimate], common: float) -> float:
    """Factor, at least 1, by which masses estimated on free motion, with true mass 0, exceed their standard errors.

    `common` is the standard error of the fit, which all masses share.  (Birge, 1932)
    """
    ratios = [w.mass**2 / (w.std**2 + common**2) for w in free if w.std > 0]
    return max(1.0, float(np.sqrt(np.mean(ratios)))) if ratios else 1.0


def moved_with(chain: Chain, coordinate: int) -> str:
    """The link that a coordinate moves between base and tip, or about the remote centre; raises ValueError if none."""
    for body in to_base(chain, int(chain.body[chain.names.index(chain.tip)])):
        if chain.coordinate[body - 1] == coordinate:
            return chain.links[body - 1]
    raise ValueError(f"coordinate {coordinate} does not move {chain.tip}")


def mirror_position(position: ArrayLike) -> Array:
    """The position (3,) rotated by half a turn about the vertical: at the same height on the other side of the link."""
    return np.asarray(position, float) * (-1.0, -1.0, 1.0)


def unit_load(chain: Chain, link: str, position: ArrayLike, q: Array, dq: Array, ddq: Array) -> Array:
    """Effort (N, n) by gravity and inertia of 1 kg at a position (3,) [m] of a link, in a motion (N, n)."""
    n, L, which, frame = q.shape[1], len(chain.links), chain.links.index(link), chain.names.index(link)
    pose = frames(chain, np.zeros(n))[frame] @ np.linalg.inv(chain.offset[frame])
    point = np.append(remote_centre(chain) + np.asarray(position, float), 1.0)
    masses, centres = np.zeros(L), np.zeros((L, 3))
    masses[which], centres[which] = 1.0, np.linalg.solve(pose, point)[:3]  # in the link's frame, whatever q
    return inverse_dynamics(chain, Bodies(masses, centres, np.zeros((L, 3, 3)), np.zeros(L, np.int64)), q, dq, ddq)
