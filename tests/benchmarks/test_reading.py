"""How fast logs become Parquet, beside a bare parser of text and npTDMS: `--full` for the promised sizes."""

from pathlib import Path

import numpy as np
import pyarrow.csv as csv
import pyarrow.parquet as pq
import pytest

from davinci_forces.logs import open_log
from tests.benchmarks.reading import Report, nptdms, nptdms_alone, ours, ours_alone, seconds
from tests.logs.lvm_writer import Style, Write, lvm
from tests.logs.tdms_writer import daqmx, segment

CHANNELS = 21  # position, velocity and torque of seven joints
MB = 1_000_000


def lvm_file(path: Path, size: int) -> tuple[Path, bytes]:
    """A one-segment log of about `size` bytes, and its rows."""
    columns = {f"channel {i}": [0.0] for i in range(CHANNELS)}
    head = lvm([Write(columns, x=[0.0])], Style(decimal=".", several=False))
    head = head[: head.rfind(b"Comment\r\n") + 9]
    rng = np.random.default_rng(3)
    many = 20_000
    table = rng.standard_normal((many, CHANNELS))
    rows = size // (CHANNELS * 10 + 12)
    with path.open("wb") as file:
        file.write(head)
        cells = ["\t".join(f"{value:.6f}" for value in row) for row in table]
        for first in range(0, rows, many):
            lines = (f"{(first + i) * 0.001:.6f}\t{cells[i]}\r\n" for i in range(min(many, rows - first)))
            file.write("".join(lines).encode())
    return path, path.read_bytes()[len(head) :]


def test_lvm_to_parquet_costs_little_more_than_parsing_its_rows(tmp_path: Path, full: bool, report: Report) -> None:
    size, most = (100 * MB, 2.0) if full else (10 * MB, 4.0)
    path, body = lvm_file(tmp_path / "log.lvm", size)
    (tmp_path / "body.txt").write_bytes(body)
    plain = csv.ParseOptions(delimiter="\t")
    bare, took = seconds(
        lambda: csv.read_csv(tmp_path / "body.txt", parse_options=plain), lambda: ours(path, tmp_path / "log.parquet")
    )
    rows, parsed = pq.read_table(tmp_path / "log.parquet"), csv.read_csv(tmp_path / "body.txt", parse_options=plain)
    for one, other in zip(rows.columns, parsed.columns[-rows.num_columns :], strict=True):
        np.testing.assert_array_equal(one.slice(1), other)  # the bare parser takes the first row for names
    report(f"lvm, {size // MB} MB: {took:.3f} s, bare parser {bare:.3f} s, ratio {took / bare:.2f} (at most {most})")
    assert took <= most * bare


def table(rows: int) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(4)
    return {f"Motors/channel {i}": rng.standard_normal(rows).cumsum() for i in range(CHANNELS)}


def test_contiguous_tdms_costs_little_more_than_nptdms(tmp_path: Path, full: bool, report: Report) -> None:
    size, most = (200 * MB, 1.5) if full else (20 * MB, 3.0)
    path = tmp_path / "log.tdms"
    path.write_bytes(segment(table(size // 10 // 8 // CHANNELS)) * 10)
    rival, took = seconds(
        lambda: nptdms(path, tmp_path / "rival.parquet"), lambda: ours(path, tmp_path / "log.parquet")
    )
    same(tmp_path)
    report(f"tdms contiguous, {size // MB} MB: {took:.3f} s, npTDMS {rival:.3f} s, ratio {took / rival:.2f}")
    assert took <= most * rival


def test_interleaved_tdms_is_read_several_times_faster_than_by_nptdms(
    tmp_path: Path, full: bool, report: Report
) -> None:
    size, least = (200 * MB, 3.0) if full else (20 * MB, 1.5)
    path = tmp_path / "log.tdms"
    path.write_bytes(segment(table(size // 8 // CHANNELS), interleaved=True))
    faster(path, tmp_path, "interleaved", least, report, repeats=3)


@pytest.mark.parametrize("layout", ["chunks", "segments"])
def test_tdms_written_one_sample_at_a_time_is_read_far_faster_than_by_nptdms(
    tmp_path: Path, full: bool, report: Report, layout: str
) -> None:
    size, least = (48 * MB, 30.0) if full else (5 * MB, 15.0)
    path = tmp_path / "log.tdms"
    if layout == "chunks":
        rows = size // 8 // CHANNELS
        path.write_bytes(segment(table(rows), chunks=rows))
    else:
        one = table(1)
        path.write_bytes(segment(one) + segment(one, described=False) * (size // (28 + 8 * CHANNELS)))
    faster(path, tmp_path, f"one sample per call, in {layout}", least, report, repeats=1)


def same(folder: Path) -> None:
    """What was written is what the rival wrote."""
    log, rival = (pq.read_table(folder / f"{name}.parquet") for name in ("log", "rival"))
    assert len(log) > 0
    for one, other in zip(log.columns, rival.columns, strict=True):
        np.testing.assert_array_equal(one, other)


def faster(path: Path, folder: Path, what: str, least: float, report: Report, repeats: int) -> None:
    rival, took = seconds(
        lambda: nptdms(path, folder / "rival.parquet"), lambda: ours(path, folder / "log.parquet"), repeats=repeats
    )
    same(folder)
    size = path.stat().st_size // MB
    report(f"tdms {what}, {size} MB: {took:.3f} s, npTDMS {rival:.3f} s, {rival / took:.1f} x (at least {least})")
    assert rival >= least * took


@pytest.mark.parametrize("many", [350, 1400])
def test_many_tdms_channels_of_differing_counts_cost_little_more_than_with_nptdms(
    tmp_path: Path, report: Report, many: int
) -> None:
    path = tmp_path / "log.tdms"
    path.write_bytes(b"".join(segment({f"g/{i}": np.arange(i % 97 + 1.0) for i in range(many)}) for _ in range(3)))
    little_more(path, f"{many} channels", report)


def test_as_many_clocks_as_tdms_channels_cost_little_more_than_with_nptdms(tmp_path: Path, report: Report) -> None:
    path, many = tmp_path / "log.tdms", 1400
    channels = {f"g/{i}": np.arange(97.0) for i in range(many)}
    steps = {name: 1e-3 * (1 + i / 20) for i, name in enumerate(channels)}
    path.write_bytes(b"".join(segment(channels, steps=steps) for _ in range(3)))
    clocks = {channel.time for channel in open_log(path).channels if not channel.derived}
    assert len(clocks) == many
    little_more(path, f"{many} channels with a clock each", report)


def test_values_of_daq_cards_cost_little_more_than_with_nptdms(tmp_path: Path, full: bool, report: Report) -> None:
    path, rows = tmp_path / "log.tdms", 100_000 if full else 10_000
    raw = np.random.default_rng(5).integers(-9000, 9000, (16, rows)).astype(np.int16)
    path.write_bytes(daqmx({f"g/{i}": values for i, values in enumerate(raw)}, 1e-3, chunks=100) * 5)
    little_more(path, "of DAQ cards", report)


def little_more(path: Path, what: str, report: Report) -> None:
    """Reading all channels takes at most twice as long as with npTDMS."""
    assert ours_alone(path) == pytest.approx(nptdms_alone(path), rel=1e-9)
    rival, took = seconds(lambda: nptdms_alone(path), lambda: ours_alone(path))
    report(f"tdms {what}, {path.stat().st_size / MB:.2f} MB: {took:.4f} s, npTDMS {rival:.4f} s, {took / rival:.2f} x")
    assert took <= 2 * rival
