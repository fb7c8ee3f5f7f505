"""Feel the tissue that was measured: a simulated hand in closed loop with arm, filter and link, and its margins."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics.maths.bimodal import Hand
from davinci_forces.haptics.scenario import SLIDE, SLIDE_NOISE, AxisNoise, Body
from davinci_forces.identification.used import FALLBACK, Identified
from davinci_forces.maths.models.bias import COULOMB, VISCOUS
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.records import FilterNoise, Fit, HapticResponse, HapticRun, Stiffness
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.study import HapticScenario

AT = 0.5  # [Hz] as fast as tissue is felt for, at which the rendered stiffness is stated
FROM_FILE, FROM_THESIS = "the scenario", "the thesis"


def run(
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
    noise = next((noise_of(one) for one in noises if joint is not None and one.joint == joint.name), SLIDE_NOISE)
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


def noise_of(settled: FilterNoise) -> AxisNoise:
    """What the filter takes the noise of the joint for."""
    return AxisNoise(settled.r_q, settled.r_dq, settled.r_tau)


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
