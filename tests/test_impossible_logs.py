"""Logs that no arm can have recorded: each ends in a refusal or a remark that names the fault, and none in a bug."""

import math
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import davinci_forces
from davinci_forces.errors import BadLog
from davinci_forces.filters import response
from davinci_forces.identification import candidates, search
from davinci_forces.records import Diagnostic, Recording
from davinci_forces.robots.robot import UNLIMITED
from davinci_forces.stages.forces import tune
from davinci_forces.stages.recordings import resample
from tests import arm
from tests.guide.make_logs import JOINT, LINK, measured, motion, sensed
from tests.logs.lvm_writer import Style, Write, lvm
from tests.test_bad_logs import call_any
from tests.test_new import table

Columns = dict[str, np.ndarray]  # t (N,), and q, dq and tau (N, n)
DEG = 180 / math.pi
URDF = "".join(
    [
        '<robot name="bench">\n<link name="base"/>\n',
        LINK.format(name="shoulder", centre="0 0 0", mass=2.0, small=0.02, large=0.02),
        LINK.format(name="upper", centre="0.2 0 0", mass=3.0, small=0.01, large=0.06),
        JOINT.format(name="pan", on="base", link="shoulder", at="0 0 0.1", axis="0 0 1", effort=150),
        JOINT.format(name="lift", on="shoulder", link="upper", at="0 0 0.1", axis="0 1 0", effort=150),
        "</robot>\n",
    ]
)


def scaled(**factors: float) -> Callable[[Columns], Columns]:
    return lambda log: log | {name: log[name] * factor for name, factor in factors.items()}


def constant(**values: float) -> Callable[[Columns], Columns]:
    return lambda log: log | {name: np.full_like(log[name], value) for name, value in values.items()}


def noise(**sizes: float) -> Callable[[Columns], Columns]:
    def spoil(log: Columns) -> Columns:
        rng = np.random.default_rng(5)
        return log | {name: size * rng.normal(size=log[name].shape) for name, size in sizes.items()}

    return spoil


def first(change: Callable[[Columns], Columns]) -> Callable[[Columns], Columns]:
    """Spoil the first joint alone."""

    def spoil(log: Columns) -> Columns:
        bad = change({name: column[:, :1] for name, column in log.items() if name != "t"} | {"t": log["t"]})
        return log | {name: np.column_stack([bad[name], log[name][:, 1:]]) for name in ("q", "dq", "tau")}

    return spoil


