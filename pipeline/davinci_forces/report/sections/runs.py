"""Every run: its recording, its external effort by the smoother, and its traces."""

from collections.abc import Iterator

from davinci_forces.records import Diagnostic, Explanation, Load, LogSummary, Signal, Track
from davinci_forces.records.forces import SMOOTHER, FilterNoise, FreeSpace
from davinci_forces.records.record import as_list, first_of_each_kind
from davinci_forces.report.content import Block, Bullets, Cell, Figure, OnScreen, Panel, Prose, Table, Verdict
from davinci_forces.report.content.inline import literal, message
from davinci_forces.report.content.marks import AnyMark, Band, Line, VSpan
from davinci_forces.report.context import Context, count, label, name_in_sentence
from davinci_forces.report.sections import parts
from davinci_forces.report.verdicts import band_in_words, log_remarks, percent

WORST = "the worst run of this joint in free space"
ON_PAPER = 2  # joints whose worst run is drawn in the PDF
NOISY = 2.0  # noise over the range of the band, above which it is not drawn
LEVELS = ("free_rms", "detection_level")


@parts.section_of("Runs", "runs")
def section(context: Context) -> Iterator[Block]:
    """The recordings, a table of all tracks, the worst run of each joint, and every run on demand."""
    if summaries := context.catalogue.records(LogSummary):
        yield from recording_blocks(context, summaries)
    if tracks := context.catalogue.records(Track):
        yield from track_blocks(context, tracks)


def track_blocks(context: Context, tracks: list[Track]) -> Iterator[Block]:
    """The external effort of all runs, the worst of each joint drawn, the others on demand."""
    tuned = ", tuned as in [@filter-tuning]" if context.catalogue.records(FilterNoise) else ""
    tested = " Its innovations test whether it fits the data ([@innovations])."
    tested *= bool(context.catalogue.records(Explanation))
    yield Prose(parts.explanation("runs", tuned=tuned, tested=tested))
    if at_rest := [t for t in tracks if t.at_rest]:
        friction = parts.static_frictions(context, at_rest)
        levels = [f"{friction[joint]} on {name_in_sentence(joint)}" for joint in context.joints_of(at_rest)]
        yield Prose(parts.explanation("runs-at-rest", levels=as_list(levels)))
    yield from parts.paper_or_screen(scores(context, tracks))
    spaces = [space for joint in context.joints_of(tracks) if (space := context.worst_space(joint)) is not None]
    worst = [t for space in spaces for t in tracks if (t.log, t.joint) == (space.log, space.joint)]
    traces = [trace(context, t, WORST + parts.UNFITTED * (t.role != "identification")) for t in worst]
    yield from parts.first_on_paper(traces, "The worst run of each other joint", "worst-runs", ON_PAPER)
    others = [t for t in tracks if t not in worst and not t.at_rest]
    if others:
        runs = tuple(OnScreen(parts.run_name(t), f"track-{t.log}-{t.joint}", (trace(context, t, ""),)) for t in others)
        yield OnScreen(f"Traces of {count(len(others), 'other run')}", "other-runs", runs)


def scores(context: Context, tracks: list[Track]) -> Table:
    """The external effort of every track in free space, and the coverage of its band."""
    rows = tuple(
        (*parts.run_cells(t), *context.numbers(f"effort.{t.log}.{t.joint}", LEVELS, 2), *coverage(context, t))
        for t in tracks
    )
    header = ("Log", "Joint", "RMS", "Detection level", "Coverage", "By speed", "Band")
    return Table(parts.explanation("free-space-table"), header, rows, "free-space-table", "llrrrll")


def coverage(context: Context, t: Track) -> tuple[Cell, Cell, Cell]:
    """The coverage of a run's band, also by quartile of speed, and whether this coverage is right."""
    spaces = context.catalogue.select(FreeSpace, log=t.log, joint=t.joint, filter=SMOOTHER)
    words = band_in_words(spaces[0].coverage, spaces[0].coverage_std) if spaces else "–"
    by_speed = ", ".join(map(percent, spaces[0].quartile_coverage)) if spaces else ""
    return context.number(f"effort.{t.log}.{t.joint}.coverage", 2), by_speed or "–", words


def trace(context: Context, t: Track, why: str) -> Figure:
    """One run over time.  Fig 7.6-7.11"""
    name, windows = parts.run_name(t), parts.spans(context.study.log(t.log).contact, "stated contact")
    largest = float(abs(t.tau_ext_smooth[parts.converged_rows(t.t)]).max(initial=0.0))
    caption = parts.explanation("runs-trace", run=name, why=f", {why}" if why else "")
    alt = f"{name}: the external effort reaches {context.size(t, 'tau_ext', largest)}."
    panels = (
        Panel("Trajectory", "time [s]", label(t, "q", "position"), (*windows, Line(t.t, t.q, "", "blue"))),
        parts.effort_panel(t, *windows),
        external_effort_panel(t, *windows),
    )
    return Figure(caption, alt, panels, f"track-figure-{t.log}-{t.joint}", zoomable=True, height=30)


