# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Queried flips that train a surrogate for later frames, kept as npz.

No pickled surrogate: the recorded rows (flips, gains) are kept, and the surrogate is fitted to
them when the attacker starts. Rows can be read and checked, do not hang on a release of
scikit-learn, and cannot run code.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.surrogates import Surrogate
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.arrays import read_npz
from adversarial_lcd_ros.files.writing import replacing
from adversarial_lcd_ros.paths import SURROGATE_DATA, model_path

# A support vector machine takes the square of its rows, in time and memory.
_MAX_ROWS = 20_000


def data_path(config: AttackConfig) -> Path:
    """Return the file of an attack's surrogate data: one's own, or the one that ships."""
    return Path(config.surrogate_data) if config.surrogate_data else model_path(SURROGATE_DATA)


@dataclass(frozen=True)
class SurrogateData:
    """
    What an attacker learned by queries on other frames than those it attacks.

    The surrogate is fitted to these rows when it is loaded: nothing but arrays is stored.

    Attributes
    ----------
    features : float64, (k, d)
        WL features of single flips.
    gain : float64, (k,)
        Attack loss that each gained.
    is_loop : bool, (k,)
        Detector's answer to the clean graph of each.
    word_score : float64, (f,)
        Per clean graph: largest vBoW score with an older one.
    word_loop : bool, (f,)
        Per clean graph: the detector's answer.

    """

    features: NDArray[np.float64]
    gain: NDArray[np.float64]
    is_loop: NDArray[np.bool_]
    word_score: NDArray[np.float64]
    word_loop: NDArray[np.bool_]

    def fit(self, make: Callable[[], Surrogate | None]) -> dict[bool, Surrogate]:
        """Return a surrogate for each answer to the clean graph that the data suffice for."""
        trained = {}
        for is_loop in (False, True):
            rows = self.is_loop == is_loop
            surrogate = make()
            if surrogate is not None and surrogate.fit(self.features[rows], self.gain[rows]):
                trained[is_loop] = surrogate
        return trained

    def loop_bound(self) -> float:
        """Return the vBoW score that best tells loops from others on the training graphs."""
        order = np.argsort(self.word_score)
        loops = self.word_loop[order].astype(np.float64)
        total = loops.sum(), len(loops) - loops.sum()
        if not all(total):
            raise ModelError('the training graphs of the surrogate were all loops, or none was: '
                             f'found {int(total[0])} loops among {len(loops)} graphs')
        missed = np.r_[0, np.cumsum(loops)] / total[0]
        invented = 1 - np.r_[0, np.cumsum(1 - loops)] / total[1]
        bounds = np.r_[self.word_score[order], np.inf]
        return float(bounds[np.argmin(missed + invented)])

    def save(self, path: Path) -> None:
        """Write the arrays as compressed npz."""
        with replacing(path) as stream:
            np.savez_compressed(stream, **{entry.name: getattr(self, entry.name)
                                           for entry in fields(self)})

    @classmethod
    def load(cls, path: Path) -> SurrogateData:
        """Read the arrays; raises ModelError."""
        try:
            data = cls(**read_npz(path, [entry.name for entry in fields(cls)]))
        except FileError as error:
            raise ModelError(f'{path} holds no surrogate data: {error}; "adversarial-lcd train" '
                             'makes some') from error
        data.check(path)
        return data

    def check(self, path: Path) -> None:
        """Raise ModelError, naming the file, if the arrays are not what the class says."""
        numbers = (self.features, self.gain, self.word_score)
        if not (all(array.dtype.kind == 'f' for array in numbers)
                and self.is_loop.dtype == self.word_loop.dtype == bool
                and self.features.ndim == 2 and self.word_score.ndim == 1
                and self.gain.shape == self.is_loop.shape == self.features.shape[:1]
                and self.word_loop.shape == self.word_score.shape
                and all(np.isfinite(array).all() for array in numbers)):
            raise ModelError(f'{path}: the arrays of the surrogate data do not belong together')
        if len(self.features) > _MAX_ROWS:
            raise ModelError(f'{path}: {len(self.features)} rows of surrogate data; expected at '
                             f'most {_MAX_ROWS}')
