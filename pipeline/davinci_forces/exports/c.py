"""The model as C99: inertia, bias, gravity, friction, predicted effort, and the step of the filter with its band."""

from collections.abc import Mapping
from math import inf
from pathlib import Path
from typing import Any

from davinci_forces.errors import BadRequest
from davinci_forces.exports.identified import Export, Rendering
from davinci_forces.files import read_bytes, text_of
from davinci_forces.maths.mechanics.bodies import PARAMETERS
from davinci_forces.maths.models.terms import COEFFICIENTS, Z_OF_MOTION

KINDS = ("", "deflection", "smooth sign", "Stribeck", *Z_OF_MOTION)  # of z, in the order of `state` in model.c
NO_BAND = {"edges": [inf] * 3, "factor": [1.0] * 4, "model_variance": 0.0}
NO_LINK = {"name": "", "parent": None, "coordinate": None, "prismatic": False, "placement": [[0.0] * 4] * 3}


def render(export: Export) -> Rendering:
    """Render model.h and model.c; raises BadRequest if a joint has no filter."""
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
    return Rendering(files, export.remarks())


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
