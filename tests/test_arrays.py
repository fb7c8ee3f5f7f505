"""From arrays to models and external efforts: the numbers of a study on the same arrays, and one message of errors."""

import doctest
import gc
import pickle
import re
import shutil
import tomllib
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

import davinci_forces
from davinci_forces import arrays
from davinci_forces.arrays import IdentifiedArm
from davinci_forces.errors import BadRequest, BadRobot, NotAFile
from davinci_forces.maths.models.independent import regressor
from davinci_forces.records import Contact, Fit, FreeSpace, JointModel, PathShare, Record, Threshold, Track, store
from davinci_forces.records.record import COLUMN_DTYPES
from davinci_forces.report.verdicts import BEYOND
from davinci_forces.robots.robot import UNLIMITED
from davinci_forces.runner import runs
from davinci_forces.study import reading
from tests import arm
from tests.report.report_records import free_space

SHORT = {"periods": 6, "rate": 50.0}
JOINT = "hand_roll"
FIRST = arm.signal(JOINT, period=2.0, **SHORT)
SECOND = arm.signal(JOINT, period=3.0, seed=1, **SHORT)
PUSHED = arm.signal(JOINT, period=2.6, seed=2, external=lambda t: np.where((t > 4) & (t < 6), 1.0, 0.0), **SHORT)


