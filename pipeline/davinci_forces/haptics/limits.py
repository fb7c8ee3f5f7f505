"""The limits of the tissue's stiffness for a hand: one headline, and what each of the others includes.

The headline is the formula of a delayed force, (G K_T + Z) x, at the frequency of the hand's oscillation at the limit.
It includes hand, link, sampling, arm and filter, and elastic tissue; the filter's lag and gain are measured in logs.
The response and the simulation of the same loop, without friction and damping of tissue, contain the filter itself.
They must agree with the headline.  `k_t_settles` adds the friction of the arm and the damping of the tissue.
`k_t_cqlf` and `k_t_switching` leave out link, arm, filter, sampling and delay, and allow any switching.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from davinci_forces.haptics.loop import FREQUENCIES, felt_share, hand_settles, is_followed
from davinci_forces.haptics.maths import delay as delays
from davinci_forces.haptics.maths.bimodal import Hand, cqlf_limit, switching_limit
from davinci_forces.haptics.scenario import MAX_TICKS, Body, FullScenario
from davinci_forces.maths.arrays import Array
from davinci_forces.records import HandLimit

NO_TISSUE = 1e-3  # [N/m] stiffness at which the hand feels the arm's motion alone
SEGMENT_PERIODS, MIN_SEGMENTS = 8, 5  # periods of one segment of a log, and least number of segments with an error
MAX_DELAY_MARGIN = 1.0  # [s]
TICK_DIVISORS = (2, 4, 8)  # of the shorter ticks that are tried for an unstable arm
TRIED_DELAYS = 101  # additional delays, up to one period of the free hand
# Time [s], the response of the filter at rest to the effort minus the model's, and its external effort, each (N,).
Recording = tuple[Array, Array, Array]
# w (N,) [rad/s], and at each w G and Z [N/m].
LoopResponse = tuple[Array, delays.Complex, delays.Complex]


def without_friction(scenario: FullScenario, body: Body | None = None) -> FullScenario:
    """The linear scenario: elastic tissue, no friction, also in the filter, no encoder steps; or with another body."""
    moved, assumed = (
        x._replace(coulomb=(0.0, 0.0), static=(0.0, 0.0), bristle_stiffness=0.0, bristle_damping=0.0)
        for x in (body or scenario.body, scenario.assumed_body)
    )
    return replace(
        scenario, body=moved, assumed_body=assumed, damping=0.0, friction=0.0, motor=scenario.motor._replace(
        encoder_step=np.zeros(1)), device=scenario.device._replace(strongest=math.inf, step=0.0),
    )  # fmt: skip


def has_limits(scenario: FullScenario) -> bool:
    """Whether the arm follows a slow hand, and not by the help of its friction alone, as with a loose controller."""
    return is_followed(scenario) and is_followed(without_friction(scenario))


def why_unstable(scenario: FullScenario) -> str:
    """Describe an arm without limits: its inertia and tick, and the longest shorter tick at which it has limits."""
    divisors = [n for n in TICK_DIVISORS if n * scenario.duration / scenario.tick <= MAX_TICKS]
    tick = next((scenario.tick / n for n in divisors if has_limits(replace(scenario, tick=scenario.tick / n))), None)
    text = f"its simulated controller does not stabilise {scenario.body.inertia:.2g} kg at `tick` = {scenario.tick} s"
    if tick:
        return f"{text}; it does at {tick} s, so state tick = {tick} under [arm], or the tick and gains of your drivers"
    tried = f", nor at a tick down to {scenario.tick / divisors[-1]} s" if divisors else ""
    return f"{text}{tried}; check the gains of your drivers, [arm.control], and [arm.body]"


def without_arm(name: str, hand: Hand) -> HandLimit:
    """The limits of a hand that need no arm; all others are NaN."""
    known: dict[str, Any] = {"hand": name, "hand_mass": hand.m, "hand_damping": hand.b, "hand_stiffness": hand.k}
    known |= {"k_t_cqlf": cqlf_limit(hand), "k_t_switching": switching_limit(hand)}
    unknown = dict.fromkeys(HandLimit.scalars(), math.nan) | dict.fromkeys(HandLimit.columns(), np.zeros(0))
    return HandLimit(**unknown | known)


def gain_and_impedance(scenario: FullScenario, frequency: float) -> tuple[complex, complex]:
    """G and Z [N/m] at a frequency [Hz], from simulations with and without the tissue."""
    gain = scenario.device.force * scenario.device.motion
    Z = NO_TISSUE * felt_share(replace(scenario, stiffness=NO_TISSUE), frequency)
    return gain * (felt_share(scenario, frequency) - Z / scenario.stiffness), gain * Z


def loop_response(scenario: FullScenario) -> LoopResponse:
    """The response of the loop without friction; it is the same for every hand."""
    G, Z = np.array([gain_and_impedance(without_friction(scenario), f) for f in FREQUENCIES.tolist()]).T
    return 2.0 * np.pi * FREQUENCIES, G, Z


def filter_response(recordings: Sequence[Recording], frequency: float) -> tuple[complex, float]:
    """The filter's response in logs over that at rest, at a frequency [Hz], and the error of either part.

    It is that of least squares over segments of a Hann window, sum Y conj(X) / sum |X|^2.  The standard error is the
    jackknife's over segments.  NaN with few segments.
    """
    cross, power = [], []
    for t, at_rest, filtered in recordings:
        n = round(SEGMENT_PERIODS / frequency / float(t[1] - t[0]))
        wave = np.exp(-2j * np.pi * frequency * t[:n]) * np.hanning(n)
        for start in range(0, len(t) - n + 1, n):
            X, Y = (np.sum(wave * (x[start : start + n] - x[start : start + n].mean())) for x in (at_rest, filtered))
            cross.append(Y * np.conj(X))
            power.append(abs(X) ** 2)
    if len(power) < MIN_SEGMENTS:
        return complex(math.nan), math.nan
    total, without = sum(cross) / sum(power), (sum(cross) - np.array(cross)) / (sum(power) - np.array(power))
    variance = (len(power) - 1) * np.mean(np.abs(without - without.mean()) ** 2)
    return complex(total), float(np.sqrt(0.5 * variance))


def limits_of(
    scenario: FullScenario, name: str, hand: Hand, loop: LoopResponse, recordings: Sequence[Recording] = (),
    bodies: Sequence[Body] = (),
) -> HandLimit:  # fmt: skip
    """Compute the limits of a hand, with the filter measured in recordings of a joint, or else as the scenario has it.

    `bodies` are the arm's with one parameter changed by its standard error.
    """
    linear, tissue = without_friction(scenario), scenario.stiffness
    by_response, w = delays.response_limit(hand, *loop)
    changed = [without_friction(scenario, body) for body in bodies]
    measured = measured_limit(linear, hand, w, recordings if scenario.filtered else (), changed)
    simulated = max_settling(linear, hand, by_response)
    settles = max_settling(scenario, hand, simulated)
    added = np.linspace(0.0, 2.0 * math.pi / hand.frequency, TRIED_DELAYS)
    turns = np.exp(-1j * loop[0] * added[:, np.newaxis])
    k_t_delay = np.array([delays.response_limit(hand, loop[0], loop[1] * turn, loop[2] * turn)[0] for turn in turns])
    best = int(np.argmax(np.nan_to_num(k_t_delay)))

    def settles_with(delay: float) -> bool:
        return hand_settles(replace(scenario, force_delay=scenario.force_delay + delay), hand)

    margin = delays.max_stable(settles_with, MAX_DELAY_MARGIN / 64.0) if hand_settles(scenario, hand) else 0.0
    best_limit = float(k_t_delay[best])
    checks = {"k_t_response": by_response, "k_t_simulated": simulated, "k_t_settles": settles, "k_t_best": best_limit}
    share = measured["k_t_limit_std"] / (measured["k_t_limit"] or math.nan)  # all have the arm and the filter in common
    needed = delays.damping_needed(hand, tissue, lambda damped: delays.response_limit(damped, *loop)[0])
    return HandLimit(
        hand=name, hand_mass=hand.m, hand_damping=hand.b, hand_stiffness=hand.k, link_rate=scenario.link_rate,
        k_t_cqlf=cqlf_limit(hand), k_t_switching=switching_limit(hand), best_delay=float(added[best]),
        damping_needed=needed, delay_margin=margin, delay=added, k_t_delay=k_t_delay, **measured, **checks,
        **{f"{name}_std": limit * share for name, limit in checks.items()},
    )  # fmt: skip


def max_settling(scenario: FullScenario, hand: Hand, guess: float) -> float:
    """The stiffest tissue [N/m] against which the hand settles, searched from a guess or from the scenario's tissue."""
    start = guess if math.isfinite(guess) else scenario.stiffness
    return delays.max_stable(lambda k_t: hand_settles(replace(scenario, stiffness=k_t), hand), start)