def external_effort_panel(t: Track, *spans: VSpan) -> Panel:
    """The external effort over time with its band, and measured minus modelled effort unless its noise hides them."""
    shown, effort, upper = parts.converged_rows(t.t), t.tau_ext_smooth, 2 * t.tau_ext_smooth_std
    lower = effort - upper
    upper += effort  # in place, as a column of a long log takes much memory
    direct, room = t.tau_ext_direct[shown], float(upper[shown].max() - lower[shown].min())
    is_noisy = float(direct.max() - direct.min()) > NOISY * room
    marks: tuple[AnyMark, ...] = (
        *spans,
        *([] if is_noisy else [Line(t.t[shown], direct, "measured minus model", "grey", "dotted")]),
        Band(t.t[shown], lower[shown], upper[shown], "± 2 σ (total)", "sky"),
        Line(t.t[shown], effort[shown], "smoother", "vermillion"),
    )
    return Panel("External effort", "time [s]", label(t, "tau_ext", "external effort"), marks)


def recording_blocks(context: Context, summaries: list[LogSummary]) -> Iterator[Block]:
    """One table over all logs, and the remarks on the study, of the readers and of the stages."""
    yield from parts.paper_or_screen(overview(context, summaries))
    elsewhere = ("fit", "resolve", "sense")  # stages whose remarks stand beside what they are about
    diagnostics = [d for d in context.catalogue.records(Diagnostic) if d.stage not in elsewhere]
    of_stages = [("study.toml", text) for text in context.study.remarks]
    of_stages += [(diagnostic.stage, text) for diagnostic in diagnostics for text in diagnostic.text]
    remarked = {summary.log: texts for summary in summaries if (texts := log_remarks(summary))}
    of_logs = [d for d in diagnostics if d.stage in ("ingest", "resample", "average")]
    followed = {diagnostic.subject.partition(".")[0] for diagnostic in of_logs}
    if clean := len({summary.log for summary in summaries} - followed - set(remarked)):
        every = clean == len(summaries)
        which = "Every log was" if every else f"{clean} of {count(len(summaries), 'log')} were"
        yield Verdict("good" if every and not of_logs else "info", f"{which} read without a remark.")
    yield from (Verdict("warn", f"**{literal(log)}**: {message('; '.join(texts))}.") for log, texts in remarked.items())
    stated = "the rate stated in study.toml"  # of a log without a clock
    signals = context.catalogue.records(Signal)
    methods = sorted({(stated if context.study.log(s.log).rate else s.method, s.velocity) for s in signals})
    if methods:
        cutoff = context.study.settings.lowpass
        derived = f"differences of the position after a zero-phase low-pass at {cutoff:g} Hz"
        sources = ((method, "as logged" if velocity == "logged" else derived) for method, velocity in methods)
        yield Prose("Sources of the uniform clock and of the velocities of the recordings:")
        yield Bullets(tuple(f"clock: {method}; velocity: {source}" for method, source in sources))
    if of_stages:
        yield Prose(parts.explanation("runs-remarks"))
        first = tuple(message(text) for _, text in first_of_each_kind(of_stages))
        yield Bullets(first)
        if len(first) < len(of_stages):
            all_of_them = Bullets(tuple(message(text) for _, text in of_stages))
            yield OnScreen(f"All {len(of_stages)} remarks", "all-remarks", (all_of_them,))
    of_the_tip = [d for d in context.catalogue.records(Diagnostic) if d.stage in ("resolve", "sense")]
    if left_out := tuple(message(text) for diagnostic in of_the_tip for text in diagnostic.text):
        yield OnScreen("Logs of contact without a force at the tip", "tip-left-out", (Bullets(left_out),))


def overview(context: Context, summaries: list[LogSummary]) -> Table:
    """One row per log."""
    rows = []
    for summary in summaries:
        log, period = f"log.{summary.log}", f"period.{summary.log}"
        clock = *context.numbers(log, ("rate", "duration"), 5), context.number(f"{log}.jitter", 2)
        periods: tuple[Cell, ...] = context.number(period, 6, std=None), context.count(f"{period}.periods")
        for load in context.catalogue.select(Load, log=summary.log, weight=summary.log):
            periods = (f"{load.period:.6g} s", str(load.periods)) if load.period else periods
        samples = context.count(f"{log}.rows")
        rows.append((literal(summary.log), summary.role, summary.format, samples, *clock, *periods))
    header = ("Log", "Role", "Format", "Samples", "Rate", "Duration", "Clock jitter", "Period", "Periods")
    return Table("The logs of the study.", header, rows, "recorded-table", "lllrrrrrr")
