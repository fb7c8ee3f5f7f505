"""Identify a robot, and estimate its external efforts, from arrays: the stages run on a study in a temporary folder."""

import os
import shutil
import tempfile
import warnings
import weakref
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from davinci_forces import robots
from davinci_forces.arrays.effort import ExternalEffort, as_html, axes_of
from davinci_forces.arrays.given import Columns, Samples, Windows, columns_of, joints_of, windows_of
from davinci_forces.errors import BadRequest
from davinci_forces.files import read_bytes, write_folder
from davinci_forces.filters.error_bands import total_variance
from davinci_forces.identification.joint_models import Identified
from davinci_forces.records import (
    AnyRecord,
    Choice,
    Contact,
    Diagnostic,
    ErrorBand,
    Fit,
    FittedPaths,
    FreeSpace,
    JointModel,
    PathShare,
    Threshold,
    Track,
    store,
)
from davinci_forces.records.forces import SMOOTHER
from davinci_forces.report.content import Number
from davinci_forces.report.verdicts import BEYOND, MAX_OUTSIDE, MAX_SPEED_RATIO, band, covered_share, percent
from davinci_forces.robots import Robot
from davinci_forces.robots.from_toml import robot_of
from davinci_forces.runner import runs
from davinci_forces.runner.console import Console, table
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.results.dataframes import as_frame
from davinci_forces.runner.runner import Runner
from davinci_forces.study import LogEntry, Study
from davinci_forces.study.entries import entries_of
from davinci_forces.study.reading import settings_of
from davinci_forces.toml import TomlFile, TomlTable, in_toml

IDENTIFIED, PREDICTED, MEASURED = "calibrate", "predict", "measure"  # the last stage of each request
NEW = "new"  # the log that is predicted, or whose external effort is estimated
FITTED, VALIDATION = "identification", "validation"


def identify(
    robot: str | Path | Robot | Mapping[str, Any], t: Samples, q: Samples, tau: Samples, *,
    period: float | Sequence[float] | None = None, dq: Samples = None,
    joints: str | Sequence[str] | None = None, settings: Mapping[str, Any] | None = None,
    roles: Sequence[str] | None = None, names: Sequence[str] | None = None,
) -> "IdentifiedArm":  # fmt: skip
    """Identify the models of a robot's joints from free motion; see `davinci_forces.identify`."""
    table = TomlTable(dict(settings or {}), TomlFile("settings", {}))
    if isinstance(robot, Mapping):
        described = TomlTable(dict(robot), TomlFile("robot", {}))
        arm = robot_of(described, "arm")
        refuse(described)
        assert arm is not None
    else:
        arm = robot if isinstance(robot, Robot) else robots.load(Path(robot).name, Path(robot).parent)
    used = settings_of(table, arm)
    refuse(table)
    several = isinstance(t, list | tuple) and len(t) > 0 and np.ndim(t[0]) > 0
    given = {name: x if several else [x] for name, x in (("q", q), ("tau", tau), ("dq", dq)) if x is not None}
    times = list(t) if several else [t]
    periods = [period] * len(times) if period is None or isinstance(period, int | float) else list(period)
    used_as = [FITTED] * len(times) if roles is None else list(roles)
    if not {FITTED} <= {*used_as} <= {FITTED, VALIDATION}:
        each = f"give {FITTED} or {VALIDATION} for each log"
        raise BadRequest(f"roles is {used_as}: {each}, and {FITTED} for at least one")
    numbers = [used_as[: i + 1].count(role) for i, role in enumerate(used_as)]
    by_role = [f"{role}-{i}" if len(times) > 1 else role for role, i in zip(used_as, numbers, strict=True)]
    called = by_role if names is None else list(names)
    for name, x in [*given.items(), ("period", periods), ("roles", used_as), ("names", called)]:
        if len(x) != len(times):
            raise BadRequest(f"t has {len(times)} logs, but {name} has {len(x)}; give a list of as many for each")
    if len({*called, NEW}) <= len(called):
        raise BadRequest(f"names is {called}: give each log a name of its own, and none {NEW!r}")
    moved = joints_of(arm, given["q"][0], [joints] if isinstance(joints, str) else joints)
    logs = columns_of(times, given, moved)

    def study_in(home: Path) -> Study:
        entries = [save_log(arm, home, *log) for log in zip(called, logs, periods, used_as, strict=True)]
        return Study(home, "Arrays", arm, False, used, tuple(entries))

    return IdentifiedArm(study_in, moved, (robot, dict(settings or {})))


