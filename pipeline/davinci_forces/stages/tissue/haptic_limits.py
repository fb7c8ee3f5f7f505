"""Limit what a hand can feel: how stiff tissue may be before a haptic loop is unstable, in theory and in simulation."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics.maths import bimodal
from davinci_forces.haptics.maths.bimodal import THESIS, Hand, cqlf_limit, energy, switching_limit
from davinci_forces.haptics.maths.delay import damping_needed, delay_limit, sampled_limit
from davinci_forces.haptics.maths.motion import Law, at_contact, switched, worst
from davinci_forces.haptics.scenario import SLIDE, SLIDE_NOISE, AxisNoise, Body
from davinci_forces.identification.used import FALLBACK, Identified
from davinci_forces.maths.models.bias import COULOMB, VISCOUS
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.records import (
    Comparison,
    DelayLimit,
    FilterNoise,
    Fit,
    HapticMotion,
    HapticResponse,
    HapticRun,
    StabilityLimit,
    StabilityMap,
    Stiffness,
    TissueLimit,
)
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.study import HapticScenario

BEYOND = 1.5  # times the limit of arbitrary switching, at which motions are shown
TURNS = 5.0  # of the free hand, that they last
AT = 0.5  # [Hz] as fast as tissue is felt for, at which the rendered stiffness is stated
FROM_FILE, FROM_THESIS = "the scenario", "the thesis"


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
        yield moved(robot, law)
    joint, lag = slowest(list(comparisons), robot)
    for one in tissues:
        yield asked(one, joint, lag)


def mapped(robot: Robot) -> StabilityMap:
    """Whether the solver found a Lyapunov function, cell by cell.  (8.10), Fig 8.9"""
    k_h, k_t = np.repeat(bimodal.K_H, len(bimodal.K_T)), np.tile(bimodal.K_T, len(bimodal.K_H))
    found = np.arange(len(bimodal.K_T)) < np.array(bimodal.PROVED)[:, None]
    return StabilityMap(robot.name, THESIS.m, THESIS.b, k_h, k_t, found.ravel().astype(int))


def limits(robot: Robot) -> StabilityLimit:
    """The exact borders beside that map."""
    k_h = np.geomspace(bimodal.SOFTEST, bimodal.STIFFEST, 101)
    hands = [THESIS._replace(k=k) for k in k_h.tolist()]
    proved, switching = (np.array([limit(hand) for hand in hands]) for limit in (cqlf_limit, switching_limit))
    return StabilityLimit(robot.name, THESIS.m, THESIS.b, k_h, proved, switching)


def delayed(robot: Robot) -> DelayLimit:
    """The limit over the delay, of a force that changes at once and of one that the link holds."""
    late = np.array([delay_limit(THESIS, delay) for delay in bimodal.DELAYS.tolist()])
    leaving = np.full(len(bimodal.DELAYS), np.nan)
    leaving[bimodal.SIMULATED] = bimodal.LEAVING
    return DelayLimit(
        robot=robot.name,
        hand_mass=THESIS.m,
        hand_damping=THESIS.b,
        hand_stiffness=THESIS.k,
        link_rate=bimodal.LINK_RATE,
        k_t_cqlf=cqlf_limit(THESIS),
        k_t_switching=switching_limit(THESIS),
        delay=bimodal.DELAYS,
        k_t_delay=late,
        k_t_held=np.array(bimodal.HELD),
        k_t_leaving=leaving,
    )


def moved(robot: Robot, law: Law) -> HapticMotion:
    """The hand let go beside the tissue, by the worst switching or by the one there is.  Fig 8.8, 8.10"""
    k_t = BEYOND * switching_limit(THESIS)
    motion = switched(THESIS, k_t, (-0.01, 0.0), TURNS * 2.0 * np.pi / THESIS.frequency, law)
    name = law.__name__.replace("_", " ")
    return HapticMotion(robot.name, name, k_t, *motion, energy(THESIS, k_t, motion.x, motion.dx))


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
    total = lag + 0.5 / bimodal.LINK_RATE  # a held force is half a sample later
    return TissueLimit(
        log=tissue.log,
        stiffness=k_t,
        k_h_needed=needed,
        lag_of=joint,
        force_lag=lag,
        k_t_lag=sampled_limit(THESIS, lag, bimodal.LINK_RATE) if known else float("nan"),
        damping_needed=damping_needed(THESIS, k_t, total) if known else float("nan"),
    )


def gather(
    stiffnesses: Iterable[Stiffness],
    fits: Iterable[Fit],
    noises: Iterable[FilterNoise],
    haptics: HapticScenario,
    robot: Robot,
    *,
    q_tau: float,
) -> Iterator[HapticResponse | HapticRun]:
    """The experiment of section 8.4 with every hand of the scenario; nothing where no tissue was measured."""
    tissues = [one.stiffness for one in stiffnesses if one.pushes and one.stiffness > 0.0]
    if not tissues:
        return
    joint = next((joint for joint in robot.joints if joint.kind is Kind.PRISMATIC and not joint.effort), None)
    body, arm_from = fitted(robot, fits, joint)
    settled = [AxisNoise(one.r_q, one.r_dq, one.r_tau) for one in noises if joint and one.joint == joint.name]
    noise = next(iter(settled), SLIDE_NOISE)
    scenario = haptic.filled(haptics, body, noise, float(np.median(tissues)), q_tau or (joint.q_tau if joint else 0.0))
    answer = haptic.response(scenario)
    yield rendered(robot, FROM_FILE if haptics.body else arm_from, scenario, answer)
    for name, hand in scenario.hands:
        yield felt(name, hand, scenario, answer)


def fitted(robot: Robot, fits: Iterable[Fit], joint: Joint | None) -> tuple[Body, str]:
    """What slides as its own fit has it, and what it is called; as the thesis has it where there is no such fit."""
    identified = Identified(robot, fits)
    kept = identified.used(joint.name, FALLBACK) if joint else None
    if kept is None or joint is None:
        return SLIDE, FROM_THESIS
    still = np.zeros((1, 1))
    [dynamics] = identified.model(kept).joint_dynamics(
        kept.theta, ArmMotion(still, still, still, 1.0, np.zeros(1, int))
    )
    coulomb, viscous = max(dynamics.coefficients[COULOMB], 0.0), max(dynamics.coefficients[VISCOUS], 0.0)
    inertia = float(dynamics.inertia[0])
    if inertia <= 0.0:
        return SLIDE, FROM_THESIS
    return Body(inertia, dynamics.coefficients[0], viscous, (coulomb, coulomb), (coulomb, coulomb)), joint.name


def rendered(robot: Robot, arm_from: str, scenario: HapticScenario, answer: haptic.FeltResponse) -> HapticResponse:
    """The tissue as it is felt."""
    share = float(np.interp(AT, answer.frequency, answer.share))
    gain, stiffness = scenario.device.force * scenario.device.motion, scenario.stiffness or float("nan")
    return HapticResponse(
        robot=robot.name,
        arm_from=arm_from,
        tissue_stiffness=stiffness,
        at_frequency=AT,
        rendered_stiffness=gain * share * stiffness,
        transparency=share,
        felt_delay=float(np.interp(AT, answer.frequency, answer.late)),
        frequency=answer.frequency,
        felt_share=answer.share,
        felt_late=answer.late,
    )


def felt(name: str, hand: Hand, scenario: HapticScenario, answer: haptic.FeltResponse) -> HapticRun:
    """One hand: what it feels, and its margins."""
    run, margins = haptic.experiment(scenario, hand), haptic.margins(scenario, hand, answer)
    return HapticRun(
        hand=name,
        hand_mass=hand.m,
        hand_damping=hand.b,
        hand_stiffness=hand.k,
        out_of_reach=int(run.thrown),
        true_peak=float(run.true.max()),
        felt_peak=float(run.felt.max()),
        felt_error=run.error,
        k_t_settles=margins.stiffness,
        k_t_response=margins.by_response,
        stiffness_margin=margins.stiffness / (scenario.stiffness or float("nan")),
        delay_margin=margins.delay,
        t=run.t,
        plan_x=run.plan,
        hand_x=run.x,
        arm_x=run.q,
        true_force=run.true,
        felt_force=run.felt,
    )
