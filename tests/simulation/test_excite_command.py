"""The command `excite`: what it prints and writes, and what it refuses."""

import json

import numpy as np
import pytest
import typer
from typer.testing import CliRunner

from davinci_forces import cli
from davinci_forces.commands import excite
from davinci_forces.errors import BadRequest, BadRobot
from davinci_forces.maths.excitation import arm
from davinci_forces.simulation.excitation import request
from tests.simulation.six_joints import write

PITCH = "-0.1912,0.2861,-0.0639,0.1741,0.3701"
app = typer.Typer()
app.command()(excite.run)


def call(*words: str) -> str:
    result = CliRunner().invoke(app, list(words), catch_exceptions=False)
    assert result.exit_code == 0
    return result.stdout


def test_json_of_given_coefficients_has_objective_coefficients_ranges_and_condition():
    found = json.loads(call("davinci", "hand_pitch", "--evaluate", PITCH, "--json"))
    assert found["objective"] == pytest.approx(-12.7527, abs=1e-3)
    assert found["coefficients"] == {"a0": -0.1912, "a1": 0.2861, "b1": -0.0639, "a2": 0.1741, "b2": 0.3701}
    assert found["ranges"]["q"] == pytest.approx([-0.6003, 0.6008], abs=1e-4)
    assert found["condition"] == pytest.approx(47.2, abs=0.1)
    assert found["within_limits"] is False


def test_a_given_trajectory_that_breaks_a_limit_is_shown_to():
    assert "LIMIT EXCEEDED: q goes from -0.6003 to 0.6008 rad, its limits are -0.6 and 0.6" in call(
        "davinci", "hand_pitch", "--evaluate", PITCH
    )


def test_a_trajectory_that_tells_nothing_is_worth_null():
    found = json.loads(call("davinci", "hand_pitch", "--evaluate", "0.1,0,0", "--json"))
    assert (found["objective"], found["condition"]) == (None, None)
    assert found["ranges"] == {"q": [0.1, 0.1], "dq": [0.0, 0.0], "ddq": [0.0, 0.0]}
    assert "objective inf" in call("davinci", "hand_pitch", "--evaluate", "0.1,0,0")


def test_the_table_for_the_controller_is_one_period_of_the_motion(tmp_path):
    call(
        "davinci",
        "instrument_slide",
        "--evaluate",
        "0.02,0.1,0.0",
        "--rate",
        "200",
        "--no-run-in",
        "--csv",
        str(tmp_path / "t.csv"),
    )
    lines = (tmp_path / "t.csv").read_text().splitlines()
    t, q, dq, ddq = np.loadtxt(lines[1:], delimiter=",").T
    w = 2 * np.pi / 5
    assert lines[0] == "t,q,dq,ddq"
    assert np.allclose(t, np.arange(1000) / 200)
    assert np.allclose(q, 0.02 + 0.1 / w * np.sin(w * t))
    assert np.allclose(dq, 0.1 * np.cos(w * t))
    assert np.allclose(ddq, -0.1 * w * np.sin(w * t))


def table(path, *words):
    call("davinci", "hand_pitch", "--evaluate", PITCH, *words, "--csv", str(path))
    return np.loadtxt(path, delimiter=",", skiprows=1).T


def test_the_table_begins_at_rest_and_runs_into_the_period_without_a_jump(tmp_path):
    t, q, dq, ddq = table(tmp_path / "t.csv")
    period = table(tmp_path / "period.csv", "--no-run-in")
    assert np.array([t, q, dq, ddq])[:, t >= 0] == pytest.approx(period)
    assert -10 <= t[0] <= -2.5
    assert (dq[0], ddq[0]) == (0, 0)
    assert np.allclose(np.diff(t), 0.01)
    assert np.abs(np.diff(q) - (dq[1:] + dq[:-1]) / 2 * 0.01).max() < 1e-6  # the trapezium's error, h^3 / 12 of jerk
    assert np.abs(np.diff(dq) - (ddq[1:] + ddq[:-1]) / 2 * 0.01).max() < 1e-6
    assert np.abs(q).max() <= 0.601  # what the period itself takes
    assert np.abs(ddq).max() <= 1.2


def test_a_run_in_that_cannot_keep_the_limits_is_refused(tmp_path):
    """Where the period begins, acceleration is at its limit and velocity is not 0."""
    words = ("--evaluate", "0,0.1,0.1,0,0.1", "--ddq", "-0.192,0.192")
    with pytest.raises(BadRequest, match="--no-run-in"):
        call("davinci", "hand_pitch", *words, "--csv", str(tmp_path / "t.csv"))
    call("davinci", "hand_pitch", *words, "--no-run-in", "--csv", str(tmp_path / "t.csv"))


def test_more_samples_of_a_period_are_worth_more():
    """det(F'F) of p columns grows with K^p."""
    few, many = (
        json.loads(call("davinci", "hand_pitch", "--evaluate", PITCH, "--samples", k, "--json"))
        for k in ("300", "3000")
    )
    assert (few["samples"], many["samples"]) == (300, 3000)
    assert few["objective"] - many["objective"] == pytest.approx(5, abs=0.01)


