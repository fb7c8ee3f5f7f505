"""Files of MATLAB, HDF5, Arrow, NumPy and Excel: arrays by name, in structs, groups and columns."""

import sys
import zipfile
import zlib
from datetime import datetime, timedelta
from io import BytesIO
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pyarrow as pa
import pytest
import scipy.io.matlab
from numpy.testing import assert_array_equal
from pyarrow import parquet
from scipy.io import savemat

from davinci_forces.errors import BadLog
from tests.logs.array_writers import arrow, hdf5, matlab, matlab_73, npy, npz, xlsx
from tests.logs.reading import read

ROWS = 30
T = 0.01 * np.arange(ROWS)
Q = np.arange(3.0 * ROWS).reshape(ROWS, 3)
OBJECTS = Path(__file__).with_name("objects.mat").read_bytes()
OBJECT_Q = np.arange(60.0).reshape(20, 3)
MATLAB = pytest.mark.parametrize("write", [matlab, matlab_73])


def names(log) -> list[str]:
    return [channel.name for channel in log.channels]


@MATLAB
@pytest.mark.parametrize("across", [False, True])
def test_columns_of_a_matrix_are_numbered_along_its_shorter_side(write, across):
    log, samples = read(write({"t": T, "q": Q.T if across else Q}), "log.mat")
    assert sorted(names(log)) == ["q[0]", "q[1]", "q[2]", "t"]
    for i in range(3):
        assert_array_equal(samples[f"q[{i}]"], Q[:, i])


@MATLAB
def test_structs_in_structs_are_found_by_either_spelling(write):
    log, samples = read(write({"log": {"arm": {"q": Q[:, 0], "title": "left"}, "gain": 2.5}}), "log.mat")
    assert log.find("log.arm.q") == log.find("log/arm/q") == log.find("q")
    assert_array_equal(samples["log/arm/q"], Q[:, 0])
    assert (log.facts["log/arm/title"], log.facts["log/gain"]) == ("left", "2.5")


@MATLAB
def test_the_times_of_a_timeseries_are_the_clock_of_its_values_and_of_no_others(write):
    timeseries = {"Time": T, "Data": Q, "TimeInfo": {"Units": "seconds"}, "DataInfo": {"Units": "rad"}}
    log = opened(write({"ts": timeseries, "other": T + 1.0}), "log.mat")
    with pytest.raises(BadLog, match="have 2 clocks"):
        next(log.blocks(["ts/Data[0]", "other"]))
    assert (log.find("ts/Data[1]").time, log.find("ts/Data[1]").unit) == ("ts/Time", "rad")
    assert (log.find("ts/Time").kind, log.find("other").time) == ("time", "")


@MATLAB
def test_times_in_minutes_are_no_clock_that_is_taken_for_seconds(write):
    timeseries = {"Time": T, "Data": Q, "TimeInfo": {"Units": "minutes"}}
    log, _ = read(write({"ts": timeseries}), "log.mat")
    assert log.find("ts/Data[1]").time == ""


def test_what_simulink_logs_is_on_its_time():
    """Elements of a struct array count from 1, as in MATLAB."""
    signals = np.zeros((1, 2), dtype=[("values", object), ("label", object)])
    for i, label in enumerate(("angle", "current")):
        signals[0, i] = Q[:, i : i + 1], label
    log, samples = read(matlab({"out": {"time": T, "signals": signals}}), "log.mat")
    assert log.find("out.signals(2).values").time == "out/time"
    assert_array_equal(samples["out/signals(2)/values"], Q[:, 1])
    assert log.facts["out/signals(1)/label"] == "angle"


def test_a_struct_array_of_version_7_3_is_followed():
    file = BytesIO()
    with h5py.File(file, "w") as hdf:
        group = hdf.create_group("signals")
        group.attrs["MATLAB_class"] = np.bytes_("struct")
        parts = [hdf.create_dataset(f"#refs#/{name}", data=Q[:, i : i + 1].T) for i, name in enumerate("ab")]
        group.create_dataset("values", data=np.array([[part.ref] for part in parts], h5py.ref_dtype))
    log, samples = read(file.getvalue(), "log.h5")
    assert names(log) == ["signals/values(1)", "signals/values(2)"]
    assert_array_equal(samples["signals/values(2)"], Q[:, 1])


