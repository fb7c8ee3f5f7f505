"""Set the threshold of every joint: the detection level of its worst free space, above which contacts stand out."""

from collections.abc import Iterable, Iterator

from davinci_forces.maths.contact.detection import Quiet, alarm_level
from davinci_forces.records import FreeSpace, Threshold


def run(spaces: Iterable[FreeSpace]) -> Iterator[Threshold]:
    """One Threshold per joint and filter of which there is any free space."""
    every: dict[tuple[str, str], list[FreeSpace]] = {}
    for space in spaces:
        every.setdefault((space.joint, space.filter), []).append(space)
    for (joint, name), own in every.items():
        judge = worst(own)
        alarms, loudest = max(((alarm(space), space) for space in unseen(own)), key=lambda pair: pair[0])
        yield Threshold(
            joint, name, judge.detection_level, judge.detection_level_std, alarms,
            alarms * loudest.free_rms_std / loudest.free_rms if loudest.free_rms else 0.0, judge.log,
        )  # fmt: skip


def alarm(space: FreeSpace) -> float:
    """The effort that this free motion crosses no more than once in ten minutes; it scales with the motion's size."""
    return alarm_level([Quiet(space.smooth_rms, space.smooth_max, space.crossings)])


def worst(spaces: list[FreeSpace]) -> FreeSpace:
    """The free space with the highest detection level."""
    return max(unseen(spaces), key=lambda space: space.detection_level)


def unseen(spaces: list[FreeSpace]) -> list[FreeSpace]:
    """Those of logs that no parameter was fitted to, where there are any."""
    return [space for space in spaces if space.role != "identification"] or spaces