def test_how_far_the_starts_of_a_search_agree_is_said(laboratory):
    found = json.loads(call(laboratory, "shoulder", "--starts", "3", "--json"))
    assert found["starts"]["number"] == 3
    assert found["starts"]["best"] == pytest.approx(found["objective"], abs=1e-6)
    assert found["starts"]["best"] <= found["starts"]["median"] <= found["starts"]["worst"]
    assert "3 starts of the search: best" in call(laboratory, "shoulder", "--starts", "3")
    assert "starts" not in json.loads(call("davinci", "hand_pitch", "--evaluate", PITCH, "--json"))


def test_each_start_of_a_search_is_reported_with_the_time_to_go(laboratory):
    result = CliRunner().invoke(app, [laboratory, "shoulder", "--starts", "2", "--json"])
    first, second = result.stderr.splitlines()
    assert first.startswith("start 1 of 2: objective -")
    assert second.endswith("about 0 s to go")
    assert json.loads(result.stdout)["starts"]["number"] == 2


ARM = """
name = "arm"
[[joint]]
name = "shoulder"
kind = "revolute"
terms = ["inertia", "viscous friction"]
harmonics = 2
limits = { q = [-1.0, 1.0], dq = [-2.0, 2.0], ddq = [-5.0, 5.0] }
[[joint]]
name = "rail"
kind = "prismatic"
terms = ["inertia", "Coulomb friction"]
harmonics = 2
limits = { q = [-0.1, 0.3], dq = [-2.0, 2.0], ddq = [-5.0, 5.0] }
"""


@pytest.fixture
def laboratory(tmp_path) -> str:
    (tmp_path / "arm.toml").write_text(ARM)
    return str(tmp_path / "arm.toml")


def test_joints_of_independent_models_that_move_together_share_a_period_and_sum_their_objectives(laboratory, tmp_path):
    found = json.loads(call(laboratory, "all", "--starts", "1", "--json", "--csv", str(tmp_path / "all.csv")))
    assert list(found["joints"]) == ["shoulder", "rail"]
    assert {joint["period"] for joint in found["joints"].values()} == {10.0}
    assert found["objective"] == pytest.approx(sum(joint["objective"] for joint in found["joints"].values()))
    assert (tmp_path / "all.csv").read_text().startswith("t,shoulder.q,shoulder.dq,shoulder.ddq,rail.q")


@pytest.mark.parametrize("suffix", [".svg", ".png"])
def test_a_plot_is_the_same_bytes_twice(tmp_path, suffix):
    for name in ("one", "two"):
        call("davinci", "hand_pitch", "--evaluate", PITCH, "--plot", str(tmp_path / f"{name}{suffix}"))
    assert (tmp_path / f"one{suffix}").read_bytes() == (tmp_path / f"two{suffix}").read_bytes()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (["davinci", "hand_pitch", "--dq", "0.1,0.5"], "hand_pitch: the velocity of a periodic motion"),
        (["davinci", "hand_pitch", "--q", "2"], "--q takes lower,upper"),
        (["davinci", "hand_pitch", "--evaluate", "1,2"], "--evaluate takes a0,a1,b1,a2,b2"),
        (["davinci", "hand_pitch", "--evaluate", "1,x,2"], "value 2 is 'x', not a number"),
        (["davinci", "hand_pitch", "--evaluate", "1,nan,2"], "finite"),
        (["davinci", "all", "--evaluate", PITCH], "name it instead of `all`"),
        (["davinci", "hand_pitch", "--period", "-1"], "--period must be positive"),
        (["davinci", "hand_pitch", "--criterion", "volume"], "--criterion is one of determinant, condition"),
        (["davinci", "hand_pitch", "--evaluate", PITCH, "--plot", "a.txt"], "the name of a plot must end in"),
        (["davinci", "hand_pitch", "--evaluate", PITCH, "--rate", "nan", "--csv", "a.csv"], "--rate must be positive"),
        (["davinci", "hand_pitch", "--evaluate", PITCH, "--rate", "33.33", "--csv", "a.csv"], "whole number"),
    ],
)
def test_what_cannot_be_met_is_refused_with_the_remedy(words, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadRequest) as error:
        call(*words)
    assert says in str(error.value)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("option", "file"), [("--csv", "no/a.csv"), ("--plot", "no/a.svg")])
