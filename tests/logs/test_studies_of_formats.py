"""Studies whose logs are folders, raw numbers or read by a child: what runs again, what is said, and --jobs."""

import json

import numpy as np
import pyarrow as pa
import pytest
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from davinci_forces.errors import BadStudy
from davinci_forces.study import reading
from tests import arm
from tests.logs.array_writers import arrow, hdf5, npz, xlsx
from tests.logs.bag_writer import joint_state, write
from tests.test_new import effort, motion

SIGNAL = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
COLUMNS = {"time": SIGNAL.t, "hand_roll.q": SIGNAL.q, "hand_roll.dq": SIGNAL.dq, "hand_roll.tau": SIGNAL.tau}
STATES = {"q": "position", "dq": "velocity", "tau": "effort"}


def describe(folder, file: str, channels: dict[str, str], more: str = ""):
    folder.mkdir(parents=True, exist_ok=True)
    arm.write_robot(folder)
    lines = "".join(f'"{quantity}" = "{channel}"\n' for quantity, channel in channels.items())
    entry = f'[[log]]\nname = "roll"\nfile = "{file}"\nrole = "identification"\n{more}\n[log.channels]\n{lines}'
    (folder / "study.toml").write_text(f'title = "T"\nrobot = "arm.toml"\n{entry}')
    return folder


@pytest.fixture
def bag(tmp_path):
    """A study whose log is a folder."""
    channels = {f"hand_roll.{symbol}": f"/arm/measured_js/{state}[roll]" for symbol, state in STATES.items()}
    folder = describe(tmp_path / "raw" / "arm", "roll", channels)
    rows = zip(*COLUMNS.values(), strict=True)
    states = (joint_state(t, ["roll"], [q], [dq], [tau], topic="/arm/measured_js") for t, q, dq, tau in rows)
    write(folder / "roll", states)
    return folder


def call(*arguments) -> str:
    done = CliRunner().invoke(app, [*map(str, arguments)])
    assert "Traceback" not in done.output
    return " ".join(done.output.split())


