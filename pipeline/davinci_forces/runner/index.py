"""All entries of a ledger in one file, so that a run that finds nothing to do reads one and not thousands.

It is there while it holds what the entries do: the first entry that is written or removed takes it away, and a run that
ends puts it back.  Where an entry is newer, or any is missing, all are read one by one.  Nothing is believed for the
index's sake, since a task is current only where its files are what its entry says, and `verify` reads the entries.
"""

import json
import os
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from davinci_forces.runner.fingerprints.canonical import hash_of_text

NAME = "index.json"
SHARED = "code", "schemas", "settings"  # parts of a fingerprint that are the same for many tasks

Entries = dict[str, dict[str, dict[str, Any]]]  # by stage, and by the name of the entry's file


def read(folder: Path, files: Collection[tuple[str, str, str]]) -> Entries:
    """The entries of these stages, names and files, or none where the index is not whole, of just these and newer."""
    try:
        written = os.stat(folder / NAME).st_mtime_ns
        if any(os.stat(file).st_mtime_ns > written for *_, file in files):
            return {}
        content = _unsealed(folder.joinpath(NAME).read_text(encoding="utf-8"))
        entries: Entries = content["entries"]
        if {(stage, name) for stage, named in entries.items() for name in named} != {each[:2] for each in files}:
            return {}
        for entry in (entry for named in entries.values() for entry in named.values()):
            entry["fingerprint"] |= {part: content["shared"][i] for part, i in entry.pop("shared").items()}
    except (OSError, ValueError, TypeError, LookupError):
        return {}
    return entries


def written(entries: Mapping[str, Mapping[str, Mapping[str, Any]]]) -> bytes:
    """The content of the index of entries, which are as `read` gives them."""
    numbers: dict[str, int] = {}  # of what is shared, by its text
    brief: Entries = {}
    for stage, named in sorted(entries.items()):
        for name, entry in sorted(named.items()):
            own = {part: value for part, value in entry["fingerprint"].items() if part not in SHARED}
            texts = {part: _text(entry["fingerprint"][part]) for part in SHARED if part in entry["fingerprint"]}
            shared = {part: numbers.setdefault(text, len(numbers)) for part, text in texts.items()}
            brief.setdefault(stage, {})[name] = {**entry, "fingerprint": own, "shared": shared}
    text = _text({"entries": brief, "shared": list(map(json.loads, numbers))})
    return f"{hash_of_text(text)}\n{text}".encode()


def _unsealed(text: str) -> Any:
    """What an index holds below the hash of it in its first line."""
    sha, _, content = text.partition("\n")
    if sha != hash_of_text(content):
        raise ValueError("not as it was written")
    return json.loads(content)


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
