"""Every export format: what each file says first, and numbers that a stranger computes from the files alone."""

import json
import re
import shutil
import subprocess
from dataclasses import replace
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces import robots
from davinci_forces.errors import BadRequest, BadRobot
from davinci_forces.exports import FORMATS, renderer, urdf
from davinci_forces.exports.identified import SAFETY, export_of, least_velocity
from davinci_forces.filters import DEFAULT
from davinci_forces.identification.regression import motion_at
from davinci_forces.maths.mechanics import rigid_body
from davinci_forces.maths.mechanics.bodies import pseudo_inertias
from davinci_forces.maths.models.memory import efforts
from davinci_forces.maths.signals.smoothing import delay_segments, measured_motion
from davinci_forces.records import Choice, FreeSpace, JointModel, Motion
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.robots.davinci import ROBOT as DAVINCI
from davinci_forces.robots.dvrk_psm import ROBOT as PSM
from davinci_forces.robots.urdf import writing
from tests import arm as tested_arm
from tests import exported as exported_models
from tests.compiled_model import FLAGS, same_along_logs
from tests.conftest import ROOT
from tests.exported import ORIGIN, RATE, export, motion


@pytest.fixture
def small(lab, catalogue):
    """The export of the small study, each joint by itself."""
    return export_of(replace(lab.study, simulated=True), catalogue, ORIGIN)


@pytest.mark.parametrize("name", sorted(set(FORMATS) - {"urdf"}))
def test_every_file_says_where_it_comes_from_and_that_it_is_no_medical_device(name, small):
    files = renderer(name)(small).files
    assert files == renderer(name)(small).files
    for file, text in files.items():
        assert re.fullmatch(r"[a-z_./]+", file)
        for line in (ORIGIN.report_id, ORIGIN.version, SAFETY, "SIMULATED", f"exported despite: {ORIGIN.despite[0]}"):
            assert line in text, (file, line)
        assert "valid in the range of" in text or file.endswith("schema.json")
    honest = replace(small, origin=ORIGIN._replace(despite=()), study=replace(small.study, simulated=False))
    assert not any(
        word in text for text in renderer(name)(honest).files.values() for word in ("SIMULATED:", "despite: ")
    )


def test_a_band_that_is_too_narrow_is_warned_of_by_logs_that_no_fit_used(small):
    def warnings(*of_logs):
        spaces = [SimpleNamespace(joint="hand_roll", log=log, role=role, filter=DEFAULT, coverage=share)
                  for log, role, share in of_logs]  # fmt: skip
        catalogue = Catalogue(lambda kind: spaces if kind is FreeSpace else ())
        return [line for line in replace(small, catalogue=catalogue).remarks() if "+-1.96 std" in line]

    fitted = ("fitted", "identification", 0.5)
    assert not warnings()
    assert not warnings(fitted, ("other", "validation", 0.9))
    told = warnings(fitted, ("other", "validation", 0.95), ("worse", "contact", 0.78))
    assert told == [
        "warning: hand_roll: as samples arrive, +-1.96 std covers 78 % of its free motion in worse, not 95 %; judge "
        "its external effort by the alarm level"
    ]
    assert "50 %" in warnings(fitted)[0]


def test_limits_are_those_of_the_robot_and_null_where_it_states_none():
    for robot in (DAVINCI, PSM):
        for joint, about in zip(robot.joints, export(robot, "independent").document()["joints"], strict=True):
            assert about["limits"]["position"] == [x if np.isfinite(x) else None for x in joint.limits.q]
            largest = joint.limits.effort
            assert about["limits"]["effort"] == ([-largest, largest] if np.isfinite(largest) else [None, None])


def test_a_study_without_a_chosen_model_or_a_joint_exports_nothing(lab, catalogue):
    nothing = Catalogue(lambda kind: [] if kind is Choice else catalogue.records(kind))
    with pytest.raises(BadRequest, match="no model was chosen"):
        export_of(lab.study, nothing, ORIGIN)
    with pytest.raises(BadRobot, match="no joint 'elbow'; it has hand_roll"):
        export_of(lab.study, catalogue, ORIGIN, ["elbow"])
    assert [j.name for j in export_of(lab.study, catalogue, ORIGIN, ["hand_pitch"]).joints] == ["hand_pitch"]


