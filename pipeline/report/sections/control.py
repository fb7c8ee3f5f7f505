"""The simulated control studies: PD with gravity compensation, and PID where the masses are not known exactly."""

from collections.abc import Iterator

from pipeline.records import Control, Lyapunov
from pipeline.report.content import Block, Figure, HLine, Line, Panel, Prose, Section, Table, Verdict
from pipeline.report.context import Context, label, title

CAPTIONS = {
    "pd-to-zero": "PD with gravity compensation, from the pose to zero",
    "pd-to-pose": "PD with gravity compensation, from zero to the pose",
    "pd-light": "PD, gravity compensated with 0.9 of the masses",
    "pid-light": "PID, gravity compensated with 0.9 of the masses",
}


def section(context: Context) -> Section | None:
    """What chapter 5 showed, and what it did not."""
    studies = context.catalogue.all(Control)
    if not studies:
        return None
    return Section("Control, in simulation", "control", tuple(blocks(context, studies)))


def blocks(context: Context, studies: list[Control]) -> Iterator[Block]:
    """The section's content.  Fig 5.2-5.6"""
    yield Prose(
        "Simulated: the full rigid-body model of the arm with viscous friction, under the controllers of the thesis's "
        "chapter 5 (gains of Tables 5.1 and 5.4). With exact gravity compensation PD settles at its reference, and "
        "the Lyapunov function $V = 1/2 dot(q)^T M dot(q) + 1/2 tilde(q)^T K_p tilde(q)$ never rises."
    )
    rise = context.results["control.pd-to-zero.V_rise"]
    level = "good" if rise.value == 0 else "bad"
    yield Verdict(level, f"The Lyapunov function of the PD study rises by {rise.number(2)} at the most.")  # type: ignore[arg-type]
    yield response(context, "pd-to-zero", 1.5, with_V=True)
    yield response(context, "pd-to-pose", 1.5, with_V=False)
    yield Prose(
        "A compensator that knows only 0.9 of the masses leaves PD with an offset. Integral action removes it, but "
        "with the gains of Table 5.4 slowly: its slow pole keeps the error **larger** than PD's offset for some twenty "
        "seconds. The thesis calls the response faster, which this simulation does not confirm."
    )
    yield errors(context, studies)


def response(context: Context, study: str, until: float, with_V: bool) -> Figure:
    """Positions and velocities of a study."""
    runs = context.catalogue.about(Control, controller=study)
    first = [run for run in runs if run.joint in {"hand_roll", "hand_pitch", "instrument_slide"}]
    q = tuple(Line(run.t[run.t < until], run.q[run.t < until], title(run.joint)) for run in runs)
    dq = tuple(Line(run.t[run.t < until], run.dq[run.t < until], title(run.joint)) for run in first)
    panels = [
        Panel("Position", "time [s]", "position [rad or m]", q),
        Panel("Velocity of the first three joints", "time [s]", "velocity [rad/s or m/s]", dq),
    ]
    for lyapunov in context.catalogue.about(Lyapunov, controller=study) if with_V else ():
        early = lyapunov.t < until
        line = (Line(lyapunov.t[early], lyapunov.V[early], "", "black"), HLine(0.0))
        panels.append(Panel("Lyapunov function", "time [s]", label(lyapunov, "V"), line))
    return Figure(
        f"Simulated: {CAPTIONS[study]}.",
        f"Positions and velocities over time: {CAPTIONS[study]}.",
        tuple(panels),
        columns=2,
        height=52,
    )


def errors(context: Context, studies: list[Control]) -> Table:
    """What each controller is off by as time goes on, where the masses are known badly."""
    rows = tuple(
        (
            "PID" if run.controller.startswith("pid") else "PD",
            title(run.joint),
            *(
                context.number(f"control.{run.controller}.{run.joint}.{name}", 3)
                for name in ("error_10", "error_20", "error_end")
            ),
        )
        for run in studies
        if run.controller.endswith("light")
    )
    return Table(
        "Position error of PD and PID when gravity is compensated with 0.9 of the masses, after 10, 20 and 60 s.",
        ("Controller", "Joint", "After 10 s", "After 20 s", "After 60 s"),
        rows,
        align="llrrr",
    )
