"""Every log format: what was written is what is read, and of a file that was cut nothing is made up."""

import json
from dataclasses import dataclass, field
from importlib import import_module
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.logs import FORMATS, open_log
from davinci_forces.logs.log import Options
from tests.logs import bag_writer
from tests.logs.array_writers import arrow, hdf5, matlab, matlab_73, npy, npz, xlsx
from tests.logs.cutting import is_cut_honestly
from tests.logs.lvm_writer import Style, Write, lvm
from tests.logs.reading import read
from tests.logs.tdms_writer import segment

ROWS, STEP = 40, 0.01
random = np.random.default_rng(0)
COLUMNS = {"Roll position": random.normal(size=ROWS), "Roll current": 1e-3 * random.normal(size=ROWS)}
UNITS = {"Roll position": "rad", "Roll current": "A"}
TIMES = STEP * np.arange(ROWS)


@dataclass(frozen=True)
class Written:
    """COLUMNS as a file of a format: under which names a reader has them, and where its times are."""

    content: bytes
    file: str
    names: dict[str, str]
    time: str = ""  # the channel of the times; "" where the format counts samples
    knows: bool = False  # that this channel is the time, as the format says so
    whole_only: bool = False  # the recorder writes it at once, so that one that was cut may be refused
    units: dict[str, str] = field(default_factory=lambda: UNITS)
    resolution: float = 0.0  # [s] of its times
    precision: float = 0.0  # relative, of its numbers
    options: Options = Options()  # noqa: RUF009 - frozen; what a study has to say of it


def tdms_with_a_step() -> Written:
    """As LabVIEW's waveforms are: every channel carries its sampling interval."""
    file, timed = BytesIO(), {"wf_start_offset": 0.0, "wf_increment": STEP}
    with TdmsWriter(file) as writer:
        writer.write_segment(
            [ChannelObject("Motors", n, x, {"unit_string": UNITS[n], **timed}) for n, x in COLUMNS.items()]
        )
    return Written(file.getvalue(), "log.tdms", {name: f"Motors/{name}" for name in COLUMNS})


def tdms_in_segments() -> Written:
    """Written in four goes, interleaved, with the times as a channel."""
    all_of_it = {"Motors/t": TIMES} | {f"Motors/{name}": x for name, x in COLUMNS.items()}
    units = {"Motors/t": "s"} | {f"Motors/{name}": unit for name, unit in UNITS.items()}
    parts = [{n: x[i : i + 10] for n, x in all_of_it.items()} for i in range(0, ROWS, 10)]
    content = b"".join(segment(part, interleaved=True, units=units, described=i == 0) for i, part in enumerate(parts))
    return Written(content, "log.tdms", {name: f"Motors/{name}" for name in COLUMNS}, "Motors/t")


def lvm_with_times() -> Written:
    write = Write(COLUMNS, x=TIMES.tolist(), units=tuple(UNITS.values()), step=STEP)
    return Written(lvm([write], Style(several=False)), "log.lvm", {n: n for n in COLUMNS}, "X_Value", True)


def lvm_with_a_step() -> Written:
    write = Write(COLUMNS, units=tuple(UNITS.values()), step=STEP)
    return Written(lvm([write], Style(x_columns="No", several=False, decimal=".")), "log.lvm", {n: n for n in COLUMNS})


def text() -> Written:
    header = ",".join(["t [s]", *(f"{name} [{unit}]" for name, unit in UNITS.items())])
    rows = (",".join(map(repr, row)) for row in np.column_stack([TIMES, *COLUMNS.values()]).tolist())
    names = {name: f"{name} [{unit}]" for name, unit in UNITS.items()}
    return Written("\n".join([header, *rows, ""]).encode(), "log.csv", names, "t [s]")


UNITLESS = dict.fromkeys(COLUMNS, "")


def bag_of_ros_1() -> Written:
    return _bag("log.bag")


def bag_of_ros_2() -> Written:
    return _bag("log.db3")


def bag_of_mcap() -> Written:
    return _bag("log.mcap", "log_mcap")