def test_the_range_of_validity_is_that_of_logs_without_contact(small, catalogue):
    [roll] = [joint for joint in small.joints if joint.name == "hand_roll"]
    contact = [m for m in catalogue.select(JointModel, joint="hand_roll") if m.role == "contact"]
    assert contact
    assert max(np.abs(m.tau).max() for m in contact) > max(map(abs, roll.validity["effort"]))
    free = [m for m in catalogue.select(JointModel, joint="hand_roll") if m.role in ("identification", "validation")]
    assert roll.validity["position"] == [min(m.q_measured.min() for m in free), max(m.q_measured.max() for m in free)]


# A stranger's program: it knows the file, and nothing of this package.
FUNCTIONS = {
    "1": lambda q, dq: 1.0, "sin q": lambda q, dq: np.sin(q), "cos q": lambda q, dq: np.cos(q), "q": lambda q, dq: q,
    "dq": lambda q, dq: dq, "sign(dq)": lambda q, dq: np.sign(dq), "|dq|": lambda q, dq: abs(dq),
    "|dq| dq": lambda q, dq: abs(dq) * dq, "q dq": lambda q, dq: q * dq, "q sign(dq)": lambda q, dq: q * np.sign(dq),
    "q^2 sign(dq)": lambda q, dq: q * q * np.sign(dq), "q^2": lambda q, dq: q * q, "q^3": lambda q, dq: q**3,
    "sin 2q": lambda q, dq: np.sin(2 * q), "cos 2q": lambda q, dq: np.cos(2 * q), "sin 3q": lambda q, dq: np.sin(3 * q),
    "cos 3q": lambda q, dq: np.cos(3 * q),
}  # fmt: skip


def state(about, q, dq, segment, T):
    """z along a motion (N,) by the formulas of the file."""
    if about["kind"] == "deflection":
        z = np.zeros(len(dq))
        for k in range(len(dq) - 1):
            s = np.sign(dq[k])
            step = s - (s - z[k]) * np.exp(-abs(dq[k]) * T / about["displacement"])
            z[k + 1] = step if segment[k + 1] == segment[k] else 0.0
        return z
    if about["kind"] == "smooth sign":
        return np.tanh(dq / about["width"])
    if about["kind"] == "Stribeck":
        return np.sign(dq) * np.exp(-((dq / about["decay_velocity"]) ** 2))
    return FUNCTIONS[about["function"]](q, dq)


def turned(axis_moves, q):
    """The poses (N, 4, 4) of a joint's motion (N,): Tz(q) or Rz(q)."""
    T = np.tile(np.eye(4), (len(q), 1, 1))
    if axis_moves:
        T[:, 2, 3] = q
    else:
        T[:, :2, :2] = np.moveaxis([[np.cos(q), -np.sin(q)], [np.sin(q), np.cos(q)]], 2, 0)
    return T


def newton_euler(document, inertial, q, dq, ddq):
    """The efforts (N, n) of a chain whose links have these ten numbers, by Newton and Euler in axes of the base."""
    g, tau, links = document["gravity"], np.zeros(q.shape), document["chain"]["links"]
    up, moves, wrenches, still = np.array(document["chain"]["up"]), [], [], np.zeros((len(q), 3))
    for link in links:
        base = (np.eye(4), still, still, g * up + still)
        T, w, e, a = base if link["parent"] is None else moves[link["parent"]]
        k = link["coordinate"]
        x, v, b = still.T if k is None else (q[:, k], dq[:, k], ddq[:, k])
        v, b = v[:, None], b[:, None]
        pose = T @ np.array(link["placement"]) @ turned(link["prismatic"], x)
        z, r = pose[:, :3, 2], pose[:, :3, 3] - T[..., :3, 3]
        a = a + np.cross(e, r) + np.cross(w, np.cross(w, r))
        if link["prismatic"]:
            a = a + 2 * v * np.cross(w, z) + b * z
        else:
            e, w = e + b * z + v * np.cross(w, z), w + v * z
        moves.append((pose, w, e, a))
        m, *h, xx, xy, xz, yy, yz, zz = inertial.get(link["name"], np.zeros(10))
        R = pose[:, :3, :3]
        h, J = R @ h, R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.transpose(0, 2, 1)
        f = m * a + np.cross(e, h) + np.cross(w, np.cross(w, h))
        wrenches.append([f, np.cross(h, a) + times(J, e) + np.cross(w, times(J, w))])
    for i in reversed(range(len(links))):
        (f, n), pose, link = wrenches[i], moves[i][0], links[i]
        if link["coordinate"] is not None:
            tau[:, link["coordinate"]] += (pose[:, :3, 2] * (f if link["prismatic"] else n)).sum(axis=1)
        if link["parent"] is not None:
            above = wrenches[link["parent"]]
            above[0] = above[0] + f
            above[1] = above[1] + n + np.cross(pose[:, :3, 3] - moves[link["parent"]][0][:, :3, 3], f)
    return tau


