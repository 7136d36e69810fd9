"""Digests by which finished work is told from work to do."""

from __future__ import annotations

from functools import lru_cache
import hashlib
from pathlib import Path

from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.reading import read_bytes


@lru_cache(32)
def file_digest(path: Path) -> str:
    """Return the digest of a model file, hexadecimal; raises ModelError."""
    try:
        return digest_of(read_bytes(path))
    except FileError as error:
        raise ModelError(f'{error}; name a file that "adversarial-lcd train" wrote') from error


def digest_of(data: bytes) -> str:
    """Return the digest of some bytes, hexadecimal."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()