def measured_limit(
    linear: FullScenario, hand: Hand, w: float, recordings: Sequence[Recording], changed: Sequence[FullScenario]
) -> dict[str, Any]:
    """The fields of `HandLimit` that follow from the formula and the filter: the limit, its error, and their reasons.

    The error is that of the filter's response in the recordings and that of the arm's parameters, by the limits of the
    `changed` scenarios.  It is unknown if the arm follows no hand in one of them.  Without recordings the filter is the
    simulated one.
    For a hand without limit, w is NaN, and its own frequency is taken.
    """
    w = w if math.isfinite(w) else hand.frequency
    f = 0.5 * w / math.pi
    G, Z = gain_and_impedance(linear, f)
    unfiltered, _ = gain_and_impedance(replace(linear, filtered=False), f)
    H, (ratio, error) = G / unfiltered, filter_response(recordings, f)
    known = math.isfinite(error)
    H, std = H * ratio if known else H, error * abs(H)

    def limit(G: complex, Z: complex) -> float:
        moved, delay, share = delays.formula(hand, w, G, Z)
        return delays.delay_limit(moved, delay) / share if moved.b > 0.0 and moved.m > 0.0 else math.nan

    headline = limit(H * unfiltered, Z)
    errors = [limit((H + part) * unfiltered, Z) - headline for part in (std, 1j * std) if known]
    errors += [limit(*gain_and_impedance(s, f)) - limit(G, Z) if is_followed(s) else math.nan for s in changed]
    return {
        "k_t_limit": headline, "k_t_limit_std": math.hypot(*errors) if errors else math.nan, "limit_frequency": f,
        "filter_lag": -float(np.angle(H)) / w, "filter_lag_std": std / abs(H) / w, "filter_share": abs(H),
        "filter_share_std": std, "felt_damping": Z.imag / w,
        "loop_delay": delays.formula(hand, w, H * unfiltered, Z)[1],
    }  # fmt: skip