def _bag(file: str, name: str = "") -> Written:
    messages = [
        bag_writer.joint_state(t, ["roll"], position=[q], effort=[i], topic="/arm/measured_js")
        for t, q, i in zip(TIMES.tolist(), *COLUMNS.values(), strict=True)
    ]
    names = dict(zip(COLUMNS, ("/arm/measured_js/position[0]", "/arm/measured_js/effort[roll]"), strict=True))
    return Written(
        bag_writer.content(name or file, messages), file, names, "/arm/measured_js/stamp", knows=True,
        whole_only=not file.endswith(".bag"), units=UNITLESS, resolution=1e-9,
    )  # fmt: skip


def mat() -> Written:
    names = {"Roll position": "arm/q", "Roll current": "arm.i"}
    content = matlab({"t": TIMES, "arm": dict(zip("qi", COLUMNS.values(), strict=True))})
    return Written(content, "log.mat", names, "t", whole_only=True, units=UNITLESS)


def mat_73() -> Written:
    names = {"Roll position": "arm/q", "Roll current": "arm.i"}
    content = matlab_73({"t": TIMES, "arm": dict(zip("qi", COLUMNS.values(), strict=True))})
    return Written(content, "log.mat", names, "t", whole_only=True, units=UNITLESS)


def hdf5_in_groups() -> Written:
    arrays = {"arm/t": TIMES} | {f"arm/{name}": x for name, x in COLUMNS.items()}
    content = hdf5(arrays, {f"arm/{name}": unit for name, unit in UNITS.items()})
    return Written(content, "log.h5", {name: f"arm/{name}" for name in COLUMNS}, "arm/t", whole_only=True)


def parquet() -> Written:
    return Written(
        arrow("parquet", {"t": TIMES, **COLUMNS}, UNITS), "log.parquet", {n: n for n in COLUMNS}, "t", whole_only=True
    )


def feather() -> Written:
    return Written(
        arrow("feather", {"t": TIMES, **COLUMNS}, UNITS), "log.feather", {n: n for n in COLUMNS}, "t", whole_only=True
    )


def numpy_arrays() -> Written:
    return _npz(packed=False)


def numpy_packed() -> Written:
    return _npz(packed=True)


def _npz(packed: bool) -> Written:
    content = npz({"t": TIMES, **COLUMNS}, packed)
    return Written(content, "log.npz", {n: n for n in COLUMNS}, "t", whole_only=True, units=UNITLESS)


def numpy_records() -> Written:
    records = np.rec.fromarrays([TIMES, *COLUMNS.values()], names=["t", *COLUMNS])
    names = {name: f"log/{name}" for name in COLUMNS}
    return Written(npy(records), "log.npy", names, "log/t", whole_only=True, units=UNITLESS)


def workbook() -> Written:
    """Workbooks keep 16 digits."""
    rows = np.column_stack([TIMES, *COLUMNS.values()]).tolist()
    content = xlsx([["t", *COLUMNS], ["s", *UNITS.values()], *rows])
    names = {name: name for name in COLUMNS}
    return Written(content, "log.xlsx", names, "t", whole_only=True, resolution=1e-15, precision=1e-15)


def binary() -> Written:
    """As LabVIEW writes: big-endian, row after row."""
    content = np.column_stack([TIMES, *COLUMNS.values()]).astype(">f8").tobytes()
    options = Options(dtype="float64", columns=("t", *(f"{name} [{unit}]" for name, unit in UNITS.items())))
    names = {name: f"{name} [{unit}]" for name, unit in UNITS.items()}
    return Written(content, "log.bin", names, "t", options=options)


WRITERS = {
    "tdms": (tdms_with_a_step, tdms_in_segments), "lvm": (lvm_with_times, lvm_with_a_step), "tdm": (),  # never read
    "ros": (bag_of_ros_1, bag_of_ros_2, bag_of_mcap), "mat": (mat, mat_73), "hdf5": (hdf5_in_groups,),
    "arrow": (parquet, feather), "npz": (numpy_arrays, numpy_packed, numpy_records), "xlsx": (workbook,),
    "binary": (binary,), "text": (text,),
}  # fmt: skip
EXAMPLES = {write.__name__: (name, write()) for name, writers in WRITERS.items() for write in writers}
EXAMPLE = pytest.mark.parametrize(("name", "written"), EXAMPLES.values(), ids=EXAMPLES)


def test_every_format_has_a_writer_here():
    assert set(WRITERS) == set(FORMATS)