def times(matrices, vectors):
    """Matrices (N, 3, 3) times vectors (N, 3), one by one."""
    return (matrices @ vectors[:, :, None])[:, :, 0]


TEN = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")


def predicted(document, name, q, dq, ddq, segment, T):
    """The effort (N,) of a joint along a motion of all joints (N, n), from the file alone."""
    [joint] = [joint for joint in document["joints"] if joint["name"] == name]
    i, inertial, tau = document["coordinates"].index(name), {}, np.zeros(len(q))
    for p in document["models"][joint["model"]]["parameters"]:
        if "link" in p:
            inertial.setdefault(p["link"], np.zeros(10))[TEN.index(p["inertial"])] = p["value"]
        elif p["joint"] == name:
            z = state(p["state"], q[:, i], dq[:, i], segment, T) if p["state"] else None
            phi = p["acceleration"] * ddq[:, i]
            for function, c in p["functions"].items():
                phi = phi + c * (z if function == "z" else FUNCTIONS[function](q[:, i], dq[:, i]))
            tau += p["value"] * phi
    if inertial:
        tau += newton_euler(document, inertial, q, dq, ddq)[:, i]
    return tau


@pytest.mark.parametrize("robot", [DAVINCI, PSM, DAVINCI.with_base((0.3, -0.7, 0.2))], ids=["davinci", "psm", "tilted"])
@pytest.mark.parametrize("structure", ["independent", "coupled"])
def test_a_stranger_computes_the_predicted_effort_from_the_json_alone(robot, structure):
    given = export(robot, structure)
    document = json.loads(renderer("json")(given).files["model.json"])
    moved = motion(len(robot.joints))
    for i, joint in enumerate(given.joints):
        of_joint = moved if structure == "coupled" else moved._replace(**{
            x: getattr(moved, x)[:, i : i + 1] for x in ("q", "dq", "ddq")})  # fmt: skip
        tau = efforts(joint.model, joint.fit.theta, of_joint)[:, joint.model.efforts.index(joint.name)]
        ours = predicted(document, joint.name, moved.q, moved.dq, moved.ddq, moved.segment, 1.0 / RATE)
        assert_allclose(ours, tau, rtol=0, atol=1e-12 * np.abs(tau).max())


def test_the_json_of_a_study_predicts_what_the_study_predicted(small, catalogue):
    document = json.loads(renderer("json")(small).files["model.json"])
    models = [m for m in catalogue.records(JointModel) if not m.stand_in]
    assert {m.joint for m in models} == {joint["name"] for joint in document["joints"]}
    for m in models:
        columns = [np.zeros((len(m), len(document["coordinates"]))) for _ in range(3)]
        for column, name in zip(columns, ("q", "dq", "ddq"), strict=True):
            column[:, document["coordinates"].index(m.joint)] = getattr(m, name)
        tau = predicted(document, m.joint, *columns, m.segment, 1.0 / m.rate)
        assert_allclose(tau, m.tau_hat, rtol=0, atol=1e-12 * np.abs(m.tau_hat).max())


def test_the_c_of_a_study_gives_the_study_s_numbers_along_every_log(small, tmp_path):
    assert same_along_logs(small, tmp_path) > 1000


