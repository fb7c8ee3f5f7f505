"""Folders as recorders and laboratories write them: `new` describes them right, or says what is missing.

Right is what `ingest` then reads: positions, velocities and efforts of every joint in SI at the right times, from the
numbers that were written, and not only the text of study.toml.
"""

import re
from collections.abc import Callable
from itertools import product

import h5py
import numpy as np
import pytest
import scipy.io
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from davinci_forces.study import reading
from tests.guide.make_logs import URDF, measured
from tests.guide.make_logs import motion as arm_motion
from tests.test_new import effort, motion, table
from tests.test_runs import call

RATE, DEG = 125.0, 180 / np.pi
Signals = tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]  # t (N,), q, dq, tau (N, n)


def recorded(seed: int, joints: int, repeats: bool) -> Signals:
    t, q, dq = motion(joints, seed, repeats)
    return t, q, dq, effort(q, dq)


def names(template: str, joints: int, first: int) -> list[str]:
    return [template.format(k) for k in range(first, first + joints)]


def csv(*templates: str, first: int = 1, delimiter: str = ",", units: str = "", time: str = "time") -> Callable:
    """Write columns of these names; `scale` and `start` of the time and scales of the signals go with their names."""

    def write(file, signals: Signals, scales: tuple[float, ...], start: float = 0.0) -> None:
        t, *blocks = signals
        joints = blocks[0].shape[1]
        used = list(zip(blocks, scales[1:], strict=True))[:: 1 if len(templates) == 3 else 2]
        header = [*([time] if time else []), *(name for t in templates for name in names(t, joints, first))]
        text = [
            delimiter.join(header),
            *(
                [delimiter.join(units.split()[:1] + [u for u in units.split()[1:] for _ in range(joints)])]
                if units
                else []
            ),
        ]
        columns = ([start + t * scales[0]] if time else []) + [signal * scale for signal, scale in used]
        numbers = np.column_stack(columns)
        rows = [
            delimiter.join(f"{x:.17g}" if i == 0 and time else f"{x:.9g}" for i, x in enumerate(row)) for row in numbers
        ]
        file.write_text("\n".join([*text, *rows]) + "\n")

    return write


