# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""ONNX networks, opened in one place: bounded in memory, and silent."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import os
from pathlib import Path
import resource
import stat
from typing import Any

from adversarial_lcd_ros.errors import FileError
from adversarial_lcd_ros.files.reading import MIB

MAX_NETWORK_BYTES = 2048 * MIB
# What a network may take when it is loaded, beside a multiple of its own size.
NETWORK_ROOM_BYTES, _ROOM_FACTOR = 2048 * MIB, 6
_PAGES = Path('/proc/self/statm')


def open_network(path: Path, threads: int) -> Any:
    """
    Return an onnxruntime.InferenceSession of a file, on the CPU.

    Weights in files of their own are found beside the model; onnxruntime refuses those that
    lead elsewhere.

    Parameters
    ----------
    path : Path
    threads : int
        Of one operation; 0: as many as cores.

    Raises
    ------
    FileError
        It is no regular file, larger than 2 GiB, or no network that can be loaded.

    """
    import onnxruntime  # some commands and targets do without, and start sooner

    # __init__.py has told onnxruntime by the environment; this holds for sessions opened where
    # somebody imported it before.
    getattr(onnxruntime, 'disable_telemetry_events', lambda: None)()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.log_severity_level = 4  # what is an error is raised, and said once
    # Spinning threads would take a core from what runs beside.
    options.add_session_config_entry('session.intra_op.allow_spinning', '0')
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) or found.st_size > MAX_NETWORK_BYTES:
            raise FileError(f'{path} is no regular file of at most {MAX_NETWORK_BYTES} bytes')
        with bounded_memory(NETWORK_ROOM_BYTES + _ROOM_FACTOR * found.st_size):
            return onnxruntime.InferenceSession(str(path), options,
                                                providers=['CPUExecutionProvider'])
    except FileError:
        raise
    except Exception as error:  # onnxruntime's own classes are private
        raise FileError(f'{path} cannot be loaded as ONNX: {error}') from error


@contextmanager
def bounded_memory(room_bytes: int) -> Iterator[None]:
    """
    Let this process ask for that much more memory at most while the block runs.

    A network of some bytes may declare constants of any size, which are made when it is loaded:
    with a bound that is an error of onnxruntime, and not the end of the process. Where the
    system does not say how much is in use (not Linux), there is no bound.
    """
    if not _PAGES.is_file():
        yield
        return
    used = int(_PAGES.read_text(encoding='ascii').split()[0]) * os.sysconf('SC_PAGE_SIZE')
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = used + room_bytes
    bounds = [limit for limit in (soft, hard) if limit != resource.RLIM_INFINITY]
    resource.setrlimit(resource.RLIMIT_AS, (min([wanted, *bounds]), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))
