"""The haptic loop of a scenario: the force that a hand feels through the arm, and its response to the hand's motion.

The filter in the loop is the filter that tracks the logs; it takes one sample at a time.
"""

import math
from collections.abc import Callable
from dataclasses import fields, replace
from typing import Any, NamedTuple

import numpy as np

from davinci_forces.filters import ekf, sample, tracker
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.response import smallest_q_tau
from davinci_forces.haptics.maths.bimodal import THESIS_TISSUE, Hand
from davinci_forces.haptics.maths.delay import Complex, harmonic, settles, zero_order_hold
from davinci_forces.haptics.maths.simulated_loop import Axis, Clocks, FeltTissue, Grip, LoopRun, SensorReading, simulate
from davinci_forces.haptics.scenario import SLIDE, SLIDE_NOISE, AxisNoise, Body, FullScenario, HapticScenario
from davinci_forces.maths.arrays import Array, records
from davinci_forces.maths.constants import PUSH_DELAY
from davinci_forces.maths.models.terms import Coefficients
from davinci_forces.maths.simulation.actuators import Loops
from davinci_forces.maths.simulation.step import Friction, at_rest
from davinci_forces.maths.simulation.surroundings import Path
from davinci_forces.records import HapticRun
from davinci_forces.toml import in_toml

NO_PATH = np.zeros((0, 2))  # no prescribed path: the hand moves freely
PRESS_FORCE, EXTRA_SHARE = 10.0, 0.3  # [N] steady force of a hand, and share of it that is released at once
RISE_TIME, RELEASE_TIME = 1.0, 3.0  # [s] when the force has risen to steady force plus share; when it is released
SETTLING_PERIODS = 30.0  # periods of the free hand in which growth becomes visible
FREQUENCIES = np.geomspace(0.2, 30.0, 33)  # [Hz] of the frequency response
MEAN_DEPTH, AMPLITUDE = 0.012, 0.008  # [m] of the hand's sinusoidal motion in the tissue
MAX_SPEED = 0.6  # [m/s] of that motion; at 0.8 m/s the default motor reaches its voltage
FOLLOWED = (0.5, 2.0)  # felt stiffness over true stiffness at the lowest frequency, of an arm that follows the hand
TRANSIENT, MIN_WATCH = 2.0, 2.0  # [s] initial time that is not evaluated, and least evaluated time


class FeltResponse(NamedTuple):
    """The response of the felt force to the motion of the hand, over frequencies (N,) [Hz]."""

    frequency: Array
    T: Complex

    @property
    def share(self) -> Array:
        """Felt stiffness over true stiffness (N,)."""
        return np.asarray(np.abs(self.T))

    @property
    def late(self) -> Array:
        """Delay of the felt force (N,) [s]."""
        return np.asarray(-np.unwrap(np.angle(self.T)) / (2.0 * np.pi * self.frequency))


def complete_scenario(
    scenario: HapticScenario, body: Body = SLIDE, noise: AxisNoise = SLIDE_NOISE, stiffness: float = THESIS_TISSUE,
    q_tau: float = 0.0, delay: float = PUSH_DELAY,
) -> FullScenario:  # fmt: skip
    """Fill the fields that the scenario leaves open; the filter then assumes the true body."""
    body, stated = scenario.body or body, {f.name: getattr(scenario, f.name) for f in fields(scenario)}
    return FullScenario(**stated | {
        "body": body, "assumed_body": scenario.assumed_body or body, "noise": scenario.noise or noise,
        "stiffness": scenario.stiffness or stiffness, "q_tau": scenario.q_tau or q_tau, "filter_delay": delay,
    })  # fmt: skip


def simulate_plan(scenario: FullScenario, hand: Hand) -> LoopRun:
    """Simulate the scenario's plan, with noise from its seed."""
    ticks = round(scenario.duration / scenario.tick)
    t = scenario.tick * np.arange(ticks, dtype=float) + scenario.plan[0][0]
    path = Path(scenario.plan, ease=True)
    start = float(path.position(t[:1])[0])
    reference = path.position(t + 0.5 * scenario.tick)
    speed = (path.position(t + scenario.tick) - path.position(t)) / scenario.tick
    random = np.random.default_rng(scenario.seed)
    noise = random.normal(size=(_turns(scenario, ticks), 3)) * np.array(scenario.noise)
    return _run(scenario, hand, hand.k * reference + hand.b * speed, noise, start)