ONE = (1.0, 1.0, 1.0, 1.0)
DEGREES = (1.0, DEG, DEG, 1.0)
SINCE_1970 = 1.75e9
# name: writer, scales of time and signals, start of the time in its unit, joints, suffix of the efforts' symbol
RIGHT = {
    "rtde": (csv("actual_q_{}", "actual_qd_{}", "actual_current_{}", first=0, delimiter=" ", time="timestamp"), ONE,
             81234.5, 6),
    "rostopic echo -p": (csv("field.position{}", "field.velocity{}", "field.effort{}", first=0, time="%time"),
                         (1e9, 1, 1, 1), SINCE_1970 * 1e9, 4),
    "crtk": (csv("/PSM9/measured_js/position[{}]", "/PSM9/measured_js/velocity[{}]", "/PSM9/measured_js/effort[{}]",
                 first=0, time="/PSM9/measured_js/header/stamp"), ONE, SINCE_1970, 4),
    "franka": (csv("q[{}]", "dq[{}]", "tau_J[{}]", first=0, time="time [ms]"), (1e3, 1, 1, 1), 0.0, 7),
    "kuka fri": (csv("measuredJointPosition_A{}", "measuredJointVelocity_A{}", "measuredTorque_A{}"), ONE, 0.0, 7),
    "kinova": (csv("actuators[{}].position", "actuators[{}].velocity", "actuators[{}].torque", first=0), DEGREES, 0.0,
               7),
    "plotjuggler": (csv("/joint_states/panda_joint{}/position", "/joint_states/panda_joint{}/velocity",
                        "/joint_states/panda_joint{}/effort", time="__time"), ONE, SINCE_1970, 7),
    "one joint": (csv("pos", "vel", "eff"), ONE, 0.0, 1),
    "Joint1_Pos": (csv("Joint{}_Pos", "Joint{}_Vel", "Joint{}_Torque", delimiter=";"), ONE, 0.0, 3),
    "units after a stroke": (csv("q{} / deg", "dq{} / deg/s", "tau{} / Nm", time="time / ms"), (1e3, DEG, DEG, 1),
                             0.0, 3),
    "units after a dash": (csv("q{}_deg", "dq{}_deg_s", "tau{}_Nm", time="time_ms"), (1e3, DEG, DEG, 1), 0.0, 3),
    "units in round brackets": (csv("q{} (deg)", "dq{} (deg/s)", "tau{} (mN m)", time="Time (s)"), (1, DEG, DEG, 1e3),
                               0.0, 3),
    "units in square brackets": (csv("q{} [deg]", "dq{} [rad/s]", "current{} [mA]", time="t [us]"), (1e6, DEG, 1, 1e3),
                                0.0, 3),
    "a row of units": (csv("q{}", "dq{}", "tau{}", units="ms deg deg/s Nm"), (1e3, DEG, DEG, 1), 0.0, 3),
    "microseconds since 1970": (csv("q{}", "qd{}", "tau{}", time="timestamp"), (1e6, 1, 1, 1), SINCE_1970 * 1e6, 3),
    "milliseconds without a unit": (csv("q{}", "qd{}", "tau{}", time="t"), (1e3, 1, 1, 1), 0.0, 3),
    "ang": (csv("ang{}", "vel{}", "cur{}"), ONE, 0.0, 3),
    "q_raw": (csv("q_raw_{}", "tau_raw_{}", first=0, time="t_s"), ONE, 0.0, 3),
    "velocities in degrees": (csv("q{}", "dq{}", "tau{}"), (1, 1, DEG, 1), 0.0, 3),
    "no time": (csv("q{}", "dq{}", "tau{}", time=""), ONE, 0.0, 3),
    "a counter as time": (csv("q{}", "dq{}", "tau{}", time="t"), (RATE, 1, 1, 1), 0.0, 3),
}  # fmt: skip


def folder_of(tmp_path, dialect: str, *, repeats: tuple[bool, ...] = (True, False)) -> dict[str, Signals]:
    """A folder with logs of one dialect: one whose motion repeats, and another."""
    write, scales, start, joints = RIGHT[dialect]
    logs = {f"run_{k}": recorded(k, joints, again) for k, again in enumerate(repeats)}
    for name, (t, q, dq, tau) in logs.items():
        q = q * (0.25 if joints > 3 else 0.6)  # a third joint whose angle would also fit a slide in metres
        logs[name] = (t, q, dq * (0.25 if joints > 3 else 0.6), tau)
        write(tmp_path / f"{name}.csv", logs[name], scales, start)
    return logs


def require_right(folder, logs: dict[str, Signals], dialect: str) -> None:
    """What `ingest` reads is what was written, in SI."""
    call("ingest", folder)
    study = reading.read(folder)
    assert study.robot.name not in ("davinci", "dvrk_psm"), dialect
    table = davinci_forces.read(folder, "Recording")
    for name, (t, *signals) in logs.items():
        for k, joint in enumerate(study.robot.joints):
            rows = table[(table["log"] == name) & (table["joint"] == joint.name)]
            assert len(rows) == len(t), (name, joint.name)
            assert np.allclose(rows["t"], t - t[0], atol=2e-6), name
            for symbol, signal in zip(("q", "dq", "tau"), signals, strict=True):
                if symbol != "dq" or (rows["velocity"] == "logged").all():
                    assert np.allclose(rows[symbol], signal[:, k], rtol=1e-6, atol=1e-6), (name, joint.name, symbol)


@pytest.mark.parametrize("dialect", RIGHT)
def test_a_folder_of_the_field_is_read_right_without_an_edit(tmp_path, dialect):
    logs = folder_of(tmp_path / "", dialect)
    call("new", tmp_path)
    assert [entry.role for entry in reading.read(tmp_path).logs] == ["identification", "validation"]
    require_right(tmp_path, logs, dialect)


