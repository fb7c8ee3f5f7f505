"""The answer: the external effort, how far to trust it, and what to look at first."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from davinci_forces.maths.arrays import Booleans
from davinci_forces.records import Contact, Diagnostic, Stiffness, Threshold, Track
from davinci_forces.records.record import as_list
from davinci_forces.report.content import Block, Bullets, Cell, Figure, Panel, Prose, Table, Verdict, literal, message
from davinci_forces.report.content.marks import Colour, HBand, Line, Points, VSpan
from davinci_forces.report.content.number import in_format
from davinci_forces.report.context import Context, count, label, name_in_sentence, title
from davinci_forces.report.results import unit_of
from davinci_forces.report.sections import parts
from davinci_forces.report.sections.summary import opening
from davinci_forces.report.sections.summary.caveats import first_looks_in_order
from davinci_forces.report.verdicts import COVERED, Trust, band_in_words, error_share, is_small, percent
from davinci_forces.robots.robot import Kind

WIDTH_OF_A_VALUE = 0.1  # of the panel on page one; a value needs that much room
TOUCHED: Colour = "sky"  # of contact windows
REST: Colour = "yellow"  # of standstill
MAX_IN_COLUMN = 3  # panels below each other on page one
MAX_PEAKS = 6  # contacts of which page one states each peak
# Of its peak: the mean of the middle half of a push that is held, and the least within the peak's error; a triangle's
# is three quarters.
HELD, MIN_HELD = 0.9, 0.85
ANSWER_HEIGHT, HEIGHT_OF_A_LINE = 58.0, 5.0  # [mm] of the figure on page one, and of a line that takes room from it


@parts.section_of("The answer", "summary")
def section(context: Context) -> Iterator[Block]:
    """The answer on one page."""
    for task, failed in context.provenance.failures.items():
        yield Verdict("bad", f"**{literal(task)}** failed, and what depends on it is missing: {message(failed)}")
    trusts = [parts.trust(context, joint) for joint in fitted_joints(context)]
    contacts, lines = context.catalogue.records(Contact), opening.measurements(context)
    if trusts:
        yield Prose(f"**{opening.verdict_sentence(context, trusts)}**")
        yield Prose(opening_paragraph(context, contacts))
    if lines:
        yield Bullets(lines)
    if not trusts:
        yield from opening.nothing_identified(context)
        yield opening.sign_off(context)
        return
    panels = [panel for trusted in trusts for panel in effort_panel(context, trusted)]
    if panels:
        # What is left on page one beside the table and lines of results.
        room = ANSWER_HEIGHT - HEIGHT_OF_A_LINE * (len(lines) + max(len(panels) - MAX_IN_COLUMN, 0))
        alt = f"External effort over time, one panel a joint: {'; '.join(map(spoken, contacts[:3])) or 'no contact'}."
        columns, height = 2 if len(panels) > MAX_IN_COLUMN else 1, room / min(len(panels), MAX_IN_COLUMN)
        drawn = tuple(in_column(panels))
        yield Figure(caption(context, contacts, panels), alt, drawn, "answer-figure", columns=columns, height=height)
    yield trust_table(context, trusts)
    yield Prose(rule_in_words(trusts))
    looks = first_looks_in_order(context, trusts)
    yield Prose("**Look at these first.**" if looks else f"**Nothing has to be looked at first.**{next_step(context)}")
    if looks:
        yield Bullets(looks)
    yield opening.sign_off(context)


def next_step(context: Context) -> str:
    """What would make contacts more certain, if anything is left to state."""
    logs = [log for log in context.study.logs if log.role == "contact" and not log.has_known_free_motion]
    names = as_list([literal(log.name) for log in logs])
    state = f" Next: state when nothing touched the arm in {names} (`free`), if you know it; see [@contacts]."
    return state if logs and context.catalogue.records(Contact) else ""


def rule_in_words(trusts: list[Trust]) -> str:
    """State in words what the verdicts of the table follow from."""
    stated = [trust.sought is not None for trust in trusts]
    by_level = "detection level over the effort sought"
    by_error = "model error over effort"
    rule = by_level if all(stated) else f"{by_level} where that is stated, else {by_error}" if any(stated) else by_error
    text = f"The verdict follows from {rule}, by [@thresholds]."
    least = percent(COVERED[0])
    narrow = f" “Narrow band” is good by it, but the 95 % band covers less than {least} of free-space samples."
    return text + narrow * any(trust.narrow and trust.level == "good" for trust in trusts)


def caption(context: Context, contacts: list[Contact], panels: list[Panel]) -> str:
    """The caption of the figure, which names the log if all panels are of one, as `in_column` then does not."""
    level = "Grey: the level that 95 % of the samples in free space stay below, not an error band. "
    level += "The first second and the last half of one, in which filter and low-pass err, are not drawn."
    if not contacts:
        return f"External effort of each joint in its worst run that was not fitted. {level}"
    which = "Shown is the contact log with the largest model error, of those that touch only this joint if any do. "
    which *= len({contact.log for contact in contacts}) > 1
    logs = [panel.title.rpartition(", ") for panel in panels]
    elsewhere = [joint for joint, _, log in logs if context.study.log(log).role != "contact"]
    which += f"{as_list(elsewhere)}: in no contact log, so the worst run in free space is shown. " * bool(elsewhere)
    where = f" in {literal(one_log(panels))}" if one_log(panels) else ""
    is_shaded = any(isinstance(mark, VSpan) and mark.colour == TOUCHED for panel in panels for mark in panel.marks)
    shaded = ", stated contact windows shaded" if is_shaded else ""
    has_dots = any(isinstance(mark, Points) for panel in panels for mark in panel.marks)
    dots = " Dots: peaks, beyond the curve by what smoothing takes off them." * has_dots
    return f"External effort of each joint{where}{shaded}. {which}{level}{dots}"


def one_log(panels: list[Panel]) -> str:
    """The log of all of several panels, of which the title of each ends in its log; "" if they differ."""
    logs = {panel.title.rpartition(", ")[2] for panel in panels}
    return next(iter(logs)) if len(logs) == 1 < len(panels) else ""


def fitted_joints(context: Context) -> list[str]:
    """The joints that have a fit, in the robot's order."""
    return list(dict.fromkeys(fit.group for fit in context.own_fits()))


