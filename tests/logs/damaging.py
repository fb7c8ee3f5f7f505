"""Files of every format with random damages, each read to its end; run by itself, so that its memory can be measured.

    python -m tests.logs.damaging <seed> <count> <1 for texts alone> ...

prints what happened as JSON, a line of each run: how many were refused, what was raised that is no BadLog, and the most
memory so far and time.
"""

import json
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pyarrow as pa

from davinci_forces.errors import BadLog
from davinci_forces.logs import open_log
from davinci_forces.logs.isolated.process import close_all
from davinci_forces.logs.log import Options
from tests.contracts.test_formats import EXAMPLES
from tests.logs import array_writers, bag_writer
from tests.logs.test_dialects import READ, REFUSED

ROWS = 200
MOST_DATA = 2 << 30  # [bytes] so that what asks for more does not take the machine down
ODD = (0, 1, 0x7F, 0x80, 0xFF)
EDGE = 512  # [bytes] at either end of a file, where headers and footers are


class Example:
    """A whole file, or the files of a folder."""

    def __init__(self, name: str, files: dict[str, bytes], options: Options = Options()) -> None:  # noqa: B008
        self.name, self.files, self.options = name, files, options

    def write(self, home: Path, damaged: str, content: bytes) -> Path:
        """It with one file as it is given."""
        files = self.files | {damaged: content}
        for file, each in files.items():
            (home / file).parent.mkdir(parents=True, exist_ok=True)
            (home / file).write_bytes(each)
        return home / Path(next(iter(files))).parts[0]


def examples(all_texts: bool = False) -> Iterator[Example]:
    """Those of the contract, and larger ones: packed, in groups, in structs, with several topics; or texts alone."""
    for name, (_, written) in EXAMPLES.items():
        yield Example(name, {written.file: written.content}, written.options)
    texts = {name: dialect.text for name, dialect in [*READ.items(), *REFUSED.items()]}
    for name, content in texts.items() if all_texts else [("dialect", texts["German dates"])]:
        yield Example(name, {"log.csv": content if isinstance(content, bytes) else content.encode()})
    if all_texts:
        return
    x = np.random.default_rng(0).normal(size=(ROWS, 3))
    packed = {"chunks": (50, 3), "compression": "gzip", "shuffle": True, "fletcher32": False}
    yield Example(
        "hdf5_packed", {"log.h5": array_writers.hdf5({"arm/q": x, "arm/i": 2 * x}, {"arm/q": "rad"}, **packed)}
    )
    structs = {"log": {"arm": {"q": x, "name": "left"}}, "ts": {"Time": x[:, 0], "Data": x}}
    for packed_too in (True, False):
        yield Example(f"mat_structs_{packed_too}", {"log.mat": array_writers.matlab(structs, packed_too)})
    objects = Path(__file__).with_name("objects.mat").read_bytes()
    yield Example("mat_objects", {"log.mat": objects})
    lists = pa.FixedSizeListArray.from_arrays(pa.array(x.ravel()), 3)
    episodes = {"timestamp": x[:, 0], "episode_index": np.arange(ROWS) // 50, "observation.state": lists}
    yield Example("lerobot", {"log.parquet": array_writers.arrow("parquet", episodes)})
    yield Example("mat_73_structs", {"log.mat": array_writers.matlab_73(structs)})
    messages = [message for i, row in enumerate(x) for message in _messages(0.01 * i, row)]
    with tempfile.TemporaryDirectory() as home:
        for name in ("bag", "bag_mcap", "log.bag"):
            path = bag_writer.write(Path(home) / name, messages)
            parts = sorted(path.iterdir()) if path.is_dir() else [path]
            yield Example(f"topics_{name}", {str(part.relative_to(home)): part.read_bytes() for part in parts})


def _messages(t, row) -> Iterator[bag_writer.Message]:
    yield bag_writer.joint_state(t, ["yaw", "pitch", "insertion"], row, row, row)
    pairs = (("linear", row), ("angular", row))
    yield bag_writer.vectors(t, "TwistStamped", "twist", *pairs, topic="/PSM1/measured_cv")


def damaged(content: bytes, random: np.random.Generator) -> bytes:
    """Some bytes changed, taken out or put in, half of the time near an end."""
    at = int(random.integers(len(content)))
    if random.random() < 0.5:
        at = int(random.integers(min(EDGE, len(content))))
        at = at if random.random() < 0.5 else len(content) - 1 - at
    count = int(random.choice([1, 1, 1, 2, 4, 8, 64]))
    what = random.integers(5)
    if what == 0:
        return content[:at] + random.bytes(count) + content[at + count :]
    if what == 1:
        return content[:at] + bytes([int(random.choice(ODD))]) * count + content[at + count :]
    if what == 2:
        return content[:at] + content[at + count :]
    if what == 3:
        return content[:at] + random.bytes(count) + content[at:]
    return content[:at] + bytes([content[at] ^ (1 << int(random.integers(8)))]) + content[at + 1 :]


def read_all(path: Path, options: Options) -> None:
    """Every sample of every channel, one clock after the other."""
    log = open_log(path, options)
    usable = [channel.name for channel in log.channels if channel.kind in ("number", "time")]
    for names in log.by_clock(usable).values():
        for _ in log.blocks(names):
            pass


def own_peak() -> int:
    """The most memory that this program took [kB]; `ru_maxrss` counts what its parent had when it was started, too."""
    [line] = [line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")]
    return int(line.split()[1])


def main(seed: int, count: int, all_texts: int) -> None:
    """Damage and read so many files."""
    import resource

    resource.setrlimit(resource.RLIMIT_DATA, (MOST_DATA, MOST_DATA))
    random = np.random.default_rng(seed)
    all_of_them = list(examples(bool(all_texts)))
    outcomes: Counter[str] = Counter()
    failures: list[str] = []
    slowest = 0.0
    with tempfile.TemporaryDirectory() as folder:
        for number in range(count):
            example = all_of_them[number % len(all_of_them)]
            file = str(random.choice(sorted(example.files)))
            path = example.write(Path(folder) / str(number), file, damaged(example.files[file], random))
            begun = time.monotonic()
            try:
                read_all(path, example.options)
                outcomes[f"{example.name} read"] += 1
            except BadLog as refused:
                outcomes[f"{example.name} refused"] += 1
                if str(path) not in str(refused):
                    failures.append(f"{number} {example.name}: names no file: {refused}")
            except BaseException:
                failures.append(f"{number} {example.name}/{file}: {traceback.format_exc()}")
            slowest = max(slowest, time.monotonic() - begun)
    close_all()  # so that they count
    most = max(own_peak(), resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)
    said = {"failures": failures, "outcomes": outcomes, "slowest": slowest, "memory": most / 1024, "read": count}
    print(json.dumps(said))


if __name__ == "__main__":
    numbers = [int(number) for number in sys.argv[1:]]
    for run in zip(numbers[::3], numbers[1::3], numbers[2::3], strict=True):
        main(*run)