@pytest.fixture(params=["independent", "coupled"])
def recorded(request, small, lab, catalogue):
    """An export with logs: of the small study, or of a fit of its arm with a cutoff and a lag of each joint."""
    if request.param == "independent":
        return small
    rows, n = [], len(lab.study.robot.joints)
    model = exported_models.coupled(lab.study.robot)
    fit = exported_models.fit_of(model, "coupled", exported_models.possible(model))
    fit = replace(fit, cutoff=(5.0, 17.0, 8.0)[:n], effort_lag=(0.0, -0.01, 0.013)[:n], logs=("arm",))
    of_all = next(joint.filter for joint in small.joints if joint.filter)
    for joint in lab.study.robot.joints:
        signal = tested_arm.signal(joint.name, period=5.0, periods=2, rate=of_all["rate"], log="arm")
        rows.append(tested_arm.motion(signal))
    records = Catalogue(lambda kind: rows if kind is Motion else catalogue.records(kind))
    joints = tuple(j._replace(fit=fit, model=model) for j in small.joints)
    return replace(small, catalogue=records, joints=joints)


def test_the_program_of_the_guide_finds_the_results_of_the_pipeline_in_the_table_of_samples(recorded, tmp_path):
    guide = (ROOT / "pipeline/davinci_forces/guide/how-to/export.md").read_text()
    [build, run] = re.findall(r"`((?:cc |\./main).*?)`", guide)
    (tmp_path / "mine-c").mkdir()
    files = renderer("c")(recorded).files
    for name, text in files.items():
        (tmp_path / "mine-c" / name).write_text(text)
    (tmp_path / "main.c").write_text(guide.partition("```c\n")[2].partition("```")[0])
    compiler = next((name for name in ("gcc", "clang") if shutil.which(name)), "")
    if not compiler:
        pytest.skip("no C compiler is installed, so that the program is not compiled")
    subprocess.run([compiler, *FLAGS, *build.split()[1:]], cwd=tmp_path, check=True)
    text = subprocess.check_output(run, cwd=tmp_path, text=True, shell=True)
    samples, differences = int(text.split()[0]), [float(x) for x in text.split(":")[1].split()]
    rows = [line for line in files["check.csv"].splitlines() if line[0].isdigit()]
    assert samples == len(rows) >= 250 * len(recorded.joints)
    size = max(abs(float(x)) for row in rows for x in (row.split(",")[2], *row.split(",")[-3:]))
    assert max(differences) < 1e-12 * size
    wrong = files["check.csv"].replace(rows[5], re.sub(r",[^,]*$", ",9", rows[5]))
    (tmp_path / "mine-c" / "check.csv").write_text(wrong)
    assert float(subprocess.check_output(run, cwd=tmp_path, text=True, shell=True).split()[-1]) > 1.0


def test_the_table_of_samples_has_the_motion_at_the_low_pass_and_lag_of_each_joint(recorded):
    """The samples by the functions of the signals alone, of all joints at the cutoff and lag of the one computed."""
    lines = [line for line in renderer("c")(recorded).files["check.csv"].splitlines() if not line.startswith("#")]
    columns, names = lines[0].split(","), [joint.name for joint in recorded.study.robot.joints]
    table = np.array([line.split(",") for line in lines[1:]], float)
    for i, joint in enumerate(recorded.joints):
        rows = dict(zip(columns, table[table[:, 0] == i].T, strict=True))
        row = joint.model.efforts.index(joint.name)
        cutoff, lag = joint.fit.cutoff[row], joint.fit.effort_lag[row]
        motions = recorded.catalogue.records(Motion)
        [log] = {m.log for m in motions if m.joint == joint.name and np.isin(rows["tau"], m.tau).all()}
        for name in names:
            [m] = [m for m in motions if (m.log, m.joint) == (log, name)] or [None]
            if name not in joint.model.joints:
                assert not any(rows[f"{x}.{name}"].any() for x in ("q", "dq", "ddq"))
                continue
            at = np.searchsorted(m.t, rows["t"])
            q, dq, ddq = measured_motion(m.q_measured, m.dq_measured, m.segment, m.rate, cutoff, lag)
            for x, expected in {"q": q, "dq": np.where(m.dq == 0.0, 0.0, dq), "ddq": ddq}.items():
                assert_allclose(rows[f"{x}.{name}"], expected[at], rtol=0, atol=1e-12 * np.abs(expected).max())
            if name == joint.name:
                shifted = delay_segments(m.q_measured, m.segment, lag * m.rate)
                assert_allclose(rows["q_measured"], shifted[at], rtol=0, atol=1e-12)