@pytest.mark.parametrize("suffix", ["h5", "mat"])
def test_matrices_are_read_right_without_an_edit(tmp_path, suffix):
    logs = {f"run_{k}": recorded(k, 3, repeats=k == 0) for k in range(2)}
    for name, (t, q, dq, tau) in logs.items():
        content = {"time": t, "q": q, "dq": dq, "tau": tau, "q_desired": q + 1}
        if suffix == "mat":
            scipy.io.savemat(tmp_path / f"{name}.mat", content)
        else:
            with h5py.File(tmp_path / f"{name}.h5", "w") as file:
                file.update(content)
    call("new", tmp_path)
    require_right(tmp_path, logs, suffix)


def said(*arguments: object) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(argument) for argument in arguments])
    return result.exit_code, result.output


def test_commands_quantities_of_the_tip_and_models_are_not_measured_at_joints(tmp_path):
    t, q, dq, tau = recorded(0, 2, repeats=True)
    wrong = [
        "q_d[{}]",
        "target_q_{}",
        "actual_TCP_pose_{}",
        "tau_ext_hat_filtered[{}]",
        "O_F_ext_hat_K[{}]",
        "tau_J_d[{}]",
    ]
    header = ["t", *(n for w in wrong for n in names(w, 2, 0)), *names("q[{}]", 2, 0), *names("tau_J[{}]", 2, 0)]
    table(tmp_path / "run.csv", t, *(np.cos(q + k) for k in range(len(wrong))), q, tau, header=",".join(header))
    call("new", tmp_path)
    require_right(tmp_path, {"run": (t, q, dq, tau)}, "franka")


@pytest.mark.parametrize(("joints", "words"), [(7, "kuka"), (7, "run"), (6, "ur5")])
def test_an_arm_of_other_joints_is_no_da_vinci_though_its_third_angle_is_small(tmp_path, joints, words):
    t, q, dq, tau = recorded(0, joints, repeats=True)
    table(tmp_path / f"{words}.csv", t, 0.05 * q, 0.05 * dq, tau)
    call("new", tmp_path)
    assert reading.read(tmp_path).robot.name == "robot"


@pytest.mark.parametrize(
    "labels", [("outer_yaw", "outer_pitch", "outer_insertion", "outer_roll"), ("yaw", "pitch", "insertion", "roll")]
)
def test_the_labels_of_the_research_kit_are_its_joints_and_its_roll_is_of_the_wrist(tmp_path, labels):
    t, q, dq, tau = recorded(0, 4, repeats=True)
    header = ["t", *(f"/PSM1/measured_js/{s}[{label}]" for s in ("position", "velocity", "effort") for label in labels)]
    table(tmp_path / "run.csv", t, 0.05 * q, 0.05 * dq, tau, header=",".join(header))
    call("new", tmp_path)
    study = reading.read(tmp_path)
    held = {source.quantity: source.channel for source in study.logs[0].channels}
    assert study.robot.name == "dvrk_psm"
    for joint, label in zip(("hand_roll", "hand_pitch", "instrument_slide"), labels, strict=False):
        assert held[f"{joint}.q"] == f"/PSM1/measured_js/position[{label}]"
    assert len(held) == 10


def test_two_joints_of_the_research_kit_are_known_by_its_labels(tmp_path):
    t, q, dq, tau = recorded(0, 2, repeats=True)
    labels = ("outer_yaw", "outer_pitch")
    header = ["t", *(f"{symbol}[{label}]" for symbol in ("position", "velocity", "effort") for label in labels)]
    table(tmp_path / "run.csv", t, 0.05 * q, 0.05 * dq, tau, header=",".join(header))
    call("new", tmp_path)
    study = reading.read(tmp_path)
    held = {source.quantity: source.channel for source in study.logs[0].channels}
    assert (study.robot.name, held["hand_roll.q"], held["hand_pitch.tau"]) == (
        "dvrk_psm", "position[outer_yaw]", "effort[outer_pitch]"
    )  # fmt: skip


