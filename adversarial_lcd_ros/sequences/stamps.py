# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The stamps of a bag's frames: which clock they are of, and what is wrong with them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.sequences.sequence import check_order

HEADER, LOG = 'header', 'log'
STAMPS = (HEADER, LOG)
# What a clock that is set gains on the log times; frames that were left out do not.
_JUMP_NS = 300_000_000_000
# Milliseconds written as if they were microseconds: a thousandth. No recorder is so slow.
_SLOWEST = 500
REMEDY = f'import it with the log times of the bag, "--stamps {LOG}"'


def frame_stamps(header_ns: Sequence[int], log_ns: Sequence[int], source: Path,
                 chosen: str | None = None) -> NDArray[np.int64]:
    """
    Return the stamps of frames, strictly ascending, nanoseconds, (n,).

    Parameters
    ----------
    header_ns, log_ns : sequence of int, (n,)
        From the headers, and when the recorder got the frames.
    source : Path
        For errors.
    chosen : str, optional
        'header' or 'log'. By default the headers, of which jumps of the clock are refused, and
        those that hardly move while the recorder's clock does.

    Raises
    ------
    SequenceError
        There is no frame, or stamps are zero, repeat, go back, jump, or hardly move.

    """
    if chosen is not None and chosen not in STAMPS:
        raise SequenceError(f'stamps from {chosen!r}: expected {" or ".join(STAMPS)}')
    if chosen == LOG:
        return check_order(np.asarray(log_ns, np.int64), source)
    headers, logs = np.asarray(header_ns, np.int64), np.asarray(log_ns, np.int64)
    if len(headers) > 1 and not headers.any():
        raise SequenceError(f'{source}: all {len(headers)} frames are stamped 0: {REMEDY}')
    gap = np.diff(headers)
    jumps = np.flatnonzero(gap - np.maximum(np.diff(logs), 0) > _JUMP_NS)
    if len(jumps) and chosen is None:
        at = int(jumps[0]) + 1
        raise SequenceError(
            f'{source}: between frames {at - 1} and {at} the clock of the headers jumps by '
            f'{gap[at - 1] / 1e9:.1f} s, from {headers[at - 1]} to {headers[at]} ns, while '
            f'{(logs[at] - logs[at - 1]) / 1e9:.1f} s passed: {REMEDY}, or "--stamps {HEADER}" if '
            'the headers are right')
    if chosen is None and len(headers):
        _check_unit(headers, logs, source)
    try:
        return check_order(headers, source)
    except SequenceError as error:
        raise SequenceError(f'{error}: {REMEDY}' if len(headers) else str(error)) from None


def _check_unit(headers: NDArray[np.int64], logs: NDArray[np.int64], source: Path) -> None:
    span_ns, passed_ns = int(headers[-1] - headers[0]), int(logs[-1] - logs[0])
    if 0 < span_ns * _SLOWEST < passed_ns:
        raise SequenceError(
            f'{source}: from first frame to last {span_ns / 1e9:.6f} s pass by the headers, '
            f'and {passed_ns / 1e9:.6f} s by the log times, as where stamps in milliseconds or '
            f'microseconds were taken for nanoseconds: {REMEDY}, or "--stamps {HEADER}" if the '
            'headers are right')
