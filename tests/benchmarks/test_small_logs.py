"""What each of many small logs costs, beside what a bare reader and writer of the same columns take."""

import time
from pathlib import Path

import numpy as np
import pyarrow.csv as csv
import pytest

from davinci_forces.runner.console import Console
from davinci_forces.runner.runner import Runner
from davinci_forces.runner.runs import folders
from davinci_forces.study import reading
from tests.benchmarks.reading import Report, parquet
from tests.logs.lvm_writer import Style, Write, lvm
from tests.logs.tdms_writer import segment

ROWS = {"csv": 180, "lvm": 180, "tdms": 400}  # of about 10 kB
BARE = 12.0  # times at most, what a log costs over parsing its columns and writing them to two files


def study(folder: Path, logs: int, format: str) -> Path:
    """A study of so many logs of one joint."""
    folder.mkdir(parents=True)
    tables = ""
    for number in range(logs):
        t = np.arange(ROWS[format]) / 100
        noise = np.random.default_rng(number).standard_normal((2, len(t)))
        columns = {"time": t, "q": np.sin(t) + 1e-4 * noise[0], "tau": np.cos(t) + 0.1 * noise[1]}
        (folder / f"{number}.{format}").write_bytes(content(columns, format))
        clock = "" if format == "lvm" else 'time = "time"\n'
        tables += f'[[log]]\nname = "log-{number}"\nfile = "{number}.{format}"\nrole = "validation"\n'
        tables += f'[log.channels]\n{clock}"hand_roll.q" = "q"\n"hand_roll.tau" = "tau"\n'
    (folder / "study.toml").write_text(f'robot = "davinci"\n{tables}')
    return folder


def content(columns: dict[str, np.ndarray], format: str) -> bytes:
    if format == "tdms":
        return segment({f"g/{name}": values for name, values in columns.items()})
    if format == "lvm":
        t, *others = columns.values()
        named = dict(zip(("q", "tau"), (values.tolist() for values in others), strict=True))
        return lvm([Write(named, x=t.tolist(), step=0.01)], Style(decimal=".", several=False))
    rows = np.column_stack(list(columns.values())).tolist()
    return "\n".join([",".join(columns), *(",".join(map(repr, row)) for row in rows), ""]).encode()


def seconds_of_reading(lab: Path) -> float:
    """What the processor takes to read all logs of a study anew."""
    begun, start = time.time() - 1.0, time.process_time()  # a file system may round times
    quiet = Console(lambda line: None, lambda line: None)
    where = folders(lab, None, None)
    assert Runner(reading.read(lab), where, quiet, force=True).run(["ingest"])
    taken = time.process_time() - start
    written = [file for file in (where.processed / "recording").rglob("*.parquet") if file.stat().st_mtime >= begun]
    assert len(written) == len(reading.read(lab).logs)
    return taken


def seconds_of_bare(text: Path, target: Path, times: int) -> float:
    start = time.process_time()
    for _ in range(times):
        table = csv.read_csv(text)
        for name in ("a.parquet", "b.parquet"):
            with parquet(target / name, table.column_names) as writer:
                writer.write_table(table.cast(writer.schema))
    return time.process_time() - start


@pytest.mark.parametrize("format", ROWS)
def test_a_small_log_costs_a_few_times_what_a_bare_reader_takes(
    tmp_path: Path, full: bool, report: Report, format: str
) -> None:
    """A study of one log takes what is the same however many there are, and what is imported."""
    logs = 500 if full else 100
    one, lab = study(tmp_path / "raw" / "one", 1, format), study(tmp_path / "raw" / "lab", logs, format)
    text = tmp_path / "log.csv"
    text.write_bytes((study(tmp_path / "raw" / "text", 1, "csv") / "0.csv").read_bytes())
    seconds_of_reading(one)
    seconds_of_bare(text, tmp_path, 1)
    each, bare = np.inf, np.inf
    for _ in range(3):
        each = min(each, (seconds_of_reading(lab) - seconds_of_reading(one)) / (logs - 1))
        bare = min(bare, seconds_of_bare(text, tmp_path, logs) / logs)
    report(
        f"{format}: {1e3 * each:.1f} ms a log of {logs}, {each / bare:.1f} times a bare reader's {1e3 * bare:.2f} ms"
    )
    assert each < BARE * bare
