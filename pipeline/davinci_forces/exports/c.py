"""The model as C99: inertia, bias, gravity, friction, predicted effort, and the step of the filter with its band."""

from collections.abc import Iterator, Mapping
from math import inf
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.exports.identified import Export, ExportedJoint, Rendering
from davinci_forces.files import read_bytes, text_of
from davinci_forces.filters import DEFAULT, tracker
from davinci_forces.filters.problem import FilterInput
from davinci_forces.filters.response import noise_model
from davinci_forces.identification.joint_models import LogModels
from davinci_forces.maths.mechanics.bodies import PARAMETERS
from davinci_forces.maths.models.memory import efforts
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.models.terms import COEFFICIENTS, Z_OF_MOTION
from davinci_forces.maths.signals.smoothing import delay_segments
from davinci_forces.records import FilterNoise, Motion

KINDS = ("", "deflection", "smooth sign", "Stribeck", *Z_OF_MOTION)  # of z, in the order of `state` in model.c
NO_BAND = {"edges": [inf] * 3, "factor": [1.0] * 4, "model_variance": 0.0}
CHECKED = 400  # samples of a joint in check.csv
NO_LINK = {"name": "", "parent": None, "coordinate": None, "prismatic": False, "placement": [[0.0] * 4] * 3}


def render(export: Export) -> Rendering:
    """Render model.h, model.c and check.csv; raises BadRequest if a joint has no filter."""
    document = export.document()
    if missing := [joint["name"] for joint in document["joints"] if not joint["filter"]]:
        raise BadRequest(f"{export.study.name}: no identification log gives the noise of the filter of {missing[0]}")
    head = export.head(*(fit for fit, _ in export.fits.values()))
    rate, lowpass = document["joints"][0]["filter"]["rate"], export.study.settings.lowpass
    values = _values(document, [line.replace("*/", "* /").replace("??", "? ?") for line in head])
    values |= {"RATE": _text(rate), "HZ": f"{rate:g}", "PERIOD": _text(1.0 / rate), "LOWPASS": f"{lowpass:g}"}
    files = {name: text_of(read_bytes(Path(__file__).with_name(name))) for name in ("model.h", "model.c")}
    for key, value in values.items():
        files = {name: text.replace(f"@{key}@", value) for name, text in files.items()}
    columns = (f"{x}.{name}" for x in ("q", "dq", "ddq") for name in document["coordinates"])
    title = ("joint", "t", "tau", "q_measured", "dq_measured", *columns, "tau_hat", "tau_ext", "std_filter")
    numbers = (f"{i},{','.join(map(repr, row))}" for i, j in enumerate(export.joints) for row in _checked(export, j))
    files["check.csv"] = "\n".join([*(f"# {line}" for line in head), ",".join(title), *numbers, ""])
    return Rendering(files, export.remarks())


def _checked(export: Export, joint: ExportedJoint) -> Iterator[list[float]]:
    """Return samples from the middle of the first log of a joint's fit at the filter's rate, and their results."""
    fit, model, online, names = joint.fit, joint.model, joint.filter or {}, [j.name for j in export.study.robot.joints]
    row, T_s, catalogue = model.efforts.index(joint.name), 1.0 / online["rate"], export.catalogue
    logs = (m for m in catalogue.select(Motion, joint=joint.name) if m.log in fit.logs and not m.at_rest)
    for m in [m for m in logs if np.isclose(m.rate * T_s, 1.0, rtol=1e-6)][:1]:
        half, late = len(m) // 2, fit.effort_lag[row] * m.rate
        part = half + np.flatnonzero(m.segment[half : half + CHECKED] == m.segment[half])
        q, dq, ddq, *_ = LogModels(export.identified, catalogue.select(Motion, log=m.log)).motion(fit, joint.name)
        motion = ArmMotion(q[part], dq[part], ddq[part], T_s, m.segment[part])  # of the joints of the model
        columns = np.zeros((3, len(part), len(names)))
        columns[:, :, [names.index(name) for name in model.joints]] = motion[:3]
        own, [tuned] = columns[2, :, names.index(joint.name)], catalogue.select(FilterNoise, joint=joint.name)
        y_q, y_dq = (delay_segments(x, m.segment, late)[part] for x in (m.q_measured, m.dq_measured))
        tau, dynamics = m.tau[part], model.joint_dynamics(fit.theta, motion)[row]
        inputs = FilterInput(dynamics, y_q, y_dq, own, tau, T_s, online["initial_std"])
        tracked = tracker(DEFAULT)(inputs, noise_model(tuned, joint.joint, T_s, export.study.settings.q_tau))
        results = efforts(model, fit.theta, motion)[:, row], tracked.tau_ext, tracked.tau_ext_std
        yield from np.column_stack([m.t[part], tau, y_q, y_dq, *columns, *results]).tolist()


