"""Compute the stability limits of haptic feedback: the largest tissue stiffness, in theory and in simulation."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics.maths import bimodal
from davinci_forces.haptics.maths.bimodal import THESIS_HAND, Hand, cqlf_limit, energy, switching_limit
from davinci_forces.haptics.maths.delay import damping_needed, delay_limit, sampled_limit
from davinci_forces.haptics.maths.motion import Law, at_contact, simulate_switching, worst
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

UNSTABLE_STIFFNESS = 1.5  # tissue stiffness of the simulated motions, over the limit of arbitrary switching
MOTION_CYCLES = 5.0  # duration of a simulated motion, in periods of the free hand
PALPATION_FREQUENCY = 0.5  # [Hz] at which the rendered stiffness is stated
FROM_FILE, FROM_THESIS = "the scenario", "the thesis"


def run(
    stiffnesses: Iterable[Stiffness], comparisons: Iterable[Comparison], robot: Robot
) -> Iterator[StabilityMap | StabilityLimit | DelayLimit | TissueLimit | HapticMotion]:
    """Compute the stability limits of the thesis's hand, and the requirements of each measured tissue."""
    tissues = [tissue for tissue in stiffnesses if tissue.pushes and tissue.stiffness > 0.0]
    if not tissues:
        return
    yield stability_map(robot)
    yield stability_limit(robot)
    yield delay_limits(robot)
    for law in (worst, at_contact):
        yield unstable_motion(robot, law)
    joint, lag = slowest_filter(list(comparisons), robot)
    for tissue in tissues:
        yield tissue_limit(tissue, joint, lag)


def stability_map(robot: Robot) -> StabilityMap:
    """Whether a solver found a common quadratic Lyapunov function, by stiffness of hand and tissue.  (8.10), Fig 8.9"""
    k_h, k_t = np.repeat(bimodal.K_H, len(bimodal.K_T)), np.tile(bimodal.K_T, len(bimodal.K_H))
    proved = np.arange(len(bimodal.K_T)) < np.array(bimodal.CQLF_COUNTS)[:, None]
    return StabilityMap(robot.name, THESIS_HAND.m, THESIS_HAND.b, k_h, k_t, proved.ravel().astype(int))


def stability_limit(robot: Robot) -> StabilityLimit:
    """The exact limits of tissue over hand stiffness, with a Lyapunov function and under arbitrary switching."""
    k_h = np.geomspace(bimodal.MIN_HAND_STIFFNESS, bimodal.MAX_HAND_STIFFNESS, 101)
    hands = [THESIS_HAND._replace(k=k) for k in k_h.tolist()]
    proved, switching = (np.array([limit(hand) for hand in hands]) for limit in (cqlf_limit, switching_limit))
    return StabilityLimit(robot.name, THESIS_HAND.m, THESIS_HAND.b, k_h, proved, switching)


def delay_limits(robot: Robot) -> DelayLimit:
    """The stability limit over the delay, for a continuous force and for a force that the link samples and holds."""
    continuous = np.array([delay_limit(THESIS_HAND, delay) for delay in bimodal.DELAYS.tolist()])
    leaving = np.full(len(bimodal.DELAYS), np.nan)
    leaving[bimodal.SIMULATED_DELAYS] = bimodal.LEAVING_LIMITS
    return DelayLimit(
        robot=robot.name,
        hand_mass=THESIS_HAND.m,
        hand_damping=THESIS_HAND.b,
        hand_stiffness=THESIS_HAND.k,
        link_rate=bimodal.LINK_RATE,
        k_t_cqlf=cqlf_limit(THESIS_HAND),
        k_t_switching=switching_limit(THESIS_HAND),
        delay=bimodal.DELAYS,
        k_t_delay=continuous,
        k_t_held=np.array(bimodal.SAMPLED_LIMITS),
        k_t_leaving=leaving,
    )


def unstable_motion(robot: Robot, law: Law) -> HapticMotion:
    """The motion of a hand released at the tissue, with the worst or the actual switching.  Fig 8.8, 8.10"""
    k_t = UNSTABLE_STIFFNESS * switching_limit(THESIS_HAND)
    motion = simulate_switching(
        THESIS_HAND, k_t, (-0.01, 0.0), MOTION_CYCLES * 2.0 * np.pi / THESIS_HAND.frequency, law
    )
    name = law.__name__.replace("_", " ")
    return HapticMotion(robot.name, name, k_t, *motion, energy(THESIS_HAND, k_t, motion.x, motion.dx))