def test_joints_in_another_order_go_by_their_names_where_a_robot_has_them(tmp_path):
    t, q, dq, tau = recorded(0, 2, repeats=True)
    header = ["t", *(f"/js/{joint}/{s}" for s in ("position", "velocity", "effort") for joint in ("elbow", "base"))]
    table(tmp_path / "run.csv", t, q, dq, tau, header=",".join(header))
    terms = 'kind = "revolute"\nterms = ["inertia", "viscous friction"]\n'
    joints = "".join(f'[[joint]]\nname = "{joint}"\n{terms}' for joint in ("base", "elbow"))
    (tmp_path / "arm.toml").write_text(f'name = "arm"\ntitle = "Arm"\n{joints}')
    call("new", tmp_path)
    held = {source.quantity: source.channel for source in reading.read(tmp_path).logs[0].channels}
    assert held["elbow.q"] == "/js/elbow/position"
    assert held["base.tau"] == "/js/base/effort"


FOLDERS = {
    "identification/run.csv": "identification", "validation/run.csv": "validation", "contact/run.csv": "contact",
    "free motion/run_2.csv": "validation", "payload/run_500g.csv": "weight", "Friction/run_3.csv": "friction",
    "payload/run_4.csv": "weight",
}  # fmt: skip


def test_words_of_folders_and_files_tell_the_role_whatever_the_channels_say(tmp_path):
    for seed, file in enumerate(FOLDERS):
        t, q, dq, tau = recorded(seed, 1, repeats=True)
        table(tmp_path / file, t, q, dq, tau, header="Time,Roll angle,Roll speed,Roll torque")
    call("new", tmp_path)
    study = reading.read(tmp_path)
    assert {entry.files[0]: entry.role for entry in study.logs} == FOLDERS
    assert len({entry.name for entry in study.logs}) == len(FOLDERS)
    text = (tmp_path / "study.toml").read_text()
    assert 'role = "contact"  # "contact" in its name' in text
    assert "\nweight = { mass = 0.5 }  # CHECK: at the tip; elsewhere also moves_with = " in text
    assert "\nweight = {}  # mass = <kg, if known>; CHECK: at the tip; " in text


def test_stillness_and_outliers_of_the_effort_tell_contact_whatever_the_channels_say(tmp_path):
    header = "Time,Roll angle,Roll speed,Roll torque"
    for name in ("a", "b"):
        t, q, dq, tau = recorded(0, 1, repeats=True)
        pushed = (t % 8 > 6)[:, None] * (name == "b")
        table(tmp_path / f"{name}.csv", t, q, dq, tau + 30 * pushed, header=header)
    table(tmp_path / "c.csv", t, 0 * q + 1, 0 * q, tau, header=header)
    _, table_shown = said("new", tmp_path)
    assert [entry.role for entry in reading.read(tmp_path).logs] == ["identification", "contact", "contact"]
    assert "outliers, as pushes make them" in table_shown
    assert "no joint moves in it" in table_shown


MISSING = {  # what is written, and what `all` says is missing
    "no time, no velocity": (csv("q{}", "tau{}", time=""), ONE, ("rate is missing", "no clock")),
    "times that velocities deny": (csv("q{}", "dq{}", "tau{}"), (1.25, 1, 1, 1), ("rate is missing", "no clock")),
    "a counter and no velocity": (csv("q{}", "tau{}", time="t"), (RATE, 1, 1, 1), ("rate is missing", "no clock")),
    "a time of unknown unit": (csv("q{}", "tau{}", time="t"), (1e6, 1, 1, 1), ("rate is missing", "no clock")),
    "angles of unknown unit": (csv("q{}", "dq{}", "tau{}"), DEGREES, ("unit is missing",)),
}


