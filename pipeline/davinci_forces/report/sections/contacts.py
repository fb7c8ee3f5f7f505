"""Every contact with its effort and error, against the detection level; and recordings that are not analysed."""

from collections import Counter
from collections.abc import Iterator

import numpy as np

from davinci_forces.records import Contact, Stiffness, Threshold, Track, Weight, by_name
from davinci_forces.records.record import groups_of
from davinci_forces.report.content import Block, Cell, Figure, Panel, Prose, Table, literal
from davinci_forces.report.content.marks import HBand, Points
from davinci_forces.report.context import Context, count, label, title
from davinci_forces.report.sections.parts import contacts_at_once, explanation, run_cells, section_of, static_frictions
from davinci_forces.report.verdicts import is_small
from davinci_forces.study import LogEntry

PRINTED = 20  # contacts of the PDF at most


@section_of("Contacts", "contacts")
def section(context: Context) -> Iterator[Block]:
    """All contact windows, and the recordings that were not analysed."""
    if contacts := context.catalogue.records(Contact):
        yield Prose(explanation("contacts", levels=alarm_levels(context)))
        yield peaks(context, contacts)
        yield from by_time(context, contacts)
        yield contact_table(context, contacts)
        logs = dict.fromkeys(contact.log for contact in contacts)
        if unknown := [literal(log) for log in logs if not context.study.log(log).has_known_free_motion]:
            yield Prose(explanation("contacts-unknown", logs=", ".join(unknown)))
    if unused := tuple((literal(name), joint, why) for name, joint, why in not_analysed(context)):
        columns = ("Log", "Joint", "Reason, and remedy")
        yield Table("Joints of logs on which no contact was measured.", columns, unused, "not-analysed")


def contact_table(context: Context, contacts: list[Contact]) -> Table:
    """Every window, log by log."""
    states_some = any(contact.stated.any() for contact in contacts)
    outside = " outside the windows that the study states" if states_some else ", as the study states no window"
    caption = explanation("contact-table", most=PRINTED, outside=outside)
    header = ("Log", "Joint", "No.", "Onset", "Release", "Peak", "Middle half", "Impulse", "Verdict")
    earlier: Counter[str] = Counter()  # windows of each joint in the logs before, as the figure numbers them
    rows: list[tuple[Cell, ...]] = []
    names = ("onset", "release", "peak", "middle_mean", "impulse")
    for contact in contacts:
        for i in range(len(contact)):
            numbers = context.numbers(f"contact.{contact.log}.{contact.joint}.{i + 1}", names)
            number = str(earlier[contact.joint] + i + 1)
            rows.append((*run_cells(contact), number, *numbers, verdict(contact, i)))
        earlier[contact.joint] += len(contact)
    return Table(caption, header, rows, "contact-table", "llrrrrrrl", largest(contacts))


def by_time(context: Context, contacts: list[Contact]) -> Iterator[Table]:
    """The peaks of contacts on several joints of a log, those at the same time in a row."""
    touching = {log: of for log, of in by_name(contacts, "log").items() if len(of) > 1}
    joints = context.joints_of([contact for of in touching.values() for contact in of])
    rows = []
    for group in contacts_at_once((c for of in touching.values() for c in of), lambda contact: contact.above == 1):
        log, first, last = group[0][0], min(start for _, start, *_ in group), max(end for _, _, end, *_ in group)
        largest_last = sorted(group, key=lambda window: window[3])
        keys = {joint: f"contact.{log}.{joint}.{i + 1}.peak" for *_, joint, i in largest_last}
        peaks = (context.number(keys[joint]) if joint in keys else "–" for joint in joints)
        rows.append((literal(log), f"{first:.1f} to {last:.1f} s", *peaks))
    if rows:
        header = ("Log", "Time", *map(title, joints))
        yield Table(explanation("contacts-by-time"), header, tuple(rows), "contacts-by-time", "ll" + "r" * len(joints))


