# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What compiles, and where compiled code is kept for the next process.

Numba keeps it beside the modules where that folder can be written, and gives up with a traceback
where neither that nor a home can. An installation may well be read-only, and a user of a
container have no home.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
import logging
from pathlib import Path
import tempfile
from typing import Any

import numba

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.paths import cache_folder

_FOLDER = 'compiled'
_settings: Any = numba.config  # its names are made when it is imported
_log = logging.getLogger(__name__)


def compiled_with(**options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return numba's decorator with these options, with a cache where there can be one."""
    decorator: Callable[[Callable[..., Any]], Any] = numba.njit(
        cache=code_folder() is not None, nogil=True, **options)
    return decorator


@lru_cache(1)
def code_folder() -> Path | None:
    """
    Return where compiled code is kept, and see to it that numba finds the place.

    NUMBA_CACHE_DIR, else beside the modules (then the folder of the package is returned), else in
    this package's cache of the user. None where it cannot be kept; a warning has then said so,
    once a process.
    """
    chosen = _settings.CACHE_DIR
    if chosen and _writable(Path(chosen)):
        return Path(chosen)
    if _writable(Path(__file__).parent / '__pycache__'):
        return Path(__file__).parents[1]
    try:
        place = cache_folder() / _FOLDER
    except ModelError:
        place = None
    if place is not None and _writable(place):
        _settings.CACHE_DIR = str(place)
        return place
    _log.warning('compiled code cannot be kept, so that every start compiles for some seconds: '
                 'set NUMBA_CACHE_DIR to a folder that can be written')
    return None


def _writable(folder: Path) -> bool:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True
