"""A hand that feels tissue through an arm, as a scenario describes it: what it feels, and how far it is from unstable.

The filter in the loop is the one that tracks every log, fed with one sample at a time.
"""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import ekf, stepping
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.response import slowest
from davinci_forces.haptics.maths.bimodal import THESIS_TISSUE, Hand
from davinci_forces.haptics.maths.delay import Complex, harmonic, held, largest, response_limit, settles
from davinci_forces.haptics.maths.simulated_loop import Axis, Clocks, Felt, FeltTissue, Grip, SensorReading, simulate
from davinci_forces.haptics.scenario import SLIDE, SLIDE_NOISE, AxisNoise, Body, HapticScenario
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.models.bias import Coefficients
from davinci_forces.maths.simulation.step import Friction
from davinci_forces.maths.simulation.surroundings import Path

FREE = np.zeros((0, 2))  # nobody puts the hand anywhere
PRESS, MORE = 10.0, 0.3  # [N] that a hand presses with, and share of it that is let go of at once
PRESSED, LET_GO = 1.0, 3.0  # [s] when it presses with both, and when it lets go
SWINGS = 30.0  # of the free hand, in which a motion has shown whether it grows
FREQUENCIES = np.geomspace(0.2, 12.0, 14)  # [Hz] at which the response is taken
DENT, SWAY = 0.012, 0.008  # [m] about which, and by which, the hand is then moved
SETTLE, WATCH = 2.0, 2.0  # [s] before, and at least watched
LATEST = 1.0  # [s] of a delay that is tried


class Margins(NamedTuple):
    """How far a hand is from unstable; NaN where no limit was found."""

    stiffness: float  # K_T [N/m] up to which it settles, by simulation
    by_response: float  # the same by the loop's response
    delay: float  # [s] more of the force, up to which it settles; 0 where it does not as it is


class FeltResponse(NamedTuple):
    """What lies between hand and felt force, over frequencies (N,) [Hz]."""

    frequency: Array
    T: Complex

    @property
    def share(self) -> Array:
        """The stiffness that is felt over the true one (N,)."""
        return np.asarray(np.abs(self.T))

    @property
    def late(self) -> Array:
        """How late the force is (N,) [s]."""
        return np.asarray(-np.unwrap(np.angle(self.T)) / (2.0 * np.pi * self.frequency))


def filled(
    scenario: HapticScenario,
    body: Body = SLIDE,
    noise: AxisNoise = SLIDE_NOISE,
    stiffness: float = THESIS_TISSUE,
    q_tau: float = 0.0,
) -> HapticScenario:
    """The scenario with what it leaves open; the filter takes the body for what was found of it."""
    own = scenario.body or body
    return replace(
        scenario,
        body=own,
        known=scenario.known or own,
        noise=scenario.noise or noise,
        stiffness=scenario.stiffness or stiffness,
        q_tau=scenario.q_tau or q_tau,
    )


def felt(scenario: HapticScenario, hand: Hand) -> Felt:
    """The scenario's plan, with the noise of its seed."""
    ticks = round(scenario.duration / scenario.tick)
    t = scenario.tick * np.arange(ticks, dtype=float) + scenario.plan[0][0]
    path = Path(scenario.plan, ease=True)
    start = float(path.position(t[:1])[0])
    middle = t + 0.5 * scenario.tick
    wanted = path.position(middle)
    speed = (path.position(t + scenario.tick) - path.position(t)) / scenario.tick
    random = np.random.default_rng(scenario.seed)
    _, noise_of = _parts(scenario)
    noise = random.normal(size=(_turns(scenario, ticks), 3)) * np.array(noise_of)
    return _run(scenario, hand, hand.k * wanted + hand.b * speed, noise, start)


