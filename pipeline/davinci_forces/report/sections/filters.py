"""The filter: its noise, the parts of the standard deviation, the cost of real time, and a comparison of filters."""

from collections.abc import Iterator, Sequence

from davinci_forces import filters
from davinci_forces.records import Comparison, FilterNoise, Streamed, Track
from davinci_forces.report.content import Block, Cell, Figure, OnScreen, Panel, Prose, Table, literal
from davinci_forces.report.content.marks import Line, Points
from davinci_forces.report.context import Context, count, label, title
from davinci_forces.report.sections.parts import explanation, run_cells, section_of


@section_of("The filter", "filters", FilterNoise)
def section(context: Context, noises: list[FilterNoise]) -> Iterator[Block]:
    """Tuning, error budget and comparison."""
    yield Prose(explanation("filters", delay=f"{context.study.settings.delay:g}"))
    yield tuning(context, noises)
    spaces = [space for noise in noises if (space := context.worst_space(noise.joint)) is not None]
    worst = [t for space in spaces for t in context.catalogue.select(Track, log=space.log, joint=space.joint)]
    if worst:
        yield Prose(explanation("error-parts"))
        yield budget(context, worst)
        yield cost_of_real_time(context, worst)
    comparisons = [c for track in worst for c in context.catalogue.select(Comparison, log=track.log, joint=track.joint)]
    if comparisons:
        compared = comparison(context, comparisons), noise_over_delay(noises)
        yield OnScreen("Filters compared, and noise over delay", "filters-compared", compared)
    if logs := context.catalogue.records(Streamed):
        yield OnScreen("The same filter as samples arrive", "filters-streamed", (stream_table(context, logs),))


def tuning(context: Context, noises: list[FilterNoise]) -> Table:
    """The tuned noise of each joint, and the logs of the tuning."""
    names = ("r_q", "r_dq", "r_tau", "q_tau")
    rows = [(title(n.joint), *context.numbers(f"tuning.{n.joint}", names), literal(", ".join(n.logs))) for n in noises]
    header = ("Joint", "Position", "Velocity", "Effort", "Random walk", "Tuned on")
    return Table(explanation("filter-tuning"), header, rows, "filter-tuning", "lrrrrl")


def budget(context: Context, tracks: list[Track]) -> Table:
    """The parts of the standard deviation of each joint's worst free run, beside the RMS and coverage of that run."""
    keys = ("effort", "smooth_part"), ("ekf", "model_part"), ("effort", "free_rms"), ("effort", "coverage")
    over_logs = ("coverage", "band_width")
    rows = tuple((*run_row(context, t, keys), *context.numbers(f"band.{t.joint}", over_logs, 2)) for t in tracks)
    header = ("Joint", "Worst free run", "Smoother", "Model", "RMS", "Coverage", "Mean coverage", "Half-width")
    return Table(explanation("error-budget"), header, rows, "error-budget", "llrrrrrr")


def run_row(context: Context, t: Track, keys: Sequence[tuple[str, str]]) -> tuple[Cell, ...]:
    """The joint and log of a run, and its results `<prefix>.<log>.<joint>.<name>` by prefix and name."""
    numbers = (context.number(f"{prefix}.{t.log}.{t.joint}.{name}", 2) for prefix, name in keys)
    return (*run_cells(t)[::-1], *numbers)


def cost_of_real_time(context: Context, tracks: list[Track]) -> Table:
    """Smoother and filter on the worst free run of each joint, and the delay and lag of the filter."""
    keys = [(prefix, name) for name in ("free_rms", "detection_level") for prefix in ("effort", "ekf")]
    rows = tuple(run_row(context, t, (*keys, ("ekf", "push_delay"), ("ekf", "lag_part"))) for t in tracks)
    compared = (f"{what}, {which}" for what in ("RMS", "Level") for which in ("smoother", "filter"))
    header = ("Joint", "Worst free run", *compared, "Delay", "Lag error")
    return Table(explanation("real-time-cost"), header, rows, "real-time-cost", "llrrrrrr")


def stream_table(context: Context, logs: list[Streamed]) -> Table:
    """Every log filtered as samples arrive, beside the smoother."""
    names = ("stream_delay", "free_rms", "stream_loss", "peak_ratio")
    rows = []
    for s in logs:
        of_log, key = context.numbers(f"stream.{s.log}.{s.joint}", names, 2), f"stream.{s.joint}.alarm_level"
        level = context.results.get(key)
        detected = f"{int((abs(s.peak) > level.value).sum())} of {len(s)}" if level and len(s) else "–"
        rows.append((*run_cells(s)[::-1], *of_log, context.number(key, 2), detected))
    header = ("Joint", "Log", "Delay", "RMS", "Over smoother", "Peaks", "Alarm level", "Contacts found")
    return Table(explanation("stream"), header, rows, "stream", "llrrrrrr")


def comparison(context: Context, compared: list[Comparison]) -> Table:
    """Every filter on the worst run in free space of each joint."""
    names = (("free_rms", 2), ("detection_level", 2), ("push_share", 2), ("push_delay", 1))
    rows = []
    for c in compared:
        numbers = (context.number(f"{c.filter}.{c.log}.{c.joint}.{name}", digits) for name, digits in names)
        rows.append((title(c.joint), name_of(c.filter), *numbers))
    header = ("Joint", "Filter", "RMS", "Detection level", "Peak ratio", "Delay")
    return Table(explanation("filter-comparison"), header, rows, "filter-comparison", "llrrrr")


def name_of(label: str) -> str:
    """The title of a filter in a comparison; one is the default filter with the terms of the joint alone."""
    name = label.replace("-", "_")
    return filters.title(name) if name in filters.FILTERS else f"{filters.title(filters.DEFAULT)}, joint alone"


def noise_over_delay(noises: list[FilterNoise]) -> Figure:
    """What another delay would cost each joint."""
    panels = []
    for n in noises:
        marks = Line(n.trial_delay, n.trial_std), Points(n.trial_delay, n.trial_std)
        panels.append(Panel(title(n.joint), "delay [s]", label(n, "trial_std", "noise"), marks, x_log=True))
    caption = explanation("noise-over-delay", delay=noises[0].delay)
    alt = f"Noise of the filter over its delay for {count(len(noises), 'joint')}."
    return Figure(caption, alt, tuple(panels), "noise-over-delay", height=35)