def opening_paragraph(context: Context, contacts: list[Contact]) -> str:
    """One paragraph: what was estimated, and which contacts stand out."""
    logs, joints = ({getattr(track, about) for track in context.catalogue.records(Track)} for about in ("log", "joint"))
    stated = sum(int(contact.stated.sum()) for contact in contacts)
    above = sum(int((contact.above * contact.stated).sum()) for contact in contacts)
    unstated = sum(len(contact) for contact in contacts) - stated
    times = len(parts.contacts_at_once(contacts, lambda contact: contact.stated == 0))
    of_joints = f" of joints, at {count(times, 'time')}," * (times < unstated)  # several joints feel one touch
    contacts_above = f"{count(unstated, 'contact')}{of_joints} found above"
    joints_of_robot = f"{count(len(joints), 'joint')} of the {literal(context.study.robot.title)}"
    some_logs = f"{len(logs)} of {count(len(context.study.logs), 'log')}"
    text = parts.explanation("answer", efforts=efforts_in_words(context), joints=joints_of_robot, logs=some_logs)
    text += opening.currents_in_words(context)
    if not contacts:
        roles = {log.role for log in context.study.logs}
        why = "pushes are in [@tissue]" if context.catalogue.records(Stiffness) else "no log has the role contact"
        if "contact" in roles:
            why = "none was found, and the study states no window of contact"
        return f"{text} No contact is measured: {why}."
    peaks = peaks_in_words(context, contacts)
    doubtful = sum(int(is_doubtful(context, contact).sum()) for contact in contacts)
    which = f" {count(doubtful, 'peak')} below twice the alarm level or in a log that identifies"
    doubt = f"{which} may be due to the model: see [@contacts]." * (doubtful > 0)
    if not stated:
        level = "the alarm level, which free motion crosses at most once in ten minutes"
        return f"{text} **{contacts_above} {level}; the study states no window of contact.{peaks}**{doubt}"
    outside = f" Outside the stated windows, {contacts_above} the alarm level." if unstated else ""
    peak_only = sum(int((contact.above * contact.stated * (1 - contact.found)).sum()) for contact in contacts)
    fewer = f", in {peak_only} of them with its peak only" if peak_only else ""
    each = "counted once for each joint on which they are measured"
    cases = f"{count(stated, 'case')} (stated windows, {each})"
    exceeds = f"Of {cases}, the effort exceeds the detection level in {above}{fewer}."
    return f"{text} **{exceeds}{outside}{peaks}**{doubt}"