def settled(scenario: HapticScenario, hand: Hand) -> bool:
    """Whether the hand, pressed into the tissue, settles when it suddenly presses less; without noise or stops."""
    ticks = round((LET_GO + SWINGS * 2.0 * math.pi / hand.frequency) / scenario.tick)
    t = np.arange(ticks) * scenario.tick
    push = PRESS * (1.0 + MORE) * 0.5 * (1.0 - np.cos(np.pi * np.clip(t / PRESSED, 0.0, 1.0)))
    push[t >= LET_GO] = PRESS
    endless = replace(scenario, stops=(-1e3, 1e3))
    run = _run(endless, hand, push, np.zeros((_turns(scenario, ticks), 3)), 0.0)
    gain = scenario.device.force * scenario.device.motion
    return settles(run.x[t >= LET_GO], MORE * PRESS / (hand.k + gain * _parts(scenario)[0]))


def margins(scenario: HapticScenario, hand: Hand, response: FeltResponse) -> Margins:
    """The limits of tissue and delay, each with all else as it is."""
    stiffness, _ = _parts(scenario)
    gain = scenario.device.force * scenario.device.motion
    w = 2.0 * np.pi * response.frequency
    by_response = response_limit(hand, w, response.T, gain * scenario.damping) / gain if gain else math.nan

    def bears(k_t: float) -> bool:
        return settled(replace(scenario, stiffness=k_t), hand)

    def waits(delay: float) -> bool:
        return settled(replace(scenario, force_delay=scenario.force_delay + delay), hand)

    limit = largest(bears, by_response if math.isfinite(by_response) else stiffness)
    delay = largest(waits, LATEST / 64.0) if bears(stiffness) else 0.0
    return Margins(limit, by_response, delay)


def response(scenario: HapticScenario) -> FeltResponse:
    """How the felt force answers a hand that is moved in the tissue, frequency by frequency; without noise."""
    return FeltResponse(FREQUENCIES, np.array([_answer(scenario, f) for f in FREQUENCIES.tolist()]))


def _answer(scenario: HapticScenario, frequency: float) -> complex:
    """T at one frequency [Hz]."""
    w, stiffness = 2.0 * math.pi * frequency, _parts(scenario)[0]
    turns = math.ceil(WATCH * frequency)
    ticks = round((SETTLE + turns / frequency) / scenario.tick)
    t = np.arange(ticks + 1) * scenario.tick
    ease = 0.5 * (1.0 - np.cos(np.pi * np.clip(t / (0.5 * SETTLE), 0.0, 1.0)))
    put = np.column_stack([ease * (DENT + SWAY * np.sin(w * t)), np.zeros(len(t))])
    put[:, 1] = np.gradient(put[:, 0], scenario.tick)
    noise = np.zeros((_turns(scenario, ticks), 3))
    run = _run(scenario, Hand(1.0, 1.0, 1.0), np.zeros(ticks), noise, 0.0, put)
    watched = slice(ticks - round(turns / frequency / scenario.tick), ticks)
    middle = run.t[watched] + 0.5 * scenario.tick
    answer = harmonic(middle, run.felt[watched], w) / harmonic(run.t[watched], run.x[watched], w)
    return answer / (scenario.device.force * scenario.device.motion * (stiffness + 1j * w * scenario.damping))


def _run(scenario: HapticScenario, hand: Hand, push: Array, noise: Array, start: float, put: Array = FREE) -> Felt:
    """One run of the loop."""
    stiffness, _ = _parts(scenario)
    clocks = Clocks(
        scenario.tick,
        round(1.0 / scenario.rate / scenario.tick),
        round(1.0 / scenario.link_rate / scenario.tick),
        math.ceil(scenario.position_delay / scenario.tick - 1e-9),
        math.ceil(scenario.force_delay / scenario.tick - 1e-9),
    )
    tissue = FeltTissue(stiffness, scenario.damping, scenario.friction)
    grip = Grip(*held(hand, scenario.tick), put)
    maker = streaming(scenario) if scenario.filtered else lambda reading: reading.force  # as a sensor at the tip has it
    return simulate(grip, scenario.device, _axis(scenario), tissue, clocks, push, noise, (start, 0.0), maker)