def load(folder: Path) -> "IdentifiedArm":
    """Load the identified models of a study, to use them on arrays; see `davinci_forces.load`."""
    study = replace(runs.load(folder), folder=folder.resolve())
    if NEW in [log.name for log in study.logs]:
        raise BadRequest(f"{folder}: {NEW!r} stands for the log of arrays; give the log of that name another")
    if not runs.run(folder, [IDENTIFIED], verbosity="quiet"):
        raise BadRequest(f"{folder}: a task failed, so there is no model; correct its log, or leave it out")

    def study_in(home: Path) -> Study:
        shutil.copytree(runs.folders(folder, None, None).processed, folders_in(home).processed)
        return study

    return IdentifiedArm(study_in)


def folders_in(home: Path) -> Folders:
    """The folders of an arm: of its logs, which a study's need not be in, and of what the stages make of them."""
    return Folders(home, home / "processed", home / "reports")


def save_log(
    robot: Robot, folder: Path, name: str, columns: Columns, period: float | None, role: str = FITTED, **windows: Any
) -> LogEntry:
    """Save a log, and describe it as study.toml does."""
    np.savez(folder / f"{name}.npz", **columns)  # type: ignore[arg-type]
    log = {"name": name, "file": f"{name}.npz", "role": role, "channels": {column: column for column in columns}}
    log |= windows
    table = TomlTable({"log": [log | ({} if period is None else {"period": period})]}, TomlFile(name, {}))
    [entry] = entries_of(table, robot)
    refuse(table)
    return entry


def refuse(table: TomlTable) -> None:
    """Raise the problems of a table, one a line, without the lines of a file, as there is none."""
    if table.file.noted:
        raise BadRequest("\n".join(text for _, text in sorted(table.file.noted)))