def peaks_in_words(context: Context, contacts: list[Contact]) -> str:
    """State the peaks with their standard errors, logs and times: all if they are few, else the largest of each joint.

    Doubtful ones are not named beside others.  Then name the joints of contact logs
    without any, and the level below which a contact is missed.
    """
    found = [(contact, row) for contact in contacts for row in np.flatnonzero(contact.above).tolist()]
    touched = {contact.joint for contact, _ in found}
    above = [(contact, row) for contact, row in found if not is_doubtful(context, contact)[row]] or found
    is_short = len(above) <= MAX_PEAKS
    if not is_short:
        by_size = sorted(above, key=lambda of: abs(of[0].peak[of[1]]))
        largest = {contact.joint: (contact, row) for contact, row in by_size}
        above = [largest[joint] for joint in dict.fromkeys(contact.joint for contact in contacts) if joint in largest]
    logs = {contact.log for contact, _ in above}
    named = f" in {literal(*logs)}" if len(logs) == 1 < len(above) else ""  # once for all
    peaks = [
        f"{context.number(f'contact.{of.log}.{of.joint}.{row + 1}.peak', 3)} on {name_in_sentence(of.joint)} "
        f"({'' if named else f'{literal(of.log)}, '}{of.onset[row]:.1f} to {of.release[row]:.1f} s"
        f"{level_or_impulse(context, of, row)})"
        for of, row in above
    ]
    which = "Contact peaks" if is_short else "Largest contact peak of each joint"
    text = f" {which}{named}: {as_list(peaks)}." if peaks else ""
    sought = {track.joint for track in context.catalogue.select(Track, role="contact") if not track.at_rest}
    # A joint that something seems to touch in free motion has a level that this touch may have raised.
    of_levels = context.catalogue.select(Diagnostic, stage="assess")
    doubted = {d.subject.rpartition(".")[2] for d in of_levels if "warning" in d.severity.tolist()}
    levels = [
        f"{name_in_sentence(t.joint)} above {context.number(f'threshold.{t.joint}.alarm_level', 2, std=None)}"
        for t in context.catalogue.records(Threshold)
        if t.joint in sought - touched - doubted
    ]
    return f"{text} None on {as_list(levels)}." if peaks and levels else text


def is_doubtful(context: Context, contact: Contact) -> Booleans:
    """Whether each contact (C,) may be due to the model: it is small, or nothing should touch the arm in its log."""
    identifies = context.study.log(contact.log).role == "identification"
    return np.asarray(is_small(contact) | (identifies & (contact.stated == 0)))


def level_or_impulse(context: Context, contact: Contact, row: int) -> str:
    """The level of a push that is held, longer than twice the smoother's rise and near its peak; else the impulse."""
    key = f"contact.{contact.log}.{contact.joint}.{row + 1}"
    rises = [track.smooth_rise for track in context.catalogue.select(Track, log=contact.log, joint=contact.joint)]
    is_long = contact.duration[row] >= 2.0 * max(rises, default=0.0)
    peak, middle = abs(contact.peak[row]), contact.middle_mean[row] * np.sign(contact.peak[row])
    is_held = middle > min(HELD * peak, max(peak - contact.peak_std[row], MIN_HELD * peak))
    words, name = ("held at", "middle_mean") if is_held and is_long else ("impulse", "impulse")
    return f", {words} {context.number(f'{key}.{name}', 3)}"


def efforts_in_words(context: Context) -> str:
    """The efforts of the robot's joints with their units."""
    words = {Kind.REVOLUTE: "torque [N m] at joints that turn", Kind.PRISMATIC: "force [N] at joints that slide"}
    kinds = {joint.kind for joint in context.study.robot.joints if not joint.effort}
    efforts = [text for kind, text in words.items() if kind in kinds]
    if any(joint.effort for joint in context.study.robot.joints):
        efforts.append("motor current [A] where the torque constant is unknown")
    return as_list(efforts)


