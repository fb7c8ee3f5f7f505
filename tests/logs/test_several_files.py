"""A log in several files: parts in order, placed by when they started, and files side by side."""

import gzip
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from numpy.typing import NDArray

from davinci_forces.errors import BadLog
from davinci_forces.logs.joined import open_joined
from davinci_forces.logs.log import Log, Options
from davinci_forces.logs.parts import open_parts
from tests.logs.lvm_writer import Style, Write, lvm
from tests.logs.test_clocks import NOON, said, tdms


def times(log: Log, name: str) -> NDArray[np.float64]:
    """When the samples of a channel were taken."""
    channel = log.find(name)
    time, name = channel.time or log.time, channel.name
    return np.concatenate([block[time] for block in log.blocks([time, name])])


def files(folder: Path, suffix: str, *contents: bytes) -> list[Path]:
    made = []
    for i, content in enumerate(contents):
        made.append(folder / f"part-{i}.{suffix}")
        made[-1].write_bytes(content)
    return made


def waves(start: float, step: float = 0.01, rows: int = 3) -> bytes:
    return tdms({"a/q": (range(rows), said(start, step))})


def text(start: str, x: list[float], style: Style = Style(several=False)) -> bytes:  # noqa: B008 - frozen
    return lvm([Write({"q": [1.0, 2.0, 3.0]}, x=x, start=start)], style)


@pytest.mark.parametrize(
    ("suffix", "contents", "wanted"),
    [
        ("tdms", (waves(0), waves(60)), [0, 0.01, 0.02, 60, 60.01, 60.02]),
        ("tdms", (waves(0), waves(0.03)), [0, 0.01, 0.02, 0.03, 0.04, 0.05]),
        ("tdms", (waves(0), waves(60, 0.5)), [0, 0.01, 0.02, 60, 60.5, 61]),
        ("lvm", (text("02:26:06,5", [0, 0.1, 0.2]), text("02:26:08,5", [0, 0.1, 0.2])), [0, 0.1, 0.2, 2, 2.1, 2.2]),
        ("lvm", (text("02:26:06,5", [0, 0.1, 0.2]), text("02:26:08,5", [3, 3.1, 3.2])), [0, 0.1, 0.2, 3, 3.1, 3.2]),
        (
            "lvm",
            tuple(text(start, [], Style(x_columns="No")) for start in ("02:26:06,5", "02:27:06,5")),
            [0, 1, 2, 60, 61, 62],
        ),
        (
            "lvm",
            (
                text("02:26:06,5", [0, 0.1, 0.2]),
                lvm([Write({"q": [float(i)]}, x=[0.0], start=s) for i, s in enumerate(("02:26:07,5", "02:26:09,5"))]),
            ),
            [0, 0.1, 0.2, 1, 3],
        ),
        ("csv", (b"t,q\n2026-10-15T02:26:01Z,1\n", b"t,q\n2026-10-15T02:26:04.5Z,1\n"), [0, 3.5]),
    ],
)  # fmt: skip
def test_parts_are_placed_by_when_they_started(
    tmp_path: Path, suffix: str, contents: tuple[bytes, ...], wanted: list[float]
) -> None:
    log = open_parts(files(tmp_path, suffix, *contents), Options())
    for _ in range(2):  # a second pass is the same
        assert_allclose(times(log, "q"), wanted, rtol=1e-12)


def test_parts_that_follow_directly_have_the_times_of_one_file_to_the_last_bit(tmp_path: Path) -> None:
    step, rows = 1 / 3000, 1000
    parts = (waves(0, step, rows), waves(round(rows * step, 6), step, rows))
    log = open_parts(files(tmp_path, "tdms", *parts), Options())
    assert_array_equal(times(log, "q"), step * np.arange(2 * rows))


@pytest.mark.parametrize(
    ("contents", "says"),
    [
        ((waves(60), waves(0)), r'list the parts in this order: files = \["part-1.tdms", "part-0.tdms"\]'),
        ((waves(0), waves(0.01)), "begins at 0.01 s of the log, but part-0.tdms ends at 0.02 s; the parts overlap"),
        ((waves(0), waves(0)), "it is a copy of part-0.tdms, byte by byte; list each part of a log once"),
        ((waves(0), tdms({"a/i": ([1.0], said(60, 0.01))})), "its channels differ from those of"),
    ],
)
def test_parts_that_are_no_parts_of_one_recording_are_refused(
    tmp_path: Path, contents: tuple[bytes, ...], says: str
) -> None:
    with pytest.raises(BadLog, match=says):
        times(open_parts(files(tmp_path, "tdms", *contents), Options()), "q")