def slowest_filter(comparisons: list[Comparison], robot: Robot) -> tuple[str, float]:
    """The prismatic joint, which palpates in section 8.4, or else any joint; and the largest lag of its filter [s]."""
    default = [c for c in comparisons if c.default]
    prismatic = [c for c in default if robot.joint(c.joint).kind is Kind.PRISMATIC]
    latest = max(prismatic or default, key=lambda c: c.push_delay, default=None)
    return (latest.joint, latest.push_delay) if latest is not None else ("", float("nan"))


def tissue_limit(tissue: Stiffness, joint: str, lag: float) -> TissueLimit:
    """The hand that a tissue requires: its stiffness for a Lyapunov function, its damping for the lag and the link."""
    m, b, k_t = THESIS_HAND.m, THESIS_HAND.b, tissue.stiffness
    needed = m * (max(k_t - b**2 / m, 0.0) / (2.0 * b)) ** 2
    has_lag = lag > 0.0
    total = lag + 0.5 / bimodal.LINK_RATE  # holding a force between samples delays it by half a sample on average
    return TissueLimit(
        log=tissue.log,
        stiffness=k_t,
        k_h_needed=needed,
        lag_of=joint,
        force_lag=lag,
        k_t_lag=sampled_limit(THESIS_HAND, lag, bimodal.LINK_RATE) if has_lag else float("nan"),
        damping_needed=damping_needed(THESIS_HAND, k_t, total) if has_lag else float("nan"),
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
    """Simulate the experiment of section 8.4 on the measured tissue, with every hand of the scenario."""
    tissues = [tissue.stiffness for tissue in stiffnesses if tissue.pushes and tissue.stiffness > 0.0]
    if not tissues:
        return
    joint = next((joint for joint in robot.joints if joint.kind is Kind.PRISMATIC and not joint.effort), None)
    body, arm_from = moving_body(robot, fits, joint)
    joint_noises = (AxisNoise(n.r_q, n.r_dq, n.r_tau) for n in noises if joint and n.joint == joint.name)
    noise = next(joint_noises, SLIDE_NOISE)
    scenario = haptic.complete_scenario(
        haptics, body, noise, float(np.median(tissues)), q_tau or (joint.q_tau if joint else 0.0)
    )
    answer = haptic.response(scenario)
    yield haptic_response(robot, FROM_FILE if haptics.body else arm_from, scenario, answer)
    for name, hand in scenario.hands:
        yield haptic_run(name, hand, scenario, answer)


def moving_body(robot: Robot, fits: Iterable[Fit], joint: Joint | None) -> tuple[Body, str]:
    """The body that a prismatic joint moves, from the joint's fit, and its name; without a fit, the thesis's body."""
    identified = Identified(robot, fits)
    fit = identified.fit_of(joint.name, FALLBACK) if joint else None
    if fit is None or joint is None:
        return SLIDE, FROM_THESIS
    still = np.zeros((1, 1))
    [dynamics] = identified.model(fit).joint_dynamics(fit.theta, ArmMotion(still, still, still, 1.0, np.zeros(1, int)))
    coulomb, viscous = max(dynamics.coefficients[COULOMB], 0.0), max(dynamics.coefficients[VISCOUS], 0.0)
    inertia = float(dynamics.inertia[0])
    if inertia <= 0.0:
        return SLIDE, FROM_THESIS
    return Body(inertia, dynamics.coefficients[0], viscous, (coulomb, coulomb), (coulomb, coulomb)), joint.name


def haptic_response(
    robot: Robot, arm_from: str, scenario: HapticScenario, answer: haptic.FeltResponse
) -> HapticResponse:
    """The frequency response from the tissue to the hand, and the stiffness that the hand feels."""
    share = float(np.interp(PALPATION_FREQUENCY, answer.frequency, answer.share))
    gain, stiffness = scenario.device.force * scenario.device.motion, scenario.stiffness or float("nan")
    return HapticResponse(
        robot=robot.name,
        arm_from=arm_from,
        tissue_stiffness=stiffness,
        at_frequency=PALPATION_FREQUENCY,
        rendered_stiffness=gain * share * stiffness,
        transparency=share,
        felt_delay=float(np.interp(PALPATION_FREQUENCY, answer.frequency, answer.late)),
        frequency=answer.frequency,
        felt_share=answer.share,
        felt_late=answer.late,
    )


def haptic_run(name: str, hand: Hand, scenario: HapticScenario, answer: haptic.FeltResponse) -> HapticRun:
    """The forces that one hand feels, and its stability margins."""
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
