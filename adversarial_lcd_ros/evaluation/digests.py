# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Digests of the files that figures rest on."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.digests import digest_of
from adversarial_lcd_ros.files.reading import read_bytes


@lru_cache(32)
def file_digest(path: Path) -> str:
    """Return the digest of a model file, hexadecimal; raises ModelError."""
    try:
        return digest_of(read_bytes(path))
    except FileError as error:
        raise ModelError(f'{error}; name a file that "adversarial-lcd train" wrote') from error


def model_digests(decision: Path) -> list[str]:
    """Return the digests of a trained decision and of the network beside it, if it has one."""
    return [file_digest(path) for path in (decision, decision.with_suffix('.onnx'))
            if path.exists()]