class IdentifiedArm:
    """The identified models of a robot's joints, which predict efforts and estimate external efforts.

    `fits` and `record` hold the Fit of each joint, or of all coupled joints, with `r2` and `mse` of their efforts
    together; `parameters` is the same as a DataFrame.
    `models` has the JointModel of each joint and log, `diagnostics` the remarks of the stages.  `save` makes a study of
    it, for a report, a stream or an export.
    """

    def __init__(
        self, study_in: Callable[[Path], Study], joints: Sequence[str] = (),
        arguments: tuple[str | Path | Robot | Mapping[str, Any], dict[str, Any]] | None = None,
    ) -> None:  # fmt: skip
        self._arguments = arguments  # robot and settings as `identify` got them; None of a study
        self._home = Path(tempfile.mkdtemp(prefix="davinci-forces-"))
        weakref.finalize(self, shutil.rmtree, self._home, ignore_errors=True)
        self._study = study = study_in(self._home)
        self.robot, self._places = study.robot, replace(folders_in(self._home), raw=study.folder)
        reading = self._run(IDENTIFIED)
        identified = Identified(study.robot, [*reading(Fit), *reading(Choice)])
        each = joints or [joint.name for joint in study.robot.joints]
        fits = {joint: identified.fit_of(joint, study.settings.fit) for joint in each}
        self.joints = tuple(joint for joint in each if joints or fits[joint])
        self.diagnostics = texts_of(reading(Diagnostic))
        if not any(fits.values()):
            raise BadRequest("\n".join(["no joint has a model", *self.diagnostics]))
        self.fits: dict[str, Fit] = {joint: fit for joint, fit in fits.items() if fit}
        self.models: tuple[JointModel, ...] = tuple(reading(JointModel))
        self._bands = {band.joint: band for band in reading(ErrorBand)}

    @property
    def record(self) -> tuple[Fit, ...]:
        """The frozen Fit of each joint, or of the whole arm."""
        return tuple({fit.key: fit for fit in self.fits.values()}.values())

    @property
    def parameters(self) -> pd.DataFrame:
        """The parameters of each fit with their standard errors and units.

        Friction reverses or decays within its `scale`.  A parameter of coupled links is a sum that it leads:
        `combination`; `described` is that of the description.
        """
        columns = {"theta": "value", "theta_std": "std"}
        names = ["group", "model", "estimator", "parameter", *columns, "unit", "scale", "combination", "described"]
        frames = [as_frame(fit)[names] for fit in self.record]
        return pd.concat(frames, ignore_index=True).rename(columns=columns)

    def predict(self, t: Samples, q: Samples, dq: Samples = None) -> pd.DataFrame:
        """Predict the effort of free motion: a row a time, columns (joint, `tau`) and (joint, `std`).

        The standard deviation is that of the low-passed measured effort about it, as calibrated on free motion.  Single
        samples of the measured effort scatter by their noise, too.

        Raises
        ------
        BadRequest
            If the arrays are wrong, or no joint has a model.
        """
        columns = self._columns(t, q=q, dq=dq)
        columns |= {f"{joint}.tau": np.zeros_like(columns["time"]) for joint in self.joints}
        reading = self._run(PREDICTED, self._contact_log(NEW, columns))
        models = [model for model in reading(JointModel) if model.log == NEW]
        paths = Identified(self.robot, reading(FittedPaths))
        for model in models:
            if (outside := paths.share_outside(model)) > MAX_OUTSIDE:
                warnings.warn(f"{NEW}/{model.joint}: {percent(outside)} of its samples are {BEYOND}", stacklevel=2)
        if not models:
            raise BadRequest("\n".join(["the effort of no joint is predicted", *new_texts(reading)]))
        predictions: dict[str, pd.DataFrame] = {}
        for model in models:
            std, band = np.full(len(model), np.nan), self._bands.get(model.joint)
            if band is not None:
                smoothed = np.full(len(model), np.sqrt(np.mean(band.tau_ext_std_filter**2)))
                std = np.sqrt(total_variance(band, model.log, model.path, model.dq, smoothed, False)[0])
            columns = {"tau": model.tau_hat, "std": std}
            predictions[model.joint] = pd.DataFrame(columns, index=pd.Index(model.t, name="t"))
        return pd.concat([*predictions.values()], keys=[*predictions], axis=1, names=["joint", ""])

    def external_effort(
        self, t: Samples, q: Samples, tau: Samples, dq: Samples = None, *, free: Windows = (), contact: Windows = ()
    ) -> "ExternalEffort":
        """Estimate the effort that the robot exerts on its environment, and detect contacts.

        It is `tau` minus the effort of the model, smoothed.  Windows [[start, end], ...] [s], from the first sample,
        are those in which nothing touches the arm (`free`: a constant offset is then subtracted) or something does.

        Raises
        ------
        BadRequest
            If the arrays or windows are wrong, or no joint has a model.
        """
        columns = self._columns(t, q=q, tau=tau, dq=dq)
        stated = {"free": free, "contact": contact}
        windows = {name: windows_of(name, of, columns["time"]) for name, of in stated.items() if len(of)}
        reading = self._run(MEASURED, self._contact_log(NEW, columns, windows))
        tracks, contacts = ([r for r in reading(kind) if r.log == NEW] for kind in (Track, Contact))
        doubted = doubts(reading)
        texts = (*new_texts(reading), *doubted)
        for text in doubted:
            warnings.warn(text, stacklevel=2)
        if not tracks:
            raise BadRequest("\n".join(["the external effort of no joint is estimated", *texts]))
        labels = tuple(self._effort_label(track.joint) for track in tracks)
        levels = tuple(threshold for threshold in reading(Threshold) if threshold.filter == SMOOTHER)
        return ExternalEffort(tuple(tracks), tuple(contacts), levels, labels, texts, (columns, windows))

    def save(
        self, folder: str | Path, *, title: str = "From arrays", simulated: bool = False, replaces: bool = False,
        **contact_logs: "ExternalEffort",
    ) -> Path:  # fmt: skip
        """Write the identified logs and study.toml to a new folder: `davinci_forces.run(arm.save("raw/mine"))` reports.

        The logs of external efforts are written, too, each under its name: `arm.save("raw/mine", push=effort)`.
        Pages of a `simulated` study say so.  An arm that was loaded writes its study, to which these logs are added.
        A folder that holds only files of these names may be replaced.

        Raises
        ------
        NotAFile
            If the folder exists, and is not to be or cannot be replaced.
        BadRequest
            If the robot was given as an object, of which there is no file, or two logs have one name.
        """
        target, home = Path(folder), self._study.folder
        if taken := sorted({log.name for log in self._study.logs} & {*contact_logs}):
            raise BadRequest(f"{taken[0]} is the name of an identified log; give the other log another name")
        logs = [self._contact_log(name, *effort._log) for name, effort in contact_logs.items()]
        if self._arguments is None:
            contents = {
                path.relative_to(home).as_posix(): read_bytes(path) for path in home.rglob("*") if path.is_file()
            }
            lines = [contents["study.toml"].decode().rstrip()]
        else:
            contents, lines = self._described(title, simulated)
            logs = [*self._study.logs, *logs]
        for log in logs:
            [file] = log.files
            contents[Path(file).name] = read_bytes(home / file)
            lines += ["", "[[log]]", f"name = {in_toml(log.name)}", f"file = {in_toml(Path(file).name)}"]
            lines += [f"role = {in_toml(log.role)}", *([f"period = {log.period}"] if log.period else [])]
            windows = {"contact": log.contact, "free": log.free}
            lines += [f"{name} = {in_toml([list(window) for window in of])}" for name, of in windows.items() if of]
            lines += ["[log.channels]"]
            lines += [f"{in_toml(source.quantity)} = {in_toml(source.channel)}" for source in log.channels]
        write_folder(target, contents | {"study.toml": ("\n".join(lines) + "\n").encode()}, replaces)
        return target

    def _described(self, title: str, simulated: bool) -> tuple[dict[str, bytes], list[str]]:
        """The file of the robot, if it has one, and the lines of study.toml above its logs."""
        assert self._arguments
        robot, settings = self._arguments
        if isinstance(robot, Robot):
            raise BadRequest("a study names its robot: give `identify` the name of a listed robot, or a file")
        file, contents = Path("robot.toml" if isinstance(robot, Mapping) else robot).name, dict[str, bytes]()
        if isinstance(robot, Mapping):
            contents[file] = "".join(f"{key} = {in_toml(value)}\n" for key, value in robot.items()).encode()
        elif Path(robot).suffix:
            contents[file] = read_bytes(Path(robot))
        lines = [f"title = {in_toml(title)}", f"robot = {in_toml(file)}", f"simulated = {in_toml(simulated)}"]
        return contents, [*lines, "", "[settings]", *(f"{key} = {in_toml(value)}" for key, value in settings.items())]

    def __getstate__(self) -> dict[str, Any]:
        raise BadRequest("an IdentifiedArm keeps its logs in a temporary folder and cannot be pickled; use `save`")

    def plot(self) -> Any:
        """Plot measured and modelled effort of all given logs, one after another; returns the axes, one a joint."""
        axes = axes_of({joint: self._effort_label(joint) for joint in self.fits})
        for ax, joint in zip(axes, self.fits, strict=True):
            shift = 0.0
            for i, model in enumerate(model for model in self.models if model.joint == joint):
                t = model.t + (shift - model.t[0] if i else 0.0)
                ax.plot(t, model.tau, "C0", lw=0.7, label="" if i else "measured")
                ax.plot(t, model.tau_hat, "C1", lw=1.2, label="" if i else "model")
                shift = t[-1]
        axes[0].legend(loc="upper right")
        return axes

    def __repr__(self) -> str:
        """The parameters as a table: joint, parameter, value ± standard error, unit."""
        lines = [("joint", "parameter", "value", "unit")]
        for fit in self.record:
            rows = zip(fit.parameter, fit.theta.tolist(), fit.theta_std.tolist(), fit.unit, strict=True)
            lines += [(fit.group, name, Number(value, std=std).text, unit) for name, value, std, unit in rows]
        return "\n".join(table(lines))

    def _repr_html_(self) -> str:
        return as_html([self.parameters.set_index("group")], self.diagnostics)

    def _effort_label(self, joint: str) -> str:
        return f"effort [{self.robot.joint(joint).unit('{effort}')}]"

    def _columns(self, t: Samples, **given: Samples) -> Columns:
        [columns] = columns_of([t], {name: [x] for name, x in given.items() if x is not None}, self.joints)
        return columns

    def _contact_log(self, name: str, columns: Columns, windows: Mapping[str, Any] | None = None) -> LogEntry:
        windows, length = windows or {}, float(columns["time"][-1] - columns["time"][0])
        is_free = "contact" not in windows and any(a <= 0.0 and b >= length for a, b in windows.get("free", ()))
        role = VALIDATION if is_free else "contact"  # free throughout
        entry = save_log(self.robot, self._home, name, columns, None, role, **windows)
        return replace(entry, files=(os.path.relpath(self._home / entry.files[0], self._study.folder),))

    def _run(self, stage: str, *more: LogEntry) -> Any:
        """Run the stages up to this one, without output; return what reads the records of a kind."""
        study, lines = replace(self._study, logs=(*self._study.logs, *more)), list[str]()
        runner = Runner(study, self._places, Console(lambda line, **style: None, lines.append))
        if not runner.run([stage]):
            raise BadRequest("\n".join(lines))
        for line in lines if stage != PREDICTED else ():  # a prediction is given no effort, which is no fault
            warnings.warn(line.replace("warning: ", "", 1), stacklevel=3 if more else 5)

        def read(kind: type[AnyRecord]) -> list[AnyRecord]:
            places = runner.plan.places().find((kind,))
            return [store.read(kind, self._places.processed, Path(place)) for _, place in places]

        return read


