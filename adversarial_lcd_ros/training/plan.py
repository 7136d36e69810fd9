# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a training is of: settings, labels, targets, and how much of everything.

Labels are wider than those of the evaluation (``TRAINING_LABELS``): short sequences have few late
revisits.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.registry import TARGETS

# By exact co-visibility, or what else shows it, as those of an evaluation; but revisits within a
# few seconds count, too, which short sequences are full of. The overlap is for the check before
# the work, and for training by poses alone: wider, so that glancing revisits are seen.
TRAINING_LABELS = LabelConfig(rule='auto', min_gap_s=3.0, positive_overlap=0.45)


def default_targets() -> tuple[str, ...]:
    """Return what is trained unless others are asked for: all that need only this package."""
    return tuple(name for name in TARGETS if not TARGETS.find(name).trainer)


@dataclass(frozen=True)
class TrainingPlan:
    """
    What is trained, and on how much.

    Attributes
    ----------
    builder : BuilderConfig
        Of the graphs; a vocabulary named here is used instead of a new one.
    lcd : LcdConfig
        Its map window is that of the decisions; the detector that the surrogate data are
        queried from has the rest of its settings too.
    labels : LabelConfig
        What counts as a loop.
    targets : tuple of str
        Targets to train; the first one answers the queries of the surrogate data.
    pairs : int
        Most loops, and most random pairs of different places, of a sequence.
    vocabulary_stride : int
        Every how many frames one is used for the vocabulary.
    branching, depth : int
        Shape of the vocabulary: branching^depth words.
    flips_per_frame : int
        Flips queried on each frame of the first sequence; 0: no surrogate data.
    networks : Path, optional
        Folder of an earlier training whose networks are used instead of new ones.

    Raises
    ------
    ConfigError
        A target is unknown or named twice, or a number is out of range.

    """

    builder: BuilderConfig = field(default_factory=BuilderConfig)
    lcd: LcdConfig = field(default_factory=LcdConfig)
    labels: LabelConfig = TRAINING_LABELS
    targets: tuple[str, ...] = field(default_factory=default_targets)
    pairs: int = 600
    vocabulary_stride: int = 2
    branching: int = 16
    depth: int = 3
    flips_per_frame: int = 8
    networks: Path | None = None

    def __post_init__(self) -> None:
        """Check names and ranges."""
        for target in self.targets:
            TARGETS.check(target)
        if not self.targets or len(set(self.targets)) != len(self.targets):
            raise ConfigError(f'targets {", ".join(self.targets) or "(none)"}: expected some of '
                              f'{TARGETS}, each once')
        for name, low in (('pairs', 1), ('vocabulary_stride', 1), ('branching', 2), ('depth', 1),
                          ('flips_per_frame', 0)):
            if getattr(self, name) < low:
                raise ConfigError(f'{name} = {getattr(self, name)}: expected {low} or more')