@MATLAB
def test_arrays_of_other_lengths_end_in_nulls_and_are_remarked_on(write):
    log, samples = read(write({"t": T, "limits": [1.0, 2.0]}), "log.mat")
    assert log.nulls == {"t": 0, "limits": ROWS - 2}
    assert_array_equal(samples["limits"][:2], [1.0, 2.0])
    assert "different numbers of samples" in log.warnings[0]


def test_complex_numbers_are_not_read_as_their_real_part():
    log = opened(matlab({"t": T, "z": Q[:, 0] + 1j}), "log.mat")
    with pytest.raises(BadLog, match="complex"):
        list(log.blocks(["z"]))
    log = opened(hdf5({"t": T, "z": Q[:, 0] + 1j}), "log.h5")
    assert log.find("z").kind == "complex"


def test_of_many_parameters_some_are_shown_and_the_others_counted():
    log, _ = read(hdf5({"t": T, **{f"gain/{i}": float(i) for i in range(1000)}}), "log.h5")
    assert log.facts["gain/0"] == "0.0"
    assert log.facts["..."] == "960 more that are not recordings"


def test_a_file_of_scalars_is_no_log():
    with pytest.raises(BadLog, match="it holds no variable of samples; it has gain"):
        read(matlab({"gain": 2.0}), "log.mat")


def test_a_matlab_object_says_how_to_save_it():
    file = BytesIO()
    with h5py.File(file, "w", userblock_size=512) as hdf:
        hdf["t"] = T
        made = hdf.create_dataset("ts", data=np.zeros((1, 6), np.uint32))
        made.attrs["MATLAB_class"], made.attrs["MATLAB_object_decode"] = np.bytes_("timeseries"), np.int32(3)
    content = b"MATLAB 7.3 MAT-file".ljust(512, b" ") + file.getvalue()[512:]
    log, _ = read(content, "log.mat")
    line = "ts = struct('Time', ts.Time, 'Data', squeeze(ts.Data)); save('ts.mat', 'ts')"
    assert log.warnings[0].endswith(line)


def test_what_that_line_of_matlab_saves_is_read_with_its_clock():
    log, samples = read(matlab({"ts": {"Time": T[:, None], "Data": Q}}), "ts.mat")
    assert_array_equal(samples["ts/Data[2]"], Q[:, 2])
    assert log.find("ts/Data[2]").time == "ts/Time"


def test_objects_of_matlab_are_read_beside_its_variables():
    """Written by PyPI's mat-io, which is a witness of its own: timeseries, a table, a timetable, a string, a struct."""
    log, samples = read(OBJECTS, "log.mat")
    assert log.warnings == []
    assert not any("workspace" in name for name in names(log))
    for series in ("ts", "uniform", "inner/arm"):  # a uniform one stores its start and its increment alone
        assert_array_equal(np.column_stack([samples[f"{series}/Data[{i}]"] for i in range(3)]), OBJECT_Q)
        assert log.find(f"{series}/Data[0]").time == f"{series}/Time"
    np.testing.assert_allclose(samples["ts/Time"], 0.01 * np.arange(20), rtol=0, atol=1e-15)
    np.testing.assert_allclose(samples["uniform/Time"], 0.5 + 0.01 * np.arange(20), rtol=0, atol=1e-15)
    assert_array_equal(samples["x[2]"], OBJECT_Q[:, 2])
    for table in ("T", "TT"):
        assert_array_equal(samples[f"{table}/q"], OBJECT_Q[:, 0])
        assert_array_equal(samples[f"{table}/i"], OBJECT_Q[:, 1])
    np.testing.assert_allclose(samples["TT/Time"], 0.01 * np.arange(20), rtol=0, atol=1e-15)
    assert (log.find("TT/q").time, log.find("TT/Time").kind, log.find("T/q").time) == ("TT/Time", "time", "")
    assert log.facts["s"] == "left"


