# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What came of a fault, and how memory went meanwhile."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
import os
from pathlib import Path

import numpy as np
from scipy import stats

_PAGE_MB = os.sysconf('SC_PAGE_SIZE') / 2**20


@dataclass
class Outcome:
    """
    A row of the table.

    Attributes
    ----------
    fault, promise : str
    outcomes : Counter
        What happened, in words, and how often; a name that starts with 'BROKEN' is no promise
        kept.
    note : str

    """

    fault: str
    promise: str
    outcomes: Counter[str] = field(default_factory=Counter)
    note: str = ''

    @property
    def tried(self) -> int:
        """Number of trials."""
        return sum(self.outcomes.values())

    @property
    def broken(self) -> int:
        """Number of trials that broke the promise."""
        return sum(count for name, count in self.outcomes.items() if name.startswith('BROKEN'))


def resident_mb(pid: int | str = 'self') -> float:
    """Return the resident memory of a process, MB."""
    return int(Path(f'/proc/{pid}/statm').read_text(encoding='ascii').split()[1]) * _PAGE_MB


class Slope:
    """Resident memory over a count of trials, and the line through its later three quarters."""

    def __init__(self) -> None:
        self._at: list[float] = []
        self._mb: list[float] = []

    def add(self, count: float, megabytes: float) -> None:
        """Add a sample."""
        self._at.append(count)
        self._mb.append(megabytes)

    def is_due(self, count: float, every: float) -> bool:
        """Tell whether the last sample is so long ago."""
        return not self._at or count >= self._at[-1] + every

    def text(self, per: float, unit: str) -> str:
        """Return the slope with its 95 % interval, KB for so many of a unit; '' of nothing."""
        if not self._at:
            return ''
        skip = len(self._at) // 4  # what is loaded and cached once
        at, mb = np.array(self._at[skip:]) / per, np.array(self._mb[skip:]) * 1024
        if len(at) < 5:
            return f'resident memory {self._mb[-1]:.0f} MB'
        line = stats.linregress(at, mb)
        half = stats.t.ppf(0.975, len(at) - 2) * line.stderr
        low, high = line.slope - half, line.slope + half
        return (f'memory {line.slope:+.1f} KB [{low:+.1f}, {high:+.1f}] {unit}, '
                f'{self._mb[-1]:.0f} MB at the end')
