# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Networks of the targets that have one, and what trains them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.lcd.targets import TARGETS
from adversarial_lcd_ros.registry import load
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.training.model_folder import network_file
from adversarial_lcd_ros.training.pair_scores import LabelledPairs


class Trainer(ABC):
    """
    Trains the network of a target; the class that its ``trainer`` names.

    Making one raises ModelError where it lacks what it needs, before the first minute of work.
    """

    @abstractmethod
    def train(self, sequences: Sequence[LabelledPairs], path: Path, seed: int,
              progress: Progress | None = None) -> dict[str, Any]:
        """
        Train the network on labelled pairs, write it, and return what its card says.

        Parameters
        ----------
        sequences : sequence of LabelledPairs
        path : Path
            File to write.
        seed : int
        progress : callable, optional
            Called with the work done and to do.

        """


def make_trainer(target: str) -> Trainer | None:
    """Return what trains the network of a target; None for one without."""
    reference = TARGETS.find(target).trainer
    if not reference:
        return None
    trainer: Trainer = load(f'trainer of target {target}', reference)()
    return trainer


def reused_network(target: str, folder: Path) -> Path | None:
    """Return the network of a target in a folder, None if it needs none; raises ModelError."""
    found = TARGETS.find(target)
    if not found.trainer:
        return None
    network = folder / network_file(found.name)
    if not network.is_file():
        raise ModelError(f'{folder} has no {network.name}: expected the folder of a training '
                         f'with the target {target}, or no --networks')
    return network