@pytest.mark.parametrize("folder", MISSING)
def test_what_is_not_known_is_missing_and_all_says_so_and_stops(tmp_path, folder):
    write, scales, says = MISSING[folder]
    for k in range(2):
        write(tmp_path / f"run_{k}.csv", recorded(k, 2, repeats=True), scales)
    shown = call("new", tmp_path)
    code, output = said("all", tmp_path, "--processed", tmp_path / "processed", "--reports", tmp_path / "reports")
    assert code == 1
    for k in range(2):
        assert any(f"run_{k}" in line and any(text in line for text in says) for line in output.splitlines()), output
    assert "rate: " in shown or "unit of" in shown
    assert "MISSING" in (tmp_path / "study.toml").read_text()


def test_a_rate_that_velocities_deny_is_proposed(tmp_path):
    MISSING["times that velocities deny"][0](tmp_path / "run.csv", recorded(0, 2, repeats=True), (1.25, 1, 1, 1))
    assert "by 'time' the rate is 100 Hz, but the velocities fit the positions at 125 Hz" in call("new", tmp_path)


def test_all_missing_keys_are_said_at_once(tmp_path):
    for name, (k, kind) in product(("identification_contact",), enumerate(("no time, no velocity",))):
        MISSING[kind][0](tmp_path / f"{name}_{k}.csv", recorded(k, 2, repeats=True), ONE)
    call("new", tmp_path)
    code, output = said("all", tmp_path)
    assert code == 1
    assert "identification_contact_0': role is missing" in output.replace("\n", "")
    assert "identification_contact_0': rate is missing" in output.replace("\n", "")


def test_a_file_that_cannot_be_read_or_used_stops_no_other(tmp_path):
    t, q, dq, tau = recorded(0, 2, repeats=True)
    table(tmp_path / "run.csv", t, q, dq, tau, header="t,q1,q2,dq1,dq2,tau1,tau2")
    table(tmp_path / "weather.csv", t, q, header="t,humidity,pressure")
    (tmp_path / "broken.tdms").write_bytes(b"TDSm" + bytes(9))
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "notes.md").write_text("# notes\n")
    code, shown = said("new", tmp_path)
    text = (tmp_path / "study.toml").read_text()
    assert code == 0
    assert [entry.name for entry in reading.read(tmp_path).logs] == ["run"]
    for file in ("weather", "broken.tdms", "empty.csv"):
        assert f"# {file}: left out: " in text
    assert shown.count("left out") == 3
    assert "notes" not in text


def test_nothing_is_written_where_no_file_can_be_read(tmp_path):
    (tmp_path / "empty.csv").write_text("")
    code, shown = said("new", tmp_path)
    assert code == 1
    assert "is empty" in shown
    assert not (tmp_path / "study.toml").exists()


@pytest.mark.parametrize("approach", [0.0, 5.0])
def test_probes_that_touch_from_the_start_are_in_contact_throughout(tmp_path, approach):
    depth = np.tile(np.linspace(0, 10, 30), 6)
    force = np.maximum(depth - approach, 0) ** 1.5 * 0.1
    table(tmp_path / "probes.csv", np.repeat(np.arange(6), 30), depth, force, header="probe,depth_mm,force_N")
    call("new", tmp_path)
    [entry] = reading.read(tmp_path).logs
    assert entry.role == "tissue"
    assert bool(entry.contact) is (approach == 0.0)


def test_the_report_says_what_a_missing_contact_changes(tmp_path):
    depth = np.tile(np.linspace(0, 10, 30), 6)
    table(
        tmp_path / "raw/a/probes.csv",
        np.repeat(np.arange(6), 30),
        depth,
        0.1 * depth**1.5,
        header="probe,depth_mm,force_N",
    )
    call("new", tmp_path / "raw/a")
    file = tmp_path / "raw/a/study.toml"
    file.write_text(file.read_text().replace('contact = "all"', '# contact = "all"'))
    call("palpate", tmp_path / "raw/a")
    said_of = davinci_forces.read(tmp_path / "raw/a", "Diagnostic")
    assert any('write contact = "all"' in text for text in said_of["text"])