def test_an_object_that_cannot_be_read_is_named_and_the_variables_are_read():
    """The file lacks its last part, the properties, whose place the header states."""
    log, samples = read(OBJECTS[: int.from_bytes(OBJECTS[116:124], "little")], "log.mat")
    assert set(names(log)) == {"t", "x[0]", "x[1]", "x[2]", "inner/x[0]", "inner/x[1]", "inner/x[2]"}
    assert_array_equal(samples["x[0]"], OBJECT_Q[:, 0])
    assert [warning.partition(" is a MATLAB object")[0] for warning in log.warnings] == [
        "ts", "uniform", "T", "TT", "s", "inner/arm", "odd",
    ]  # fmt: skip
    assert not any("damaged" in warning for warning in log.warnings)


def test_functions_are_no_channels():
    file = Path(scipy.io.matlab.__file__).with_name("tests") / "data" / "some_functions.mat"
    if not file.exists():
        pytest.skip("scipy is installed without its tests")
    with pytest.raises(BadLog, match="sqr is a function of MATLAB") as refused:
        read(file.read_bytes(), "log.mat")
    assert "workspace" not in str(refused.value)


def test_text_and_sparse_matrices_of_versions_4_and_5_are_what_they_are():
    import scipy.sparse

    for version in ("4", "5"):
        file = BytesIO()
        savemat(file, {"t": T, "who": "left", "s": scipy.sparse.csc_array(Q)}, format=version)
        log, samples = read(file.getvalue(), "log.mat")
        assert log.facts["who"] == "left"
        assert_array_equal(samples["s[1]"], Q[:, 1])


def test_a_scalar_reference_is_followed():
    file = BytesIO()
    with h5py.File(file, "w") as hdf:
        hdf["q"] = Q[:, 0]
        hdf.create_dataset("best", data=hdf["q"].ref, dtype=h5py.ref_dtype)
        hdf.create_dataset("none", data=h5py.Reference(), dtype=h5py.ref_dtype)
    _, samples = read(file.getvalue(), "log.h5")
    assert_array_equal(samples["best(1)"], Q[:, 0])


def test_version_4_is_read():
    file = BytesIO()
    savemat(file, {"t": T, "q": Q}, format="4")
    log, samples = read(file.getvalue(), "log.mat")
    assert_array_equal(samples["q[2]"], Q[:, 2])
    assert log.format == "mat"


@pytest.mark.parametrize("how", [{}, {"chunks": (7, 2), "compression": "gzip"}, {"maxshape": (None, 3)}])
def test_datasets_of_any_layout_are_the_same(how):
    _, samples = read(hdf5({"arm/q": Q}, **how), "log.h5")
    assert_array_equal(np.column_stack([samples[f"arm/q[{i}]"] for i in range(3)]), Q)


def test_fields_of_records_are_channels():
    records = np.zeros(ROWS, dtype=[("t", "f8"), ("i", "<i2"), ("vector", "f4", 3)])
    records["t"], records["i"] = T, np.arange(ROWS)
    log, samples = read(hdf5({"run": records}, {"run": "A"}), "log.h5")
    assert names(log) == ["run/t", "run/i"]
    assert_array_equal(samples["run/i"], np.arange(ROWS))


def test_what_lies_in_another_file_is_left_out(tmp_path):
    (tmp_path / "other.h5").write_bytes(hdf5({"q": Q[:, 0]}))
    with h5py.File(tmp_path / "log.h5", "w") as hdf:
        hdf["t"] = T
        hdf["link"] = h5py.ExternalLink("other.h5", "/q")
        layout = h5py.VirtualLayout((ROWS,), "f8")
        layout[:] = h5py.VirtualSource("other.h5", "q", (ROWS,))
        hdf.create_virtual_dataset("virtual", layout)
    log, _ = read((tmp_path / "log.h5").read_bytes(), "log.h5")
    assert names(log) == ["t"]
    assert log.warnings == ["dataset /virtual is stored in another file and is left out"]


def test_a_dataset_that_claims_more_samples_than_its_file_can_hold_is_refused():
    """As a damaged length does: what was never written reads as zeros."""
    file = BytesIO()
    with h5py.File(file, "w") as hdf:
        hdf.create_dataset("q", shape=(10**11,), dtype="f8", chunks=(1 << 16,))
    with pytest.raises(BadLog, match="claim more samples than they can hold"):
        for _ in opened(file.getvalue(), "log.h5").blocks(["q"]):
            pass


