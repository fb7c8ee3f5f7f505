"""The model as JSON: model.json, and the schema of the file, which describes how to compute the effort."""

import json
from pathlib import Path
from typing import Any

from davinci_forces.exports.identified import Export
from davinci_forces.files import read_bytes, text_of

SCHEMA = "model.schema.json"


def render(export: Export) -> dict[str, str]:
    """Render model.json and its schema."""
    schema = json.loads(text_of(read_bytes(Path(__file__).with_name(SCHEMA))))
    return {
        "model.json": _text({"$schema": SCHEMA, **export.document()}),
        SCHEMA: _text({**schema, "$comment": "; ".join(export.head())}),
    }


def _text(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False) + "\n"
