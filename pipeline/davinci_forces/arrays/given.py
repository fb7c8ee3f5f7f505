"""Check the arrays that a program gives, and name their columns as the channels of a log."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from davinci_forces.errors import BadRequest
from davinci_forces.maths.arrays import Array
from davinci_forces.robots import Robot

MIN_SAMPLES = 50  # of a log

Samples = Any  # an array, Series or DataFrame, or a list of those, one a log
Windows = Sequence[Sequence[float]]  # [[start, end], ...] [s]
Columns = dict[str, Array]  # the channels of a log by name: `time`, `hand_roll.q`, ...


def joints_of(robot: Robot, q: Samples, joints: Sequence[str] | None) -> list[str]:
    """The joints of the columns of a position: as named, else by names of a DataFrame, else all joints of the robot.

    Raises BadRequest if neither names nor the number of columns tell the joints; BadRobot if there is no such joint.
    """
    names = [joint.name for joint in robot.joints]
    labels = [label for label in getattr(q, "columns", ()) if isinstance(label, str)]
    width = 1 if np.ndim(q) == 1 else np.shape(q)[1] if np.ndim(q) == 2 else 0
    if joints is None and not set(labels) <= set(names):
        mismatch = f"q has the columns {', '.join(labels)}, but the joints of {robot.name} are {', '.join(names)}"
        raise BadRequest(f"{mismatch}; rename the columns, or say with joints=[...] which joint each of them is")
    chosen = list(joints) if joints is not None else labels or names
    if len(chosen) != width:
        count = f"q has shape {np.shape(q)}, but there are {len(chosen)} joints: {', '.join(chosen)}"
        raise BadRequest(f"{count}; give one column a joint, and name other joints with joints=[...]")
    return [robot.joint(name).name for name in chosen]


def windows_of(name: str, windows: Windows, t: Array) -> list[list[float]]:
    """Windows [[start, end], ...] [s] as Python's numbers; raises BadRequest where they are none, or not of the log."""
    try:
        spans = [[float(start), float(end)] for start, end in windows]
    except (TypeError, ValueError) as error:
        raise BadRequest(f"{name} is {windows!r}; give [[start, end], ...] in s from the first sample") from error
    length = float(t[-1] - t[0])
    for window in spans:
        if window[0] > length:
            raise BadRequest(f"{name} {window} begins after the log, of {length:.6g} s; count from its first sample")
    return spans


def columns_of(
    times: Sequence[Samples], given: Mapping[str, Sequence[Samples]], joints: Sequence[str]
) -> list[Columns]:
    """The channels of each log; raises BadRequest with all that is wrong with its arrays, by their names."""
    logs: list[Columns] = []
    problems: list[str] = []
    for i, t in enumerate(times):
        place, before = f"log {i + 1}: " if len(times) > 1 else "", len(problems)
        columns = {"time": np.asarray(t, np.float64)}
        if columns["time"].ndim != 1 or len(columns["time"]) < MIN_SAMPLES:
            problems.append(f"{place}t has shape {columns['time'].shape}; give (n,) times, of at least {MIN_SAMPLES}")
        for symbol, values in given.items():
            named = isinstance(values[i], pd.DataFrame) and set(joints) <= set(values[i].columns)
            array = np.asarray(values[i][list(joints)] if named else values[i], np.float64)
            array = array[:, None] if array.ndim == 1 else array
            if array.shape != (len(columns["time"]), len(joints)):
                needed = f"t has {len(columns['time'])} samples, and {len(joints)} joints need as many columns"
                problems.append(f"{place}{symbol} has shape {np.shape(values[i])}, but {needed}")
                continue
            columns |= {f"{joint}.{symbol}": array[:, k] for k, joint in enumerate(joints)}
        for name, column in columns.items():
            if len(missing := np.flatnonzero(~np.isfinite(column))):
                which = f"{len(missing)} values that are not finite, the first at sample {missing[0]}"
                problems.append(f"{place}{name} has {which}; remove these samples from all arrays")
        if len(problems) == before and (late := np.flatnonzero(np.diff(columns["time"]) <= 0)).size:
            problems.append(f"{place}t does not increase at sample {late[0] + 1}; sort the samples by time")
        logs.append(columns)
    if problems:
        raise BadRequest("\n".join(problems))
    return logs
