"""Read the messages of a bag of ROS 1 or 2, from any storage, with rosbags."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import quote

from rosbags import rosbag1, rosbag2
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore

from davinci_forces.errors import BadLog
from davinci_forces.files import open_file

RULE = "=" * 80 + "\n"  # between definitions in IDL
LITERAL = "/:"  # characters of a path that an SQLite address may hold unquoted
PAGES = slice(28, 32)  # bytes of a database's header with the number of pages
PAGE = slice(16, 18)  # and with the size of a page


class Database(Sqlite3Reader):  # type: ignore[misc]  # rosbags is not there for everybody who checks types
    """An SQLite storage with a quoted path: rosbags makes an address of it, which `#` or `?` in a name would end."""

    def __init__(self, path: Path) -> None:
        super().__init__(Path(quote(path.as_posix(), safe=LITERAL)))


class Folder(DirectoryReader):  # type: ignore[misc]
    """A bag in a folder."""

    STORAGE_PLUGINS: ClassVar[dict[str, Any]] = {**DirectoryReader.STORAGE_PLUGINS, "sqlite3": Database}


class Bag:
    """An opened bag."""

    def __init__(self, path: Path) -> None:
        head = b"" if path.is_dir() else _head(path)
        self.ros1 = head.startswith(b"#ROSBAG")
        try:
            self.storage = _storage(path, head)
            self.storage.open()
        except (rosbag1.ReaderError, rosbag2.ReaderError) as error:
            remedy = "run `rosbag reindex` on it" if "not indexed" in str(error) else "record it again"
            raise BadLog(f"{path}: this bag cannot be read ({error}); {remedy}") from None
        for database in path.glob("*.db3") if path.is_dir() else [path]:
            _require_pages(database)

    @property
    def connections(self) -> Sequence[Any]:
        """Its topics with their types; in ROS 1 one connection per publisher."""
        return self.storage.connections  # type: ignore[no-any-return]

    def messages(self, connections: Sequence[Any]) -> Iterator[tuple[int, Any]]:
        """Yield the time at which each message was received [ns] since 1970, and the message."""
        for connection, received, content in self.storage.messages(connections):
            types = _types(connection.msgdef, connection.msgtype, self.ros1)
            read = types.deserialize_ros1 if self.ros1 else types.deserialize_cdr
            yield received, read(content, connection.msgtype)


def _head(path: Path) -> bytes:
    with open_file(path) as file:
        return file.read(32)


def _storage(path: Path, head: bytes) -> Any:
    if path.is_dir():
        return Folder(path)
    if head.startswith(b"#ROSBAG"):
        return rosbag1.Reader(path)
    return McapReader(path) if head.startswith(b"\x89MCAP") else Database(path)


def _require_pages(path: Path) -> None:
    """Refuse a truncated database; SQLite would take the missing pages for zeros, or for an index it does not need.

    Raises
    ------
    BadLog
        If it lacks pages.
    """
    head = _head(path)
    page, pages = int.from_bytes(head[PAGE]), int.from_bytes(head[PAGES])
    if head.startswith(b"SQLite") and path.stat().st_size < (page if page > 1 else 1 << 16) * pages:
        raise BadLog(f"{path}: this bag cannot be read (it lacks some of its {pages} pages); record it again")


@lru_cache(maxsize=64)  # bags of one robot share definitions, and parsing them takes longer than reading a small bag
def _types(definition: Any, kind: str, ros1: bool) -> Any:
    """Return the types in a message, as the bag defines them, else as ROS does."""
    if definition.format == MessageDefinitionFormat.NONE:
        return get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    types = get_typestore(Stores.EMPTY)
    types.register(_defined(definition, kind))
    return types


def _defined(definition: Any, kind: str) -> dict[str, Any]:
    if definition.format == MessageDefinitionFormat.MSG:
        return dict(get_types_from_msg(definition.data, kind))
    parts = definition.data.split(RULE)[1:] if definition.data.startswith(f"{RULE}IDL: ") else [f"\n{definition.data}"]
    return {name: fields for part in parts for name, fields in get_types_from_idl(part.split("\n", 1)[1]).items()}
