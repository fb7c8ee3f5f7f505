"""Where each table, figure and equation of the thesis is in this package, and its printed numbers beside ours.

`thesis.toml` has the rows and the printed numbers.  Numbers that follow from the thesis's own inputs are recomputed
here; parameters that it fitted to its recordings are compared with those of a study, as `davinci-thesis`.
"""

import tomllib
from collections.abc import Callable, Mapping
from decimal import Decimal
from functools import cache
from importlib.resources import files
from math import pi
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.estimators.pso import MAX_ITERATIONS, PARTICLES, PATIENCE
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.excitation import fourier
from davinci_forces.maths.models.terms import gravity_cos, gravity_sin, inertia
from davinci_forces.records.record import slug
from davinci_forces.robots import Joint, davinci

ROUNDING = 1e-9  # of a number that lies half a printed digit away
STANDARD_ERRORS = 2.0  # of a fitted parameter, within which it agrees
ESTIMATORS = ("wlse", "lse", "pso")
ROLL, PITCH, SLIDE = davinci.ROBOT.joints


class ThesisItem(NamedTuple):
    """A table, figure or group of equations."""

    item: str
    shows: str
    here: str  # commands, result keys, records and public names; or what it is, such as a photograph
    differs: str


class ThesisChapter(NamedTuple):
    """The rows of a chapter."""

    title: str
    rows: tuple[ThesisItem, ...]


class PrintedNumbers(NamedTuple):
    """Some printed numbers, and the same ones here; NaN where they come from recordings of which we have none."""

    item: str
    name: str
    printed: tuple[Decimal, ...]
    here: Array
    std: Array  # of the numbers here; 0 for what is computed
    why: str  # why they differ, if they do

    @property
    def differ(self) -> Array:
        """Whether each number here is not the printed one, rounded to its digits or within its standard errors."""
        half_digits = np.array([0.5 * 10.0 ** int(x.as_tuple().exponent) for x in self.printed])
        limit = np.where(self.std > 0, STANDARD_ERRORS * self.std, half_digits)
        return np.asarray(np.abs(self.here - np.array(self.printed, float)) > limit * (1 + ROUNDING))

    @property
    def printed_text(self) -> str:
        """The printed numbers, digit for digit."""
        return " ".join(map(str, self.printed))

    @property
    def here_text(self) -> str:
        """The numbers here; "as printed" if all are, "–" where there are none."""
        if np.isnan(self.here).all():
            return "–"
        text = " ".join("–" if np.isnan(value) else f"{value:.5g}" for value in self.here.tolist())
        return text if self.std.any() or self.differ.any() or np.isnan(self.here).any() else "as printed"


@cache
def read() -> dict[str, Any]:
    """The content of thesis.toml."""
    text = files("davinci_forces.simulation").joinpath("thesis.toml").read_text(encoding="utf-8")
    return tomllib.loads(text, parse_float=Decimal)  # which keeps the number of printed digits


def chapters() -> tuple[ThesisChapter, ...]:
    """All rows of the index."""
    return tuple(ThesisChapter(c["title"], tuple(ThesisItem(*row) for row in c["rows"])) for c in read()["chapter"])


def numbers(results: Mapping[str, tuple[float, float]]) -> tuple[PrintedNumbers, ...]:
    """The printed numbers beside ours; `results` has value and standard error of a study's fits by key."""
    compared = []
    for item, table in read()["numbers"].items():
        computed = FOUND[item]() if item in FOUND else {}
        for name, printed in table.items():
            unknown = np.full(len(printed), np.nan)
            here, std = computed.get(name, unknown), np.zeros(len(printed))
            if item in TABLES and name in ESTIMATORS:  # parameters in a study; NaN if it has none
                joint = TABLES[item]
                keys = (f"fit.{joint.name}.independent.{name}.{slug(term.name)}" for term in joint.terms)
                here, std = np.array([results.get(key, (np.nan, np.nan)) for key in keys]).T
            why = read()["why"].get(item, {}).get(name, "")
            compared.append(PrintedNumbers(item, name, tuple(map(Decimal, printed)), np.asarray(here, float), std, why))
    return tuple(compared)