def hand_settles(scenario: FullScenario, hand: Hand) -> bool:
    """Whether a hand pressed into the tissue settles after a sudden release; simulated without noise or stops."""
    ticks = round((RELEASE_TIME + SETTLING_PERIODS * 2.0 * math.pi / hand.frequency) / scenario.tick)
    t = np.arange(ticks) * scenario.tick
    push = PRESS_FORCE * (1.0 + EXTRA_SHARE) * 0.5 * (1.0 - np.cos(np.pi * np.clip(t / RISE_TIME, 0.0, 1.0)))
    push[t >= RELEASE_TIME] = PRESS_FORCE
    endless = replace(scenario, stops=(-1e3, 1e3))
    run = _run(endless, hand, push, np.zeros((_turns(scenario, ticks), 3)), 0.0)
    gain, x = scenario.device.force * scenario.device.motion, run.x[t >= RELEASE_TIME]
    in_contact = bool(x[len(x) // 2 :].min() > 0.0)  # a hand that bounces off may do so with a bounded amplitude
    return in_contact and settles(x, EXTRA_SHARE * PRESS_FORCE / (hand.k + gain * scenario.stiffness))


def response(scenario: FullScenario) -> FeltResponse:
    """Compute the response of the felt force to a hand that moves in the tissue, without noise."""
    return FeltResponse(FREQUENCIES, np.array([felt_share(scenario, f) for f in FREQUENCIES.tolist()]))


def is_followed(scenario: FullScenario) -> bool:
    """Whether the arm of a scenario follows a slow hand; one that its controller does not stabilise does not."""
    return FOLLOWED[0] < abs(felt_share(scenario, float(FREQUENCIES[0]))) < FOLLOWED[1]


def felt_share(scenario: FullScenario, frequency: float) -> complex:
    """T at one frequency [Hz]: the felt force over the force that the tissue would exert at the hand's position."""
    w, turns = 2.0 * math.pi * frequency, math.ceil(MIN_WATCH * frequency)
    ticks = round((TRANSIENT + turns / frequency) / scenario.tick)
    t = np.arange(ticks + 1) * scenario.tick
    ease = 0.5 * (1.0 - np.cos(np.pi * np.clip(t / (0.5 * TRANSIENT), 0.0, 1.0)))
    path = np.column_stack([ease * (MEAN_DEPTH + min(AMPLITUDE, MAX_SPEED / w) * np.sin(w * t)), np.zeros(len(t))])
    path[:, 1] = np.gradient(path[:, 0], scenario.tick)
    noise = np.zeros((_turns(scenario, ticks), 3))
    run = _run(scenario, Hand(1.0, 1.0, 1.0), np.zeros(ticks), noise, 0.0, path)
    watched = slice(ticks - round(turns / frequency / scenario.tick), ticks)
    middle = run.t[watched] + 0.5 * scenario.tick
    answer = harmonic(middle, run.felt[watched], w) / harmonic(run.t[watched], run.x[watched], w)
    return answer / (scenario.device.force * scenario.device.motion * (scenario.stiffness + 1j * w * scenario.damping))


def _run(scenario: FullScenario, hand: Hand, push: Array, noise: Array, x_0: float, path: Array = NO_PATH) -> LoopRun:
    periods = [round(1.0 / rate / scenario.tick) for rate in (scenario.rate, scenario.link_rate)]
    delays = [math.ceil(x / scenario.tick - 1e-9) for x in (scenario.position_delay, scenario.force_delay)]
    clocks = Clocks(scenario.tick, *periods, *delays)
    tissue = FeltTissue(scenario.stiffness, scenario.damping, scenario.friction)
    grip = Grip(*zero_order_hold(hand, scenario.tick), path)
    estimate = filter_in_loop(scenario) if scenario.filtered else lambda reading: reading.force  # sensor at the tip
    axis = _axis(scenario, scenario.device.motion * x_0)
    return simulate(grip, scenario.device, axis, tissue, clocks, push, noise, (x_0, 0.0), estimate)


def _turns(scenario: FullScenario, ticks: int) -> int:
    """The number of controller periods in a number of ticks."""
    return math.ceil(ticks * scenario.tick * scenario.rate - 1e-6)


def _axis(scenario: FullScenario, q: float) -> Axis:
    """The prismatic joint, at rest at q [m]."""
    body = scenario.body
    friction = Friction(*(np.array([float(x)]) for x in (body.viscous, *body.coulomb, *body.static, *body[5:])))
    parts = scenario.motor, scenario.law, friction, Loops(*np.zeros((len(Loops._fields), 1))), at_rest(np.array([q]))
    motors, law, friction_of_body, loops, state = map(records, parts)
    low, high = (np.array([stop]) for stop in scenario.stops)
    return Axis(
        motors, law, friction_of_body, loops, state, np.zeros(1), np.array([[body.inertia]]), np.array([body.gravity]),
        (low, high), scenario.exact,
    )  # fmt: skip


def filter_in_loop(scenario: FullScenario) -> Callable[[SensorReading], float]:
    """The extended Kalman filter: a function from successive sensor readings to forces.  (7.6), (7.7)"""
    body, T_s = scenario.assumed_body, 1.0 / scenario.rate
    noise, c_b = filter_noise(scenario), coefficients(body)
    predicted: sample.Belief | None = None

    def estimate(reading: SensorReading) -> float:
        nonlocal predicted
        if predicted is None:
            predicted = sample.first(reading.q, reading.dq, noise.r_q, noise.r_dq, scenario.noise.tau)
        now, predicted = ekf.step(predicted, (reading.q, reading.dq), reading.tau, body.inertia, c_b, T_s, noise)
        return now[2]

    return estimate


def coefficients(body: Body) -> Coefficients:
    """The coefficients of b(q, dq) that the filter assumes: gravity, viscous and Coulomb friction."""
    return body.gravity, 0.0, 0.0, 0.0, body.viscous, 0.5 * sum(body.coulomb), 0.0


def filter_noise(scenario: FullScenario) -> NoiseModel:
    """The noise per sample that the filter assumes."""
    body, noise, T_s = scenario.assumed_body, scenario.noise, 1.0 / scenario.rate
    model = NoiseModel(noise.q, noise.dq, 0.0, noise.tau * T_s / body.inertia, scenario.q_tau * T_s**0.5)
    walk = model.q_tau or smallest_q_tau(tracker("ekf"), body.inertia, body.viscous, T_s, model, scenario.filter_delay)
    return model._replace(q_tau=walk)


def in_file(scenario: FullScenario) -> str:
    """The lines of a scenario file about tick, gains, and all that a study fills in, to 6 digits."""
    body, law, walk = scenario.body, scenario.law, filter_noise(scenario).q_tau * scenario.rate**0.5
    stated = body[:4] if body == Body(*body[:4], body.coulomb) else body  # the others have their defaults
    late = "" if scenario.q_tau else f"  # q_tau shows a push of 1 s at most {scenario.filter_delay:g} s late"
    tables: dict[str, dict[str, Any]] = {
        "[arm.control]": law._asdict(), "[arm.body]": dict(zip(body._fields, stated, strict=False)),
        "[arm.noise]": scenario.noise._asdict(), "[tissue]": {"stiffness": scenario.stiffness},
        f"[filter]{late}": {"q_tau": walk},
    }  # fmt: skip
    lines = ["[arm]", f"tick = {scenario.tick}"]
    for table, values in tables.items():
        numbers = ((key, [float(f"{x:.6g}") for x in np.ravel(value).tolist()]) for key, value in values.items())
        lines += [table, *(f"{key} = {in_toml(x if len(x) > 1 else x[0])}" for key, x in numbers)]
    return "\n".join(lines)


def experiment(scenario: FullScenario, name: str, hand: Hand) -> HapticRun:
    """Simulate the scenario's plan, sampled at the controller's rate, until its end or until the hand leaves the reach.

    The error is the root mean square of felt force over force scale, minus true force.
    """
    run = simulate_plan(scenario, hand)
    outside = np.flatnonzero(np.abs(run.x) > scenario.reach)
    samples = slice(0, int(outside[0]) if len(outside) else len(run.t), round(1.0 / scenario.rate / scenario.tick))
    t, true, felt = run.t[samples] + scenario.plan[0][0], run.true[samples], run.felt[samples]
    error = felt / (scenario.device.force or math.nan) - true
    return HapticRun(
        hand=name, out_of_reach=int(len(outside) > 0), true_peak=float(true.max()), felt_peak=float(felt.max()),
        felt_error=float(np.sqrt(np.mean(error**2))), t=t, plan_x=Path(scenario.plan, ease=True).position(t),
        hand_x=run.x[samples], arm_x=run.q[samples], true_force=true, felt_force=felt,
    )  # fmt: skip