def _values(document: Mapping[str, Any], head: list[str]) -> dict[str, str]:
    """What stands for each @NAME@ in model.h and model.c."""
    coordinates, models, joints = document["coordinates"], document["models"], document["joints"]
    coupled = [name for name, model in models.items() if model["structure"] == "coupled"]
    chain: Mapping[str, Any] = document["chain"] if coupled else {"up": [0.0] * 3, "links": [NO_LINK]}
    links = chain["links"]
    bodies = [_bodies(models[name], links) for name in coupled] or [[[0.0] * len(PARAMETERS)]]
    terms = [_terms(models[joint["model"]], joint["name"]) for joint in joints]
    rows = [
        [coordinates.index(joint["name"]), coupled.index(joint["model"]) if joint["model"] in coupled else -1,
         len(terms[i]), f"TERMS_{i}", [*joint["validity"].values()], *_filter(joint["filter"])]
        for i, joint in enumerate(joints)
    ]  # fmt: skip
    return {
        "PROCESSING": "\n".join(map(_processing, joints)),
        "COORDINATES": ", ".join(coordinates), "N": str(len(coordinates)),
        "JOINTS": ", ".join(f"DF_{joint['name'].upper().replace('-', '_')}" for joint in joints),
        "STATES": str(max(map(len, terms))), "GRAVITY": _text(document["gravity"]), "UP": _text(chain["up"]),
        "LINKS": str(len(links)), "CHAIN": _text(list(map(_link, links))), "BODIES": _text(bodies),
        "TERMS": "\n".join(f"static const Term TERMS_{i}[] = {_text(of_joint)};" for i, of_joint in enumerate(terms)),
        "MODEL": ",\n".join(map(_text, rows)), "HEAD": "\n".join(f" * {line}" for line in head),
    }  # fmt: skip


def _processing(joint: Mapping[str, Any]) -> str:
    motion, online, units = joint["motion"], joint["filter"], joint["units"]
    least, level = f"dq 0 below {online['least_velocity']:.3g} {units['velocity']}", online["alarm_level"]
    alarm = f"alarm level {level:.6g} {units['effort']}" if level else "no alarm level"
    return f" *   {joint['name']}: cutoff {motion['cutoff']:g} Hz, lag {motion['effort_lag']:g} s, {least}, {alarm}"


def _terms(model: Mapping[str, Any], joint: str) -> list[Any]:
    rows = []
    for p in (p for p in model["parameters"] if p["joint"] == joint):
        kind, scale = (p["state"] or {"kind": "", "": 0.0}).values()
        kind, scale = (scale, 0.0) if kind == "function" else (kind, scale)
        std, c = inf if p["std"] is None else p["std"], [p["functions"].get(name, 0.0) for name in COEFFICIENTS]
        rows.append([p["value"], std, p["acceleration"], c, scale, KINDS.index(kind), int(p["role"] == "friction")])
    return rows


def _link(link: Mapping[str, Any]) -> list[Any]:
    parent, k = link["parent"], link["coordinate"]
    slides = link["prismatic"] or k is None
    return [0 if parent is None else parent + 1, -1 if k is None else k, int(slides), link["placement"][:3]]


def _bodies(model: Mapping[str, Any], links: list[Any]) -> list[Any]:
    values = {(p["link"], p["inertial"]): p["value"] for p in model["parameters"] if p["role"] == "link"}
    return [[values.get((link["name"], which), 0.0) for which in PARAMETERS] for link in links]


def _filter(online: Mapping[str, Any]) -> list[Any]:
    band, numbers = online["band"] or NO_BAND, [online[name] for name in ("R", "Q", "initial_std")]
    return [*numbers, *(band[name] for name in NO_BAND), online["alarm_level"] or 0.0, online["lag"]]


def _text(value: Any) -> str:
    """A number, a name or a nested list as C."""
    if isinstance(value, list):
        return f"{{{', '.join(map(_text, value))}}}"
    return "INFINITY" if value == inf else str(value)