@EXAMPLE
def test_what_was_written_is_read_bit_for_bit(name: str, written: Written):
    log, samples = read(written.content, written.file, written.options)
    assert log.format == name
    assert not log.warnings
    assert (log.cut, log.dropped) == (False, 0)
    for column, x in COLUMNS.items():
        channel = log.find(written.names[column])
        assert channel.unit == written.units[column]
        assert channel.kind == "number"
        assert_allclose(samples[channel.name], x, rtol=written.precision, atol=0)
        assert (log.nulls[channel.name], log.nans[channel.name]) == (0, 0)


@EXAMPLE
def test_the_clock_is_the_one_that_was_written(name: str, written: Written):
    log, samples = read(written.content, written.file, written.options)
    assert log.time == (written.time if written.knows else "")
    if written.time:
        assert_allclose(samples[written.time], TIMES, rtol=0, atol=written.resolution)
    else:
        assert log.clock is not None
        assert_allclose(log.clock.start + log.clock.step * np.arange(ROWS), TIMES, rtol=0, atol=1e-12)


@EXAMPLE
def test_some_channels_in_another_order_are_the_same_and_so_is_a_second_pass(name: str, written: Written, tmp_path):
    (tmp_path / written.file).write_bytes(written.content)
    log = open_log(tmp_path / written.file, written.options)
    chosen = [log.find(written.names[column]).name for column in reversed(COLUMNS)]
    for names in (chosen, chosen, chosen[:1]):
        blocks = list(log.blocks(names))
        assert [set(block) for block in blocks] == [set(names)] * len(blocks)
        for channel, x in zip(names, reversed(COLUMNS.values()), strict=False):
            assert_allclose(np.concatenate([block[channel] for block in blocks]), x, rtol=written.precision, atol=0)


@EXAMPLE
def test_a_file_that_was_cut_gives_whole_rows_or_a_clear_error(name: str, written: Written):
    """Nothing is read that was not written: at every seventh byte, or a thousand, and the last ones."""
    size = len(written.content)
    for length in sorted({*range(0, size, max(7, size // 1000)), *range(size - 100, size)}):
        is_cut_honestly(written.content, length, written.file, written.options)


@EXAMPLE
def test_a_file_that_lost_its_last_quarter_keeps_half_of_its_samples(name: str, written: Written):
    """Which a reader that refuses whatever was cut would not keep."""
    if written.whole_only:
        pytest.skip("a file of this format is read whole or not at all")
    log, samples = read(written.content[: len(written.content) * 3 // 4], written.file, written.options)
    kept = sum(np.isfinite(samples[log.find(written.names[column]).name]).sum() for column in COLUMNS)
    assert ROWS <= kept < 2 * ROWS


@EXAMPLE
def test_inspect_shows_what_is_in_it(name: str, written: Written, tmp_path):
    (tmp_path / written.file).write_bytes(written.content)
    said = (
        ["--dtype", written.options.dtype, "--columns", ",".join(written.options.columns)]
        if written.options.dtype
        else []
    )
    done = CliRunner().invoke(app, ["inspect", str(tmp_path / written.file), "--json", "--head", "3", *said])
    assert done.exit_code == 0, done.output
    shown = json.loads(done.output)
    assert (shown["format"], shown["rows"]) == (name, ROWS)
    for column, x in COLUMNS.items():
        name_of = {c["name"]: c["name"] for c in shown["channels"]} | {
            c.get("alias", c["name"]): c["name"] for c in shown["channels"]
        }
        assert_allclose(shown["head"][name_of[written.names[column]]], x[:3], rtol=written.precision, atol=0)


@EXAMPLE
def test_the_first_format_that_recognises_a_file_is_its_own_whatever_the_file_is_called(name: str, written: Written):
    """Formats are tried in the order of their list, with the last as a catch-all."""
    for path in (Path(written.file), Path("log.dat")):
        head = written.content[:4096]
        first = next(f for f in FORMATS if import_module(f"davinci_forces.logs.{f}").recognises(path, head))
        assert first == name


@pytest.mark.parametrize("name", FORMATS)
def test_no_format_recognises_what_is_no_log(name: str):
    noise = bytes(range(256)) * 16
    assert not import_module(f"davinci_forces.logs.{name}").recognises(Path("picture.png"), noise)
