"""Compute the stiffest tissue for stable haptic feedback with this study's arm, filter and measured tissue."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters import DEFAULT, tracker
from davinci_forces.filters.problem import joint_at_rest
from davinci_forces.filters.response import noise_model
from davinci_forces.haptics import limits
from davinci_forces.haptics import loop as haptic
from davinci_forces.haptics.maths import bimodal
from davinci_forces.haptics.scenario import SLIDE, SLIDE_NOISE, AxisNoise, Body, FullScenario
from davinci_forces.identification.joint_models import FALLBACK, Identified
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.models.terms import COULOMB, VISCOUS
from davinci_forces.records.forces import Comparison, FilterNoise
from davinci_forces.records.model import Fit
from davinci_forces.records.record import Diagnostic, diagnostic
from davinci_forces.records.tissue import HandLimit, HapticMotion, HapticResponse, HapticRun, StabilityLimit, Stiffness
from davinci_forces.robots.robot import Joint, Kind, Robot
from davinci_forces.study import HapticScenario

UNSTABLE_STIFFNESS = 1.5  # tissue stiffness of the simulated motions, over the limit of arbitrary switching
MOTION_CYCLES = 5.0  # duration of a simulated motion, in periods of the free hand
PALPATION_FREQUENCY = 0.5  # [Hz] at which the rendered stiffness is stated
FROM_FILE, FROM_THESIS = "the scenario", "the thesis"


def run(
    stiffnesses: Iterable[Stiffness], comparisons: Iterable[Comparison], fits: Iterable[Fit],
    noises: Iterable[FilterNoise], haptics: HapticScenario, robot: Robot, *, q_tau: float,
) -> Iterator[StabilityLimit | HapticMotion | HandLimit | HapticResponse | HapticRun | Diagnostic]:  # fmt: skip
    """Compute the thesis's criteria; simulate the experiment of section 8.4 on the stiffest tissue, and its limits."""
    tissues = [tissue.stiffness for tissue in stiffnesses if tissue.pushes and tissue.stiffness > 0.0]
    if not tissues:
        return
    yield stability_limit(robot)
    for law in (bimodal.worst, bimodal.at_contact):
        yield unstable_motion(robot, law)
    joint = next((joint for joint in robot.joints if joint.kind is Kind.PRISMATIC and not joint.effort), None)
    bodies, arm_from = moving_bodies(robot, fits, joint)
    tuned = next((noise for noise in noises if joint and noise.joint == joint.name), None)
    noise = SLIDE_NOISE if tuned is None else AxisNoise(tuned.r_q, tuned.r_dq, tuned.r_tau)
    scenario = haptic.complete_scenario(
        haptics,
        bodies[0],
        noise,
        max(tissues),
        q_tau or (joint.q_tau if joint else 0.0),
        tuned.delay if tuned else haptics.filter_delay,
    )
    if not limits.has_limits(scenario):
        yield not_followed(scenario, FROM_FILE if haptics.body else arm_from)
        yield from (limits.without_arm(name, hand) for name, hand in scenario.hands)
        return
    loop = limits.loop_response(scenario)
    recordings = list(filtered_recordings(comparisons, joint, tuned, q_tau)) if joint and tuned is not None else []
    yield haptic_response(robot, FROM_FILE if haptics.body else arm_from, scenario, haptic.response(scenario))
    for name, hand in scenario.hands:
        yield limits.limits_of(scenario, name, hand, loop, recordings, () if haptics.body else bodies[1:])
        yield haptic.experiment(scenario, name, hand)


def not_followed(scenario: FullScenario, arm_from: str) -> Diagnostic:
    """Warn that the simulated arm is unstable by itself, as with an inertia that the logs hardly determine."""
    why, where = limits.why_unstable(scenario), "in the file that study.toml names as `haptics`"
    template = "`davinci-forces haptics --template haptics.toml` writes one"
    text = f"arm: no limit of haptic feedback through it is computed, as {why}, {where} ({template})"
    remedy = f"if the inertia of {arm_from} is wrong, record a faster motion, or state [arm.body]"
    return diagnostic("haptic-limits", "arm.followed", "warning", f"{text}; {remedy}")


