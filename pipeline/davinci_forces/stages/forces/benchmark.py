"""Benchmark filters: what each makes of free space, and of a push that is added to the recorded effort in software."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import DEFAULT, FILTERS, through
from davinci_forces.filters.problem import Driven, NoiseModel, driven, driven_smooth
from davinci_forces.filters.response import DURATION, assumed, half_sine, response
from davinci_forces.identification.joint_models import Along
from davinci_forces.identification.used import FALLBACK, Identified
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.windows import free_space, runs
from davinci_forces.maths.uncertainty.error_band import levels
from davinci_forces.records import Comparison, Diagnostic, FilterNoise, Fit, JointModel, diagnostic
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.study import LogEntry

PUSH = {Kind.REVOLUTE: 0.5, Kind.PRISMATIC: 2.0}  # [N m], [N]
FEWEST = 100  # samples of free space, below which nothing is said
INDEPENDENT = f"{DEFAULT}-independent"  # the default filter with the joint's own terms


def run(
    model: JointModel,
    fits: Iterable[Fit],
    noise: FilterNoise | None,
    entry: LogEntry,
    robot: Robot,
    *,
    q_tau: float,
) -> Iterator[Comparison | Diagnostic]:
    """One Comparison per filter of a joint that moves in a log that no parameter was fitted to.

    Each filter has the slowest walk with which it shows a push, so that they are compared at the same speed.
    """
    free = free_space(model.t, entry.contact, model.rate)
    unfitted = entry.role != "identification" and entry.tells_free_space
    if not unfitted or model.at_rest or noise is None or int(free.sum()) < FEWEST:
        return
    tried, identified = [(name.replace("_", "-"), name, model) for name in FILTERS], Identified(robot, fits)
    alone = identified.used(model.joint, FALLBACK)
    if alone is not None and model.model != "independent":
        by_itself = Along(identified, [model]).under(model, alone)
        tried += [(INDEPENDENT, DEFAULT, by_itself)] if by_itself.inertia.min() > 0 else []
    joint = robot.joint(model.joint)
    for label, name, by in tried:
        assumes = assumed(noise, joint, 1.0 / model.rate, q_tau, name)
        yield from compared(label, name, by, assumes, free, PUSH[joint.kind])


def compared(
    label: str, name: str, model: JointModel, noise: NoiseModel, free: Booleans, push: float
) -> Iterator[Comparison | Diagnostic]:
    """What one filter makes of a joint of a log, and of the same with a push."""
    parts = driven_smooth(model) if name == "direct" else driven(model)
    made = through(name, parts, noise)
    if not np.isfinite(made.tau_ext).all():
        return
    space, added = levels(made.tau_ext[free], made.tau_ext_std[free]), pushed(model.t, parts, free, push)
    shown = response(through(name, added.parts, noise).tau_ext - made.tau_ext, model.t, added.start, push)
    if label == DEFAULT and shown.share < 0.5:
        said = f"{model.log}/{model.joint}: the filter is deaf: it shows {shown.share:.0%} of a push of {DURATION:g} s"
        yield diagnostic("benchmark", f"{model.log}.{model.joint}", "warning", f"{said}; raise q_tau in [settings]")
    yield Comparison(
        log=model.log, joint=model.joint, filter=label, role=model.role, default=int(label == DEFAULT),
        free_rms=space.rms, free_rms_std=space.rms_std, free_level=space.level_95, free_level_std=space.level_95_std,
        detection_level=space.level_99, detection_level_std=space.level_99_std, push_peak=push, push_share=shown.share,
        push_delay=shown.delay, t=model.t, tau_ext=made.tau_ext,
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