def bench(folder, header, *more, names=("run",)):
    """Logs of the guide's arm of three joints beside its URDF, under other names of the columns."""
    folder.mkdir(exist_ok=True)
    (folder / "bench.urdf").write_text(URDF)
    robot = davinci_forces.robot("bench.urdf", folder)
    for seed, name in enumerate(names, start=1):
        t, q, dq, ddq = arm_motion(seed, 3, 20.0, 4.0, 0.4)
        tau = measured(robot.inverse_dynamics(q, dq, ddq), dq, seed, np.array([2.0, 2.0, 1.0]))
        table(folder / f"{name}.csv", t, q, dq, tau, *(column(t) for column in more), header=header)
    return folder


@pytest.mark.parametrize(
    ("names", "doubt"),
    [(["{}_pos", "{}_vel", "{}_torque"], ""), (["pos{}", "vel{}", "tau{}"], ""), (["x{}", "y{}", "z{}"], "CHECK: ")],
)
def test_the_robot_beside_the_logs_is_taken_though_no_column_has_the_names_of_its_joints(tmp_path, names, doubt):
    columns = [name.format(joint) for name in names for joint in ("A", "B", "C")]
    call("new", bench(tmp_path, ",".join(["t", *columns])))
    text = (tmp_path / "study.toml").read_text()
    assert 'robot = "bench.urdf"' in text
    assert "with 3 joints as they have, paired in order" in text
    [entry] = reading.read(tmp_path).logs
    quantities = [f"{joint}.{symbol}" for symbol in ("q", "dq", "tau") for joint in ("pan", "lift", "elbow")]
    assert {s.quantity: s.channel for s in entry.channels if s.quantity != "time"} == dict(
        zip(quantities, columns, strict=True)
    )
    assert text.count(doubt) >= (9 if doubt else 0)


def driven(folder, header, gear=50.0):
    """The log of a bench of which the second joint is measured at its motor, by position, velocity and current."""
    bench(folder, "t,q1,q2,q3,dq1,dq2,dq3,tau1,tau2,tau3")
    table = np.genfromtxt(folder / "run.csv", delimiter=",", skip_header=1)
    table[:, 1:7] *= 180.0 / np.pi
    table[:, [2, 5]] *= gear
    np.savetxt(folder / "run.csv", table, delimiter=",", header=header, comments="")
    return folder


def test_one_joint_at_its_motor_leaves_the_others_at_the_joint_and_in_newton_metres(tmp_path):
    header = (
        "t,j1_pos_deg,j2_motor_pos_deg,j3_pos_deg,j1_vel,j2_motor_vel,j3_vel,j1_torque_Nm,j2_current_A,j3_torque_Nm"
    )
    call("new", driven(tmp_path, header))
    [entry] = reading.read(tmp_path).logs
    quantities = {s.channel: s.quantity for s in entry.channels}
    assert {quantities[name] for name in ("j2_motor_pos_deg", "j2_motor_vel", "j2_current_A")} == {
        "lift.theta_m", "lift.dtheta_m", "lift.i"
    }  # fmt: skip
    assert [quantities[f"j{k}_torque_Nm"] for k in (1, 3)] == ["pan.tau", "elbow.tau"]
    text = (tmp_path / "study.toml").read_text()
    assert '"lift.dtheta_m" = { channel = "j2_motor_vel", unit = "deg/s" }' in text
    assert re.findall(r"\[robot_overrides\.(.*)\]", text) == ["lift"]