def stability_limit(robot: Robot) -> StabilityLimit:
    """The exact limits of tissue over hand stiffness, with a Lyapunov function and under arbitrary switching."""
    k_h = np.geomspace(bimodal.MIN_HAND_STIFFNESS, bimodal.MAX_HAND_STIFFNESS, 101)
    hands = [bimodal.THESIS_HAND._replace(k=k) for k in k_h.tolist()]
    proved, switching = (
        np.array([limit(hand) for hand in hands]) for limit in (bimodal.cqlf_limit, bimodal.switching_limit)
    )
    return StabilityLimit(robot.name, bimodal.THESIS_HAND.m, bimodal.THESIS_HAND.b, k_h, proved, switching)


def unstable_motion(robot: Robot, law: bimodal.Law) -> HapticMotion:
    """The motion of a hand released at the tissue, with the worst or the actual switching.  Fig 8.8, 8.10"""
    k_t = UNSTABLE_STIFFNESS * bimodal.switching_limit(bimodal.THESIS_HAND)
    motion = bimodal.simulate_switching(
        bimodal.THESIS_HAND, k_t, (-0.01, 0.0), MOTION_CYCLES * 2.0 * np.pi / bimodal.THESIS_HAND.frequency, law
    )
    name = law.__name__.replace("_", " ")
    return HapticMotion(robot.name, name, k_t, *motion, bimodal.energy(bimodal.THESIS_HAND, k_t, motion.x, motion.dx))


def filtered_recordings(
    comparisons: Iterable[Comparison], joint: Joint, tuned: FilterNoise, q_tau: float
) -> Iterator[limits.Recording]:
    """The joint's logs with the default filter's external effort, and with its response to the direct one at rest."""
    of_joint = [comparison for comparison in comparisons if comparison.joint == joint.name]
    direct = {comparison.log: comparison.tau_ext for comparison in of_joint if comparison.filter == "direct"}
    for c in (c for c in of_joint if c.default and c.log in direct and len(c.t) > 1):
        T_s, inertia = float(c.t[1] - c.t[0]), np.full(len(c.t), tuned.inertia)
        at_rest = joint_at_rest(inertia, tuned.viscous, direct[c.log], T_s, tuned.r_tau)
        yield c.t, tracker(DEFAULT)(at_rest, noise_model(tuned, joint, T_s, q_tau)).tau_ext, c.tau_ext


def moving_bodies(robot: Robot, fits: Iterable[Fit], joint: Joint | None) -> tuple[Sequence[Body], str]:
    """The body that a prismatic joint moves, from the joint's fit, and its name; without a fit, the thesis's body.

    More bodies follow, each with one parameter of the fit greater by its standard error.
    """
    identified = Identified(robot, fits)
    fit = identified.fit_of(joint.name, FALLBACK) if joint else None
    if fit is None or joint is None:
        return [SLIDE], FROM_THESIS
    model, errors = identified.model(fit), np.diag(fit.theta_std)
    bodies = [body_of(model, theta) for theta in (fit.theta, *(fit.theta + errors))]
    return (bodies, joint.name) if bodies[0].inertia > 0.0 else ([SLIDE], FROM_THESIS)


def body_of(model: Model, theta: Array) -> Body:
    """The body of a joint's model with the parameters theta (p,)."""
    still = np.zeros((1, 1))
    [dynamics] = model.joint_dynamics(theta, ArmMotion(still, still, still, 1.0, np.zeros(1, int)))
    coulomb, viscous = max(dynamics.coefficients[COULOMB], 0.0), max(dynamics.coefficients[VISCOUS], 0.0)
    return Body(float(dynamics.inertia[0]), dynamics.coefficients[0], viscous, (coulomb, coulomb), (coulomb, coulomb))


def haptic_response(robot: Robot, arm_from: str, scenario: FullScenario, answer: haptic.FeltResponse) -> HapticResponse:
    """The frequency response from the tissue to the hand, and the stiffness that the hand feels."""
    share = float(np.interp(PALPATION_FREQUENCY, answer.frequency, answer.share))
    gain, stiffness = scenario.device.force * scenario.device.motion, scenario.stiffness
    return HapticResponse(
        robot=robot.name, arm_from=arm_from, scenario=haptic.in_file(scenario), tissue_stiffness=stiffness,
        at_frequency=PALPATION_FREQUENCY, rendered_stiffness=gain * share * stiffness, transparency=share,
        felt_delay=float(np.interp(PALPATION_FREQUENCY, answer.frequency, answer.late)), frequency=answer.frequency,
        felt_share=answer.share, felt_late=answer.late,
    )  # fmt: skip