def test_without_h5py_the_message_says_how_to_install_it(monkeypatch):
    files = (hdf5({"t": T}), "log.h5"), (matlab_73({"t": T}), "log.mat")
    monkeypatch.setitem(sys.modules, "h5py", None)
    for content, name in files:
        with pytest.raises(BadLog, match=r"-m pip install h5py$"):
            read(content, name)
    assert read(matlab({"t": T}), "log.mat")[0].format == "mat"


TABLES = pytest.mark.parametrize("kind", ["parquet", "feather"])


@TABLES
def test_time_stamps_are_the_clock_and_nulls_are_counted_apart_from_nan(kind):
    stamps = pa.array((T * 1e9).round().astype(np.int64) + 1_700_000_000 * 10**9, pa.timestamp("ns", "UTC"))
    holes = pa.array([None, float("nan"), *Q[2:, 0]])
    log, samples = read(arrow(kind, {"when": stamps, "q": holes, "who": pa.array(["a"] * ROWS)}), f"log.{kind}")
    assert (log.time, log.started, log.zone) == ("when", "2023-11-14T22:13:20", "UTC")
    np.testing.assert_allclose(samples["when"], T, rtol=0, atol=1e-9)
    assert (log.nulls["q"], log.nans["q"]) == (1, 1)
    assert log.find("who").kind == "text"


@TABLES
def test_all_time_stamps_count_from_one_second_whatever_their_units(kind):
    ms = (T * 1e3).round().astype(np.int64) + 1_700_000_000_250
    stamps = {"a": pa.array(ms, pa.timestamp("ms")), "b": pa.array((ms + 500) * 10**6, pa.timestamp("ns"))}
    log, samples = read(arrow(kind, stamps), f"log.{kind}")
    assert (log.started, log.zone) == ("2023-11-14T22:13:20", "local")
    np.testing.assert_allclose(samples["a"], 0.25 + T, rtol=0, atol=1e-9)
    np.testing.assert_allclose(samples["b"], 0.75 + T, rtol=0, atol=1e-9)


