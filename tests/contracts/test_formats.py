"""Every log format: what was written is what is read, and of a file that was cut nothing is made up."""

import json
from dataclasses import dataclass
from importlib import import_module
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, TdmsWriter
from numpy.testing import assert_allclose, assert_array_equal
from typer.testing import CliRunner

from pipeline.cli import app
from pipeline.logs import FORMATS, open_log
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


WRITERS = {"tdms": (tdms_with_a_step, tdms_in_segments), "lvm": (lvm_with_times, lvm_with_a_step), "text": (text,)}
EXAMPLES = {write.__name__: (name, write()) for name, writers in WRITERS.items() for write in writers}
EXAMPLE = pytest.mark.parametrize(("name", "written"), EXAMPLES.values(), ids=EXAMPLES)


def test_every_format_has_a_writer_here():
    assert set(WRITERS) == set(FORMATS)


@EXAMPLE
def test_what_was_written_is_read_bit_for_bit(name: str, written: Written):
    log, samples = read(written.content, written.file)
    assert log.format == name
    assert not log.warnings
    assert (log.cut, log.dropped) == (False, 0)
    for column, x in COLUMNS.items():
        channel = log.find(written.names[column])
        assert channel.unit == UNITS[column]
        assert channel.kind == "number"
        assert_array_equal(samples[channel.name], x)
        assert (log.nulls[channel.name], log.nans[channel.name]) == (0, 0)


@EXAMPLE
def test_the_clock_is_the_one_that_was_written(name: str, written: Written):
    log, samples = read(written.content, written.file)
    assert log.time == (written.time if written.knows else "")
    if written.time:
        assert_array_equal(samples[written.time], TIMES)
    else:
        assert log.clock is not None
        assert_allclose(log.clock.start + log.clock.step * np.arange(ROWS), TIMES, rtol=0, atol=1e-12)


@EXAMPLE
def test_some_channels_in_another_order_are_the_same_and_so_is_a_second_pass(name: str, written: Written, tmp_path):
    (tmp_path / written.file).write_bytes(written.content)
    log = open_log(tmp_path / written.file)
    chosen = [log.find(written.names[column]).name for column in reversed(COLUMNS)]
    for names in (chosen, chosen, chosen[:1]):
        blocks = list(log.blocks(names))
        assert [set(block) for block in blocks] == [set(names)] * len(blocks)
        for channel, x in zip(names, reversed(COLUMNS.values()), strict=False):
            assert_array_equal(np.concatenate([block[channel] for block in blocks]), x)


@EXAMPLE
def test_a_file_that_was_cut_gives_whole_rows_or_a_clear_error(name: str, written: Written):
    """Nothing is read that was not written: at every seventh byte, and at each of the last hundred."""
    size = len(written.content)
    for length in sorted({*range(0, size, 7), *range(size - 100, size)}):
        is_cut_honestly(written.content, length, written.file)


@EXAMPLE
def test_a_file_that_lost_its_last_quarter_keeps_half_of_its_samples(name: str, written: Written):
    """Which a reader that refuses whatever was cut would not keep."""
    if written.whole_only:
        pytest.skip("a file of this format is read whole or not at all")
    log, samples = read(written.content[: len(written.content) * 3 // 4], written.file)
    kept = sum(np.isfinite(samples[log.find(written.names[column]).name]).sum() for column in COLUMNS)
    assert ROWS <= kept < 2 * ROWS


@EXAMPLE
def test_inspect_shows_what_is_in_it(name: str, written: Written, tmp_path):
    (tmp_path / written.file).write_bytes(written.content)
    done = CliRunner().invoke(app, ["inspect", str(tmp_path / written.file), "--json", "--head", "3"])
    assert done.exit_code == 0, done.output
    shown = json.loads(done.output)
    assert (shown["format"], shown["rows"]) == (name, ROWS)
    for column, x in COLUMNS.items():
        assert shown["head"][written.names[column]] == x[:3].tolist()


@EXAMPLE
def test_the_first_format_that_recognises_a_file_is_its_own_whatever_the_file_is_called(name: str, written: Written):
    """Formats are tried in the order of their list, with the last as a catch-all."""
    for path in (Path(written.file), Path("log.dat")):
        head = written.content[:4096]
        first = next(f for f in FORMATS if import_module(f"pipeline.logs.{f}").recognises(path, head))
        assert first == name


@pytest.mark.parametrize("name", FORMATS)
def test_no_format_recognises_what_is_no_log(name: str):
    noise = bytes(range(256)) * 16
    assert not import_module(f"pipeline.logs.{name}").recognises(Path("picture.png"), noise)