def test_a_file_that_cannot_be_written_is_named(option, file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = CliRunner().invoke(cli.app, ["excite", "davinci", "hand_pitch", "--evaluate", PITCH, option, file])
    assert said.exit_code == 1
    assert f"error: {file}: No such file or directory" in said.output


def test_an_unknown_joint_is_answered_with_the_joints_there_are():
    with pytest.raises(BadRobot, match="hand_roll, hand_pitch, instrument_slide"):
        call("davinci", "elbow")


def test_a_robot_of_a_laboratory_can_be_excited_too(laboratory):
    found = json.loads(call(laboratory, "shoulder", "--starts", "2", "--json"))
    assert found["within_limits"] is True


@pytest.mark.slow
def test_an_arm_of_a_urdf_is_excited_with_the_errors_that_it_may_expect(tmp_path, monkeypatch):
    """By a short search, since how good the trajectory is does not matter."""
    monkeypatch.setattr(arm, "EXPLORED", 2)
    monkeypatch.setattr(arm, "REFINED", 1)
    words = (str(write(tmp_path, 2)), "all", "--starts", "1", "--harmonics", "2", "--samples", "40")
    found = json.loads(call(*words, "--json", "--noise", "1,2", "--csv", str(tmp_path / "a.csv")))
    twice = json.loads(call(*words, "--json", "--noise", "2,4"))
    assert (found["limits_effort"], found["limits_workspace"], found["starts"]["number"]) == (True, False, 1)
    assert len(found["standard_errors"]) == found["base_parameters"]
    assert found["standard_errors"]["Coulomb friction of lift"]["unit"] == "N m"
    for name, parameter in found["standard_errors"].items():
        assert twice["standard_errors"][name]["std"] == pytest.approx(2 * parameter["std"])
    text = call(*words, "--noise", "1")
    assert "within the effort limits; no workspace stated; not checked for collisions" in text
    assert "viscous friction of pan: " in text


def test_the_errors_of_one_joint_fall_with_the_root_of_the_samples():
    few, many = (
        json.loads(call("davinci", "hand_pitch", "--evaluate", PITCH, "--noise", "0.2", "--samples", k, "--json"))
        for k in ("300", "1200")
    )
    assert few["standard_errors"]["inertia"]["std"] == pytest.approx(
        2 * many["standard_errors"]["inertia"]["std"], rel=0.01
    )
    assert few["standard_errors"]["inertia"]["unit"] == "kg m^2"


def test_a_joint_that_turns_without_limits_is_excited_within_one_turn(tmp_path):
    (tmp_path / "arm.toml").write_text(ARM.replace("q = [-1.0, 1.0], ", ""))
    found = json.loads(call(str(tmp_path / "arm.toml"), "shoulder", "--starts", "1", "--json"))
    assert found["limits"]["q"] == pytest.approx([-np.pi, np.pi])


def test_a_joint_without_limits_is_not_excited(tmp_path):
    (tmp_path / "arm.toml").write_text(
        ARM.replace("limits = { q = [-1.0, 1.0], dq = [-2.0, 2.0], ddq = [-5.0, 5.0] }", "")
    )
    shoulder = (str(tmp_path / "arm.toml"), "shoulder")
    with pytest.raises(BadRequest, match=r"shoulder: no limits of q and dq are stated, .* give --q and --dq"):
        call(*shoulder)
    with pytest.raises(BadRequest, match="no limits of dq are stated"):
        call(*shoulder, "--q", "-1,1")
    limited = (*shoulder, "--dq", "-1,1", "--starts", "1")
    assert json.loads(call(*limited, "--json"))["limits"]["ddq"] == [None, None]
    lines = {line.split()[0]: line for line in call(*limited).splitlines()}
    assert [name for name in ("q", "dq", "ddq") if "CHECK" in lines[name]] == ["q", "ddq"]


def test_a_robot_file_that_is_elsewhere_is_refused_with_the_remedy(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("robot.toml", "robot.urdf"):
        with pytest.raises(BadRobot, match="run this in the folder of the file, or give its path"):
            call(name, "shoulder")


@pytest.mark.parametrize("noise", ["0", "-1", "1,2", "x"])
def test_noise_is_positive_and_one_or_one_for_each_joint(noise):
    with pytest.raises(BadRequest, match="--noise"):
        call("davinci", "hand_pitch", "--evaluate", PITCH, "--noise", noise)


def test_a_stated_workspace_limits_the_search(monkeypatch):
    def refuse(problem, *_):
        raise ValueError(f"around it is {problem.limits.obstacles}")

    monkeypatch.setattr(request.arm, "design_together", refuse)
    with pytest.raises(BadRequest, match=r"floor=-0\.2, boxes=\(\(0\.0, 1\.0, 2\.0, 3\.0, 4\.0, 5\.0\),\)"):
        call("davinci", "all", "--floor", "-0.2", "--box", "0,1,2,3,4,5")
    with pytest.raises(BadRequest, match=r"floor=-inf, boxes=\(\)"):
        call("davinci", "all")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("all", "--box", "0,0,0,1,1"), "--box takes the lowest x,y,z and, all higher,"),
        (("all", "--box", "1,0,0,0,1,1"), "all higher, the highest x,y,z, not '1,0,0,0,1,1'"),
        (("all", "--floor", "nan"), "--floor must be a number"),
        (("hand_pitch", "--floor", "0"), "--floor and --box take `all` joints"),
    ],
)
def test_a_workspace_that_makes_no_sense_is_refused(words, says):
    with pytest.raises(BadRequest, match=says):
        call("davinci", *words)
