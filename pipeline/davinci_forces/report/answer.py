"""The answer in plain text for a terminal (summary.txt), and as data (summary.json)."""

import json
import re
from collections.abc import Sequence
from typing import Any

from davinci_forces.records import LogSummary, Stiffness
from davinci_forces.report.content.inline import parse
from davinci_forces.report.context import Context
from davinci_forces.report.sections.parts import trust
from davinci_forces.report.sections.summary import first_looks_in_order, fitted_joints, trust_row
from davinci_forces.report.sections.tissue import verdict

HEADER = ("joint", "verdict", "new path", "model error", "error/effort", "R2", "ceiling", "detection level", "coverage")


def answer(context: Context) -> str:
    """The table of verdicts and the three things to look at first, in plain text."""
    trusts = [trust(context, joint) for joint in fitted_joints(context)]
    stiffness = context.catalogue.records(Stiffness)
    tissue = [f"tissue {plain(verdict(context, log).text)}" for log in stiffness]
    if not trusts:
        message = "no joint could be identified: there is no usable identification log, so no effort was tracked"
        return "\n".join([message, *tissue]) + "\n"
    rows = [[plain(str(cell)) for cell in trust_row(context, trusted, False)] for trusted in trusts]
    looks = [f"{i}. {plain(text)}" for i, text in enumerate(first_looks_in_order(context, trusts), 1)]
    lines = [*align([HEADER, *rows]), *(["look at these first:", *looks] if looks else []), *tissue]
    return "\n".join(lines) + "\n"


def plain(text: str) -> str:
    """Remove the marks and references of a marked text."""
    spans = (span.text for span in parse(re.sub(r" See \[@[^]]*\]\.", "", text)) if span.kind != "reference")
    return "".join(spans)


def align(rows: Sequence[Sequence[str]]) -> list[str]:
    """Write rows as lines, each column as wide as its longest cell."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def digest(context: Context) -> bytes:
    """The content of summary.json; each value is a key of results.json, or null if there is no such number."""
    started = [s.started for s in context.catalogue.records(LogSummary) if s.started]
    study = context.study
    content = {
        "title": study.title,
        "robot": study.robot.name,
        "simulated": study.simulated,
        "started": min(started, default=""),
        "joints": [_joint(context, joint) for joint in fitted_joints(context)],
    }
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode()


def _joint(context: Context, joint: str) -> dict[str, Any]:
    """The verdict on one joint as on page one, and the keys of its numbers."""
    trusted = trust(context, joint)
    p, space = trusted.prediction, trusted.space
    free = space.prefix if space is not None else ""
    keys = {
        "model_error": f"{p.prefix}.model_error" if p is not None else "",
        "detection_level": f"{free}.detection_level",
        "coverage": f"{free}.coverage",
    }
    result_keys = {name: key if key in context.results else None for name, key in keys.items()}
    return {"joint": joint, "verdict": trusted.level, "same_path": trusted.same_path, **result_keys}