def test_a_current_without_a_position_is_not_called_a_joint_at_rest(tmp_path):
    header = "t,j1_pos_deg,x,j3_pos_deg,j1_vel,y,j3_vel,j1_torque_Nm,j2_current_A,j3_torque_Nm"
    table = call("new", driven(tmp_path, header))
    assert "no position of lift" in " ".join(table.split())
    assert '# "lift.i" = "j2_current_A"  # CHECK: no position of the joint' in (tmp_path / "study.toml").read_text()


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (('name="elbow" type="revolute"', 'name="elbow" type="fixed"'), "bench.urdf has 2, so it is not taken"),
        (('child link="fore"', 'child link="lost"'), "bench.urdf cannot be read: line 13: <joint name='elbow'>"),
    ],
)
def test_why_the_robot_beside_the_logs_is_not_taken_is_said(tmp_path, change, why):
    bench(tmp_path, "t,q1,q2,q3,dq1,dq2,dq3,tau1,tau2,tau3")
    (tmp_path / "bench.urdf").write_text(URDF.replace(*change, 1))
    assert (
        f"written for the 3 joints of the logs, as no shipped robot (davinci, dvrk_psm) is recognised; {why}"
        in " ".join(call("new", tmp_path).split())
    )


def test_a_force_sensor_beside_joints_is_proposed_and_what_a_controller_estimates_is_not(tmp_path):
    header = "t,q1,q2,q3,dq1,dq2,dq3,tau1,tau2,tau3,force_sensor,actual_TCP_force_0,ext_force"
    call("new", bench(tmp_path, header, np.sin, np.cos, np.tanh))
    [entry] = reading.read(tmp_path).logs
    assert [s.channel for s in entry.channels if s.quantity == "force"] == ["force_sensor"]
    assert (
        "CHECK THIS; compared with the estimate; sign = -1 for a sensor of the force on the robot"
        in (tmp_path / "study.toml").read_text()
    )


def test_where_no_log_can_be_used_the_last_line_says_what_to_do(tmp_path):
    (tmp_path / "notes.csv").write_text("t,weather,mood\n" + "".join(f"{k},{k % 7},{k % 5}\n" for k in range(50)))
    last = call("new", tmp_path).strip().splitlines()[-1]
    assert "written, but no log can be used as it is: give its lines the position and the effort of each joint" in last


def test_contact_told_by_the_efforts_of_several_joints_is_to_be_checked(tmp_path):
    bench(tmp_path, "t,q1,q2,q3,dq1,dq2,dq3,tau1,tau2,tau3", names=("a", "b"))
    rows = np.loadtxt(tmp_path / "b.csv", delimiter=",", skiprows=1)
    rows[:, 7] += 20 * np.sin(7 * rows[:, 0])
    table(tmp_path / "b.csv", rows, header="t,q1,q2,q3,dq1,dq2,dq3,tau1,tau2,tau3")
    call("new", tmp_path)
    assert [entry.role for entry in reading.read(tmp_path).logs] == ["identification", "contact"]
    assert 'role = "contact"  # CHECK: a contact, or coupled joints: ' in (tmp_path / "study.toml").read_text()


def test_rostopic_s_columns_of_names_tell_the_joints_and_its_stamps_the_times(tmp_path):
    t, *signals = recorded(0, 4, repeats=True)
    columns = [f"field.{word}{k}" for word in ("name", "position", "velocity", "effort") for k in range(4)]
    with (tmp_path / "run.csv").open("w") as file:
        file.write(f"%time,field.header.stamp,{','.join(columns)}\n")
        for row in zip(t, *signals, strict=True):
            cells = [f"{x:.6f}" for part in row[1:] for x in part]
            stamp = 1764000000000000000 + round(row[0] * 1e9)
            file.write(f"{stamp + 7},{stamp},outer_yaw,outer_pitch,outer_insertion,outer_roll,{','.join(cells)}\n")
    call("new", tmp_path)
    [entry] = reading.read(tmp_path).logs
    found = {source.quantity: source.channel for source in entry.channels}
    assert found.get("hand_roll.q") == "field.position0", found
    assert found["instrument_slide.tau"] == "field.effort2"
    assert found["time"] == "field.header.stamp"
    text = (tmp_path / "study.toml").read_text()
    assert '# time = "time"  # a time that is not used' in text
    assert "field.name" not in text
    other = '# "<joint>.<quantity>" = "field.effort3"  # field.effort[outer_roll], no joint of dvrk_psm'
    assert other in text
