"""Files that are there whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
import json
import math
import os
from pathlib import Path
import tempfile
from typing import Any


def write_text(path: Path, text: str) -> None:
    """Write a text file, or leave the one that is there as it was; raises OSError."""
    # mkstemp would make it readable by its owner alone.
    with tempfile.TemporaryDirectory(prefix=f'.{path.name}.', dir=path.parent) as hidden:
        draft = Path(hidden) / path.name
        draft.write_text(text, encoding='utf-8')
        os.replace(draft, path)


def write_json(path: Path, values: Mapping[str, Any] | Sequence[Any]) -> None:
    """Write a JSON file likewise; what is not a finite number becomes null."""
    write_text(path, json_text(values))


def json_text(values: Mapping[str, Any] | Sequence[Any]) -> str:
    """Return values as JSON; what is not a finite number becomes null."""
    return json.dumps(_plain(values), indent=2, allow_nan=False) + '\n'


def _plain(value: Any) -> Any:
    # numpy scalars to Python's, NaN and infinity to None.
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(entry) for entry in value]
    if hasattr(value, 'item') and not isinstance(value, (str, bytes)):
        value = value.item()
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
