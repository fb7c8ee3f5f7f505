"""How much memory a log takes: read, 250 MB however large it is; taken through the stages, a few times its numbers.

`--full` for logs of 1 GB and of 20 minutes; else of 100 MB and of 5 minutes.
"""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.maths.arrays import BLOCK_SAMPLES
from davinci_forces.records import JointModel, Track, store
from tests import arm
from tests.benchmarks.reading import Report
from tests.benchmarks.test_reading import MB, lvm_file
from tests.logs.tdms_writer import segment

MOST = 250  # [MB]
MOST_OF_ALL = 850  # [MB] an hour of one joint at a kilohertz, from its log to the report
LIBRARIES = 330  # [MB] what a process takes that has loaded numpy, scipy, pyarrow and numba, and compiled kernels
TIMES = 1.9  # the numbers of a log, at most
COLUMNS = 5  # of a signal
STAGES = ("ingest", "resample", "average", "differentiate", "fit", "predict", "ekf", "whiteness")
JOINTS = ("hand_roll", "hand_pitch", "instrument_slide")
CHANNELS = [f"{joint}.{symbol}" for joint in JOINTS for symbol in ("q", "tau")]
MEASURED = """
import sys
from pathlib import Path
from resource import RUSAGE_CHILDREN, getrusage
from davinci_forces.maths import arrays
arrays.BLOCK_SAMPLES = int(sys.argv.pop(1))  # before others import it
from davinci_forces.logs.isolated import process
import davinci_forces
from davinci_forces.commands.inspect import describe
from davinci_forces.logs.log import Options
if sys.argv[1] == "run":
    assert davinci_forces.run(sys.argv[2], *sys.argv[3:], quiet=True)
else:
    describe(Path(sys.argv[2]), 5, Options())
process.close_all()
[line] = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")]
print(int(line.split()[1]) / 1024, getrusage(RUSAGE_CHILDREN).ru_maxrss / 1024)
"""

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="how much memory a process took is Linux's to say")