@TABLES
def test_columns_of_whole_numbers_and_flags_are_numbers(kind):
    columns = {"n": pa.array(range(ROWS), pa.uint8()), "on": pa.array([True, False] * (ROWS // 2)), "f": np.float32(T)}
    _, samples = read(arrow(kind, columns), f"log.{kind}")
    assert_array_equal(samples["n"], np.arange(ROWS))
    assert_array_equal(samples["on"], [1.0, 0.0] * (ROWS // 2))
    assert_array_equal(samples["f"], np.float32(T).astype(float))


@TABLES
@pytest.mark.parametrize(
    "kind_of_list", [pa.list_(pa.float32(), 3), pa.list_(pa.float32()), pa.large_list(pa.float64())]
)
def test_lists_of_one_length_are_columns_and_a_missing_list_is_missing(kind, kind_of_list):
    lists = pa.array([*Q[:4].tolist(), None, *Q[5:].tolist()], kind_of_list)
    log, samples = read(arrow(kind, {"t": T, "observation.state": lists}), f"log.{kind}")
    assert names(log) == ["t", *(f"observation.state[{i}]" for i in range(3))]
    for i in range(3):
        assert_array_equal(samples[f"observation.state[{i}]"], np.where(np.arange(ROWS) == 4, np.nan, Q[:, i]))
    assert (log.nulls["observation.state[1]"], log.nans["observation.state[1]"]) == (1, 0)


@TABLES
def test_lists_of_other_lengths_are_refused_only_where_they_are_read(kind):
    log = opened(arrow(kind, {"t": T, "odd": pa.array([[1.0], *[[1.0, 2.0]] * (ROWS - 1)])}), f"log.{kind}")
    assert len(next(log.blocks(["t"]))["t"]) == ROWS
    with pytest.raises(BadLog, match="lists of 'odd' have different lengths"):
        list(log.blocks(["odd[0]"]))


@TABLES
def test_episodes_of_lerobot_follow_one_another_with_a_gap(kind):
    episodes = np.repeat([0, 1, 2], 10)
    t = np.float32(np.tile(0.02 * np.arange(10), 3))
    columns = {"timestamp": t, "episode_index": episodes, "q": Q[:, 0]}
    log, samples = read(arrow(kind, columns), f"log.{kind}")
    alone = opened(arrow(kind, columns), f"log.{kind}").blocks(["timestamp"])
    assert_array_equal(np.concatenate([block["timestamp"] for block in alone]), samples["timestamp"])
    assert (log.time, log.find("timestamp").unit) == ("timestamp", "s")
    np.testing.assert_allclose(samples["timestamp"], t + (0.18 + 1.0) * episodes, rtol=0, atol=1e-6)
    going_on = {"timestamp": T, "episode_index": episodes}
    assert_array_equal(read(arrow(kind, going_on), f"log.{kind}")[1]["timestamp"], T)


def test_a_page_of_parquet_whose_checksum_is_wrong_is_refused():
    file = BytesIO()
    parquet.write_table(pa.table({"q": T}), file, write_page_checksum=True, compression="none", use_dictionary=False)
    content = file.getvalue()
    assert_array_equal(read(content, "log.parquet")[1]["q"], T)
    at = content.index(np.float64(T[7]).tobytes())
    with pytest.raises(BadLog, match=r"(?i)crc|checksum"):
        read(content[:at] + b"\1" + content[at + 1 :], "log.parquet")


def test_objects_of_python_are_named_and_never_loaded(tmp_path):
    class Touch:
        def __reduce__(self):
            return open, (str(tmp_path / "ran"), "w")

    objects = np.array([Touch(), 1], dtype=object)
    log, samples = read(npz({"t": T, "o": objects}), "log.npz")
    assert names(log) == ["t"]
    assert_array_equal(samples["t"], T)
    assert "o holds Python objects" in log.warnings[0]
    with pytest.raises(BadLog, match=r"holds Python objects.*numpy\.savez"):
        read(npy(objects), "log.npy")
    assert not (tmp_path / "ran").exists()


def test_arrays_of_numpy_in_any_layout_are_the_same():
    order = {"C": Q, "F": np.asfortranarray(Q), "big": Q.astype(">f4"), "across": Q.T, "nested": Q[:, None, :]}
    for packed in (False, True):
        log, samples = read(npz({**order, "gain": 2.5, "none": np.zeros((0, 3))}, packed), "log.npz")
        for name in order:
            assert_array_equal(np.column_stack([samples[f"{name}[{i}]"] for i in range(3)]), Q)
        assert (log.facts["gain"], log.warnings) == ("2.5", [])


def test_a_long_array_of_numpy_is_read_in_pieces_and_a_second_time():
    x = np.arange(3e5).reshape(-1, 3)
    log = opened(npz({"x": x}, packed=True), "log.npz")
    for _ in range(2):
        assert_array_equal(np.concatenate([block["x[1]"] for block in log.blocks(["x[1]"])]), x[:, 1])


def test_an_array_that_claims_more_than_its_file_holds_is_refused():
    content = npy(T).replace(b"(30,)", b"(99,)")
    with pytest.raises(BadLog, match="ends after 240 of 792 bytes"):
        read(content, "log.npy")


def test_a_workbook_has_names_units_and_dates():
    start = datetime(2024, 5, 1, 12, 0, 0, 250_000)
    rows = [[start + timedelta(milliseconds=10 * i), 0.5 * i, None if i == 3 else i, "ok"] for i in range(ROWS)]
    for head in ([["t", "q [rad]", "i", "note"]], [["t", "q", "i", "note"], ["", "rad", "A", ""]]):
        log, samples = read(xlsx([["A title"], [], *head, *rows], more=[["x", "y"], [1, 2]]), "log.xlsx")
        assert (log.time, log.started, log.zone) == ("t", "2024-05-01T12:00:00", "local")
        np.testing.assert_allclose(samples["t"], 0.25 + T, rtol=0, atol=1e-6)
        assert (log.find(log.channels[1].name).unit, log.find("note").kind) == ("rad", "text")
        assert (log.nulls["i"], np.flatnonzero(np.isnan(samples["i"])).tolist()) == (1, [3])
        assert log.warnings == ["the sheets more are left out: the longest, 'log', is read"]


def test_a_workbook_that_is_no_table_says_what_is_wrong():
    with pytest.raises(BadLog, match=r"none of its sheets \(log\) has columns of numbers below their names"):
        read(xlsx([[0.1 * i, i] for i in range(5)]), "log.xlsx")
    with pytest.raises(BadLog, match=r"sheet 'log', row 9, column 'q': 'oops' is not a number"):
        read(xlsx([["t", "q"], *[[0.1 * i, "oops" if i == 7 else i] for i in range(20)]]), "log.xlsx")


def test_without_openpyxl_the_message_says_how_to_install_it(monkeypatch):
    content = xlsx([["t", "q"], [0.0, 1.0], [0.1, 2.0]])
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    with pytest.raises(BadLog, match=r"-m pip install openpyxl$"):
        read(content, "log.xlsx")


@pytest.mark.medium
@pytest.mark.parametrize("bomb", ["entities", "array", pytest.param("blanks", marks=pytest.mark.slow)])
def test_bombs_of_zip_and_xml_end_with_a_message_or_the_samples(bomb):
    table = xlsx([["t", "q"], *[[0.1 * i, i] for i in range(20)]])
    if bomb == "array":
        content, name = (
            zipped({"q.npy": npy(T).replace(b"(30,), }         ", b"(10000000000,), }") + bytes(64 << 20)}),
            "log.npz",
        )
    else:
        name = "log.xlsx"
        with zipfile.ZipFile(BytesIO(table)) as parts:
            members = {part: parts.read(part) for part in parts.namelist()}
        sheet = "xl/worksheets/sheet1.xml"
        if bomb == "entities":
            content = zipped(members | {sheet: entities(members[sheet])})
        else:
            content = with_blanks(members, sheet, 1100)
    with pytest.raises(BadLog):
        read(content, name)


def entities(sheet: bytes) -> bytes:
    """Each entity is ten of the one before: a billion letters in all."""
    lines = "".join(f'<!ENTITY {b} "{f"&{a};" * 10}">' for a, b in pairwise("abcdefghij"))
    head = f'<!DOCTYPE worksheet [<!ENTITY a "aaaaaaaaaa">{lines}]>'.encode()
    return head + sheet.replace(b"<v>1</v>", b"<v>&j;</v>", 1)


def zipped(members) -> bytes:
    file = BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as parts:
        for name, content in members.items():
            parts.writestr(name, content)
    return file.getvalue()


def with_blanks(members, name: str, count: int) -> bytes:
    """The same with megabytes of blanks behind one of them: one is compressed, as often as it is there."""
    packing, blanks, file = zlib.compressobj(wbits=-zlib.MAX_WBITS), b" " * (1 << 20), BytesIO()
    packed = packing.compress(members[name]) + packing.flush(zlib.Z_FULL_FLUSH)
    packed += (packing.compress(blanks) + packing.flush(zlib.Z_FULL_FLUSH)) * count + packing.flush()
    sum_of_it = zlib.crc32(members[name])
    for _ in range(count):
        sum_of_it = zlib.crc32(blanks, sum_of_it)
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as parts:
        for other in members.keys() - {name}:
            parts.writestr(other, members[other])
        info = zipfile.ZipInfo(name)
        parts.writestr(info, packed)
        info.compress_type, info.CRC = zipfile.ZIP_DEFLATED, sum_of_it
        info.file_size = len(members[name]) + count * len(blanks)
        file.seek(info.header_offset)
        file.write(info.FileHeader())
        file.seek(parts.start_dir)
    return file.getvalue()


def opened(content: bytes, name: str):
    """The log without its samples; its file is kept for as long as the test runs."""
    import tempfile
    from pathlib import Path

    from davinci_forces.logs import open_log

    path = Path(tempfile.mkdtemp()) / name
    path.write_bytes(content)
    return open_log(path)
