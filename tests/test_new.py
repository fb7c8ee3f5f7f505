"""What `new` makes of logs that nobody described: by content, by numbers in names, by motion and by size."""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import davinci_forces
from davinci_forces import robots
from davinci_forces.logs.log import Channel
from davinci_forces.maths.signals import columns
from davinci_forces.robots import davinci
from davinci_forces.robots.robot import Kind
from davinci_forces.study import reading
from davinci_forces.study.holding import Holding
from davinci_forces.study.joint_names import by_joint_names
from davinci_forces.study.names import words_of
from davinci_forces.study.roles import GUESSED, WIDER, Evidence, roles_of
from tests.logs.lvm_writer import Style, Write, lvm
from tests.simulation.six_joints import write
from tests.test_runs import call

RATE, PERIOD, N = 125.0, 4.0, 2000  # [Hz], [s]: four periods
UNKNOWN_NAME = f"{GUESSED}, as no word of its name is known: "
DEMO = Path(__file__).parents[1] / "raw" / "davinci-demo"


NONE_RECOGNISED = (
    "no shipped robot (davinci, dvrk_psm) is recognised; if it is one, delete study.toml and run `new` again with "
    "--robot and its name"
)


def motion(joints: int, seed: int = 0, repeats: bool = True) -> tuple[np.ndarray, ...]:
    """Times, positions and velocities (N, joints) of smooth motion."""
    rng = np.random.default_rng(seed)
    t = np.arange(N) / RATE
    omega = 2 * np.pi / (PERIOD if repeats else 3 * N / RATE) * np.arange(1, 4 if repeats else 40)
    a, b = rng.normal(size=(2, len(omega), joints)) / np.arange(1, len(omega) + 1)[:, None]
    sin, cos = np.sin(np.outer(t, omega)), np.cos(np.outer(t, omega))
    return t, sin @ a + cos @ b, (cos * omega) @ a - (sin * omega) @ b


def effort(q: np.ndarray, dq: np.ndarray, seed: int = 1) -> np.ndarray:
    noise = np.random.default_rng(seed).normal(size=q.shape)
    return 2.0 * dq + np.sign(dq) + 5 * np.sin(q) + 0.05 * noise


def table(file, *blocks, header: str = ""):
    file.parent.mkdir(parents=True, exist_ok=True)
    np.savetxt(file, np.column_stack(blocks), delimiter=",", fmt="%.9g", header=header, comments="")
    return file


def new(*files) -> str:
    """What `new` says, having written study.toml beside the logs."""
    return call("new", *files)


def held(folder, number: int = 0) -> dict[str, object]:
    entry = reading.read(folder).logs[number]
    return {source.quantity: source.channel for source in entry.channels}


def test_columns_without_names_are_told_by_what_they_hold(tmp_path):
    t, q, dq = motion(4)
    new(table(tmp_path / "run.csv", t, q, dq, effort(q, dq)))
    expected = {"time": "column_0"}
    for k in range(4):
        expected |= {f"joint_{k + 1}.q": f"column_{1 + k}", f"joint_{k + 1}.dq": f"column_{5 + k}"}
        expected |= {f"joint_{k + 1}.tau": f"column_{9 + k}"}
    assert held(tmp_path) == expected
    text = (tmp_path / "study.toml").read_text()
    assert 'time = "column_0"  # increases throughout (125 Hz if it is in seconds)' in text
    assert text.count("CHECK: follows the velocities") == 4


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 8), st.integers(0, 3), st.integers(0, 100), st.booleans())
def test_the_number_of_joints_is_told_whatever_comes_after_the_velocities(joints, more, seed, timed):
    t, q, dq = motion(joints, seed)
    others = np.random.default_rng(seed).normal(size=(N, joints + more))
    found = columns.blocks([*q.T, *dq.T, *others.T], t if timed else None)
    assert found is not None
    assert found.n == joints
    assert found.rate == pytest.approx(1.0 if timed else RATE, rel=0.01)


def test_efforts_are_currents_where_another_block_is_the_same_but_larger():
    rng = np.random.default_rng(2)
    currents, other = rng.normal(size=(2, 3, 500))
    torques = np.array([[11.0], [12.0], [5.0]]) * currents
    moves = (0, 1, 2)
    assert columns.is_current(currents, [torques], moves)
    assert columns.is_current(currents + 0.01, [other, torques], moves)
    assert not columns.is_current(currents, [other, -torques], moves)  # another motion, or the other way round
    assert not columns.is_current(currents, [1.5 * currents, 0.1 * currents], moves)  # the same in other units
    assert not columns.is_current(currents, [np.vstack([torques[:1], other[1:]])], moves)  # one joint alone
    measured = np.vstack([currents[:1], other[1:]])  # two joints stand still: the commanded currents tell of them
    assert columns.is_current(measured, [1.2 * currents, torques], (0,))
    assert not columns.is_current(measured, [1.2 * currents, torques], (0, 1))


@settings(max_examples=25, deadline=None)
@given(st.integers(3, 24), st.integers(0, 100))
def test_noise_is_no_block_of_velocities(width, seed):
    assert columns.blocks([*np.random.default_rng(seed).normal(size=(width, 500))]) is None


@pytest.mark.parametrize("rate", [100.0, 125.0, 200.0, 500.0, 1000.0])
def test_where_there_is_no_time_the_velocities_tell_the_rate(tmp_path, rate):
    _, q, dq = motion(4)
    dq = dq * rate / RATE + np.random.default_rng(3).normal(size=dq.shape) * 0.02
    file = table(tmp_path / "run.csv", q, dq, effort(q, dq))
    new(file)
    [entry] = reading.read(tmp_path).logs
    assert entry.rate == rate
    assert f"rate = {rate!r}, at which the velocities match the derivatives of the positions" in call("inspect", file)