def jump(size: float) -> Callable[[Columns], Columns]:
    return lambda log: log | {"q": log["q"] + size * (np.arange(len(log["t"])) > len(log["t"]) // 2)[:, None]}


def cut(rows: int) -> Callable[[Columns], Columns]:
    return lambda log: {name: column[:rows] for name, column in log.items()}


def alternating(log: Columns) -> Columns:
    return log | {"q": (np.arange(len(log["t"])) % 2)[:, None] + 0.0 * log["q"]}


LOGS: dict[str, Callable[[Columns], Columns]] = {
    "positions in degrees": scaled(q=DEG),
    "both in degrees": scaled(q=DEG, dq=DEG),
    "a position of 1e200": scaled(q=1e200, dq=1e200),
    "time in us": scaled(t=1e6),
    "velocity in deg/s": scaled(dq=DEG),
    "positions stand still": constant(q=0.3, dq=0.0),
    "an effort of 1e200": scaled(tau=1e200),
    "velocity in rad/s, stated in deg/s": scaled(dq=1 / DEG),
    "positions x1000": scaled(q=1e3),
    "positions x1e6": scaled(q=1e6),
    "positions /1000": scaled(q=1e-3),
    "positions /1e6": scaled(q=1e-6),
    "both x1000": scaled(q=1e3, dq=1e3),
    "both x1e6": scaled(q=1e6, dq=1e6),
    "both tiny": scaled(q=1e-200, dq=1e-200),
    "one joint in degrees": first(scaled(q=DEG, dq=DEG)),
    "velocity x1e6": scaled(dq=1e6),
    "velocity reversed": scaled(dq=-1.0),
    "velocity 0": constant(dq=0.0),
    "positions are noise": noise(q=1.0),
    "positions are little noise": noise(q=1e-4),
    "one position is noise": first(noise(q=1.0)),
    "velocities are noise": noise(dq=10.0),
    "all is noise": noise(q=1.0, dq=1.0, tau=1.0),
    "efforts are noise": noise(tau=1.0),
    "efforts are constant": constant(tau=3.0),
    "efforts are 0": constant(tau=0.0),
    "one effort is 0": first(constant(tau=0.0)),
    "efforts x1e6": scaled(tau=1e6),
    "efforts x1e-9": scaled(tau=1e-9),
    "efforts reversed": scaled(tau=-1.0),
    "an angle wraps": jump(2 * math.pi),
    "a position jumps by 1e4": jump(1e4),
    "one joint never moves": first(constant(q=0.3, dq=0.0)),
    "time x1e-3": scaled(t=1e-3),
    "time in ms": scaled(t=1e3),
    "time x1e-6": scaled(t=1e-6),
    "one row": cut(1),
    "two rows": cut(2),
    "five rows": cut(5),
    "a fifth of a second": cut(20),
    "a part of a period": cut(100),
    "positions alternate": alternating,
    "positions are steps": lambda log: log | {"q": np.sign(log["q"] - log["q"].mean(axis=0))},
    "positions are ramps": lambda log: log | {"q": log["t"][:, None] + 0.0 * log["q"]},
    "positions are efforts": lambda log: log | {"q": log["tau"]},
    "efforts are positions": lambda log: log | {"tau": log["q"]},
}

FIRST = tuple(LOGS)[:7]
ROLL = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
PLAIN = Style()
COLUMNS = {"q": ROLL.q, "dq": ROLL.dq, "tau": ROLL.tau}


def labview(change=lambda log: log, names=("q", "dq", "tau"), style=PLAIN, **written) -> bytes:
    """The roll's log as LabVIEW writes it, spoilt; `written` stands in its header."""
    log = change(COLUMNS | {"t": ROLL.t})
    return lvm([Write({name: log[name] for name in names}, x=log["t"], step=0.02, **written)], style)


def segments(*names: str) -> bytes:
    """The log in two file segments, each with its channels."""
    return lvm([
        Write({name: COLUMNS[name][part] for name in group.split()}, x=ROLL.t[part], step=0.02)
        for group, part in zip(names, (slice(250), slice(250, None)), strict=True)
    ])  # fmt: skip


def with_lines(start: int, other: bytes) -> bytes:
    """The log with the lines of another one from `start` on."""
    return b"\r\n".join(labview().split(b"\r\n")[:start] + other.split(b"\r\n")[start:])


def repeated(log: Columns) -> Columns:
    return log | {"t": np.where(np.arange(len(log["t"])) == 250, log["t"] - 0.02, log["t"])}


def missing(log: Columns) -> Columns:
    return log | {"tau": np.where(np.arange(len(log["t"])) % 50 == 7, np.nan, log["tau"])}


LABVIEW = {
    "degrees": labview(scaled(q=DEG)),
    "counts": labview(scaled(q=65536, dq=65536)),
    "current": labview(constant(tau=0.0)),
    "still": labview(constant(q=0.3, dq=0.0)),
    "one": labview(cut(1)),
    "two": labview(cut(2)),
    "clock": labview(repeated),
    "marks": with_lines(270, labview(style=Style(decimal="."))),
    "channel": labview(names=("q", "dq")),
    "stated": labview(samples=7),
    "milliseconds": labview(scaled(t=1e3)),
    "segments": segments("q dq tau", "q tau"),
    "absent": labview(missing),
    "text": with_lines(100, labview().replace(b"\t-", b"\tn/a")),
    "cut": labview()[:-15_000],
    "header": labview()[:300],
}
REMARKS = {
    "degrees": r'0\.0175 times .* position in degrees\? write unit = "deg"',
    "counts": r"velocities reach .* degrees or counts\? write .* or the gear_ratio of a motor",
    "current": r"/hand_roll: the effort is 0 throughout; check the column",
    "still": r": no joint moves of those that study.toml names, .*; name the channels of .*, and the clock, of 50 Hz",
    "one": r"\.lvm: 1 samples are too few, .*; record more",
    "two": r"/hand_roll: no segment without a gap holds 4 of the 2 samples; record more",
    "clock": r"\.lvm: time does not increase at row 250 .*: 4\.98 s, then 4\.98 s; name another time channel",
    "marks": r": line 23: the header's decimal mark is ',', but cells use '\.' and ','; each cell is read with its own",
    "channel": r"\.lvm: there is no channel 'tau' among its 3; it has 'X_Value', 'q', 'dq'",
    "stated": r": line 22: the header states 7 samples, but 500 rows follow; these are read",
    "milliseconds": r'1e\+03 times .* is the time in ms\? write unit = "ms"',
    "segments": r"\.lvm: channel 'dq' has no sample at row 250 .*, and 250 of its 500 rows .*; record the log again",
    "absent": r": samples are missing \('tau' 10\): 10 rows with up to 20 ms",
    "text": r"\.lvm:1\d\d: 'n/a.*' in column 1 \(q\) is not a number; correct the cell",
    "cut": r": line \d+: the file ends within this row, which is dropped",
    "header": r"\.lvm:15: no line \*\*\*End_of_Header\*\*\* ends the header",
}


def arms() -> list[tuple[bool, str]]:
    """Every log on an arm with limits and velocities or on one without them, by turns; the first ones on both."""
    return [(i % 2 == 0, name) for i, name in enumerate(LOGS)] + [(i % 2 == 1, name) for i, name in enumerate(FIRST)]


@pytest.fixture
def extremes(monkeypatch):
    """Search models, ridges and delays by the first and the last value of each grid alone, the least plausible ones."""
    for name, grid in arm.coarse_grids().items():
        monkeypatch.setattr(search, name, (grid[0], grid[-1]))
    monkeypatch.setattr(candidates, "RIDGES", {name: (grid[0], grid[-1]) for name, grid in candidates.RIDGES.items()})
    monkeypatch.setattr(tune, "TRIAL_DELAYS", (tune.TRIAL_DELAYS[0], tune.TRIAL_DELAYS[-1]))
    monkeypatch.setattr(response, "BISECTIONS", 20)


@pytest.mark.usefixtures("extremes")
@pytest.mark.parametrize(("velocity", "name"), arms())
def test_no_log_however_impossible_ends_in_a_bug(tmp_path, name, velocity):
    """Identification, validation and contact are all spoilt, in an arm with or without limits and velocities."""
    folder = tmp_path / "raw" / "bench"
    folder.mkdir(parents=True)
    free = re.sub('lower=.*velocity="3"', "", URDF).replace("revolute", "continuous")
    (folder / "bench.urdf").write_text(URDF if velocity else free)
    robot, joints = davinci_forces.robot("bench.urdf", folder), ("pan", "lift")
    symbols = ("q", "dq", "tau") if velocity else ("q", "tau")
    text = 'title = "T"\nrobot = "bench.urdf"\n'
    for seed, role in enumerate(("identification", "validation", "contact"), start=1):
        t, q, dq, ddq = motion(seed, 2, 6.0, 1.5 + 0.2 * seed, 0.4)
        tau = measured(robot.inverse_dynamics(q, dq, ddq), dq, seed, np.array([2.0, 2.0]))
        log = LOGS[name](dict(zip(("t", "q", "dq", "tau"), (t, *sensed(q, dq), tau), strict=True)))
        names = [f"{joint}.{symbol}" for symbol in symbols for joint in joints]
        table(folder / f"{role}.csv", log["t"], *(log[s] for s in symbols), header=",".join(["time", *names]))
        text += f'[[log]]\nname = "{role}"\nfile = "{role}.csv"\nrole = "{role}"\n[log.channels]\ntime = "time"\n'
        text += "".join(f'"{channel}" = "{channel}"\n' for channel in names)
    (folder / "study.toml").write_text(text)
    said = " ".join(call_any("stream", folder).split())
    assert "a bug" not in said
    assert "Traceback" not in said


@pytest.fixture(scope="module")
def remarks(tmp_path_factory) -> str:
    """What is said of a study with all these files of LabVIEW."""
    folder = tmp_path_factory.mktemp("lab") / "raw" / "arm"
    folder.mkdir(parents=True)
    arm.write_robot(folder)
    text = 'title = "T"\nrobot = "arm.toml"\n'
    for name, content in LABVIEW.items():
        (folder / f"{name}.lvm").write_bytes(content)
        text += f'[[log]]\nname = "{name}"\nfile = "{name}.lvm"\nrole = "identification"\n[log.channels]\n'
        text += "".join(f'"hand_roll.{channel}" = "{channel}"\n' for channel in COLUMNS)
    (folder / "study.toml").write_text(text)
    return call_any("fit", folder)


@pytest.mark.parametrize("name", REMARKS)
def test_an_impossible_file_of_labview_is_refused_or_remarked_on_with_its_place_and_numbers(remarks, name):
    assert "a bug" not in remarks
    assert "Traceback" not in remarks
    lines = [line for line in remarks.splitlines() if re.search(rf"(error|warning): (\S+/)?{name}\b", line)]
    assert re.search(REMARKS[name], "\n".join(lines))


def resampled(change: Callable[[Columns], Columns], name="hand_roll", velocity="logged") -> list[str]:
    """The warnings that `resample` makes of one spoilt joint of the tests' arm."""
    s = arm.signal(name, rate=100.0, period=2.0, periods=5)
    log = change({"t": s.t, "q": s.q[:, None], "dq": s.dq[:, None], "tau": s.tau[:, None]})
    columns = {symbol: log[symbol][:, 0] for symbol in ("q", "dq", "tau")} | {"filled": np.zeros(len(log["t"]), int)}
    recording = Recording("run", name, "identification", 100.0, velocity, t=log["t"], **columns)
    records = list(resample.run(recording, arm.joint(name), lowpass=17.0))
    remarks = [r for r in records if isinstance(r, Diagnostic)]
    return [str(text) for r in remarks for severity, text in zip(r.severity, r.text, strict=True) if severity != "note"]


@pytest.mark.parametrize(
    ("change", "name", "factor", "hint"),
    [
        (scaled(dq=DEG), "hand_roll", 57.3, 'is the velocity in deg/s? write unit = "deg/s"'),
        (scaled(q=DEG), "hand_roll", 1 / 57.3, 'is the position in degrees? write unit = "deg"'),
        (scaled(dq=30 / math.pi), "hand_roll", 9.55, 'is the velocity in rpm? write unit = "rpm"'),
        (
            scaled(dq=1e3),
            "instrument_slide",
            1e3,
            'write unit = "mm/s" for its channel, or correct the unit of the position',
        ),
        (
            scaled(q=1e3),
            "instrument_slide",
            1e-3,
            'write unit = "mm" for its channel, or correct the unit of the velocity',
        ),
        (scaled(t=1e3), "hand_roll", 1e3, 'is the time in ms? write unit = "ms"'),
        (scaled(dq=-1.0), "hand_roll", -1.0, "write sign = -1"),
        (scaled(q=1e-4), "hand_roll", 1e4, "check the sign, unit and column of both"),  # so that it seems at rest
        (constant(dq=0.0), "hand_roll", 0.0, "without the channel of the velocity, it is derived"),
    ],
)
def test_a_velocity_that_contradicts_the_position_is_refused_with_the_factor_and_the_unit(change, name, factor, hint):
    with pytest.raises(BadLog) as refused:
        resampled(change, name)
    text = str(refused.value)
    assert text.startswith(f"run/{name}: the logged velocity is ")
    assert hint in text
    stated = float(re.findall("velocity is ([-+.e0-9]+) times", text)[0])
    assert_allclose(stated, factor, rtol=0.02, atol=1e-9)


def test_a_velocity_that_is_somewhat_wrong_is_remarked_on_and_a_right_one_is_not():
    assert resampled(lambda log: log) == []
    (text,) = resampled(scaled(dq=1.3))
    assert "the logged velocity is 1.3 times" in text


def test_one_jump_of_a_position_neither_hides_nor_feigns_a_wrong_velocity():
    (text,) = resampled(jump(0.9))
    assert "the position jumps by 0.9" in text
    assert "within one sample at 5.000 s" in text


def test_motion_beyond_the_limits_of_a_joint_is_remarked_on_and_far_beyond_them_refused():
    assert resampled(scaled(q=1.5, dq=1.5)) == []
    beyond, text = resampled(scaled(q=4.0, dq=4.0))
    assert "correct the units, or the zero of positions (`offset`), on which" in beyond
    assert re.match(r"run/hand_roll: velocities reach .* rad/s, 2\.\d+ times the limit of 1.2 rad/s; are they", text)
    with pytest.raises(BadLog) as refused:
        resampled(scaled(q=DEG), velocity="derived")
    assert re.search(r"positions reach .* rad, .* times the limit of 0\.6 rad, and velocities", str(refused.value))
    assert (
        'are they in degrees or counts? write the unit of the channel in study.toml, as unit = "deg", or the gear_ratio'
        in str(refused.value)
    )


def test_degrees_are_remarked_on_where_a_joint_states_no_limits_and_never_refused(monkeypatch):
    joint = arm.ARM.joint("hand_roll")
    boundless = replace(
        arm.ARM, joints=tuple(replace(j, limits=UNLIMITED) if j is joint else j for j in arm.ARM.joints)
    )
    monkeypatch.setattr(arm, "ARM", boundless)
    assert resampled(scaled(q=1.0), velocity="derived") == []
    (text,) = resampled(scaled(q=DEG), velocity="derived")
    assert re.search(
        r"positions reach .* rad, .* times the limit of 6\.28 rad, which is assumed.*if you pass arrays, convert", text
    )


def test_an_effort_that_never_changes_is_named_with_its_value():
    (text,) = resampled(constant(tau=0.0))
    assert text == "run/hand_roll: the effort is 0 throughout; check the column of its channel"