def in_words(compared: tuple[PrintedNumbers, ...]) -> str:
    """How many printed numbers are found here, and how many differ."""
    known = [~np.isnan(x.here) for x in compared]
    count, differ = sum(len(x.printed) for x in compared), sum(int(x.differ.sum()) for x in compared)
    absent = count - sum(int(x.sum()) for x in known)
    of_recordings = f" {absent} are of recordings; davinci-thesis simulates these." * (absent > 0)
    return f"Of {count} printed numbers, {count - absent - differ} are found here, and {differ} differ.{of_recordings}"


def text(results: Mapping[str, tuple[float, float]]) -> str:
    """The index for a terminal."""
    compared = numbers(results)
    lines = [in_words(compared)]
    for chapter in chapters():
        lines += ["", chapter.title]
        for row in chapter.rows:
            lines += ["", f"{row.item}: {row.shows}", f"    {row.here.replace('`', '')}"]
            lines += [f"    differs: {row.differs}"] if row.differs else []
            for x in compared:
                if x.item == row.item:
                    why = f" ({x.why})" if x.differ.any() else ""
                    lines.append(f"    {x.name}: {x.printed_text}; here {x.here_text}{why}")
    return "\n".join(lines)


def links() -> dict[str, Array]:
    """The parameters of Table 3.1, from the chain."""
    alpha, a, d, theta = np.array([row[2:6] for row in davinci.CHAIN.table]).T
    names = ("a [m]", "d [m]", "alpha [pi/2]", "theta at q = 0 [rad]")
    return dict(zip(names, (a, d, alpha / (pi / 2), theta), strict=True))


def bodies() -> dict[str, Array]:
    """The distances of Table 4.1, whose printed signs are part of Eq 4.17, and Table 4.2, with one jaw."""
    centres = np.abs(davinci.in_table_frames().centres).max(axis=1)[:8]
    mass, height, radius = np.array([body[:3] for body in davinci.CYLINDERS[:8]]).T
    sizes = {"mass of links 2 to 9 [kg]": mass, "height [m]": height, "radius [m]": radius}
    return {"l_c2 to l_c9 [m]": centres, **sizes}


def factors(joint: Joint, item: str) -> dict[str, Array]:
    """The factors of monomials, such as m3 or m3 lc3, in the parameters of a joint, from the chain, as printed names.

    A name tells the monomials and the term, which is the inertia unless it says the sine or the cosine.
    """
    assert joint.physical is not None
    assert joint.dependence is not None
    place, coefficients = [x.name.removesuffix("L") for x in joint.physical.parameters], joint.dependence.coefficients
    columns = [sorted(i for i in row if i < len(place)) for row in joint.dependence.factors.tolist()]
    values = {}
    for name in read()["numbers"][item]:
        monomials, _, where = name.partition("of ")[2].partition(" in the ")
        term = joint.terms.index({"sine": gravity_sin, "cosine": gravity_cos}.get(where, inertia))
        factors = [sorted(map(place.index, monomial.split())) for monomial in monomials.split(", ")]
        values[name] = coefficients[term, [*map(columns.index, factors)]]
    return values


def trajectory(joint: Joint, source: str) -> fourier.Fourier:
    """A published trajectory of Table 6.1."""
    period, *x = dict(joint.published)[source]
    return fourier.Fourier.from_coefficients(np.array(x), period)


def excitation() -> dict[str, Array]:
    """Coefficients and criterion of Table 6.1; the criterion is of the corrected rows where there are any."""
    values, criteria = {}, []
    for joint in davinci.ROBOT.joints:
        published = dict(joint.published)
        source = "table-6.1-corrected" if "table-6.1-corrected" in published else "table-6.1"
        values[f"{joint.title.lower()}: a0 a1 b1 a2 b2 T"] = np.array([*published[source][1:], published[source][0]])
        criteria.append(float(fourier.determinant(fourier.observation(joint.terms, trajectory(joint, source)))))
    return values | {"f of roll, pitch, slide": np.array(criteria)}


def limits() -> dict[str, Array]:
    """The limits of Table 6.2."""
    joints = ((joint, joint.limits) for joint in davinci.ROBOT.joints)
    return {joint.title.lower(): np.array([*bound.q, *bound.dq, *bound.ddq]) for joint, bound in joints}


