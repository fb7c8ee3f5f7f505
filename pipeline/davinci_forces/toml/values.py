"""Write values as TOML."""

import json
from collections.abc import Mapping


def in_toml(value: object) -> str:
    """A text, number, truth value, list or table of them as TOML; but for tables, JSON has the same form."""
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{in_toml(str(key))} = {in_toml(of)}' for key, of in value.items())} }}"
    return json.dumps(value, ensure_ascii=False)