@pytest.mark.parametrize("velocity", ["logged", "derived"])
def test_a_velocity_is_0_in_a_log_below_the_least_velocity_after_the_low_pass_of_the_settings(velocity):
    """The rule of the header: at that low-pass, whatever the cutoff of a fit, and without its lag."""
    m = tested_arm.motion(replace(tested_arm.signal(), velocity=velocity))
    logged = m.dq_measured if velocity == "logged" else None
    dq = measured_motion(m.q_measured, logged, m.segment, m.rate, m.cutoff)[1]
    assert not m.standing.any()
    assert_array_equal(m.dq == 0.0, np.abs(dq) < least_velocity(m))
    assert_array_equal(m.dq == 0.0, motion_at(m, 5.0, 0.02).dq[:, 0] == 0.0)
    assert (m.dq == 0.0).any()


def test_the_header_states_cutoff_lag_least_velocity_and_alarm_level_with_their_units(small, catalogue):
    header = renderer("c")(small).files["model.h"]
    for joint in small.joints:
        motions = catalogue.select(Motion, joint=joint.name)
        free = [m for m in motions if m.role in ("identification", "validation") and not m.at_rest]
        of_logs, row, unit = [least_velocity(m) for m in free], joint.model.efforts.index(joint.name), joint.joint.unit
        assert (
            f" *   {joint.name}: cutoff {joint.fit.cutoff[row]:g} Hz, lag {joint.fit.effort_lag[row]:g} s, dq 0 below "
            f"{np.median(of_logs):.3g} {unit('{position}/s')}, alarm level {joint.filter['alarm_level']:.6g} "
            f"{unit('{effort}')}\n"
        ) in header
    quiet = small.joints[0]._replace(filter=small.joints[0].filter | {"alarm_level": None})
    assert "s, no alarm level\n" in renderer("c")(replace(small, joints=(quiet,))).files["model.h"]


def mistakes(schema, value, place=""):
    """Where a value is not as its schema says; only the keywords that our schema uses."""
    kinds = {"object": dict, "array": list, "string": str, "boolean": bool, "null": type(None), "integer": int}
    types = schema.get("type", [])
    types = [types] if isinstance(types, str) else types
    fits = [isinstance(value, kinds.get(t, (int, float))) and (t == "boolean" or value is not True) for t in types]
    if types and not any(fits):
        return [f"{place}: {value!r} is not {types}"]
    wrong = [f"{place}: {value!r}"] if value not in schema.get("enum", [value]) else []
    if isinstance(value, str) and not re.search(schema.get("pattern", ""), value):
        wrong.append(f"{place}: {value}")
    if isinstance(value, dict):
        wrong += [f"{place}: no {key}" for key in schema.get("required", ()) if key not in value]
        for key, content in value.items():
            inner = schema.get("properties", {}).get(key, schema.get("additionalProperties", {}))
            wrong += mistakes(inner, content, f"{place}/{key}")
    if isinstance(value, list):
        size = schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value))
        wrong += [] if size else [f"{place}: {len(value)} items"]
        wrong += [m for i, item in enumerate(value) for m in mistakes(schema.get("items", {}), item, f"{place}/{i}")]
    return wrong


@pytest.mark.parametrize("structure", ["independent", "coupled"])
def test_the_json_is_as_its_schema_says(structure):
    files = renderer("json")(export(PSM, structure)).files
    schema, document = json.loads(files["model.schema.json"]), json.loads(files["model.json"])
    assert mistakes(schema, document) == []
    next(iter(document["models"].values()))["parameters"][0].pop("std")
    assert mistakes(schema, document)
    assert set(document) - {"$schema"} == set(schema["properties"])


def identified_arm(robot):
    """A robot's arm with the consistent fit of some mechanism, and its motion and efforts."""
    model = exported_models.coupled(robot)
    fit = exported_models.fit_of(model, "coupled", exported_models.possible(model), "consistent")
    moved = motion(len(robot.joints))
    return urdf.completed_arm(robot, fit), moved, efforts(model, fit.theta, moved)


def rigid_body_efforts(arm, moved):
    return rigid_body.inverse_dynamics(arm.chain, arm.bodies, moved.q, moved.dq, moved.ddq)


