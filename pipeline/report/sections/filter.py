"""The external effort that the filter tracked, and whether its innovations are what they should be."""

from collections.abc import Iterator

from pipeline.records import Track, Whiteness
from pipeline.report.content import Band, Block, Figure, Line, Panel, Prose, Section, Table, VSpan, literal
from pipeline.report.context import Context, label, most_telling, title
from pipeline.report.plots import autocorrelation

FIGURES = 9  # tracks that are drawn; the others are in the tables, and all are in the processed files


def section(context: Context) -> Section | None:
    """A table over all tracks, then each track."""
    tracks = context.catalogue.all(Track)
    if not tracks:
        return None
    shown = most_telling(tracks, FIGURES)
    parts = (
        Section(f"{title(t.joint)} in {literal(t.log)}", f"track-{t.log}-{t.joint}", tuple(track_blocks(context, t)))
        for t in shown
    )
    return Section(
        "External effort", "filter", (*intro(tracks), assumptions(context, tracks), scores(context, tracks), *parts)
    )


def intro(tracks: list[Track]) -> Iterator[Prose]:
    """What the filter does, and which joints it cannot say much about."""
    yield Prose(
        "An extended Kalman filter follows position, velocity and external effort of each joint by itself. It takes "
        "the noise of its measurements from the spread between periods; how fast the external effort may wander is a "
        "choice, stated in [@filter-noise]. Its innovations, what each measurement adds to what was predicted, are "
        "white where the model and the choice fit the data. Whiteness is tested over the whole run but its first "
        "second, contacts and reversals included."
    )
    moving = sum(not t.at_rest for t in tracks)
    if moving > FIGURES:
        yield Prose(
            f"Figures show {FIGURES} of {moving} runs: contacts, weights and tissue first, then validation, then "
            "identification. The others are in the tables, and all of them are in the processed files."
        )
    at_rest = [f"{title(t.joint)} in {literal(t.log)}" for t in tracks if t.at_rest]
    if at_rest:
        yield Prose(
            f"Joints at rest are in the tables only ({', '.join(at_rest)}): at standstill friction takes any value up "
            "to its Coulomb level, and external effort up to that level cannot be told from it."
        )


def assumptions(context: Context, tracks: list[Track]) -> Table:
    """What the filter assumed of noise."""
    names = ("r_q", "r_dq", "q_q", "q_dq", "q_tau")
    rows = tuple(
        (title(t.joint), literal(t.log), *(context.number(f"ekf.{t.log}.{t.joint}.{name}", 3) for name in names))
        for t in tracks
    )
    return Table(
        "Noise that the filter assumes (standard deviations): of the measured position and velocity, from the spread "
        "between periods; of their process noise per sample, from what forward Euler leaves out and from the noise of "
        "the effort; and of the random walk of the external effort, chosen.",
        ("Joint", "Log", "Position", "Velocity", "Process, $q$", "Process, $dot(q)$", "Random walk"),
        rows,
        "filter-noise",
        "llrrrrr",
    )


def scores(context: Context, tracks: list[Track]) -> Table:
    """Consistency and whiteness of every track."""
    names = ("tau_ext_rms", "nis_mean", "acf1_q", "acf1_dq", "ljung_box_p_q", "ljung_box_p_dq")
    rows = tuple(
        (title(t.joint), literal(t.log), *(context.number(f"ekf.{t.log}.{t.joint}.{name}", 3) for name in names))
        for t in tracks
    )
    header = (
        "Joint",
        "Log",
        '$tau_"ext"$ rms',
        "NIS",
        "ACF(1) $q$",
        "ACF(1) $dot(q)$",
        "$p$ of $q$",
        "$p$ of $dot(q)$",
    )
    return Table(
        "External effort outside known contacts, normalised innovation squared (expected: 2), first autocorrelation "
        "of the innovations, and the probability of a larger Ljung-Box statistic if they were white.",
        header,
        rows,
        align="llrrrrrr",
    )


def track_blocks(context: Context, t: Track) -> Iterator[Block]:
    """The figures of one track.  Fig 7.6-7.11"""
    name, entry = f"{title(t.joint)} in {literal(t.log)}", context.study.log(t.log)
    windows = tuple(
        VSpan(start, end, "known contact" if i == 0 else "") for i, (start, end) in enumerate(entry.contact)
    )
    sigma = 2 * t.tau_ext_std
    # The first samples know nothing yet: their band would set the scale of the whole plot.
    shown = slice(min(int(0.25 * t.rate), len(t) // 10), None)
    yield Figure(
        f"{name}: position; effort measured and modelled; external effort tracked by the filter with two of its "
        "standard deviations, and measured minus modelled effort.",
        f"Three panels over time for {name}: position, effort, external effort.",
        (
            Panel("Trajectory", "time [s]", label(t, "q", "position"), (*windows, Line(t.t, t.q, "", "blue"))),
            Panel(
                "Effort", "time [s]", label(t, "tau", "effort"),
                (*windows, Line(t.t, t.tau, "measured", "sky"), Line(t.t, t.tau_hat, "model", "vermillion")),
            ),
            Panel(
                "External effort", "time [s]", label(t, "tau_ext", "external effort"),
                (
                    *windows,
                    Line(t.t[shown], t.tau_ext_direct[shown], "measured minus model", "grey"),
                    Band(t.t[shown], (t.tau_ext - sigma)[shown], (t.tau_ext + sigma)[shown], "± 2 σ", "vermillion"),
                    Line(t.t[shown], t.tau_ext[shown], "filter", "vermillion"),
                ),
            ),
        ),
        zoomable=True,
        height=38,
    )  # fmt: skip
    yield from innovations(context, t, name)


def innovations(context: Context, t: Track, name: str) -> Iterator[Figure]:
    """Innovations over time and their autocorrelation."""
    late = t.t - t.t[0] >= 1.0 if t.t[-1] - t.t[0] > 5 else t.t >= t.t[0]
    panels = []
    for field, meaning in (("innovation_q", "position innovation"), ("innovation_dq", "velocity innovation")):
        values = getattr(t, field)[late]
        panels.append(
            Panel(meaning.capitalize(), "time [s]", label(t, field, meaning), (Line(t.t[late], values, "", "blue"),))
        )
        for w in context.catalogue.about(Whiteness, log=t.log, joint=t.joint, signal=field):
            panels.append(autocorrelation(w, f"ACF of the {meaning}"))
    yield Figure(
        f"{name}: innovations of position and velocity, and their autocorrelation with the 95 % band of white noise.",
        f"Four panels for {name}: position and velocity innovations and their autocorrelations.",
        tuple(panels),
        columns=2,
        height=42,
    )