def alarm_levels(context: Context) -> str:
    """The alarm level of each joint in words, and what its static friction adds at standstill."""
    frictions = static_frictions(context, context.catalogue.records(Track))
    adds = {joint: f" + {level}" for joint, level in frictions.items()}
    joints = [threshold.joint for threshold in context.catalogue.records(Threshold)]
    levels = [context.number(f"threshold.{joint}.alarm_level", 3, std=None) for joint in joints]
    return ", ".join(f"{title(j).lower()} {level}{adds.get(j, '')}" for j, level in zip(joints, levels, strict=True))


def largest(contacts: list[Contact]) -> tuple[int, ...]:
    """The rows of the `PRINTED` largest peaks over their joint's detection level, in the order of the table."""
    ratios = np.concatenate([np.abs(contact.peak) / contact.detection_level for contact in contacts])
    return tuple(sorted(np.argsort(-ratios, kind="stable")[:PRINTED].tolist()))


def verdict(contact: Contact, i: int) -> str:
    """Whether a contact is detected, or was found outside the windows that the study states."""
    if not contact.stated[i]:
        return "small" if is_small(contact)[i] else "found"
    return ("detected" if contact.found[i] else "peak only") if contact.above[i] else "not detected"


def peaks(context: Context, contacts: list[Contact]) -> Figure:
    """The peak of every window, with the detection level of its joint."""
    joints = context.joints_of(contacts)
    missed = sum(int((contact.above == 0).sum()) for contact in contacts)
    total = sum(len(contact) for contact in contacts)
    alt = f"Peaks of {count(total, 'window')}, joint by joint; {missed} lie below the detection level."
    panels = tuple(peak_panel([c for c in contacts if c.joint == joint], i == 0) for i, joint in enumerate(joints))
    return Figure(explanation("contact-peaks"), alt, panels, "contact-peaks", columns=min(len(panels), 3), height=45)


def peak_panel(contacts: list[Contact], named: bool) -> Panel:
    """The peaks of one joint, in the order of the logs."""
    peak, std = (np.concatenate([getattr(c, name) for c in contacts]) for name in ("peak", "peak_std"))
    level = max(contact.detection_level for contact in contacts)
    marks = (
        HBand(-level, level, "detection level" if named else ""),
        Points(np.arange(1.0, len(peak) + 1), peak, "peak" if named else "", "vermillion", y_std=std),
    )
    heading, y_label, whole = title(contacts[0].joint), label(contacts[0], "peak", "effort"), (0.0, len(peak) + 1.0)
    return Panel(heading, "window", y_label, marks, x_range=whole)


def not_analysed(context: Context) -> Iterator[tuple[str, str, str]]:
    """Log, joints and reason of every recording without a measured contact."""
    measured = {(contact.log, contact.joint) for contact in context.catalogue.records(Contact)}
    weighed = {weight.log for weight in context.catalogue.records(Weight)}
    tracked = {(track.log, track.joint): track for track in context.catalogue.records(Track)}
    fitted = {fit.group for fit in context.own_fits()}
    palpated = {tissue.log for tissue in context.catalogue.records(Stiffness)}
    for entry in context.study.logs:
        if entry.role not in ("contact", "weight", "tissue", "friction") or entry.name in weighed | palpated:
            continue
        joints = {joint: tracked.get((entry.name, joint)) for joint in entry.joints}
        others = ((joint, track) for joint, track in joints.items() if (entry.name, joint) not in measured)
        reasons = groups_of((reason(entry, track, joint in fitted), title(joint)) for joint, track in others)
        yield from ((entry.name, ", ".join(names), why) for why, names in reasons.items())


def reason(entry: LogEntry, track: Track | None, is_fitted: bool) -> str:
    """The reason why no contact was measured on a joint of a log."""
    if entry.role == "friction":
        return "a friction log gives friction maps; its external effort is not tracked"
    if entry.role == "weight" and entry.weight is None:
        return "its mass is not estimated; write weight = { mass = <kg, if known> } in study.toml"
    if track is None and is_fitted:
        return "its external effort is not estimated; the warnings of `davinci-forces all` say why"
    if track is None:
        return "the joint has no fit to compare with; record an identification log of this joint"
    if track.at_rest:
        return explanation("contacts-at-rest")
    if entry.role != "contact":
        return f"a log of role “{entry.role}” is tracked, but its windows are not measured"
    return explanation("contacts-none")