def beside_bodies(arm, moved):
    """The efforts that the table lists beside the URDF, and its friction."""
    tau = np.zeros_like(moved.q)
    for about, value in arm.remainder.items():
        tau[:, arm.model.joints.index(about.joint)] += urdf.remaining_effort(about, value, arm.model, moved)
    for name, (viscous, coulomb) in arm.friction.items():
        dq = moved.dq[:, arm.model.joints.index(name)]
        tau[:, arm.model.joints.index(name)] += viscous * dq + coulomb * np.sign(dq)
    return tau


def inertial(arm: urdf.IdentifiedArm) -> np.ndarray:
    """The inertial parameters (L, 10) of the links."""
    return arm.robot.bodies.parameters(arm.model.chain.n).reshape(-1, 10)


@pytest.mark.parametrize("robot", [DAVINCI, PSM], ids=["davinci", "psm"])
def test_the_urdf_and_what_is_listed_beside_it_are_the_fit(robot):
    arm, moved, tau = identified_arm(robot)
    rigid = rigid_body_efforts(arm.robot, moved)
    assert_allclose(rigid + beside_bodies(arm, moved), tau, rtol=0, atol=1e-8 * np.abs(tau).max())
    J = pseudo_inertias(inertial(arm))
    assert (np.linalg.eigvalsh(J)[:, 0] >= -1e-12).all()
    assert (inertial(arm)[:, 0] >= 0).all()


@pytest.mark.parametrize("robot", [DAVINCI, PSM], ids=["davinci", "psm"])
def test_the_urdf_reads_back_to_the_same_efforts_here_and_in_pinocchio(robot, tmp_path):
    arm, moved, _ = identified_arm(robot)
    rigid = rigid_body_efforts(arm.robot, moved)
    text = writing.text(arm.robot, ["a -- b-"], arm.friction)
    (tmp_path / "arm.urdf").write_text(text)
    back = robots.load("arm.urdf", tmp_path)
    assert_allclose(rigid_body_efforts(back, moved), rigid, rtol=0, atol=1e-9 * np.abs(rigid).max())
    elements = ElementTree.fromstring(text)
    for name, (viscous, coulomb) in arm.friction.items():
        [dynamics] = elements.findall(f"joint[@name='{name}']/dynamics")
        assert (float(dynamics.get("damping")), float(dynamics.get("friction"))) == (viscous, coulomb)
    pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed: a rival of benchmarks, not a dependency")
    model = pin.buildModelFromXML(text, mimic=True)
    data, place = model.createData(), [model.joints[model.getJointId(j.name)] for j in robot.joints]
    theirs = []
    for row in zip(moved.q, moved.dq, moved.ddq, strict=True):
        q, dq, ddq = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        for joint, x, v, a in zip(place, *row, strict=True):
            q[joint.idx_q], dq[joint.idx_v], ddq[joint.idx_v] = x, v, a
        theirs.append(pin.rnea(model, data, q, dq, ddq)[[joint.idx_v for joint in place]])
    assert_allclose(theirs, rigid, rtol=0, atol=1e-9 * np.abs(rigid).max())


def test_bodies_are_completed_by_those_nearest_to_the_robot_s_guesses():
    model = exported_models.coupled(DAVINCI)
    guess = DAVINCI.bodies.parameters(model.chain.n)
    x = np.r_[guess, np.zeros(model.mechanism.matrix.shape[1] - len(guess))]
    arm = urdf.completed_arm(
        DAVINCI, exported_models.fit_of(model, "coupled", model.mechanism.matrix @ x, "consistent")
    )
    assert_allclose(inertial(arm).ravel(), guess, rtol=0, atol=1e-7)
    light = inertial(urdf.completed_arm(replace(DAVINCI, bodies=None), arm.fit))
    assert light[:, 0].sum() < 0.9 * guess[::10].sum()
    J = pseudo_inertias(light[light[:, 0] > 0.0])  # simulators refuse a body without any inertia
    assert (np.linalg.eigvalsh(J / J[:, 3:, 3:])[:, 0] > 1e-13).all()


