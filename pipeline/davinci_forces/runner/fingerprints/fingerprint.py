"""All that the outputs of a task depend on, and in words what of it changed."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Fingerprint:
    """Everything that the outputs of a task depend on."""

    inputs: dict[str, str]  # file -> sha256
    given: dict[str, str]  # what the stage was given besides records -> sha256
    settings: dict[str, Any]
    schemas: dict[str, str]  # kind of record read or made -> sha256 of its declaration
    code: dict[str, str]  # module -> sha256
    version: str


REASONS = {  # part of a fingerprint -> what is said of what changed in it
    "given": "the {} changed",
    "schemas": "the declaration of {} changed",
    "code": "the code of {} changed",
    "inputs": "{} changed",
}


def differences(then: dict[str, Any], now: Fingerprint) -> list[str]:
    """What changed between the fingerprint of an entry and that of now, in words."""
    if then == vars(now):
        return []
    changed = []
    if then.get("version") != now.version:
        changed.append(f"version {then.get('version')} became {now.version}")
    old = then.get("settings", {})
    changed += [f"{k} = {old.get(k)!r} became {v!r}" for k, v in now.settings.items() if old.get(k) != v]
    for what, reason in REASONS.items():
        old, new = then.get(what, {}), getattr(now, what)
        changed += [reason.format(name) for name in sorted(old.keys() | new.keys()) if old.get(name) != new.get(name)]
    return changed
