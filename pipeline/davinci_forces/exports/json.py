"""The model as JSON, with the formula and the constants of every term, and a schema of the file."""

import json
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.exports.identified import Export, ExportedJoint, OnlineFilter, terms_of
from davinci_forces.files import read_bytes, text_of
from davinci_forces.filters.stepping import covariances
from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics.chain import FIXED, Chain
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.terms import Term
from davinci_forces.records import Fit

NAME, SCHEMA = "model.json", "model.schema.json"


def render(export: Export) -> dict[str, str]:
    """Render model.json and its schema."""
    schema = json.loads(text_of(read_bytes(Path(__file__).with_name(SCHEMA))))
    schema["$comment"] = "; ".join(export.head()[:-1])
    return {NAME: _text(document(export)), SCHEMA: _text(schema)}


def _text(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def document(export: Export) -> dict[str, Any]:
    """The model as JSON values."""
    robot, coupled = export.study.robot, any(isinstance(joint.model, CoupledArm) for joint in export.joints)
    chain = robot.chain if coupled else None
    return {
        "$schema": SCHEMA,
        "head": export.head(),
        "report_id": export.origin.report_id,
        "version": export.origin.version,
        "robot": robot.name,
        "simulated": export.study.simulated,
        "despite_verdict": list(export.origin.despite),
        "coordinates": [joint.name for joint in robot.joints],
        "gravity": GRAVITY,
        "chain": _chain(chain.with_coordinates(len(robot.joints))) if chain else None,
        "models": {name: _model(export, name, fit) for name, fit in export.fits.items()},
        "joints": [_joint(joint, export.origin.verdicts.get(joint.name)) for joint in export.joints],
    }


def _chain(chain: Chain) -> dict[str, Any]:
    rows = zip(chain.links, chain.parent.tolist(), chain.coordinate.tolist(), chain.slides.tolist(), strict=True)
    links = [
        {"name": name, "parent": parent - 1 if parent else None, "coordinate": None if k == FIXED else k,
         "prismatic": slides, "placement": placement}
        for (name, parent, k, slides), placement in zip(rows, chain.placement.tolist(), strict=True)
    ]  # fmt: skip
    return {"up": list(chain.up), "links": links}


def _model(export: Export, name: str, fit: Fit) -> dict[str, Any]:
    model = next(joint.model for joint in export.joints if joint.fit_name == name)
    parameters = []
    for i, about in enumerate(terms_of(model)):
        value, std = float(fit.theta[i]), float(fit.theta_std[i])
        numbers = {"value": value, "std": std if isfinite(std) else None, "unit": str(fit.unit[i])}
        what = _term(about.term) if about.term else {"link": about.link, "inertial": about.inertial}
        joint = about.joint or None
        parameters.append({"name": str(fit.parameter[i]), "role": about.role, "joint": joint, **numbers, **what})
    return {"structure": fit.structure, "efforts": list(model.efforts), "logs": list(fit.logs), "mse": fit.mse,
            "parameters": parameters}  # fmt: skip


def _term(term: Term) -> dict[str, Any]:
    state: dict[str, Any] | None = None
    if term.displacement:
        state = {"kind": "deflection", "displacement": term.displacement}
    elif term.width:
        state = {"kind": "smooth sign", "width": term.width}
    elif term.decay_velocity:
        state = {"kind": "Stribeck", "decay_velocity": term.decay_velocity}
    elif term.of_motion:
        state = {"kind": "function", "function": term.of_motion}
    return {"acceleration": term.a, "functions": dict(term.b), "state": state}


def _joint(joint: ExportedJoint, verdict: str | None) -> dict[str, Any]:
    unit, limits = joint.joint.unit, joint.joint.limits
    units = {"position": "{position}", "velocity": "{position}/s", "effort": "{effort}"}
    ends = {"position": limits.q, "velocity": limits.dq, "effort": (-limits.effort, limits.effort)}
    return {
        "name": joint.name, "title": joint.joint.title, "kind": joint.joint.kind.value, "verdict": verdict,
        "units": {name: unit(template) for name, template in units.items()},
        "gear_ratio": joint.joint.gear_ratio, "torque_constant": joint.joint.torque_constant,
        "limits": {name: [x if isfinite(x) else None for x in pair] for name, pair in ends.items()},
        "model": joint.fit_name, "motion": {"cutoff": joint.cutoff, "effort_lag": joint.effort_lag},
        "validity": dict(zip(ends, map(list, joint.validity), strict=True)),
        "filter": _filter(joint.filter) if joint.filter else None,
    }  # fmt: skip


def _filter(online: OnlineFilter) -> dict[str, Any]:
    R_q, R_dq, Q_qq, Q_qd, Q_dd, Q_tau = covariances(online.noise, 1.0 / online.rate)
    Q = np.diag([Q_qq, Q_dd, Q_tau])
    Q[0, 1] = Q[1, 0] = Q_qd
    band = online.band and {
        "edges": online.band.edges.tolist(),
        "factor": online.band.factor.tolist(),
        "model_variance": online.band.model_variance,
    }
    state = {"R": [R_q, R_dq], "Q": Q.tolist(), "initial_std": online.initial_std}
    return {"rate": online.rate, **state, "band": band, "alarm_level": online.alarm}
