"""Benchmark filters: what each makes of free space, and of a push that is added to the recorded effort in software."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import DEFAULT, FILTERS, through
from davinci_forces.filters.assumed import assumed
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.response import DURATION, half_sine, response
from davinci_forces.identification.driving import Driving, driving, motions_of, named
from davinci_forces.identification.used import FALLBACK, describing
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.models.driven import Driven
from davinci_forces.maths.signals.windows import free_space, runs
from davinci_forces.maths.uncertainty.free_space import levels
from davinci_forces.records import Choice, Comparison, Diagnostic, FilterNoise, Fit, Signal, diagnostic
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.study import LogEntry

PUSH = {Kind.REVOLUTE: 0.5, Kind.PRISMATIC: 2.0}  # [N m], [N]
FEWEST = 100  # samples of free space, below which nothing is said
INDEPENDENT = f"{DEFAULT}-independent"  # the default filter with the joint's own terms


def run(
    signals: Sequence[Signal],
    fits: Iterable[Fit],
    choices: Iterable[Choice],
    noises: Iterable[FilterNoise],
    entry: LogEntry,
    robot: Robot,
    *,
    fit: str,
    lowpass: float,
    q_tau: float,
) -> Iterator[Comparison | Diagnostic]:
    """One Comparison per filter and joint that moves in a log that no parameter was fitted to.

    Each filter has the slowest walk with which it shows a push, so that they are compared at the same speed.
    """
    if entry.role == "identification" or not entry.tells_free_space:
        return
    every, chosen, settled = list(fits), list(choices), {noise.joint: noise for noise in noises}
    motions = motions_of(signals, lowpass)
    for signal in signals:
        if signal.at_rest or signal.joint not in settled or not describing(robot, every, signal.joint):
            continue
        free = free_space(signal.t, entry.contact, signal.rate)
        if int(free.sum()) < FEWEST:
            continue
        kept, _ = named(signal, signals, every, chosen, robot, fit)
        own = driving(signal, motions, kept, robot)
        alone, _ = named(signal, signals, every, chosen, robot, FALLBACK)
        tried = [(name.replace("_", "-"), name, own) for name in FILTERS]
        if own.fit.model != "independent":
            tried.append((INDEPENDENT, DEFAULT, driving(signal, motions, alone, robot)))
        for label, name, by in tried:
            if by.joint.inertia.min() > 0:
                joint = robot.joint(signal.joint)
                noise = assumed(settled[signal.joint], joint, 1.0 / signal.rate, q_tau, name)
                yield from compared(label, name, by, noise, free, PUSH[joint.kind])


def compared(
    label: str, name: str, own: Driving, noise: NoiseModel, free: Booleans, push: float
) -> Iterator[Comparison | Diagnostic]:
    """What one filter makes of a joint of a log, and of the same with a push."""
    signal, parts = own.signal, own.smooth_parts if name == "direct" else own.parts
    made = through(name, parts, noise)
    if not np.isfinite(made.tau_ext).all():
        return
    space, added = levels(made.tau_ext[free], made.tau_ext_std[free]), pushed(own.signal.t, parts, free, push)
    shown = response(through(name, added.parts, noise).tau_ext - made.tau_ext, own.signal.t, added.start, push)
    if label == DEFAULT and shown.share < 0.5:
        said = (
            f"{signal.log}/{signal.joint}: the filter is deaf: it shows {shown.share:.0%} of a push of {DURATION:g} s"
        )
        yield diagnostic("benchmark", f"{signal.log}.{signal.joint}", "warning", f"{said}; raise q_tau in [settings]")
    yield Comparison(
        log=signal.log, joint=signal.joint, filter=label, role=signal.role, default=int(label == DEFAULT),
        free_rms=space.rms, free_rms_std=space.rms_std, free_level=space.level_95, free_level_std=space.level_95_std,
        detection_level=space.level_99, detection_level_std=space.level_99_std, push_peak=push, push_share=shown.share,
        push_delay=shown.delay, t=signal.t, tau_ext=made.tau_ext,
    )  # fmt: skip


class AddedPush(NamedTuple):
    """A recording with a push that nobody exerted, from `start` [s] on."""

    parts: list[Driven]
    start: float


def pushed(t: Array, parts: Sequence[Driven], free: Booleans, push: float) -> AddedPush:
    """A push in the middle of the longest free space, added to the recorded effort."""
    start = middle(t, free) - 0.5 * DURATION
    added, first = push * half_sine(t, start), np.cumsum([0, *(len(part.q) for part in parts)])
    touched = [
        part._replace(tau=part.tau + added[a:b]) for part, (a, b) in zip(parts, pairwise(first.tolist()), strict=True)
    ]
    return AddedPush(touched, start)


def middle(t: Array, free: Booleans) -> float:
    """The middle [s] of the longest run of free samples."""
    longest = max(runs(free), key=lambda run: run.stop - run.start)
    return float(t[(longest.start + longest.stop) // 2])
