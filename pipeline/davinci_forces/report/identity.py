"""What a report is called: a hash of the list of everything that it was made from."""

import hashlib

from davinci_forces.records.catalogue import Provenance

MANIFEST = "manifest.txt"


def manifest(provenance: Provenance, made: dict[str, bytes]) -> bytes:
    """Every file that a run reads and makes, pages apart, as `sha256sum --check` takes it.

    Names are `raw/<study>/...`, `processed/<study>/...` and `reports/<study>/...`, wherever these folders are; `made`
    are the files of the report that hold its numbers.
    """
    study = provenance.name
    files = {
        **provenance.raw,
        **{f"processed/{study}/{place}": sha for place, sha in provenance.processed.items()},
        **{f"reports/{study}/{name}": hashlib.sha256(content).hexdigest() for name, content in made.items()},
    }
    return "".join(f"{sha}  {name}\n" for name, sha in sorted(files.items()) if sha).encode()


def identity(listed: bytes) -> str:
    """The report ID: 128 bits of the sha256 of its manifest."""
    return hashlib.sha256(listed).hexdigest()[:32]