def effort_panel(context: Context, trusted: Trust) -> Iterator[Panel]:
    """The external effort of a joint in its most doubtful contact log, or where there is none, in its worst run."""
    contacts = context.catalogue.select(Contact, joint=trusted.joint)
    errors = {p.log: p.model_error for p in parts.scored_predictions(context, trusted.joint)}
    touched = {c.log: [d for d in context.catalogue.select(Contact, log=c.log) if d.above.any()] for c in contacts}
    by_error = sorted(touched, key=lambda log: errors.get(log, 0.0))
    of_contact = [log for log in by_error if context.study.log(log).role == "contact"] or by_error
    logs = [log for log in of_contact if len(touched[log]) == 1] or of_contact
    untouched = [track.log for track in context.catalogue.select(Track, joint=trusted.joint, role="contact")]
    logs = logs or untouched[:1] or ([trusted.space.log] if trusted.space is not None else [])
    for track in context.catalogue.select(Track, joint=trusted.joint, log=logs[-1]) if logs else []:
        stated = parts.spans(context.study.log(track.log).contact, colour=TOUCHED)
        sizes = [trusted.space.free_level] if trusted.space is not None else []
        level = [HBand(-size, size, "free space: level of 95 % of samples") for size in sizes]
        shown = parts.converged_rows(track.t)
        line = Line(track.t[shown], track.tau_ext_smooth[shown], "external effort", "vermillion")
        still = parts.spans_where(track.t, track.standing > 0, "at rest: not judged", REST)
        peaks = [named_peaks(track, c) for c in contacts if c.log == track.log and c.found.any()]
        heading = f"{title(track.joint)}, {track.log}"
        effort = label(track, "tau_ext", "effort")
        whole = 0.0, float(track.t[-1])  # so that the times of joints stand below each other
        yield Panel(heading, "time [s]", effort, (*stated, *still, *level, line, *peaks), x_range=whole)


def in_column(panels: list[Panel]) -> Iterator[Panel]:
    """Panels in columns: the first has the legend, the last of each column names the time."""
    lowest = len(panels) - (2 if len(panels) > MAX_IN_COLUMN else 1)
    named = f", {one_log(panels)}" if one_log(panels) else ""
    for i, panel in enumerate(panels):
        marks = panel.marks if i == 0 else tuple(replace(mark, label="") for mark in panel.marks)
        heading, below = panel.title.removesuffix(named), panel.x_label if i >= lowest else ""
        yield replace(panel, title=heading, marks=marks, x_label=below)


def named_peaks(track: Track, contact: Contact) -> Points:
    """The peak of each contact that was found, with its value unless a larger one is close by."""
    rows = contact.found > 0
    t, peaks, width = contact.t_peak[rows], contact.peak[rows], WIDTH_OF_A_VALUE * (track.t[-1] - track.t[0])
    largest = [(np.abs(peaks[np.abs(t - at) < width]) <= abs(p)).all() for at, p in zip(t, peaks, strict=True)]
    names = tuple(in_format(p, "+.3g") if named else "" for named, p in zip(largest, peaks, strict=True))
    return Points(t, peaks, "", "black", names=names)


def spoken(contact: Contact) -> str:
    """The peaks of a log in words, for those who cannot see the figure."""
    peaks = ", ".join(in_format(p, "+.3g") for p in contact.peak)
    return f"{contact.joint.replace('_', ' ')} peaks at {peaks} {unit_of(contact, 'peak')}"


def trust_table(context: Context, trusts: list[Trust]) -> Table:
    """One row a joint."""
    sought = ("Sought",) if any(trust.sought for trust in trusts) else ()
    header = (
        "Joint", "Verdict", "New path", "Model error", "Error / effort", "$R^2$", "Ceiling", "Detection level",
        "Alarm level", *sought, "Coverage",
    )  # fmt: skip
    friction = parts.static_frictions(context, context.catalogue.records(Track))
    shown = [friction[trusted.joint] for trusted in trusts if trusted.joint in friction]
    caption = parts.explanation("trust", friction=as_list(shown) or "its level")
    rows = tuple(trust_row(context, trusted, bool(sought)) for trusted in trusts)
    return Table(caption, header, rows, "trust-table", "ll" + "r" * (len(header) - 2))


def trust_row(context: Context, trusted: Trust, with_sought: bool) -> tuple[Cell, ...]:
    """The numbers of one joint."""
    space, sought, share = trusted.space, trusted.sought, error_share(trusted.prediction)
    scored, free = (about.prefix if about is not None else "" for about in (trusted.prediction, space))
    error, level = context.number(f"{scored}.model_error", 2), context.number(f"{free}.detection_level", 2)
    alarm = context.number(f"threshold.{trusted.joint}.alarm_level", 2, std=None)
    r2, ceiling = (context.number(f"{scored}.{name}", 4, std=None) for name in ("r2", "r2_ceiling"))
    size = context.size(space, "detection_level", sought, 3) if space is not None and sought else "–"
    wanted = (size,) if with_sought else ()
    covers = "–"
    if (band := trusted.narrowest) is not None:
        words = band_in_words(band.coverage, band.coverage_std)
        covers = percent(band.coverage) + (f", {words}" if words.startswith("too") else "")
    scores = title(trusted.joint), trusted.words, trusted.new_path, error, share, r2, ceiling
    return *scores, level, alarm, *wanted, covers