def test_the_same_file_is_not_two_parts(tmp_path: Path) -> None:
    [file] = files(tmp_path, "csv", b"t,q\n0,1\n1,2\n")
    with pytest.raises(BadLog, match="it is a copy of"):
        open_parts([file, tmp_path / "." / file.name], Options())


def test_parts_without_a_start_follow_directly_and_it_is_said(tmp_path: Path) -> None:
    parts = (tdms({"a/q": (values, {"wf_increment": 0.01})}) for values in ([1, 2], [3, 4]))
    log = open_parts(files(tmp_path, "tdms", *parts), Options())
    list(log.blocks(["a/q"]))
    assert log.clock is not None
    assert "each is assumed to begin directly" in log.warnings[0]


def test_parts_keep_the_clock_of_every_channel(tmp_path: Path) -> None:
    parts = (tdms({"a/q": ([1, 2], said(s, 0.01)), "a/i": ([3, 4], said(s, 0.02))}) for s in (0, 60))
    log = open_parts(files(tmp_path, "tdms", *parts), Options())
    assert_allclose(times(log, "a/q"), [0, 0.01, 60, 60.01], rtol=1e-12)
    assert_allclose(times(log, "a/i"), [0, 0.02, 60, 60.02], rtol=1e-12)


def test_files_side_by_side_keep_their_clocks_and_their_names(tmp_path: Path) -> None:
    (tmp_path / "q.csv").write_text("t,q\n0,1\n0.01,2\n0.02,3\n")
    (tmp_path / "i.csv.gz").write_bytes(gzip.compress(b"t,i\n0.005,4\n0.015,5\n"))
    log = open_joined([tmp_path / "q.csv", tmp_path / "i.csv.gz"], Options())
    assert [c.name for c in log.channels if not c.derived] == ["q/t", "q/q", "i/t", "i/i"]
    assert log.find("i").name == "i/i"
    assert [channel.name for channel in log.times_called("t")] == ["q/t", "i/t"]
    assert [channel.name for channel in log.times_called(0)] == ["q/t", "i/t"]
    [block] = log.blocks(["i/t", "i/i"])
    assert_array_equal(block["i/i"], [4, 5])
    assert "their clocks are assumed to have the same zero" in log.warnings[0]
    with pytest.raises(BadLog, match="have 2 clocks"):
        next(log.blocks(["q/q", "i/i"]))


def test_files_side_by_side_that_say_when_they_started_count_from_the_first(tmp_path: Path) -> None:
    (tmp_path / "q.tdms").write_bytes(waves(10))
    (tmp_path / "i.tdms").write_bytes(tdms({"a/i": ([1, 2], said(12.5, 0.1))}))
    log = open_joined([tmp_path / "q.tdms", tmp_path / "i.tdms"], Options())
    assert_allclose(times(log, "a/q"), [0, 0.01, 0.02], atol=1e-12)
    assert_allclose(times(log, "a/i"), [2.5, 2.6], rtol=1e-12)
    assert not log.warnings


def test_times_in_text_side_by_side_count_from_the_first_file(tmp_path: Path) -> None:
    for name, second in (("q", 1), ("i", 3)):
        (tmp_path / f"{name}.csv").write_text(f"t,{name}\n2026-10-15T02:26:0{second}Z,1\n2026-10-15T02:26:09Z,2\n")
    log = open_joined([tmp_path / "q.csv", tmp_path / "i.csv"], Options())
    assert_allclose(times(log, "q"), [0, 8])
    assert_allclose(times(log, "i"), [2, 8])


def test_an_old_start_of_labview_is_none(tmp_path: Path) -> None:
    epoch = (datetime(1904, 1, 1) - NOON).total_seconds()
    parts = (tdms({"a/q": (values, said(epoch, 0.01))}) for values in ([1, 2], [3, 4]))
    log = open_parts(files(tmp_path, "tdms", *parts), Options())
    assert log.started.startswith("1904-01-01T00:00:00")
    list(log.blocks(["a/q"]))
    assert "begin directly after" in log.warnings[0]
