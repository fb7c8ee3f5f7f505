"""What parent and child say to each other: lines of JSON, each with the numbers that belong to it behind it."""

import json
from collections.abc import Sequence
from typing import IO, Any

import numpy as np

from davinci_forces.maths.arrays import Array

Message = dict[str, Any]


def send(stream: IO[bytes], message: Message, columns: Sequence[Array] = ()) -> None:
    """Write a message, and columns of one length."""
    rows = len(columns[0]) if columns else 0
    stream.write(json.dumps(message | {"shape": [len(columns), rows]}).encode() + b"\n")
    for column in columns:
        stream.write(np.ascontiguousarray(column, np.float64).data)
    stream.flush()


def receive(stream: IO[bytes]) -> tuple[Message, list[Array]]:
    """Read a message and its columns.

    Raises
    ------
    EOFError
        If the other side is gone.
    """
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    message = json.loads(line)
    columns, rows = message.pop("shape")
    return message, [_column(stream, rows) for _ in range(columns)]


def _column(stream: IO[bytes], rows: int) -> Array:
    content = stream.read(8 * rows)
    if len(content) < 8 * rows:
        raise EOFError
    return np.frombuffer(content, np.float64)