def _turns(scenario: HapticScenario, ticks: int) -> int:
    """Turns of the controller in so many ticks."""
    return math.ceil(ticks * scenario.tick * scenario.rate - 1e-6)


def _parts(scenario: HapticScenario) -> tuple[float, AxisNoise]:
    """The tissue's stiffness and the noise of a scenario that leaves nothing open."""
    assert scenario.stiffness is not None
    assert scenario.noise is not None
    return scenario.stiffness, scenario.noise


def _axis(scenario: HapticScenario) -> Axis:
    """The joint that slides."""
    body = scenario.body or SLIDE
    values = (body.viscous, *body.coulomb, *body.static, *body[5:])
    friction = Friction(*(np.array([float(x)]) for x in values))
    low, high = scenario.stops
    stops = (np.array([low]), np.array([high]))
    return Axis(
        np.array([[body.inertia]]), np.array([body.gravity]), friction, scenario.motor, scenario.law, stops,
        scenario.exact,
    )  # fmt: skip


def streaming(scenario: HapticScenario) -> Callable[[SensorReading], float]:
    """The extended Kalman filter, which makes a force of one reading after the other.  (7.6), (7.7)"""
    known, T_s = scenario.known or SLIDE, 1.0 / scenario.rate
    noise, c_b = assumed(scenario), coefficients(known)
    predicted: stepping.Belief | None = None

    def make(reading: SensorReading) -> float:
        nonlocal predicted
        if predicted is None:
            predicted = stepping.first(reading.q, reading.dq, noise.r_q, noise.r_dq, _parts(scenario)[1].tau)
        now, predicted = ekf.step(predicted, (reading.q, reading.dq), reading.tau, known.inertia, c_b, T_s, noise)
        return now[2]

    return make


def coefficients(known: Body) -> Coefficients:
    """b(q, dq) as the filter takes it: what holds the weight, viscous and Coulomb friction."""
    return known.gravity, 0.0, 0.0, 0.0, known.viscous, 0.5 * sum(known.coulomb), 0.0


def assumed(scenario: HapticScenario) -> NoiseModel:
    """The noise of a sample, as the filter of every log takes it."""
    known, T_s = scenario.known or SLIDE, 1.0 / scenario.rate
    _, noise = _parts(scenario)
    own = NoiseModel(noise.q, noise.dq, 0.0, noise.tau * T_s / known.inertia, scenario.q_tau * T_s**0.5)
    walk = own.q_tau or slowest(ekf.track, known.inertia, known.viscous, T_s, own)
    return own._replace(q_tau=walk)


class Experiment(NamedTuple):
    """What one hand felt until the plan's end, or until it was thrown out of the device's reach; (K,) each."""

    t: Array  # [s]
    plan: Array  # [m]
    x: Array
    q: Array
    true: Array  # [N]
    felt: Array
    thrown: bool  # out of the device's reach
    error: float  # [N] root mean square of felt, at the tissue's scale, less true


def experiment(scenario: HapticScenario, hand: Hand) -> Experiment:
    """The scenario's plan at the controller's turns."""
    run = felt(scenario, hand)
    gone = np.flatnonzero(np.abs(run.x) > scenario.reach)
    kept = slice(0, int(gone[0]) if len(gone) else len(run.t), round(1.0 / scenario.rate / scenario.tick))
    t = run.t[kept] + scenario.plan[0][0]
    plan = Path(scenario.plan, ease=True).position(t)
    error = run.felt[kept] / (scenario.device.force or math.nan) - run.true[kept]
    return Experiment(
        t, plan, run.x[kept], run.q[kept], run.true[kept], run.felt[kept], bool(len(gone)),
        float(np.sqrt(np.mean(error**2))),
    )  # fmt: skip