def test_a_log_that_is_a_folder_is_read_and_counts_by_each_of_its_files(bag):
    call("ingest", bag)
    recorded = davinci_forces.read(bag, "Recording")
    np.testing.assert_allclose(recorded["t"], SIGNAL.t, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(recorded["tau"], SIGNAL.tau)
    assert "nothing to do" in call("ingest", bag)
    [entry] = (bag.parents[1] / "processed" / "arm" / "tasks" / "ingest").glob("*.json")
    inputs = json.loads(entry.read_text())["fingerprint"]["inputs"]
    assert sorted(inputs) == ["raw/roll/metadata.yaml", "raw/roll/roll.db3"]
    metadata = bag / "roll" / "metadata.yaml"
    metadata.write_text(metadata.read_text() + "\n")
    assert "raw/roll/metadata.yaml" in call("ingest", bag)
    (bag / "roll" / "roll_1.db3").write_bytes(b"")
    assert "raw/roll/roll_1.db3" in call("ingest", bag)


def test_a_folder_that_is_not_there_is_a_file_that_is_not_there(bag):
    (bag / "roll").rename(bag / "away")
    assert "file 'roll' is not in" in call("ingest", bag)


def test_channels_that_a_log_knows_by_a_number_and_a_name_are_the_same(bag):
    text = (bag / "study.toml").read_text()
    call("ingest", bag)
    named = davinci_forces.read(bag, "Recording")
    (bag / "study.toml").write_text(text.replace("[roll]", "[0]"))
    call("ingest", bag)
    assert named.equals(davinci_forces.read(bag, "Recording"))


def test_topics_that_a_study_uses_together_are_put_on_the_clock_of_the_positions(bag):
    """Efforts come 3 ms late, on a topic of their own; they are read beside the positions, by another child."""
    messages = []
    for t, q, dq, _ in zip(*COLUMNS.values(), strict=True):
        messages.append(joint_state(t, ["roll"], [q], [dq], topic="/arm/measured_js"))
        messages.append(joint_state(t + 0.003, ["roll"], [], [], [np.sin(t + 0.003)], topic="/arm/currents"))
    write(bag / "both_mcap", messages)
    text = (bag / "study.toml").read_text().replace('file = "roll"', 'file = "both_mcap"')
    (bag / "study.toml").write_text(text.replace("/arm/measured_js/effort", "/arm/currents/effort"))
    assert "error" not in call("ingest", bag)
    recorded = davinci_forces.read(bag, "Recording")
    begun = recorded["t"] + SIGNAL.t[-1] - recorded["t"].iloc[-1]  # times count from the first row that is kept
    assert len(recorded) >= len(SIGNAL) - 2
    # Slopes of parabolas are off by h^2/6 of a third derivative, of which a cubic takes 0.0962 h; at an end, where it
    # is that of a chord, by h/2 of a second one, of which it takes 4/27 h.
    off, h = np.abs(recorded["tau"] - np.sin(begun)).to_numpy(), 0.02
    assert off[1:-1].max() < 0.0962 / 6 * h**3 * 1.1
    assert off.max() < 4 / 27 / 2 * h**2 * 1.1


def test_bags_that_follow_one_another_are_parts_of_one_log(bag):
    half = len(SIGNAL.t) // 2
    rows = [*zip(*COLUMNS.values(), strict=True)]
    for name, part in (("one", rows[:half]), ("two_mcap", rows[half:])):
        states = (joint_state(t, ["roll"], [q], [dq], [tau], topic="/arm/measured_js") for t, q, dq, tau in part)
        write(bag / name, states)
    text = (bag / "study.toml").read_text().replace('file = "roll"', 'files = ["one", "two_mcap"]')
    (bag / "study.toml").write_text(text)
    assert "error" not in call("ingest", bag)
    recorded = davinci_forces.read(bag, "Recording")
    np.testing.assert_allclose(recorded["t"], SIGNAL.t, rtol=0, atol=1e-9)
    np.testing.assert_array_equal(recorded["tau"], SIGNAL.tau)


def test_the_times_at_which_the_recorder_had_messages_are_the_alternative(bag):
    states = (
        joint_state(t, ["roll"], [q], [dq], [tau], topic="/arm/measured_js", stamped=i != 0)
        for i, (t, q, dq, tau) in enumerate(zip(*COLUMNS.values(), strict=True))
    )
    write(bag / "late", states)
    text = (bag / "study.toml").read_text().replace('"roll"', '"late"', 2)
    (bag / "study.toml").write_text(text + 'time = "/arm/measured_js/received"\n')
    call("ingest", bag)
    np.testing.assert_allclose(davinci_forces.read(bag, "Recording")["t"], SIGNAL.t, rtol=0, atol=1e-9)


@pytest.mark.parametrize(("dtype", "as_"), [("DBL", ">f8"), ("<float64", "<f8")])
def test_raw_numbers_are_what_the_study_says(tmp_path, dtype, as_):
    names = {"time": "t", **{f"hand_roll.{symbol}": symbol for symbol in STATES}}
    more = f'dtype = "{dtype}"\ncolumns = {json.dumps(list(names.values()))}'
    folder = describe(tmp_path / "raw" / "arm", "roll.bin", names, more)
    np.column_stack(list(COLUMNS.values())).astype(as_).tofile(folder / "roll.bin")
    assert "error" not in call("ingest", folder)
    np.testing.assert_array_equal(davinci_forces.read(folder, "Recording")["tau"], SIGNAL.tau)


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ('dtype = "float64"', "dtype needs columns; a file of raw binary numbers"),
        ("columns = 3", "columns needs dtype; a file of raw binary numbers"),
        ('dtype = "i8"\ncolumns = 3', "dtype must be a type of number"),
        ('dtype = "DBL"\ncolumns = 0', "columns must be how many numbers a row has, or their names"),
        ('dtype = "DBL"\ncolumns = ["a", "a"]', "columns must be how many numbers a row has, or their names"),
    ],
)
def test_what_is_wrong_about_raw_numbers_is_said_with_its_line(tmp_path, more, says):
    folder = describe(tmp_path / "arm", "roll.bin", {"time": "t"}, more)
    with pytest.raises(BadStudy) as raised:
        reading.read(folder)
    assert says in str(raised.value)
    assert "study.toml:7:" in str(raised.value) or "study.toml:8:" in str(raised.value)


