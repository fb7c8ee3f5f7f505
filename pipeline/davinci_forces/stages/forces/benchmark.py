"""Compare all filters: the level of their estimates in free space, and their response to a push added to the effort."""

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

import numpy as np

from davinci_forces.filters import DEFAULT, FILTERS, filter_parts
from davinci_forces.filters.problem import FilterInput, LongInput, NoiseModel, Recording, filter_inputs
from davinci_forces.filters.response import DURATION, half_sine, noise_model, response
from davinci_forces.identification.joint_models import FALLBACK, Identified, LogModels
from davinci_forces.maths.arrays import Array, Booleans, runs
from davinci_forces.maths.signals.windows import MIN_FREE_SAMPLES, free_space
from davinci_forces.maths.uncertainty.error_band import levels
from davinci_forces.records import Comparison, Diagnostic, FilterNoise, Fit, JointModel, diagnostic
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.study import LogEntry

PUSH = {Kind.REVOLUTE: 0.5, Kind.PRISMATIC: 2.0}  # [N m], [N]
MIN_PUSH_SHARE = 0.5  # peak of the filtered push over the true peak; below this share, a warning is given
INDEPENDENT = f"{DEFAULT}-independent"  # the default filter with the joint's own terms


def run(
    model: JointModel, fits: Iterable[Fit], noise: FilterNoise | None, entry: LogEntry, robot: Robot, *, q_tau: float
) -> Iterator[Comparison | Diagnostic]:
    """Compare all filters on a moving joint in a log that no parameter was fitted to.

    Each filter has the smallest random walk with which it follows a push, so that all are compared at equal speed.
    """
    free = free_space(model.t, entry.possible_contact, model.rate, model.unscored)
    unfitted = entry.role != "identification" and entry.has_known_free_motion
    if not unfitted or model.at_rest or noise is None or int(free.sum()) < MIN_FREE_SAMPLES:
        return
    joint = robot.joint(model.joint)
    for label, name, variant in variants(model, Identified(robot, fits)):
        filter_noise = noise_model(noise, joint, 1.0 / model.rate, q_tau, name)
        yield from compare(label, name, variant, filter_noise, free, PUSH[joint.kind])


def variants(model: JointModel, identified: Identified) -> Iterator[tuple[str, str, JointModel]]:
    """Yield a label, the name of the filter, and the model of each comparison."""
    yield from ((name.replace("_", "-"), name, model) for name in FILTERS)
    fit = identified.fit_of(model.joint, FALLBACK)
    if fit is not None and model.model != "independent":
        independent = LogModels(identified, [model]).with_fit(model, fit)
        if independent.inertia.min() > 0:
            yield INDEPENDENT, DEFAULT, independent


def compare(
    label: str, name: str, model: JointModel, noise: NoiseModel, free: Booleans, push: float
) -> Iterator[Comparison | Diagnostic]:
    """Filter a joint of a log without and with a push; measure the level in free space and the response."""
    parts = filter_inputs(model, smooth=name == "direct")
    _, _, tau_ext, std, *_ = filter_parts(name, parts, noise, ("tau_ext", "tau_ext_std"))
    if not np.isfinite(tau_ext).all():
        return
    space = levels(tau_ext[free], std[free])
    del std  # of a long log, as the filter runs again
    pushed, start = add_push(model.t, parts, free, push)
    change = filter_parts(name, pushed, noise, ("tau_ext",)).tau_ext
    share, late = response(np.subtract(change, tau_ext, out=change), model.t, start, push)
    if label == DEFAULT and share < MIN_PUSH_SHARE:
        message = f"{model.log}/{model.joint}: the filter shows only {share:.0%} of a push of {DURATION:g} s"
        text = f"{message}; state a shorter delay in [settings]"
        yield diagnostic("benchmark", f"{model.log}.{model.joint}", "warning", text)
    yield Comparison.like(
        space, model, filter=label, default=int(label == DEFAULT), push_peak=push, push_share=share,
        push_delay=late, t=model.t, tau_ext=tau_ext,
    )  # fmt: skip


def add_push(t: Array, parts: Sequence[Recording], free: Booleans, push: float) -> tuple[list[LongInput], float]:
    """Add a push to the recorded effort, in the middle of the longest free space, and return its start [s]."""
    longest = max(runs(free), key=lambda run: run.stop - run.start)
    start = float(t[(longest.start + longest.stop) // 2]) - 0.5 * DURATION
    first = np.cumsum([0, *(part.samples for part in parts)])

    def add_to_part(part: Recording, t: Array, rows: slice) -> FilterInput:
        recorded = part.part(rows)
        return recorded._replace(tau=recorded.tau + push * half_sine(t[rows], start))

    pairs = zip(parts, np.split(t, first[1:-1]), strict=True)
    return [LongInput(x.samples, x.T_s, x.initial_std, partial(add_to_part, x, t)) for x, t in pairs], start
