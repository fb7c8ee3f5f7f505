"""What must hold of a file that ends too early, wherever it ends."""

from functools import lru_cache

import numpy as np
from numpy.testing import assert_array_equal

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Options
from tests.logs.reading import read

whole = lru_cache(maxsize=4)(read)


def is_cut_honestly(content: bytes, length: int, name: str, options: Options = Options()) -> None:  # noqa: B008
    """What is left of a file reads as the first rows of the whole one, or is refused with a clear error.

    A sample that is missing is counted as such, and rows are lost silently only where what is left is well formed.
    """
    _, full = whole(content, name, options)
    try:
        log, samples = read(content[:length], name, options)
    except BadLog:
        return
    for channel, values in samples.items():
        there = full[channel][: len(values)]
        missing = np.isnan(values) & ~np.isnan(there)
        assert_array_equal(values[~missing], there[~missing])
        assert missing.sum() <= log.nulls[channel]
    ended = content[:length].endswith((b"\n", b"\r", b"\n\0", b"\r\0"))
    ended = ended or bool(options.dtype and length % (8 * len(options.columns)) == 0)  # float64
    well_formed = content[length:].startswith(b"TDSm") if name.endswith("tdms") else ended
    if not well_formed and any(len(values) < len(full[channel]) for channel, values in samples.items()):
        assert log.warnings
