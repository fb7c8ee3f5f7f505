"""Estimate the contact forces of a da Vinci arm from its motor currents, offline: from raw logs to reports."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import pandas as pd

    from davinci_forces.arrays import IdentifiedArm
    from davinci_forces.filters.online import Stream
    from davinci_forces.robots.robot import Robot

__all__ = ["identify", "load", "read", "results", "robot", "run", "stream"]
__version__ = "0.2.0"  # pyproject.toml and the citation state it, too


def identify(
    robot: "str | Path | Robot | Mapping[str, Any]", t: Any, q: Any, tau: Any, *,
    period: "float | Sequence[float] | None" = None, dq: Any = None, joints: "str | Sequence[str] | None" = None,
    settings: "Mapping[str, Any] | None" = None, roles: "Sequence[str] | None" = None,
    names: "Sequence[str] | None" = None,
) -> "IdentifiedArm":  # fmt: skip
    """Identify the models of a robot's joints from arrays of free motion, as the stages do from a study's logs.

    `robot` is a name, a .toml or .urdf file, a dict with the keys of such a TOML file, or a Robot.  `t` (n,) is in s.
    `q`, `tau` and, where measured, `dq` are (n,) or (n, joints) in SI, arrays or pandas objects.  Lists of arrays are
    several logs.  `joints` names the columns; without it, the names of a DataFrame do, or the columns are all joints of
    the robot.  `period` [s] is that of the excitation, one for all logs or one a log; without it, it is detected.
    `settings` are those of a study.  `tau` are efforts at the joints [N m or N]: multiply a motor current by gear ratio
    and torque constant first.  `roles` has "identification" or "validation" for each log: bands and levels are then
    those of logs that no fit used.  `names` are those of the logs, for messages and for the study that `save` writes.

    >>> arm = davinci_forces.identify("davinci", t, q, tau, joints="hand_roll")
    >>> arm.parameters["parameter"].tolist()[:2]
    ['inertia', 'gravity, sine']
    >>> arm.predict(t, q)["hand_roll"].columns.tolist()
    ['tau', 'std']
    >>> effort = arm.external_effort(t, q, tau)
    >>> effort.tau_ext.shape == effort.std.shape == (len(effort.t), 1)
    True

    Raises
    ------
    BadRequest
        If arrays differ in length, are too short or hold NaN, or no joint can be identified; one message names all.
    BadRobot
        If there is no such robot, file or joint.
    """
    from davinci_forces.runner.processes import arithmetic

    arithmetic.pin()
    from davinci_forces import arrays

    about = {"period": period, "dq": dq, "joints": joints, "settings": settings, "roles": roles, "names": names}
    return arrays.identify(robot, t, q, tau, **about)


def load(study: str | Path) -> "IdentifiedArm":
    """Load the identified models of a study for arrays: `load("raw/mine").external_effort(t, q, tau)`.

    What is not up to date runs first.  Arrays have a column for each joint with a model, `joints` names them, of
    positions and efforts at the joints in SI, after sign, offset and gear ratio.

    Raises
    ------
    BadRequest
        If a task fails, or no joint has a model.
    """
    from davinci_forces.runner.processes import arithmetic

    arithmetic.pin()
    from davinci_forces import arrays
    from davinci_forces.runner import runs

    return arrays.load(runs.single_study(Path(study)))


def read(study: str | Path, record: str, **about: object) -> "pd.DataFrame":
    """Read all records of one kind of a study into a DataFrame: `read("raw/mine", "Track", joint="hand_roll")`.

    The scalars that identify a record (log, joint, ...) become columns.  `attrs["units"]` has the unit of each column,
    or a dict by joint where joints differ.  Keyword arguments select records by the values of their scalars.

    Raises
    ------
    BadRequest
        If there is no such kind of record.
    MissingRecord
        If the study has none: run its stages first.
    """
    from davinci_forces.runner.results.dataframes import read as read_frames

    return read_frames(Path(study), record, about)


def robot(name: str | Path, folder: str | Path = ".") -> "Robot":
    """Load a listed robot by its name, or a .toml or .urdf file in the folder: `robot("davinci").gravity([0, 0, 0])`.

    A robot with known geometry has `tip` and `jacobian`; with known masses, `mass_matrix`, `coriolis_matrix`,
    `gravity`, `inverse_dynamics`, `forward_dynamics` and `energy`.  All take positions (..., n) in rad and m.

    Raises
    ------
    BadRobot
        If there is no such robot or file, or the file has problems; the message lists each with its line.
    """
    from davinci_forces.robots import load

    return load(str(name), Path(folder))


def run(study: str | Path, *stages: str, force: bool = False, jobs: int = 1, quiet: bool = False) -> bool:
    """Run stages, groups or the report after the stages that they need; return whether all tasks succeeded.

    Without names, everything runs.  Tasks that are up to date are skipped.  `jobs` is the number of processes.

    Raises
    ------
    BadRequest
        If there is no such stage or group.
    PipelineError
        If the study is wrong, or another run is working on it.
    """
    from davinci_forces.errors import BadRequest
    from davinci_forces.runner import ALL
    from davinci_forces.runner.processes import arithmetic
    from davinci_forces.stages import GROUPS

    arithmetic.pin()
    if unknown := [name for name in stages if name not in (*ALL, *GROUPS)]:
        groups = ", ".join(name for name in GROUPS if name not in ALL)
        raise BadRequest(f"there is no stage {unknown[0]!r}; there are {', '.join(ALL)}, and the groups {groups}")
    from davinci_forces.runner import runs
    from davinci_forces.runner.processes import afresh

    how = afresh.run if sys.executable and (jobs > 1 or not arithmetic.is_pinned()) else runs.run
    return how(Path(study), stages or ALL, force=force, jobs=jobs, verbosity="quiet" if quiet else "normal")


def results(study: str | Path) -> "pd.DataFrame":
    """Read all numbers of a study's report by key: `results("raw/mine").loc["period.roll", "value"]`.

    The columns are value, std (NaN for numbers without one), unit, source, the record of the number, and std_reason,
    why it has no std.

    Raises
    ------
    MissingRecord
        If the study has no results: run its stages first.
    """
    from davinci_forces.runner.results.dataframes import results as read_results

    return read_results(Path(study))


def stream(study: str | Path, joint: str | None = None, *, despite_verdict: bool = False) -> "Stream":
    """Return the filter of a study for samples as they arrive: `stream("raw/mine").step(t, q, tau)`.

    Everything that is not up to date runs first.  `step` takes the time [s], positions, efforts and, if measured,
    velocities over all joints, or over one `joint`; a joint of a coupled arm takes all positions.  It returns the
    external efforts with their standard deviations, contacts and the force at the tip.  Research use only: nothing here
    connects to a robot.

    Raises
    ------
    BadRequest
        If a task fails, a joint has no model or no filter, or page one or a reviewer says no.
    """
    from davinci_forces.errors import BadRequest
    from davinci_forces.filters.online import Stream
    from davinci_forces.runner import runs
    from davinci_forces.runner.results.exported import permitted_export

    folders = runs.folders(runs.single_study(Path(study)), None, None)
    if not run(study, quiet=True):
        raise BadRequest(f"{study}: a task failed, so there is no filter; correct its log, or leave it out")
    try:
        return Stream(permitted_export(folders, [joint] if joint else [], despite_verdict).document())
    except ValueError as error:
        raise BadRequest(f"{study}: {error}") from error