@pytest.mark.medium
def test_processes_that_read_by_children_of_their_own_make_the_same(tmp_path):
    made = []
    for jobs in (1, 2):
        folder = tmp_path / str(jobs) / "raw" / "arm"
        describe(folder, "one.h5", {name: name for name in COLUMNS})
        text = (folder / "study.toml").read_text()
        entry = text.partition("[[log]]")[2].replace('"roll"', '"two"').replace("one.h5", "two.h5")
        (folder / "study.toml").write_text(f"{text}\n[[log]]{entry}")
        for name in ("one", "two"):
            (folder / f"{name}.h5").write_bytes(hdf5(COLUMNS))
        assert "error" not in call("ingest", folder, "--jobs", jobs)
        home = folder.parents[1] / "processed"
        made.append({file.relative_to(home): file.read_bytes() for file in home.rglob("*.parquet")})
    assert len(made[0]) > 2
    assert made[0] == made[1]


def lists(x) -> pa.Array:
    return pa.FixedSizeListArray.from_arrays(pa.array(x.ravel()), x.shape[1])


def as_npz(t, q, dq, tau) -> bytes:
    return npz({"t": t, "q": q, "dq": dq, "tau": tau})


def as_xlsx(t, q, dq, tau) -> bytes:
    names = ["t [s]", *(f"{symbol}{k}" for symbol in ("q", "dq", "tau") for k in (1, 2))]
    return xlsx([names, *np.column_stack([t, q, dq, tau]).tolist()])


def as_parquet(t, q, dq, tau) -> bytes:
    """As LeRobot: two episodes, each with times of its own."""
    first = len(t) // 3
    times = np.concatenate([t[:first], t[first:] - t[first]])
    columns = {"position": lists(q), "velocity": lists(dq), "effort": lists(tau)}
    episodes = {"timestamp": times, "episode_index": (np.arange(len(t)) >= first).astype(int)}
    return arrow("parquet", episodes | {f"observation.{name}": values for name, values in columns.items()})


@pytest.mark.medium
@pytest.mark.usefixtures("coarse_search")
@pytest.mark.parametrize(("ending", "content"), [("npz", as_npz), ("xlsx", as_xlsx), ("parquet", as_parquet)])
@pytest.mark.parametrize("command", ["ingest", pytest.param("all", marks=pytest.mark.slow)])
def test_logs_of_arrays_go_through_new_without_an_edit(tmp_path, ending, content, command):
    folder = tmp_path / "raw" / "arm"
    folder.mkdir(parents=True)
    logs = {}
    for name, seed, repeats in (("excitation", 0, True), ("validation", 5, False)):
        t, q, dq = motion(2, seed, repeats)
        # Two episodes are not one motion: a gap within one motion is taken for a fault of the clock, and mended.
        first = len(t) // 3 if ending == "parquet" else 0
        q, dq = (np.concatenate([x[100 : 100 + first], x[: len(t) - first]]) for x in (q, dq))
        logs[name] = (t, q, dq, effort(q, dq))
        (folder / f"{name}.{ending}").write_bytes(content(*logs[name]))
    call("new", *sorted(folder.iterdir()))
    assert "error:" not in call(command, folder)
    for name, (t, q, dq, tau) in logs.items():
        for k in range(2):
            recorded = davinci_forces.read(folder, "Recording", log=name, joint=f"joint_{k + 1}")
            gap = 1.0 - (t[1] - t[0]) if ending == "parquet" else 0.0  # between its episodes
            expected = t + gap * (np.arange(len(t)) >= len(t) // 3)
            np.testing.assert_allclose(recorded["t"], expected, rtol=0, atol=1e-9)
            for symbol, column in (("q", q), ("dq", dq), ("tau", tau)):
                np.testing.assert_allclose(recorded[symbol], column[:, k], rtol=1e-15, atol=0)