@pytest.fixture
def together(lab, catalogue, monkeypatch):
    """The export of an arm whose joints move together, with a fit of them."""
    model = exported_models.coupled(lab.study.robot)
    fit = exported_models.fit_of(model, "coupled", exported_models.possible(model), "consistent")
    signals = [
        tested_arm.signal(joint.name, period=5.0, periods=2, rate=50.0, log="arm") for joint in lab.study.robot.joints
    ]
    motions = [tested_arm.motion(signal) for signal in signals]
    monkeypatch.setattr(urdf, "consistent_fits", lambda export: [fit])
    records = Catalogue(lambda kind: motions if kind is Motion else catalogue.records(kind))
    return export_of(replace(lab.study, simulated=True), records, ORIGIN)


def test_the_urdf_and_its_table_say_where_they_come_from_and_what_is_missing(together):
    files = renderer("urdf")(together).files
    assert files == renderer("urdf")(together).files
    for text in files.values():
        for line in (ORIGIN.report_id, ORIGIN.version, SAFETY, "SIMULATED", f"exported despite: {ORIGIN.despite[0]}"):
            assert line in text
    [table] = [text for name, text in files.items() if name.endswith(".md")]
    for term in (
        "| hand_roll | rotor inertia |",
        "| hand_pitch | presliding friction 1 |",
        "Stribeck",
        "| chosen model |",
    ):
        assert term in table
    assert "+1 m of" in table
    ElementTree.fromstring(files["arm.urdf"])


def test_the_urdf_of_a_joint_that_moved_beyond_its_limits_says_so(together):
    for widened, beyond in ((0.0, False), (0.01, True)):
        low, high = together.joints[0].joint.limits.q
        validity = together.joints[0].validity | {"position": [low, high + widened]}
        moved = replace(together, joints=(together.joints[0]._replace(validity=validity), *together.joints[1:]))
        files, remarks = renderer("urdf")(moved)
        text = f"warning: hand_roll moved from {low:.4g} to {high + widened:.4g} rad in its logs, beyond its limits"
        assert any(remark.startswith(text) for remark in remarks) == beyond
        assert (text in files["arm.urdf"]) == beyond


def test_of_fits_the_urdf_takes_the_one_with_which_it_errs_least_and_says_what_it_lacks(together, monkeypatch):
    [fit] = urdf.consistent_fits(together)
    is_viscous = np.array([name.startswith("viscous") for name in fit.parameter])
    worse = replace(fit, model="worse", theta=fit.theta + 100.0 * is_viscous)
    for fits in ([fit, worse], [worse, fit]):
        monkeypatch.setattr(urdf, "consistent_fits", lambda export, fits=fits: fits)
        files, remarks = renderer("urdf")(together)
        assert remarks[0].startswith(f"fit {'.'.join(fit.key)}: of 2")
        assert re.search(r"^warning: a URDF cannot hold hand_roll \w+.* \d+ %", remarks[-1])
        assert all(line in text for text in files.values() for line in remarks)


@pytest.mark.parametrize("std", [0.1, 0.3])
@pytest.mark.parametrize("name", sorted(set(FORMATS) - {"urdf"}))
def test_a_negative_spring_or_friction_is_remarked_on_and_a_negative_offset_is_not(name, std, small):
    """A spring is, if it is beyond its 95 % error."""
    joint = small.joints[0]
    for term in joint.model.terms:
        theta = np.where([str(p) == term.name for p in joint.fit.parameter], -0.5, np.abs(joint.fit.theta))
        joints = (joint._replace(fit=replace(joint.fit, theta=theta, theta_std=np.full(len(theta), std))),)
        files, remarks = renderer(name)(replace(small, joints=joints))
        assert len(remarks) == int(term.positive or (term.name == "stiffness" and std < 0.2))
        for line in remarks:
            assert f"{term.name} is negative, -0.5 +- " in line
            assert all(line in text for text in files.values())


def test_a_urdf_needs_newtons_and_a_chain_and_a_log_of_the_whole_arm(small):
    with pytest.raises(BadRequest, match="no identification log moves the joints together"):
        renderer("urdf")(small)
    with pytest.raises(BadRequest, match="whole arm; leave --joint out"):
        renderer("urdf")(replace(small, joints=small.joints[:1]))
    joints = tuple(joint._replace(joint=replace(joint.joint, effort="A")) for joint in small.joints)
    bare = replace(small.study, robot=replace(small.study.robot, chain=None))
    with pytest.raises(BadRequest, match=r"that of hand_roll.* is in A; state torque_constant; and the geometry"):
        renderer("urdf")(replace(small, joints=joints, study=bare))