def tdms(path: Path, size: int) -> Path:
    """A log of 50 channels, those of joints among them, as it is written second by second."""
    t, names = np.arange(1000) / 1000, [*CHANNELS, *(f"other {i}" for i in range(43))]
    one = {f"g/{name}": np.sin(t + i) for i, name in enumerate(names)}
    second = 8 * (len(one) + 1) * len(t)
    with path.open("wb") as file:
        for i in range(size // second):
            file.write(segment({"g/time": i + t, **one}))
    return path


def lvm(path: Path, size: int) -> Path:
    made, _ = lvm_file(path, size)
    return made


def hdf5(path: Path, size: int) -> Path:
    """A log of 20 packed channels."""
    import h5py

    rows = size // 8 // 20
    values = np.random.default_rng(1).standard_normal(rows)
    with h5py.File(path, "w") as file:
        for name in ("time", *CHANNELS, *(f"other {i}" for i in range(13))):
            data = np.arange(rows) / 1000 if name == "time" else values
            file.create_dataset(name, data=data, chunks=(4096,), compression="gzip", compression_opts=1)
    return path


def parquet(path: Path, size: int) -> Path:
    """The same as one row group."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    rows = size // 8 // 20
    values = np.random.default_rng(1).standard_normal(rows)
    columns = dict.fromkeys((*CHANNELS, *(f"other {i}" for i in range(13))), values)
    pq.write_table(pa.table({"time": np.arange(rows) / 1000, **columns}), path, row_group_size=rows)
    return path


FORMATS: dict[str, tuple[Callable[[Path, int], Path], str]] = {
    "log.tdms": (tdms, ""),
    "log.lvm": (lvm, "channel "),
    "log.h5": (hdf5, ""),
    "log.parquet": (parquet, ""),
}


@pytest.mark.parametrize("name", FORMATS)
def test_a_log_is_read_in_little_memory_however_large_it_is(tmp_path: Path, full: bool, report: Report, name: str):
    write, numbered = FORMATS[name]
    (tmp_path / "raw" / "lab").mkdir(parents=True)
    log = write(tmp_path / "raw" / "lab" / name, (1000 if full else 100) * MB)
    channels = [f"{numbered}{i}" if numbered else channel for i, channel in enumerate(CHANNELS)]
    said = "".join(f'"{own}" = "{channel}"\n' for own, channel in zip(CHANNELS, channels, strict=True))
    said += "" if name.endswith("lvm") else 'time = "time"\n'
    table = f'[[log]]\nname = "large"\nfile = "{name}"\nrole = "validation"\n[log.channels]\n{said}'
    (log.parent / "study.toml").write_text(f'robot = "davinci"\n{table}')
    peaks = {"ingest": peak("run", log.parent, "ingest"), "inspect": peak("inspect", log)}
    told = "; ".join(f"{how} {own:.0f} MB, and its child {child:.0f} MB" for how, (own, child) in peaks.items())
    report(f"{name}, {log.stat().st_size // MB} MB: {told}")
    assert max(max(pair) for pair in peaks.values()) < MOST


def test_the_stages_of_a_long_log_take_little_more_memory_than_it_does(tmp_path: Path, full: bool, report: Report):
    """A kilohertz of three joints, one process: what the libraries are, and its numbers a few times."""
    signals = [arm.signal(joint, period=10.0, rate=1000.0, periods=120 if full else 30) for joint in JOINTS]
    study = tmp_path / "raw" / "lab"
    arm.write_csv(study / "long.csv", signals)
    (study / "study.toml").write_text(
        'robot = "davinci"\n' + arm.log_table("long", "long.csv", "identification", JOINTS)
    )
    own, _ = peak("run", study, *STAGES)
    shown, _ = peak("run", study, "report")
    numbers = 8 * COLUMNS * sum(len(signal) for signal in signals) / MB
    report(f"{len(signals[0])} samples of three joints, {numbers:.0f} MB: {', '.join(STAGES)} take {own:.0f} MB")
    report(f"the stages after them and the report {shown:.0f} MB")
    assert own < LIBRARIES + TIMES * numbers
    assert shown < LIBRARIES + TIMES * numbers


def hour_study(home: Path, minutes: int, share: float = 1.0) -> Path:
    """A study of one joint at a kilohertz: a minute to fit, one to validate, and a contact log of these minutes.

    Or this share of a minute, at a pace that is faster by as much.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    folder, joint = home / "raw" / "lab", "hand_roll"
    folder.mkdir(parents=True)
    windows = [[60.0 * i + 4.0, 60.0 * i + 6.0] for i in range(min(10, minutes))]

    def push(t: np.ndarray) -> np.ndarray:
        return np.where((t % 60.0 > 4.0) & (t % 60.0 < 6.0) & (t < 600.0), 1.0, 0.0)

    tables = []
    for seed, (name, role, period, seconds, external, more) in enumerate((
        ("ident", "identification", 10.0 * share, 60 * share, None, f"period = {10.0 * share}"),
        ("check", "validation", 13.0 * share, 65 * share, None, ""),
        ("push", "contact", 13.0, 60 * minutes, push, f"contact = {windows}"),
    )):  # fmt: skip
        signal = arm.signal(joint, seed, periods=seconds / period, rate=1000.0, period=period, external=external)
        columns = {"time": signal.t} | {f"{joint}.{symbol}": getattr(signal, symbol) for symbol in ("q", "dq", "tau")}
        pq.write_table(pa.table(columns), folder / f"{name}.parquet", row_group_size=1 << 16)
        tables.append(arm.log_table(name, f"{name}.parquet", role, [joint], more))
    arm.write_robot(folder)
    (folder / "study.toml").write_text('robot = "arm.toml"\nsimulated = true\n' + "".join(tables))
    return folder


def test_an_hour_at_a_kilohertz_goes_through_all_stages(tmp_path: Path, full: bool, report: Report):
    minutes = 60 if full else 10
    study = hour_study(tmp_path, minutes)
    own, child = peak("run", study)
    report(f"{minutes} minutes of one joint at 1 kHz take {own:.0f} MB through all stages, a child {child:.0f} MB")
    for kind in (JointModel, Track):
        place = store.path(kind, ("push", "hand_roll"))
        assert len(store.read(kind, tmp_path / "processed" / "lab", place, longest=1)) == minutes * 60_000
    assert (tmp_path / "reports" / "lab" / "results.json").exists()
    assert max(own, child) < MOST_OF_ALL


def peak(how: str, what: Path, *stages: str, block: int = BLOCK_SAMPLES) -> tuple[float, float]:
    """The most memory [MB] that a process takes for it, in blocks of so many samples, and a child of it."""
    words = [how, str(what), *stages]
    done = subprocess.run(
        [sys.executable, "-c", MEASURED, str(block), *words], capture_output=True, text=True, check=True
    )
    own, child = map(float, done.stdout.splitlines()[-1].split())
    return own, child