def motors() -> dict[str, Array]:
    """The motors of Table 6.3."""
    constants = np.array([joint.torque_constant for joint in davinci.ROBOT.joints])
    return {"gear ratio of motors 1 to 7": davinci.DRIVES.gear_ratio, "K_m [N m/A] of motors 1 to 3": constants}


def counts() -> dict[str, Array]:
    """Numbers of physical parameters, and of parameters of the models."""
    joints = davinci.ROBOT.joints
    physical = np.array([len(joint.physical.parameters) for joint in joints if joint.physical])
    lumped = np.array([len(joint.terms) for joint in joints])
    return {"physical parameters of roll, pitch, slide": physical, "parameters of roll, pitch, slide": lumped}


def parameters(joint: Joint) -> dict[str, Array]:
    """The guess from Tables 4.1 and 4.2, and the errors that follow from the printed parameters.

    MSE(theta) = MSE_LSE + d' (F' F / K) d, d = theta - theta_LSE, for the printed excitation without its misprints.
    """
    assert joint.physical is not None
    assert joint.dependence is not None
    guess = joint.dependence.theta(np.array([x.guess for x in joint.physical.parameters]))
    F = fourier.observation(joint.terms, trajectory(joint, joint.published[-1][0]))
    columns = {column.estimator: column for column in joint.printed}
    least = columns["lse"]
    d = np.array([np.subtract(column.theta, least.theta) for column in joint.printed])
    mse = least.mse + np.einsum("ij,jk,ik->i", d, F.T @ F / len(F), d)
    return {"guess": guess, "MSE of guess, wlse, lse, pso": mse}


def hand() -> dict[str, Array]:
    """The hand of Fig 8.9."""
    from davinci_forces.haptics.maths.bimodal import THESIS_HAND

    return {"m [kg] and b_H [N s/m]": np.array([THESIS_HAND.m, THESIS_HAND.b])}


def measurement_noise() -> dict[str, Array]:
    """The noise that the shipped scenario of section 7.3 puts in."""
    from davinci_forces.simulation.scenario.reading import load

    arm = load("davinci-filter").arm
    assert arm is not None
    [family] = arm.families.values()
    noise = family.noise[PITCH.name]
    return {"deviation of position [rad] and velocity [rad/s]": np.array([noise.q, noise.dq])}


# Numbers that need no computation: gains, poses, the size of a swarm and when it ends, and the hanging mass with the
# scale from the printed force.
GAINS = {"K_p": np.array(davinci.K_P), "K_i": np.array(davinci.K_I), "K_d": np.array(davinci.K_D)}
POSES = {"q at the start": np.array(davinci.POSE), "reference": np.array(davinci.POSE)}
SWARM = {"particles, iterations, iterations without change": np.array([PARTICLES, MAX_ITERATIONS, PATIENCE])}
WEIGHT = {
    "mass [kg] and weight [N]": np.array([0.097, 0.097 * GRAVITY]),
    "force [N] and scale of the thesis's recording": np.array([np.nan, 4.7945 / (0.097 * GRAVITY)]),
}
TABLES = {"Eq 6.57-6.58, Table 6.4": ROLL, "Eq 6.59-6.60, Table 6.5": PITCH, "Eq 6.61, Table 6.6": SLIDE}
FOUND: dict[str, Callable[[], dict[str, Array]]] = {
    "Table 3.1": links,
    "Table 4.1": bodies,
    "Table 4.2": bodies,
    "Table 5.1": lambda: GAINS,
    "Table 5.2": lambda: POSES,
    "Table 5.3": lambda: POSES,
    "Table 5.4": lambda: GAINS,
    "Eq 6.7-6.9": lambda: factors(ROLL, "Eq 6.7-6.9"),
    "Eq 6.10-6.12": lambda: factors(PITCH, "Eq 6.10-6.12"),
    "Table 6.1": excitation,
    "Table 6.2": limits,
    "Eq 6.28-6.29, Table 6.3": motors,
    "Section 6.5.1": lambda: SWARM,
    "Section 6.6": counts,
    "Table 7.1": measurement_noise,
    "Eq 7.29-7.30, Fig 7.12": lambda: WEIGHT,
    "Eq 8.8-8.10, Fig 8.9": hand,
    **{item: (lambda joint=joint: parameters(joint)) for item, joint in TABLES.items()},  # type: ignore[misc]
}