def new_texts(reading: Any) -> tuple[str, ...]:
    """The texts of the diagnostics of the new log."""
    return texts_of(d for d in reading(Diagnostic) if d.subject.partition(".")[0] == NEW)


def doubts(reading: Any) -> list[str]:
    """What page one of a report would doubt: motion beyond the fitted one, and bands that are too narrow."""
    texts = []
    for x in (share for share in reading(PathShare) if share.role != FITTED):
        if x.speed_ratio > MAX_SPEED_RATIO:
            texts.append(f"{x.log}/{x.joint}: it moves {x.speed_ratio:.2g} times as fast as in any fitted log")
        if x.outside > MAX_OUTSIDE:
            texts.append(f"{x.log}/{x.joint}: {percent(x.outside)} of its samples are {BEYOND}")
    spaces = [space for space in reading(FreeSpace) if space.filter == SMOOTHER and space.role != FITTED]
    narrow = "the 95 % band is too narrow: it covers only"
    return texts + [
        f"{x.log}/{x.joint}: {narrow} {covered_share(x)} of free motion; judge by the alarm level"
        for x in spaces if band(x.coverage) == "bad"
    ]  # fmt: skip


def texts_of(diagnostics: Iterable[Diagnostic]) -> tuple[str, ...]:
    """The texts of diagnostics, without duplicates."""
    return tuple(dict.fromkeys(str(text) for d in diagnostics for text in d.text))