def test_torques_that_are_proportional_tell_that_a_block_is_of_currents(tmp_path):
    t, q, dq = motion(2)
    i = effort(q, dq)
    new(table(tmp_path / "run.csv", t, q, dq, i, i + 0.01 * np.cos(q), 12.0 * i))
    assert {"joint_1.i": "column_5", "joint_2.i": "column_6"}.items() <= held(tmp_path).items()
    assert [joint.effort for joint in robots.load("robot.toml", tmp_path).joints] == ["A", "A"]


def test_a_joint_at_rest_stays_commented_out_with_the_reason(tmp_path):
    t, q, dq = motion(4)
    q[:, 2], dq[:, 2] = 0.7 + 1e-4 * np.sin(t), 0.0
    new(table(tmp_path / "run.csv", t, q, dq, effort(q, dq)))
    assert not any(quantity.startswith("joint_3.") for quantity in held(tmp_path))
    assert '# "joint_3.q" = "column_3"  # the joint does not move' in (tmp_path / "study.toml").read_text()


def test_an_arm_with_a_chain_keeps_a_joint_at_rest_so_that_the_whole_arm_is_fitted(tmp_path):
    t, q, dq = motion(6)
    q[:, 2:], dq[:, 2:] = 0.7, 0.0
    write(tmp_path)
    new(table(tmp_path / "run.csv", t, q, dq, effort(q, dq)))
    assert held(tmp_path)["elbow.q"] == "column_3"
    note = "no unit: SI; does not move, but a model of the whole arm needs it"
    assert f"{note}\n" in (tmp_path / "study.toml").read_text()


@pytest.mark.parametrize(
    "names",
    [
        ["q{}", "dq{}", "tau{}"],
        ["/PSM1/measured_js/position[{}]", "/PSM1/measured_js/velocity[{}]", "/PSM1/measured_js/effort[{}]"],
    ],
)
@pytest.mark.parametrize("first", [0, 1])
def test_the_number_in_a_name_tells_the_joint(tmp_path, names, first):
    t, q, dq = motion(4)
    header = ",".join(["t", *(name.format(first + k) for name in names for k in range(4))])
    new(table(tmp_path / "run.csv", t, q, dq, effort(q, dq), header=header))
    for symbol, name in zip(("q", "dq", "tau"), names, strict=True):
        for k in range(4):
            assert held(tmp_path)[f"joint_{k + 1}.{symbol}"] == name.format(first + k)


def test_a_position_of_which_no_word_names_a_joint_is_in_the_table_and_wanted_and_time_are_not(tmp_path):
    t, q, dq = motion(2)
    names = [f"{joint} {quantity}" for quantity in ("position", "torque") for joint in ("Roll", "Swivel")]
    header = ",".join(["Time", *names, "Roll position setpoint"])
    said = new(table(tmp_path / "run.csv", t, 0.2 * q, effort(q, dq), 0.2 * q[:, :1], header=header))
    assert [line.count("joint of Swivel position") for line in said.splitlines() if "run.csv" in line] == [1]
    assert said.count("joint of") == 1
    text = (tmp_path / "study.toml").read_text()
    for quantity, name in (("q", "Swivel position"), ("tau", "Swivel torque")):
        assert f'# "<joint>.{quantity}" = "{name}"  # MISSING: the joint\n' in text
    assert '# "<joint>.<quantity>" = "Roll position setpoint"\n' in text


@pytest.mark.parametrize("label", ["Ins", "Insertion", "insertion"])
def test_the_slide_of_a_da_vinci_arm_is_known_by_its_short_name(tmp_path, label):
    t, q, dq = motion(3)
    names = [f"{joint} {quantity}" for quantity in ("pos", "curr (A)") for joint in ("Roll", "Pitch", label)]
    new(table(tmp_path / "run.csv", t, q * [0.2, 0.2, 0.03], effort(q, dq), header=",".join(["Time", *names])))
    assert 'robot = "davinci"' in (tmp_path / "study.toml").read_text()
    assert held(tmp_path)["instrument_slide.q"] == f"{label} pos"
    assert held(tmp_path)["instrument_slide.i"] == f"{label} curr (A)"


@pytest.mark.parametrize("name", ["ins_weight150g", "mass_150g", "load-0p15kg", "payload_of_150_g"])
def test_the_mass_is_read_wherever_the_name_states_it(tmp_path, name):
    t, q, dq = motion(1)
    new(table(tmp_path / f"{name}.csv", t, 0.2 * q, effort(q, dq), header="Time,Roll pos,Roll curr (A)"))
    assert 'role = "weight"' in (tmp_path / "study.toml").read_text()
    assert "\nweight = { mass = 0.15 }  # CHECK: at the tip" in (tmp_path / "study.toml").read_text()


