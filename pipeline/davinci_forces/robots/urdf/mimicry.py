"""Which coordinate moves each joint of a URDF: its own, or that of the joint that it mimics."""

from collections.abc import Mapping
from typing import NamedTuple

from davinci_forces.robots.urdf.tables import UrdfJoint
from davinci_forces.toml.file import TomlFile


class Mover(NamedTuple):
    """A joint at sign times the position of the joint `by`, plus a bias; `by` is "" of one that does not move."""

    by: str
    sign: int = 1
    bias: float = 0.0


def driven(joints: Mapping[str, UrdfJoint], file: TomlFile) -> dict[str, Mover]:
    """How each joint is moved; what is wrong with a mimic is noted."""
    return {name: _driven(one, joints, file) for name, one in joints.items()}


def _driven(joint: UrdfJoint, joints: Mapping[str, UrdfJoint], file: TomlFile) -> Mover:
    """Along the joints that mimic each other, to the one that moves by itself."""
    sign, bias, seen, one = 1.0, 0.0, [joint.name], joint
    while one.kind != "fixed" and one.mimic:
        sign, bias = sign * one.multiplier, bias + sign * one.bias
        following = joints.get(one.mimic)
        wrong = _wrong(one, following, seen)
        if wrong:
            if one is joint:
                file.note(one.line, f"<joint name={one.name!r}> <mimic>: {wrong}")
            return Mover("")
        assert following is not None
        one = following
        seen.append(one.name)
    return Mover("" if one.kind == "fixed" or not sign else one.name, 1 if sign >= 0 else -1, bias)


def _wrong(joint: UrdfJoint, following: UrdfJoint | None, seen: list[str]) -> str:
    """What is wrong with what a joint mimics, or ""."""
    if following is None:
        return f"there is no joint {joint.mimic!r}; correct the name"
    if following.name in seen:
        return f"{' mimics '.join([*seen, following.name])}: one of them must move by itself"
    if following.kind == "fixed":
        return f"joint {joint.mimic!r} is fixed; name one that moves, or make this one fixed, too"
    if joint.multiplier not in (-1.0, 0.0, 1.0):
        said = f"multiplier is {joint.multiplier:g}, and links that share a coordinate go by 1 or -1 times it"
        return f'{said}; where it carries little, write type="fixed" and no mimic, or describe it as a joint of its own'
    return ""
