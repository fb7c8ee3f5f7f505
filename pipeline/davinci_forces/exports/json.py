"""The model as JSON: model.json, and the schema of the file, which describes how to compute the effort."""

import json
from pathlib import Path

from davinci_forces.exports.identified import Export, Rendering
from davinci_forces.files import read_bytes, text_of

SCHEMA = "model.schema.json"


def render(export: Export) -> Rendering:
    """Render model.json and its schema."""
    schema = json.loads(text_of(read_bytes(Path(__file__).with_name(SCHEMA))))
    files = {
        "model.json": {"$schema": SCHEMA, **export.document()},
        SCHEMA: {**schema, "$comment": "; ".join(export.head())},
    }
    texts = {name: json.dumps(x, indent=1, ensure_ascii=False, allow_nan=False) + "\n" for name, x in files.items()}
    return Rendering(texts, export.remarks())
