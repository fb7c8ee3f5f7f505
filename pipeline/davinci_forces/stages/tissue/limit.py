"""Limit what a hand can feel: how stiff tissue may be before a haptic loop is unstable, switching, late or sampled."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.haptics.maths.bimodal import THESIS, cqlf_limit, energy, switching_limit
from davinci_forces.haptics.maths.delay import damping_needed, delay_limit, sampled_limit
from davinci_forces.haptics.maths.lmi import holds
from davinci_forces.haptics.maths.motion import at_contact, leaving_limit, switched, worst
from davinci_forces.maths.arrays import Array
from davinci_forces.records import (
    Comparison,
    DelayLimit,
    HapticMotion,
    StabilityLimit,
    StabilityMap,
    Stiffness,
    TissueLimit,
)
from davinci_forces.robots.robot import Kind, Robot

CELLS = 30  # of the map, along either axis
SOFTEST, STIFFEST = 1.0, 1e5  # [N/m] hands of the map
TISSUES = (0.5, 2e3)  # [N/m] of the map
DELAYS = np.geomspace(1e-3, 0.5, 55)  # [s]
SIMULATED = slice(18, None, 9)  # of the delays, at which the hand that leaves the tissue is simulated
LINK_RATE = 100.0  # [Hz] of messages, chapter 9
BEYOND = 1.5  # times the limit of arbitrary switching, at which motions are shown
TURNS = 5.0  # of the free hand, that they last


def run(
    stiffnesses: Iterable[Stiffness], comparisons: Iterable[Comparison], robot: Robot
) -> Iterator[StabilityMap | StabilityLimit | DelayLimit | TissueLimit | HapticMotion]:
    """The limits of the thesis's hand, and where the tissues are that have been measured; nothing without any."""
    tissues = [one for one in stiffnesses if one.pushes and one.stiffness > 0.0]
    if not tissues:
        return
    yield mapped(robot)
    yield limits(robot)
    yield delayed(robot)
    for law in (worst, at_contact):
        yield moved(robot, law.__name__.replace("_", " "))
    joint, lag = slowest(list(comparisons), robot)
    for one in tissues:
        yield asked(one, joint, lag)


def mapped(robot: Robot) -> StabilityMap:
    """Whether the solver finds a Lyapunov function, cell by cell.  (8.10), Fig 8.9"""
    k_t, rows = np.geomspace(*TISSUES, CELLS), np.geomspace(SOFTEST, STIFFEST, CELLS)
    found = [holds(THESIS._replace(k=k), k_t) for k in rows.tolist()]
    return StabilityMap(
        robot.name, THESIS.m, THESIS.b, np.repeat(rows, CELLS), np.tile(k_t, CELLS), np.concatenate(found).astype(int)
    )


def limits(robot: Robot) -> StabilityLimit:
    """The exact borders beside that map."""
    k_h = np.geomspace(SOFTEST, STIFFEST, 101)
    hands = [THESIS._replace(k=k) for k in k_h.tolist()]
    proved, switching = (np.array([limit(hand) for hand in hands]) for limit in (cqlf_limit, switching_limit))
    return StabilityLimit(robot.name, THESIS.m, THESIS.b, k_h, proved, switching)


def delayed(robot: Robot) -> DelayLimit:
    """The limit over the delay, of a force that changes at once and of one that the link holds."""
    late = np.array([delay_limit(THESIS, delay) for delay in DELAYS.tolist()])
    leaving = np.full(len(DELAYS), np.nan)
    leaving[SIMULATED] = [leaving_limit(THESIS, d, k) for d, k in zip(DELAYS[SIMULATED], late[SIMULATED], strict=True)]
    return DelayLimit(
        robot=robot.name,
        hand_mass=THESIS.m,
        hand_damping=THESIS.b,
        hand_stiffness=THESIS.k,
        link_rate=LINK_RATE,
        k_t_cqlf=cqlf_limit(THESIS),
        k_t_switching=switching_limit(THESIS),
        delay=DELAYS,
        k_t_delay=late,
        k_t_held=held(DELAYS),
        k_t_leaving=leaving,
    )


def held(delays: Array) -> Array:
    """The limits of a force that comes by the link, as late as that (N,) [s] already."""
    return np.array([sampled_limit(THESIS, delay, LINK_RATE) for delay in delays.tolist()])


def moved(robot: Robot, law: str) -> HapticMotion:
    """The hand let go beside the tissue, by the worst switching or by the one there is.  Fig 8.8, 8.10"""
    k_t = BEYOND * switching_limit(THESIS)
    motion = switched(
        THESIS, k_t, (-0.01, 0.0), TURNS * 2.0 * np.pi / THESIS.frequency, worst if law == "worst" else at_contact
    )
    return HapticMotion(robot.name, law, k_t, *motion, energy(THESIS, k_t, motion.x, motion.dx))


def slowest(comparisons: list[Comparison], robot: Robot) -> tuple[str, float]:
    """The joint that slides, as it felt for tissue in section 8.4, else any, and the filter's largest lag there [s]."""
    own = [one for one in comparisons if one.default]
    sliding = [one for one in own if robot.joint(one.joint).kind is Kind.PRISMATIC]
    latest = max(sliding or own, key=lambda one: one.push_delay, default=None)
    return (latest.joint, latest.push_delay) if latest is not None else ("", float("nan"))


def asked(tissue: Stiffness, joint: str, lag: float) -> TissueLimit:
    """What a tissue asks of the hand: stiffness for a Lyapunov function, damping for the lag and the link."""
    m, b, k_t = THESIS.m, THESIS.b, tissue.stiffness
    needed = m * (max(k_t - b**2 / m, 0.0) / (2.0 * b)) ** 2
    known = lag > 0.0
    total = lag + 0.5 / LINK_RATE  # a held force is half a sample later
    return TissueLimit(
        log=tissue.log,
        stiffness=k_t,
        k_h_needed=needed,
        lag_of=joint,
        force_lag=lag,
        k_t_lag=float(held(np.array([lag]))[0]) if known else float("nan"),
        damping_needed=damping_needed(THESIS, k_t, total) if known else float("nan"),
    )
