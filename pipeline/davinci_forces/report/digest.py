"""What a campaign asks of each report: when it was recorded, and the verdict of every joint, as data."""

import json
from typing import Any

from davinci_forces.records import LogSummary
from davinci_forces.report.context import Context
from davinci_forces.report.sections.summary import fitted_joints, trust


def digest(context: Context) -> bytes:
    """The content of summary.json; a key leads to its number in results.json, null where there is none."""
    started = [s.started for s in context.catalogue.all(LogSummary) if s.started]
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
    """One joint as page one judges it: its verdict, and where its numbers are."""
    trusted = trust(context, joint)
    p, space = trusted.prediction, trusted.space
    free = f"{space.filter}.{space.log}.{space.joint}" if space is not None else ""
    keys = {
        "model_error": f"{p.prefix}.model_error" if p is not None else "",
        "detection_level": f"{free}.detection_level",
        "coverage": f"{free}.coverage",
    }
    known = {name: key if key in context.results else None for name, key in keys.items()}
    return {"joint": joint, "verdict": trusted.level, "same_path": trusted.same_path, **known}