@pytest.fixture(scope="module", autouse=True)
def _coarse_search():
    """No test asks which model is found, only whether arrays and a study find the same."""
    with arm.searched_coarsely():
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A study of the same signals as files, written by hand."""
    home = tmp_path_factory.mktemp("by-hand") / "raw" / "study"
    logs = {"first": FIRST, "second": SECOND, "pushed": PUSHED}
    tables = ['title = "By hand"\nrobot = "arm.toml"\nsimulated = true\n']
    for name, signal in logs.items():
        arm.write_csv(home / f"{name}.csv", [signal])
        role = "contact" if name == "pushed" else "identification"
        more = "period = 2.0" if name == "first" else ""
        tables.append(arm.log_table(name, f"{name}.csv", role, [JOINT], more))
    arm.write_robot(home)
    (home / "study.toml").write_text("".join(tables))
    assert davinci_forces.run(home, "measure", quiet=True)
    return home


@pytest.fixture(scope="module")
def identified(folder) -> IdentifiedArm:
    """What two arrays a log give, with the robot of the same file."""
    t, q, dq, tau = ([getattr(log, name) for log in (FIRST, SECOND)] for name in ("t", "q", "dq", "tau"))
    return davinci_forces.identify(folder / "arm.toml", t, q, tau, dq=dq, joints=JOINT, period=[2.0, None])


def of_study(folder: Path, kind: type[Record]) -> list[Record]:
    processed = runs.folders(folder, None, None).processed
    files = sorted((processed / kind.folder()).rglob("*.parquet"))
    return [store.read(kind, processed, file.relative_to(processed)) for file in files]


def assert_equal_numbers(record: Record, expected: Record) -> None:
    for name in record.columns():
        if COLUMN_DTYPES[type(record).__dataclass_fields__[name].type] is np.object_:
            assert getattr(record, name).tolist() == getattr(expected, name).tolist()
        else:
            assert_allclose(getattr(record, name), getattr(expected, name), rtol=1e-12, atol=1e-12)
    for name in record.scalars():
        value = getattr(record, name)
        if isinstance(value, float):
            assert_allclose(value, getattr(expected, name), rtol=1e-12, atol=1e-12)


def test_the_parameters_are_those_of_a_study_on_the_same_arrays(folder, identified):
    [fit] = identified.record
    [same] = [f for f in of_study(folder, Fit) if f.key == fit.key]
    assert_equal_numbers(fit, same)
    frame = identified.parameters
    assert_allclose(frame["value"], same.theta, rtol=1e-12)
    assert_allclose(frame["std"], same.theta_std, rtol=1e-12)


def test_the_external_effort_and_its_contacts_are_those_of_a_study_on_the_same_arrays(folder, identified):
    effort = identified.external_effort(PUSHED.t, PUSHED.q, PUSHED.tau, dq=PUSHED.dq)
    [same] = [track for track in of_study(folder, Track) if track.log == "pushed"]
    assert_equal_numbers(effort.record[0], same)
    assert_allclose(effort.tau_ext[JOINT], same.tau_ext_smooth, rtol=1e-12, atol=1e-12)
    assert_allclose(effort.std[JOINT], same.tau_ext_smooth_std, rtol=1e-12)
    assert_allclose(effort.t, same.t, rtol=1e-12)
    [contact] = of_study(folder, Contact)
    assert_equal_numbers(effort.contact_record[0], contact)
    assert effort.contacts["joint"].tolist() == [JOINT] * len(contact)
    assert_allclose(effort.contacts["peak"], contact.peak, rtol=1e-12)
    assert not effort.contacts["small"].any()
    assert effort.contacts["alarm_level"].unique().tolist() == [contact.alarm_level]
    weak = replace(contact, peak=1.5 * contact.alarm_level * np.sign(contact.peak), stated=0 * contact.stated)
    for above in (0, 1):
        of = replace(effort, contact_record=(contact, replace(weak, above=np.full(len(weak), above))))
        assert of.contacts["small"].tolist() == [False] * len(contact) + [True] * len(weak)
        assert f"{len(contact) + above * len(weak)} contacts of joints" in repr(of)
        assert "middle_mean" in repr(of)


def test_the_predicted_effort_is_that_of_a_study_and_needs_no_effort(folder, identified):
    [same] = [model for model in of_study(folder, JointModel) if model.log == "pushed"]
    predicted = identified.predict(PUSHED.t, PUSHED.q, dq=PUSHED.dq)[JOINT]
    assert_allclose(predicted["tau"], same.tau_hat, rtol=1e-12, atol=1e-12)
    assert_allclose(predicted.index, same.t, rtol=1e-12)


def test_the_band_of_a_predicted_effort_holds_the_true_one_of_a_path_that_was_not_fitted(identified):
    predicted = identified.predict(PUSHED.t, PUSHED.q, dq=PUSHED.dq)[JOINT]
    truth = regressor(arm.joint(JOINT).terms, *arm.excitation(JOINT, PUSHED.t, 2.6)) @ arm.THETA[JOINT]
    error = np.abs(predicted["tau"] - truth)
    assert np.mean(error < 1.96 * predicted["std"]) > 0.95
    assert predicted["std"].max() < 0.5 * arm.NOISE[JOINT]  # so wide that the test says nothing


def test_a_saved_study_gives_the_numbers_of_the_arrays_and_a_stream(identified, tmp_path):
    folder = identified.save(tmp_path / "raw" / "saved")
    assert davinci_forces.run(folder, "calibrate", quiet=True)
    for fit in of_study(folder, Fit):
        if fit.key in {made.key for made in identified.record}:
            assert_allclose(
                fit.theta, next(made.theta for made in identified.record if made.key == fit.key), rtol=1e-12
            )
    assert len(davinci_forces.read(folder, "Fit", group=JOINT, periods=0)) > 0  # a number selects, too
    stream = davinci_forces.stream(folder)
    assert stream.joints == (JOINT,)
    with pytest.raises(NotAFile, match="exists"):
        identified.save(folder)


def test_the_log_of_an_external_effort_is_saved_with_its_windows(identified, tmp_path):
    effort = identified.external_effort(PUSHED.t, PUSHED.q, PUSHED.tau, dq=PUSHED.dq, free=[[0, 4]], contact=[[5, 7]])
    folder = identified.save(tmp_path / "raw" / "both", push=effort)
    log = reading.read(folder).log("push")
    assert (log.role, log.free, log.contact) == ("contact", ((0.0, 4.0),), ((5.0, 7.0),))
    with np.load(folder / log.files[0]) as saved:
        assert_allclose(saved[f"{JOINT}.tau"], PUSHED.tau)
        assert_allclose(saved["time"], PUSHED.t)
    assert f"{JOINT}, {len(effort.t)} samples, {int(effort.contacts['above'].sum())} contacts" in repr(effort)
    free = identified.external_effort(FIRST.t, FIRST.q, FIRST.tau, dq=FIRST.dq, free=[[0, 1000]])
    assert reading.read(identified.save(tmp_path / "free", calm=free)).log("calm").role == "validation"
    with pytest.raises(BadRequest, match="identification-1 is the name of an identified log"):
        identified.save(tmp_path / "other", **{"identification-1": effort})
    assert not (tmp_path / "other").exists()


def test_a_log_for_validation_is_not_fitted_and_gives_the_band(folder, tmp_path):
    logs = {name: [getattr(log, name) for log in (FIRST, PUSHED)] for name in ("t", "q", "tau", "dq")}
    t, q, tau, dq = logs.values()
    given = {"joints": JOINT, "period": [2.0, None], "roles": ["identification", "validation"]}
    made = davinci_forces.identify(str(folder / "arm.toml"), t, q, tau, dq=dq, **given)
    assert {log for fit in made.record for log in fit.logs} == {"identification-1"}
    assert "validation-1" in set(made._bands[JOINT].source)
    roles = [(log.name, log.role) for log in reading.read(made.save(tmp_path / "two")).logs]
    assert roles == [("identification-1", "identification"), ("validation-1", "validation")]
    for wrong in (["validation"] * 2, ["identification", "contact"], ["identification"]):
        with pytest.raises(BadRequest, match="roles"):
            davinci_forces.identify("davinci", t, q, tau, **given | {"roles": wrong})


def test_settings_are_saved_and_a_robot_of_no_file_is_not(identified, folder, tmp_path):
    given = {"effort": {JOINT: 0.5}, "lowpass": 11.0}
    arguments = {"dq": FIRST.dq, "joints": JOINT, "period": 2.0, "settings": given}
    robot = str(folder / "arm.toml")
    made = davinci_forces.identify(robot, FIRST.t, FIRST.q, FIRST.tau, **arguments)
    study = reading.read(made.save(tmp_path / "set"))
    assert (study.settings.effort, study.settings.lowpass) == ({JOINT: 0.5}, 11.0)
    loaded = davinci_forces.robot("arm.toml", folder)
    made = davinci_forces.identify(loaded, FIRST.t, FIRST.q, FIRST.tau, **arguments)
    with pytest.raises(BadRequest, match="the name of a listed robot, or a file"):
        made.save(tmp_path / "none")
    assert not (tmp_path / "none").exists()
    with pytest.raises(BadRequest, match="cannot be pickled; use `save`"):
        pickle.dumps(identified)


def test_a_loaded_study_predicts_and_estimates_as_its_records_do_without_a_new_fit(folder):
    made = davinci_forces.load(folder)
    assert made.joints == (JOINT,)
    [fit] = made.record
    assert_equal_numbers(fit, next(of for of in of_study(folder, Fit) if of.key == fit.key))
    processed = runs.folders(folder, None, None).processed
    before = {file: file.read_bytes() for file in processed.rglob("*") if file.is_file()}
    effort = made.external_effort(PUSHED.t, PUSHED.q, PUSHED.tau, dq=PUSHED.dq)
    [same] = [track for track in of_study(folder, Track) if track.log == "pushed"]
    assert_allclose(effort.tau_ext[JOINT], same.tau_ext_smooth, rtol=1e-12, atol=1e-12)
    [model] = [model for model in of_study(folder, JointModel) if model.log == "pushed"]
    predicted = made.predict(PUSHED.t, PUSHED.q, dq=PUSHED.dq)[JOINT]
    assert_allclose(predicted["tau"], model.tau_hat, rtol=1e-12, atol=1e-12)
    assert {file: file.read_bytes() for file in processed.rglob("*") if file.is_file()} == before
    fits = [*(processed / Fit.folder()).rglob("*.parquet")]
    assert fits
    for file in fits:  # copies, of the same time, and not made anew
        copied = made._places.processed / file.relative_to(processed)
        assert copied.stat().st_mtime_ns == file.stat().st_mtime_ns
    more = reading.read(made.save(folder.parent / "with-more", later=effort))
    before = reading.read(folder)
    assert (more.title, more.robot.joints) == (before.title, before.robot.joints)
    assert [log.name for log in more.logs] == [*(log.name for log in before.logs), "later"]
    assert not more.absent()


def test_a_saved_folder_is_replaced_where_that_is_asked_for_and_it_holds_nothing_else(identified, tmp_path):
    folder = identified.save(tmp_path / "raw" / "again")
    with pytest.raises(NotAFile, match="exists"):
        identified.save(folder)
    identified.save(folder, title="Another", replaces=True)
    assert reading.read(folder).title == "Another"
    (folder / "notes.txt").write_text("mine")
    with pytest.raises(NotAFile, match=r"notes\.txt"):
        identified.save(folder, replaces=True)
    assert (folder / "notes.txt").read_text() == "mine"


def test_levels_are_there_also_where_no_contact_is(identified, folder):
    effort = identified.external_effort(FIRST.t, FIRST.q, FIRST.tau, dq=FIRST.dq, free=[[0, 1000]])
    assert len(effort.contacts) == 0
    [level] = effort.levels.itertuples()
    [threshold] = [t for t in of_study(folder, Threshold) if t.filter == "rts"]
    assert level.joint == JOINT
    assert 0.5 * threshold.alarm_level < level.alarm_level < 2.0 * threshold.alarm_level  # of one log more
    assert 0.0 < level.detection_level < level.alarm_level


def test_a_study_that_cannot_be_loaded_says_why(folder, tmp_path):
    for file, content, text in (
        ("study.toml", (folder / "study.toml").read_text().replace('"pushed"', '"new"'), "'new' stands for the log"),
        ("second.csv", "no numbers", "a task failed"),
    ):
        other = tmp_path / file / "raw" / "study"
        shutil.copytree(folder, other)
        (other / file).write_text(content)
        with pytest.raises(BadRequest, match=text):
            davinci_forces.load(other)


def test_a_robot_may_be_a_dict_which_is_saved(folder, identified, tmp_path):
    described = tomllib.loads((folder / "arm.toml").read_text())
    arguments = {"dq": FIRST.dq, "joints": JOINT, "period": 2.0}
    made, same = (
        davinci_forces.identify(robot, FIRST.t, FIRST.q, FIRST.tau, **arguments)
        for robot in (described, folder / "arm.toml")
    )
    assert_equal_numbers(made.record[0], same.record[0])
    saved = reading.read(made.save(tmp_path / "raw" / "of-dict"))
    assert saved.robot.joints == same.robot.joints
    described["joint"][0] |= {"kind": "round", "gear_ratio": 0}
    with pytest.raises(BadRequest, match=r"gear_ratio must be(?s:.)*kind must be"):
        davinci_forces.identify(described, FIRST.t, FIRST.q, FIRST.tau, **arguments)


def test_names_of_logs_title_and_origin_are_saved(folder, tmp_path):
    t, q, tau, dq = ([getattr(log, name) for log in (FIRST, SECOND)] for name in ("t", "q", "tau", "dq"))
    given = {"dq": dq, "joints": JOINT, "period": [2.0, None], "names": ["sweep", "check"]}
    roles = ["identification", "validation"]
    made = davinci_forces.identify(folder / "arm.toml", t, q, tau, roles=roles, **given)
    assert {model.log for model in made.models} == {"sweep", "check"}
    study = reading.read(made.save(tmp_path / "raw" / "named", title="Our bench", simulated=True))
    assert (study.title, study.simulated, [log.name for log in study.logs]) == ("Our bench", True, ["sweep", "check"])
    for wrong, text in (
        (["a", "a"], "a name of its own"),
        (["a", "new"], "none 'new'"),
        (["a"], "names"),
        (["a", "B!"], "B!"),
    ):
        with pytest.raises(BadRequest, match=text):
            davinci_forces.identify(folder / "arm.toml", t, q, tau, **given | {"names": wrong})


def test_a_prediction_of_motion_beyond_the_fitted_one_is_warned_of(identified):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        identified.predict(PUSHED.t, PUSHED.q, dq=PUSHED.dq)
    with pytest.warns(UserWarning, match=f"new/{JOINT}: .* of its samples are {BEYOND}"):
        identified.predict(PUSHED.t, 0.0 * PUSHED.q + 2.0, dq=0.0 * PUSHED.dq)  # at rest


def test_a_constant_offset_is_subtracted_where_free_windows_are_given(identified):
    about = (PUSHED.t, PUSHED.q, PUSHED.tau + 0.7, PUSHED.dq)
    plain, centred = (identified.external_effort(*about, free=free) for free in ((), [(0.0, 3.5), (8.0, 14.0)]))
    assert float(plain.tau_ext[JOINT].median()) == pytest.approx(0.7, abs=0.1)
    assert float(centred.tau_ext[JOINT].median()) == pytest.approx(0.0, abs=0.1)
    stated = identified.external_effort(PUSHED.t, PUSHED.q, PUSHED.tau, PUSHED.dq, contact=[(3.0, 7.0)])
    assert len(stated.contacts) == 1


def test_an_external_effort_leaves_the_models_and_the_predictions_as_they_are(identified):
    before = identified.predict(PUSHED.t, PUSHED.q, dq=PUSHED.dq)
    identified.external_effort(PUSHED.t, PUSHED.q, PUSHED.tau + 5.0, dq=PUSHED.dq)
    pd.testing.assert_frame_equal(before, identified.predict(PUSHED.t, PUSHED.q, dq=PUSHED.dq), check_exact=True)


@pytest.mark.filterwarnings("ignore:.*the inertia of chosen.ridge is not positive:UserWarning")
def test_data_frames_give_the_numbers_of_arrays_with_joints_by_their_names():
    logs = [arm.signal(name, period=2.0, seed=i, **SHORT) for i, name in enumerate((JOINT, "instrument_slide"))]
    q, tau = (np.column_stack([getattr(log, name) for log in logs]) for name in ("q", "tau"))
    names = [log.joint for log in logs]
    by_array = davinci_forces.identify(arm.ARM, FIRST.t, q, tau, joints=names)
    frames = pd.DataFrame(q, columns=names), pd.DataFrame(tau[:, ::-1], columns=names[::-1])
    by_frame = davinci_forces.identify(arm.ARM, pd.Series(FIRST.t), *frames)
    pd.testing.assert_frame_equal(by_array.parameters, by_frame.parameters, check_exact=True)
    assert set(by_frame.fits) == set(names)
    wrong = by_frame.external_effort(FIRST.t, frames[0], tau).tau_ext  # in the order of the joints
    right = by_frame.external_effort(FIRST.t, *frames).tau_ext
    pd.testing.assert_frame_equal(wrong, right, check_exact=True)


def test_nothing_is_printed_and_the_folder_is_removed_with_the_object(capfd):
    fitted = davinci_forces.identify(arm.ARM, FIRST.t, FIRST.q, FIRST.tau, joints=JOINT)
    home = fitted._home
    assert home.is_dir()
    assert capfd.readouterr() == ("", "")
    del fitted
    gc.collect()
    assert not home.exists()


def test_what_a_study_s_run_warns_of_is_a_warning_of_python():
    """Degrees of a joint that states no limits."""
    joint = replace(arm.ARM.joint(JOINT), limits=UNLIMITED)
    with pytest.warns(
        UserWarning, match=r"identification/hand_roll: positions reach .* the limit of 6\.28 rad, which is assumed"
    ):
        davinci_forces.identify(
            replace(arm.ARM, joints=(joint,)), FIRST.t, np.rad2deg(FIRST.q), FIRST.tau, joints=JOINT
        )


def test_notebooks_show_parameters_efforts_and_contacts(identified):
    effort = identified.external_effort(PUSHED.t, PUSHED.q, PUSHED.tau, dq=PUSHED.dq)
    assert "gravity, sine" in identified._repr_html_()
    title, first, *_ = repr(identified).splitlines()
    assert title.split() == ["joint", "parameter", "value", "unit"]
    assert re.fullmatch(r"\S+ +inertia +-?[\d.]+ ± [\d.]+ +\S.*", first)
    html = effort._repr_html_()
    assert html.count("<table") == 2
    assert f"{effort.contacts['peak'][0]:.4g}" in html
    [ax] = effort.plot()
    assert ax.get_ylabel() == "external effort [N m]"
    assert_allclose(ax.lines[0].get_ydata(), effort.tau_ext[JOINT])
    assert len(ax.patches) == len(effort.contacts)
    [ax] = identified.plot()
    assert {text.get_text() for text in ax.get_legend().texts} == {"measured", "model"}
    first, model, second, _ = (line.get_xdata() for line in ax.lines)
    assert_allclose(model, first)
    assert first[-1] == second[0], "the second log follows the first one"


LOG = {"t": FIRST.t, "q": FIRST.q, "tau": FIRST.tau, "joints": JOINT}
HOLES = np.where(FIRST.t > 3.0, np.nan, FIRST.q)


@pytest.mark.parametrize(
    ("change", "texts"),
    [
        ({"t": FIRST.t[:-1]}, ["q has shape (600,)", "tau has shape (600,)", "599 samples"]),
        ({"q": HOLES, "tau": HOLES}, ["hand_roll.q has 449 values", "hand_roll.tau has 449", "first at sample 151"]),
        ({name: LOG[name][:20] for name in ("t", "q", "tau")}, ["t has shape (20,)", "at least 50"]),
        ({"t": FIRST.t[::-1]}, ["t does not increase at sample 1"]),
        ({"q": np.zeros(600)}, ["no joint moves"]),
        ({"joints": None}, ["q has shape (600,)", "3 joints", "joints=[...]"]),
        ({"period": -1.0}, ["period must be positive, not -1.0"]),
        ({"settings": {"lowpas": 3.0}}, ["unknown key 'lowpas'", "did you mean 'lowpass'?"]),
        ({"t": [FIRST.t, SECOND.t], "q": [FIRST.q, SECOND.q], "tau": [FIRST.tau]}, ["2 logs, but tau has 1"]),
        (
            {"t": [FIRST.t, SECOND.t], "q": [FIRST.q, SECOND.q[1:]], "tau": [FIRST.tau, SECOND.tau]},
            ["log 2: q has shape (899,)", "t has 900 samples"],
        ),
    ],
)
def test_wrong_arrays_are_refused_with_all_their_problems_in_one_message(change, texts):
    with pytest.raises(BadRequest) as refused:
        davinci_forces.identify(arm.ARM, **LOG | change)
    assert [text for text in texts if text not in str(refused.value)] == []


@pytest.mark.parametrize(
    ("change", "text"),
    [({"robot": "elbow"}, "there is no robot 'elbow'"), ({"joints": ["elbow"]}, "no joint 'elbow'")],
)
def test_a_robot_or_joint_that_is_unknown_is_named(change, text):
    with pytest.raises(BadRobot, match=text):
        davinci_forces.identify(**{"robot": arm.ARM, **LOG, **change})


@pytest.mark.parametrize("ask", ["predict", "external_effort"])
def test_wrong_arrays_of_a_new_log_are_refused(identified, ask):
    given = [PUSHED.t[:-1], PUSHED.q, PUSHED.tau][: 2 if ask == "predict" else 3]
    with pytest.raises(BadRequest, match=r"q has shape \(780,\)") as refused:
        getattr(identified, ask)(*given)
    assert ("tau" in str(refused.value)) == (ask == "external_effort")


@pytest.mark.parametrize(
    ("windows", "text"),
    [
        ([10, 14], "contact is [10, 14]; give [[start, end], ...] in s"),
        ([[10, "end"]], "give [[start, end], ...] in s"),
        (np.array([[1e9, 1e9 + 2]]), "s; count from its first sample"),
        ([[16, 50]], "contact [16.0, 50.0] begins after the log, of 15.58 s"),
    ],
)
def test_windows_that_are_none_or_not_of_the_log_are_refused(identified, windows, text):
    with pytest.raises(BadRequest) as refused:
        identified.external_effort(PUSHED.t, PUSHED.q, PUSHED.tau, contact=windows)
    assert text in str(refused.value)


def test_windows_may_be_an_array():
    assert arrays.windows_of("free", np.array([[1, 2], [3.5, 4]]), PUSHED.t) == [[1.0, 2.0], [3.5, 4.0]]


def test_columns_that_name_no_joint_are_not_taken_for_joints_in_their_order():
    frame = pd.DataFrame({"outer_pitch": FIRST.q, "outer_yaw": FIRST.q})
    with pytest.raises(BadRequest, match=r"columns outer_pitch, outer_yaw, but the joints of .* are hand_roll"):
        davinci_forces.identify(arm.ARM, FIRST.t, frame, frame)
    assert arrays.joints_of(arm.ARM, frame, ["hand_pitch", "hand_roll"]) == ["hand_pitch", "hand_roll"]
    assert arrays.joints_of(arm.ARM, pd.DataFrame(np.zeros((60, 3))), None) == [j.name for j in arm.ARM.joints]


def test_motion_beyond_what_was_fitted_and_a_narrow_band_are_doubted():
    share = PathShare("new", JOINT, "contact", 0.5, 1.0, 1.6, 0.25)
    usual, fitted = replace(share, speed_ratio=1.4, outside=0.05), replace(share, role="identification")
    space = free_space(log="validation", joint=JOINT, coverage=0.85)
    wide, filtered = replace(space, coverage=0.94), replace(space, filter="ekf")
    records = {PathShare: [share, usual, fitted], FreeSpace: [space, wide, filtered]}
    assert arrays.doubts(records.__getitem__) == [
        "new/hand_roll: it moves 1.6 times as fast as in any fitted log",
        "new/hand_roll: 25 % of its samples are beyond all fitted positions by more than 5 % of their range",
        "validation/hand_roll: the 95 % band is too narrow: it covers only 85 % of free motion; "
        "judge by the alarm level",
    ]


def test_the_example_in_the_docstring_runs():
    names = {"davinci_forces": davinci_forces, **{name: LOG[name] for name in ("t", "q", "tau")}}
    [example] = doctest.DocTestFinder().find(davinci_forces.identify, "identify", globs=names)
    assert len(example.examples) >= 4
    assert doctest.DocTestRunner().run(example).failed == 0