def test_steps_back_and_gaps_do_not_change_the_rate_that_new_and_inspect_state(tmp_path):
    t, q, dq = motion(1)
    rows = np.arange(N)
    stamps = {"gaps": t + 15.0 * (rows // 700), "again": t - t[N // 2] * (rows >= N // 2)}
    for name, stamped in stamps.items():
        file = table(tmp_path / name / "run.csv", stamped, 0.2 * q, effort(q, dq), header="X_Value,Roll pos,Roll curr")
        assert f" at {RATE:g} Hz, " in call("inspect", file)
        if name == "gaps":
            assert f" {RATE:g} Hz " in new(file)


def test_words_in_brackets_tell_the_joint_by_their_order_and_what_was_wanted_is_left_out(tmp_path):
    t, q, dq = motion(2)
    header = "t,position[pan],position[lift],setpoint_effort[pan],setpoint_effort[lift],effort[pan],effort[lift]"
    new(table(tmp_path / "run.csv", t, q, effort(q, dq), effort(q, dq), header=header))
    assert held(tmp_path) == {
        "time": "t", "pan.q": "position[pan]", "lift.q": "position[lift]",
        "pan.tau": "effort[pan]", "lift.tau": "effort[lift]",
    }  # fmt: skip


# Templates of position, velocity (where there is one) and effort; labels of the joints; the joints; "i" or "tau".
NAMES = {
    "units that differ by joint": (
        ["Position joint {} [{}]", "Velocity joint {} [{}/s]", "Current joint {} [mA]"],
        [("1", "deg"), ("2", "deg"), ("3", "deg"), ("4", "mm")], ["joint_1", "joint_2", "joint_3", "joint_4"], "i",
    ),
    "words of joints with units": (
        ["Winkel {} [{}]", "Strom {} [A]"], [("Drehen", "°"), ("Schieben", "mm")], ["drehen", "schieben"], "i",
    ),
    "thesis": (
        ["{} theta", "{} dtheta", "{} i"], [("hand roll",), ("hand pitch",), ("instrument slide",)],
        ["hand_roll", "hand_pitch", "instrument_slide"], "i",
    ),
    "drives": (["Axis{}.ActPos", "Axis{}.ActVelo", "Axis{}.ActCurrent"], [("1",), ("2",)], ["joint_1", "joint_2"], "i"),
    "only what is actual": (
        ["{} actual", "{} current actual"], [("roll",), ("pitch",), ("slide",)],
        ["hand_roll", "hand_pitch", "instrument_slide"], "i",
    ),
    "the joint and a unit alone": (
        ["{} [{}]", "{} [{}/s]", "I {} [A]"], [("Roll", "deg"), ("Pitch", "deg"), ("Insertion", "mm")],
        ["hand_roll", "hand_pitch", "instrument_slide"], "i",
    ),
    "units after a word": (
        ["{} in {}", "{} speed in {}/s", "{} current in A"],
        [("Roll", "deg"), ("Slide", "mm")], ["hand_roll", "instrument_slide"], "i",
    ),
    "derivatives with a dot": (
        ["theta{}", "theta{}_dot", "i{}"], [("1",), ("2",), ("3",)], ["joint_1", "joint_2", "joint_3"], "i",
    ),
    "what is set and what is": (
        ["{} act pos", "{} act cur"], [("Roll",), ("Pitch",), ("Slide",)],
        ["hand_roll", "hand_pitch", "instrument_slide"], "i",
    ),
    "force of a joint": (["q_{}", "f_{}"], [("roll",), ("insertion",)], ["hand_roll", "instrument_slide"], "tau"),
    "LabVIEW's own names": (["Untitled {}"], [(k,) for k in range(9)], ["joint_1", "joint_2", "joint_3"], "tau"),
}  # fmt: skip


@pytest.mark.parametrize("kind", NAMES)
def test_names_that_laboratories_give_are_read_without_an_edit(tmp_path, kind):
    templates, labels, joints, symbol = NAMES[kind]
    names = [template.format(*label) for template in templates for label in labels]
    n = len(joints)
    t, q, dq = motion(n)
    size = 0.2 * np.array([{"deg": 57.0, "°": 57.0, "mm": 1000.0}.get(label[-1], 1.0) for label in labels[:n]])
    blocks = [size * q, size * dq, effort(q, dq)] if len(names) == 3 * n else [size * q, effort(q, dq)]
    columns = dict(zip(names, np.column_stack(blocks).T.tolist(), strict=True))
    if kind == "what is set and what is":
        columns = {f"{joint} set pos": columns[names[0]] for (joint,) in labels} | columns
    if kind == "units that differ by joint":  # of which one is not told by its name
        columns["Position joint 1 setpoint [deg]"] = columns[names[0]]
    (tmp_path / "run.lvm").write_bytes(lvm([Write(columns, x=t.tolist())], Style(encoding="utf-8-sig")))
    said = new(tmp_path / "run.lvm")
    found, symbols = held(tmp_path), ["q", "dq", symbol] if len(names) == 3 * n else ["q", symbol]
    places = [f"{joint}.{quantity}" for quantity in symbols for joint in joints]
    assert found == {"time": "X_Value", **dict(zip(places, names, strict=True))}
    slides = [joint.kind is Kind.PRISMATIC for joint in reading.read(tmp_path).robot.joints]
    assert slides[-1] == (kind not in ("drives", "LabVIEW's own names", "derivatives with a dot"))
    assert not any(slides[:-1])
    assert ("CHECK: what its channels hold" in said) == (kind in ("LabVIEW's own names", "only what is actual"))


def test_a_name_tells_the_side_of_the_motor_whose_torque_is_to_be_checked(tmp_path):
    t, q, dq = motion(1)
    for effort_name, doubt in (("roll_Imotor", 0), ("Motor torque roll", 1)):
        columns = {"roll_theta_m": q[:, 0].tolist(), "roll_omega_m": dq[:, 0].tolist()}
        columns[effort_name] = effort(q, dq)[:, 0].tolist()
        path = tmp_path / f"{doubt}" / "run.lvm"
        path.parent.mkdir()
        path.write_bytes(lvm([Write(columns, x=t.tolist())], Style(encoding="utf-8-sig")))
        new(path)
        assert held(path.parent)["hand_roll.theta_m"] == "roll_theta_m"
        assert held(path.parent)["hand_roll.dtheta_m"] == "roll_omega_m"
        text = (path.parent / "study.toml").read_text()
        assert text.count("a torque of the motor needs scale = <gear ratio>") == doubt


@pytest.mark.parametrize(
    ("unit", "symbol"), [("deg", "q"), ("deg/s", "dq"), ("mA", "i"), ("N m", "tau"), ("", "q"), ("V", "")]
)
def test_the_unit_of_a_joint_tells_the_quantity(unit, symbol):
    meanings = by_joint_names([Channel("roll", unit)], davinci.ROBOT).meanings
    assert [meaning.symbol for meaning in meanings.values()] == [symbol] * bool(symbol)
    assert all(("CHECK" in meaning.reason) == (not unit) for meaning in meanings.values())


@pytest.mark.parametrize(
    ("files", "joints"),
    [
        (("roll.lvm", "pitch.lvm"), ("hand_roll", "hand_pitch")),
        (("roll/run.lvm", "slide/run.lvm"), ("hand_roll", "instrument_slide")),
        (("joint1_a.lvm", "joint2_a.lvm"), ("joint_1", "joint_2")),
        (("Motor 0.lvm", "Motor 1.lvm", "Motor 2.lvm"), ("joint_1", "joint_2", "joint_3")),
        (("m1.lvm", "m2.lvm"), ("joint_1", "joint_1")),
    ],
)
def test_where_each_file_has_one_joint_its_name_tells_which(tmp_path, files, joints):
    for k, file in enumerate(files):
        t, q, dq = motion(1, seed=k)
        columns = {"Position (rad)": 0.1 * q, "Velocity (rad/s)": 0.1 * dq, "Current (A)": effort(q, dq)}
        (tmp_path / file).parent.mkdir(exist_ok=True)
        columns = {name: column[:, 0].tolist() for name, column in columns.items()}
        (tmp_path / file).write_bytes(lvm([Write(columns, x=t.tolist())]))
    said = new(tmp_path)
    logs = {entry.files[0]: entry for entry in reading.read(tmp_path).logs}
    for file, joint in zip(files, joints, strict=True):
        found = {source.quantity: source.channel for source in logs[file].channels}
        at_motor = "_m" * (joint == "instrument_slide")
        assert found == {
            "time": "X_Value", f"{joint}.{'theta' if at_motor else 'q'}{at_motor}": "Position (rad)",
            f"{joint}.{'dtheta' if at_motor else 'dq'}{at_motor}": "Velocity (rad/s)", f"{joint}.i": "Current (A)",
        }  # fmt: skip
    assert "CHECK" not in said.replace(GUESSED, "")


@pytest.mark.parametrize("robot", ["", "davinci"])
def test_words_in_one_and_sides_that_only_some_channels_name_are_read(tmp_path, robot):
    """`Motorwinkel` is an angle of the motor, and no name says whether a current is; letters tell the joints."""
    t, q, dq = motion(3)
    kinds = (("Motorwinkel (rad)", 30 * q), ("Motordrehzahl (rad/s)", 30 * dq), ("Strom (mA)", effort(q, dq)))
    columns = {f"Achse {'ABC'[k]} {name}": block[:, k].tolist() for k in range(3) for name, block in kinds}
    columns |= {f"Achse {'ABC'[k]} Sollwinkel (rad)": (30 * q[:, k]).tolist() for k in range(3)}
    (tmp_path / "messung.lvm").write_bytes(lvm([Write(columns, x=t.tolist())]))
    new(tmp_path, *(["--robot", robot] if robot else []))
    joints = [joint.name for joint in davinci.ROBOT.joints] if robot else ["achse_a", "achse_b", "achse_c"]
    symbols = zip(("theta_m", "dtheta_m", "i"), (name for name, _ in kinds), strict=True)
    channels = {f"{j}.{s}": f"Achse {'ABC'[k]} {n}" for s, n in symbols for k, j in enumerate(joints)}
    assert held(tmp_path) == {"time": "X_Value", **channels}
    in_order = "CHECK: which joint it is: taken in order; joint 'achse_"
    assert (tmp_path / "study.toml").read_text().count(in_order) == 9 * bool(robot)


def test_a_prefix_with_a_word_that_is_too_short_to_be_meant_is_no_quantity():
    assert (words_of("Sollposition"), words_of("Motori"), words_of("Istwert")) == (
        ["soll", "position"], ["motori"], ["istwert"],
    )  # fmt: skip


def test_pushes_that_names_tell_are_no_joint_whatever_their_values_say(tmp_path):
    t, q, dq = motion(1)
    new(table(tmp_path / "probe.csv", t, 0.01 * q, 0.01 * dq, effort(q, dq), header="time,indentation,v,load"))
    [entry] = reading.read(tmp_path).logs
    assert entry.role == "tissue"
    assert {s.quantity: s.channel for s in entry.channels} == {"time": "time", "depth": "indentation", "force": "load"}


def test_a_log_of_one_joint_that_nothing_tells_is_to_be_checked_beside_logs_of_more(tmp_path):
    t, q, dq = motion(2)
    names = [f"{quantity} {joint}" for quantity in ("q", "tau") for joint in (1, 2)]
    table(tmp_path / "both.csv", t, 0.1 * q, effort(q, dq), header=",".join(["t", *names]))
    table(tmp_path / "one.csv", t, 0.1 * q[:, :1], effort(q, dq)[:, :1], header="t,q,tau")
    said = new(tmp_path)
    assert [line.count("CHECK: what its channels hold") for line in said.splitlines() if ".csv" in line] == [0, 1]
    told = "# CHECK: which joint it is, as other logs are of more than one; by its name"
    assert (tmp_path / "study.toml").read_text().count(told) == 2


@pytest.mark.parametrize(
    ("scale", "told"),
    [
        (1.0, ""),
        (57.3, "MISSING: the unit is deg or rad; in rad, its position reaches "),
        (1e5, 'MISSING: the unit; its position reaches .*, as counts do: scale = <rad per count>, unit = "rad"'),
    ],
)
def test_a_position_that_reaches_too_far_misses_its_unit_and_one_in_counts_its_scale(tmp_path, scale, told):
    t, q, dq = motion(2)
    sizes = 0.7 / np.abs(q[:, 0]).max(), 0.05 / np.abs(q[:, 1]).max()
    header = "Time,Roll enc,Slide enc,Roll cur,Slide cur"
    said = new(table(tmp_path / "run.csv", t, scale * q * sizes, effort(q, dq), header=header))
    text = (tmp_path / "study.toml").read_text()
    assert bool(re.search(f"Roll enc.*{told}", text)) if told else "MISSING" not in text
    assert ("unit of Roll enc" in said) == bool(told)
    slide = 'MISSING: the unit; its position reaches 5e+03, as counts do: scale = <m per count>, unit = "m"'
    assert (slide in text) == (scale == 1e5)


def test_three_joints_of_which_the_third_slides_are_of_the_arm_of_the_kit(tmp_path):
    t, q, dq = motion(3)
    scale = np.array([0.2, 0.2, 0.03])
    new(table(tmp_path / "run.csv", t, q * scale, dq * scale, effort(q, dq)))
    assert 'robot = "dvrk_psm"' in (tmp_path / "study.toml").read_text()
    assert "instrument_slide.q" in held(tmp_path)
    assert not (tmp_path / "robot.toml").exists()


@pytest.mark.parametrize(
    ("joints", "range_3", "quantity", "hint"),
    [
        (
            7,
            0.1,
            "tau",
            "if it is the arm of a dVRK, run `new` again with --robot dvrk_psm, which takes the first 3 joints",
        ),
        (6, 0.1, "i", "if it is a da Vinci arm, run `new` again with --robot davinci, which takes the first 3 joints"),
        (
            7,
            0.6,
            "tau",
            NONE_RECOGNISED,
        ),
        (
            5,
            0.1,
            "tau",
            NONE_RECOGNISED,
        ),
    ],
)
def test_the_robot_that_more_joints_may_be_of_is_named_where_their_number_and_ranges_allow(
    tmp_path, joints, range_3, quantity, hint
):
    t, q, dq = motion(joints)
    scale = 1.0 / np.abs(q).max(axis=0)
    scale[2] *= range_3
    header = ",".join(["t", *(f"{symbol}{k}" for symbol in ("q", "dq", quantity) for k in range(joints))])
    file = table(tmp_path / "run.csv", t, q * scale, dq * scale, effort(q, dq), header=header)
    said = new(file)
    assert f"robot.toml: written for the {joints} joints of the logs, as " in said
    assert "no joint's motion loads another: `davinci-forces guide robot-file` adds links" in said
    [robot] = re.findall("^robot = .*", (tmp_path / "study.toml").read_text(), re.M)
    assert robot.startswith('robot = "robot.toml"')
    assert robot.endswith(hint)
    refused = call("new", file, "--robot", "dvrk_psm", code=1)
    assert "overwrites nothing: move or delete it, then run `new` again; --print shows the new text" in refused
    (tmp_path / "study.toml").unlink()
    call("new", file, "--robot", "dvrk_psm")
    assert reading.read(tmp_path).robot.name == "dvrk_psm"


@pytest.mark.parametrize(("unit", "robot"), [("m", "davinci"), ("rad", "robot.toml")])
def test_a_third_joint_whose_unit_is_of_an_angle_does_not_slide(tmp_path, unit, robot):
    t, q, dq = motion(3)
    names = [f"Encoder {k} [{unit if k == 3 else 'rad'}]" for k in (1, 2, 3)] + [f"Current {k} [A]" for k in (1, 2, 3)]
    new(table(tmp_path / "run.csv", t, q * [0.2, 0.2, 0.03], effort(q, dq), header=",".join(["Time [s]", *names])))
    assert reading.read(tmp_path).robot.file == robot * robot.endswith("toml")


def test_a_robot_file_is_taken_where_it_fits_and_never_overwritten(tmp_path):
    t, q, dq = motion(4)
    file = table(tmp_path / "run.csv", t, q, dq, effort(q, dq))
    (tmp_path / "robot.toml").write_text("mine = true\n")
    new(file)
    assert (tmp_path / "robot.toml").read_text() == "mine = true\n"
    written = (tmp_path / "robot-of-4.toml").read_text()
    (tmp_path / "study.toml").unlink()
    (tmp_path / "robot-of-4.toml").rename(tmp_path / "arm.toml")
    new(file)
    assert 'robot = "arm.toml"' in (tmp_path / "study.toml").read_text()
    assert (tmp_path / "arm.toml").read_text() == written
    assert sorted(p.name for p in tmp_path.glob("*.toml")) == ["arm.toml", "robot.toml", "study.toml"]


def test_a_written_robot_has_the_limits_that_the_logs_reach(tmp_path):
    t, q, dq = motion(2)
    wide = q * [1.0, 10.0]
    new(table(tmp_path / "run.csv", t, wide, dq * [1.0, 10.0], effort(q, dq)))
    moderate, may_be_degrees = (joint.limits for joint in robots.load("robot.toml", tmp_path).joints)
    low, high = q[:, 0].min(), q[:, 0].max()
    assert moderate.q == pytest.approx((low, high), abs=0.1 * max(-low, high))
    assert moderate.q[0] <= low + 0.01
    assert moderate.q[1] >= high - 0.01
    assert moderate.dq[1] == -moderate.dq[0] == pytest.approx(np.abs(dq[:, 0]).max(), rel=0.1)
    assert not np.isfinite([*may_be_degrees.q, *may_be_degrees.dq]).any()


def test_a_robot_file_outside_the_study_is_refused_at_once(tmp_path):
    t, q, dq = motion(2)
    file = table(tmp_path / "mine" / "run.csv", t, q, dq, effort(q, dq))
    new(table(tmp_path / "other" / "run.csv", t, q, dq, effort(q, dq)))
    for robot in ("../other/robot.toml", "robot.toml"):
        says = call("new", file, "--robot", robot, code=1)
        assert f"--robot {robot}: copy that file into {file.parent}, beside study.toml" in says
    assert [path.name for path in file.parent.iterdir()] == ["run.csv"]


def test_a_robot_file_of_the_study_may_be_named_from_the_current_folder(tmp_path):
    t, q, dq = motion(2)
    file = table(tmp_path / "mine" / "run.csv", t, q, dq, effort(q, dq))
    new(file)
    (file.parent / "study.toml").unlink()
    robot = (file.parent / "robot.toml").rename(file.parent / "arm.toml")
    call("new", file, "--robot", robot)
    assert 'robot = "arm.toml"' in (file.parent / "study.toml").read_text()


def test_motion_and_words_of_the_name_tell_what_a_log_is_for(tmp_path):
    made = {}
    for seed, (name, repeats) in enumerate({"a": True, "b": False, "c_noweight": True, "d_205g": True}.items()):
        t, q, dq = motion(4, seed, repeats)
        made[name] = table(tmp_path / f"{name}.csv", t, q, dq, effort(q, dq))
    t = np.arange(N) / RATE
    speeds = np.repeat([0.1, -0.1, 0.2, -0.2, 0.4, -0.4, 0.1, -0.1], N // 8)
    dq = np.column_stack([speeds, np.zeros((N, 3))])
    q = np.cumsum(dq, axis=0) / RATE
    made["e"] = table(tmp_path / "e.csv", t, q, dq, effort(q, dq))
    new(*made.values())
    roles = {entry.name: entry.role for entry in reading.read(tmp_path).logs}
    assert roles == {
        "a": "identification", "b": "validation", "c_noweight": "validation", "d_205g": "weight", "e": "friction",
    }  # fmt: skip
    weight = next(entry for entry in reading.read(tmp_path).logs if entry.role == "weight")
    assert (weight.weight.mass, weight.tare) == (0.205, "c_noweight")


WORDS_OF_ROLES = {
    "identification": ("sysid_01", "Ident roll", "train"),
    "validation": (
        "verification",
        "crossvalidation",
        "cross_val",
        "no contact 3",
        "frei",
        "tare",
        "other path",
        "Kreuzvalidierung",
        "roll_pruefung",
        "Überprüfung_2",
        "PRU\u0308FUNG",
        "validación",
        "ohne_last",
        "sans contact",
        "berührung/kontaktfrei",
        "verifica",
    ),
    "contact": (
        "balance_test",
        "pull_test",
        "with_force",
        "Kontakt",
        "stoß2",
        "poke3",
        "TouchTip",
        "collision",
        "Berührung",
        "contatto",
    ),
    "weight": ("hang_100g", "load100", "Gewicht", "payload0p25kg", "vægt", "poids2"),
    "friction": ("constVel", "friction_map", "Haftreibung", "frottement"),
    "tissue": ("slide_silicone", "foam block 2", "PalpationA", "gelatin"),
}


def test_words_of_several_laboratories_tell_the_role():
    for role, names in WORDS_OF_ROLES.items():
        for name in names:
            [said] = roles_of([Evidence(name, name, Holding(), slides=True)])
            assert said.role == role, name


def test_free_motion_identifies_where_no_other_log_does_and_another_tests_and_is_to_be_checked():
    def roles(*names):
        said = roles_of([Evidence(name, name, Holding(moving=(0,), ranges={0: (-1.0, 1.0)})) for name in names])
        assert all(("CHECK" in role.reason) == (role.role == "identification") for role in said)
        return [role.role for role in said]

    assert roles("free_run_a", "free_run_b", "validation") == ["identification", "identification", "validation"]
    assert roles("free_run_a", "free_run_b") == ["identification", "validation"]


@pytest.mark.parametrize("names", [("anregung", "pruefung"), ("excitación", "prueba"), ("Excitation", "essai")])
def test_the_excitation_identifies_and_the_check_validates_in_other_languages(tmp_path, names):
    for scale, name in zip((1.0, 1.1), names, strict=True):  # the check reaches farther
        t, q, dq = motion(1)
        table(tmp_path / f"roll_{name}.csv", t, scale * q, scale * dq, effort(q, dq))
    said = new(tmp_path)
    assert GUESSED not in said
    roles = {entry.name: entry.role for entry in reading.read(tmp_path).logs}
    assert list(roles.values()) == ["identification", "validation"]


def test_a_log_called_a_test_whose_effort_has_outliers_is_to_be_checked(tmp_path):
    t, q, dq = motion(1)
    pushed = 60.0 * (np.abs(t - t[N // 2]) < 0.05 * t[-1])
    table(tmp_path / "roll_excitation.csv", t, q, dq, effort(q, dq))
    table(tmp_path / "roll_test.csv", t, q, dq, effort(q, dq) + pushed[:, None])
    assert 'CHECK: "test" in its name, but the effort of joint 1 has outliers' in new(tmp_path)


@pytest.mark.parametrize("farther", [1.1, 1.5])
def test_of_two_motions_that_reach_about_as_far_the_longer_in_whole_periods_identifies(tmp_path, farther):
    t, q, dq = motion(1)
    table(tmp_path / "b.csv", t, q, dq, effort(q, dq))
    short = slice(3 * N // 4)  # three of the four periods
    table(tmp_path / "a.csv", t[short], farther * q[short], farther * dq[short], effort(q, dq)[short])
    said = new(tmp_path)
    longest_identifies = farther < WIDER
    roles = {entry.name: entry.role for entry in reading.read(tmp_path).logs}
    assert roles == dict(zip("ab", ("validation", "identification")[:: 1 if longest_identifies else -1], strict=True))
    why = "reaches hardly farther than that of b" if longest_identifies else "stays within that of a"
    assert f"{UNKNOWN_NAME}its motion {why}, which identifies" in said


def test_a_word_that_all_names_share_is_not_called_unknown(tmp_path):
    for k in (1, 2):
        t, q, dq = motion(1)
        table(tmp_path / f"test_{k}.csv", t, q / k, dq / k, effort(q, dq))
    said = new(tmp_path)
    assert said.count(GUESSED) == 2
    assert UNKNOWN_NAME not in said


def test_the_word_that_tells_an_excitation_is_quoted_as_it_stands(tmp_path):
    t, q, dq = motion(4)
    new(table(tmp_path / "exc_1.csv", t, q, dq, effort(q, dq)))
    assert 'role = "identification"  # "exc" in its name' in (tmp_path / "study.toml").read_text()


def test_where_nothing_repeats_all_logs_but_the_one_that_tests_are_identified_from(tmp_path):
    files = []
    for seed in (4, 5, 6):
        t, q, dq = motion(4, seed, repeats=False)
        files.append(table(tmp_path / f"run-{seed}.csv", t, q, dq, effort(q, dq)))
    new(*files)
    assert [entry.role for entry in reading.read(tmp_path).logs] == ["identification", "identification", "validation"]


def test_files_of_one_signal_each_are_joined(tmp_path):
    t, q, dq = motion(4)
    signals = {"q_actual": q, "qd_actual": dq, "i_actual": effort(q, dq), "i_target": effort(q, dq, 2)}
    new(*(table(tmp_path / f"No1_all__{name}.csv", t, values) for name, values in signals.items()))
    [entry] = reading.read(tmp_path).logs
    assert entry.join
    assert len(entry.files) == 4
    assert held(tmp_path)["time"] == 0
    assert held(tmp_path)["joint_2.i"] == "No1_all__i_actual/column_2"
    assert not any("target" in str(channel) for channel in held(tmp_path).values())


@pytest.mark.parametrize(("scale", "unit"), [(12.0, "mm"), (0.012, "m")])
def test_a_depth_that_is_too_large_for_metres_is_in_millimetres(tmp_path, scale, unit):
    depth = np.linspace(0, scale, 50)
    new(table(tmp_path / "probes.csv", np.arange(50) // 10, depth, depth / scale, header="probe,depth,force"))
    [entry] = reading.read(tmp_path).logs
    assert {source.quantity: source.unit for source in entry.channels}["depth"] == unit


@pytest.mark.parametrize("header", ["t", "Time (s)", "Time [s]", "elapsed s", "X_Value"])
def test_inspect_and_new_name_the_same_clock(tmp_path, header):
    t, q, dq = motion(1)
    file = table(tmp_path / "run.csv", t, q, effort(q, dq), header=f"{header},roll position,roll current")
    new(file)
    assert held(tmp_path)["time"] == header
    assert f"clock: channel '{header}'" in call("inspect", file)
    assert not reading.read(tmp_path).logs[0].rate


FOLDERS = {  # robot and roles that the recordings ask for
    "dvrk_wpi": ("dvrk_psm", ["identification", "weight", "validation"]),
    "dvrk_slide": ("dvrk_psm", ["identification", "friction", "friction", "validation"]),
    "ur10e": ("robot.toml", ["validation", "identification", "identification"]),
    "palpation": ("davinci", ["tissue", "tissue"]),
    "ur5": ("robot.toml", ["contact"]),
}


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_stranger_s_folder_becomes_a_study(data, tmp_path, folder):
    robot, roles = FOLDERS[folder]
    study = tmp_path / folder
    study.mkdir()
    for file in sorted((data / folder).glob("*.csv")):
        (study / file.name).write_bytes(file.read_bytes())
    new(*sorted(study.glob("*.csv")))
    assert f'robot = "{robot}"' in (study / "study.toml").read_text()
    assert [entry.role for entry in reading.read(study).logs] == roles
    rates = {entry.name: entry.rate for entry in reading.read(study).logs}
    if folder.startswith("dvrk"):
        assert rates == {name: 100.0 if name.startswith("slide") else 200.0 for name in rates}
    call("ingest", study)


@pytest.mark.parametrize("correction", ["# skip = 1.0", "skip = 11.0"])
def test_a_joint_of_another_arm_is_identified_from_what_new_writes_corrected_or_not(data, tmp_path, correction):
    """A slow start, five periods and a stop: by every fit, the chosen one included, however it is cross-validated."""
    study = tmp_path / "raw" / "ur10e"
    study.mkdir(parents=True)
    shutil.copy(data / "ur10e" / "joint_1.csv", study)
    new(study / "joint_1.csv")
    file = study / "study.toml"
    file.write_text(file.read_text().replace("# skip = 1.0", correction))
    for stage in ("ingest", "resample", "average", "differentiate", "fit", "choose", "predict"):
        call(stage, study)
    errors = davinci_forces.read(study, "Prediction").drop_duplicates(["model", "estimator"])
    assert {"leave one period out", "leave a block of path out"} == set(errors["scheme"])
    assert "chosen" in set(errors["model"])
    assert errors["relative_error"].max() < 0.06


def test_a_urdf_beside_the_logs_is_the_robot_and_currents_are_its_effort(data, tmp_path):
    for name in ("fourier_20s_8harm.csv", "ur10e.urdf"):
        (tmp_path / name).write_bytes((data / "ur10e" / name).read_bytes())
    new(tmp_path / "fourier_20s_8harm.csv")
    assert 'robot = "ur10e.urdf"' in (tmp_path / "study.toml").read_text()
    assert held(tmp_path)["elbow_joint.i"] == "column_15"
    assert {joint.effort for joint in reading.read(tmp_path).robot.joints} == {"A"}
    assert not (tmp_path / "robot.toml").exists()


def demonstration(tmp_path, *, neutral: bool) -> dict[str, str]:
    """What `new` makes of the logs of the demonstration: the role of each file, by its shipped name."""
    shipped = reading.read(DEMO)
    names = {file: file for entry in shipped.logs for file in entry.files}
    if neutral:  # in an order that tells nothing
        names = {f: f"log_{sum(map(ord, f[::-1])) * 7919 % 997}_{k}.{f[-4:].strip('.')}" for k, f in enumerate(names)}
    for file, name in names.items():
        shutil.copy(DEMO / file, tmp_path / name)
    new(tmp_path)
    roles = {entry.files[0]: entry.role for entry in reading.read(tmp_path).logs}
    return {file: roles[name] for file, name in names.items()}


def test_a_draft_proposes_the_settings_that_remarks_ask_for_at_their_defaults(tmp_path):
    t, q, dq = motion(2)
    new(table(tmp_path / "run.csv", t, q, dq, effort(q, dq)))
    proposed = dict(re.findall(r"^# (delay|harmonics|lowpass) = ([\d.]+)", (tmp_path / "study.toml").read_text(), re.M))
    settings = reading.read(tmp_path).settings
    assert {name: float(value) for name, value in proposed.items()} == {
        name: getattr(settings, name) for name in ("delay", "harmonics", "lowpass")
    }


def test_the_logs_of_the_demonstration_become_the_shipped_study(tmp_path):
    shipped = reading.read(DEMO)
    assert demonstration(tmp_path, neutral=False) == {entry.files[0]: entry.role for entry in shipped.logs}
    drafted = {entry.files: entry for entry in reading.read(tmp_path).logs}
    for entry in shipped.logs:
        mine = {s.quantity: str(s.channel).rpartition("/")[2] for s in drafted[entry.files].channels}
        assert mine == {s.quantity: str(s.channel).rpartition("/")[2] for s in entry.channels}


@pytest.mark.parametrize(("tests", "role"), [(True, "identification"), (False, "validation")])
def test_a_repeating_motion_within_another_identifies_too_where_one_that_does_not_repeat_tests(tmp_path, tests, role):
    t, q, dq = motion(2, repeats=True)
    table(tmp_path / "a.csv", t, q, dq, effort(q, dq))
    table(tmp_path / "b.csv", t, 0.5 * q, 0.5 * dq, effort(0.5 * q, 0.5 * dq))
    if tests:
        t, q, dq = motion(2, seed=3, repeats=False)
        table(tmp_path / "c.csv", t, 0.3 * q, 0.3 * dq, effort(0.3 * q, 0.3 * dq))
    new(tmp_path)
    assert [entry.role for entry in reading.read(tmp_path).logs] == ["identification", role] + ["validation"] * tests


@pytest.mark.parametrize(
    ("files", "joint"), [(("slide_a", "slide_b", "probe"), True), (("slide_a", "roll", "probe"), False)]
)
def test_a_log_of_one_joint_whose_name_tells_none_has_that_of_the_others(tmp_path, files, joint):
    for k, file in enumerate(files):
        t, q, dq = motion(1, seed=k)
        columns = {"Position (rad)": 20.0 * q, "Velocity (rad/s)": 20.0 * dq, "Current (A)": effort(q, dq)}
        of_joint = {name: column[:, 0].tolist() for name, column in columns.items()}
        (tmp_path / f"{file}.lvm").write_bytes(lvm([Write(of_joint, x=t.tolist())]))
    new(tmp_path)
    text = (tmp_path / "study.toml").read_text()
    of_probe = next(entry for entry in reading.read(tmp_path).logs if entry.name == "probe")
    assert (of_probe.joints == ("instrument_slide",)) == joint
    assert ("CHECK: which joint it is: taken is that of the other logs" in text) == joint


def test_a_role_that_values_tell_is_to_be_checked_where_another_log_moves_the_joint(tmp_path):
    for name, seed, size in (("a", 1, 1.0), ("b", 2, 0.5), ("slide_unknown", 1, 1.0)):
        t, q, dq = motion(2, seed=seed)
        table(tmp_path / "all" / f"{name}.csv", t, size * q, size * dq, effort(size * q, size * dq))
    said = new(tmp_path / "all")
    roles = {entry.name: entry.role for entry in reading.read(tmp_path / "all").logs}
    assert roles == {"a": "identification", "b": "validation", "slide_unknown": "weight"}
    assert f"{UNKNOWN_NAME}its motion repeats" in said
    assert f"{UNKNOWN_NAME}its motion stays within that of a" in said
    t, q, dq = motion(1)
    alone = new(table(tmp_path / "one" / "a.csv", t, q, dq, effort(q, dq)))
    assert "its motion repeats" in alone
    assert GUESSED not in alone


def test_without_their_names_motion_and_effort_tell_the_roles_of_the_demonstration(tmp_path):
    """A mass changes the effort as a drift does, and tissue is a contact: without a name, no more can be known."""
    alike = {"tissue": "contact", "weight": "validation"}
    expected = {entry.files[0]: alike.get(entry.role, entry.role) for entry in reading.read(DEMO).logs}
    expected["slide_excitation.tdms"] = "validation"  # its motion stays within that of arm_excitation
    assert demonstration(tmp_path, neutral=True) == expected
