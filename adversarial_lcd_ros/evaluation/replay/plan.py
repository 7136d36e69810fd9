# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What decides the figures of a replay."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    Config,
    LabelConfig,
    LcdConfig,
    ReplayConfig,
)


@dataclass(frozen=True)
class Plan:
    """
    Everything that decides what an evaluation gives.

    Attributes
    ----------
    builder, lcd, labels, replay
        Settings; the replay is in lockstep, whatever they say. None for a builder: the bag has
        graphs.
    attacks : mapping
        Settings of every attack by the name of its run.
    rebuild : bool
        Replay the images for every attack. Otherwise they are for the first one, which shows
        whether the graphs come out the same, and the others start from the graphs of that run.
    seed : int
        Of the bootstrap.
    sweep_labels : bool
        Label the decisions with other thresholds, too.
    posters : mapping
        Settings of the replay that hang a poster in a run, by its name.

    """

    builder: BuilderConfig | None
    lcd: LcdConfig
    labels: LabelConfig
    replay: ReplayConfig
    attacks: Mapping[str, AttackConfig]
    rebuild: bool = False
    seed: int = 42
    sweep_labels: bool = False
    posters: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    @property
    def sections(self) -> dict[str, Config | None]:
        """All settings that decide what the runs give, by what they are of."""
        return {'builder': self.builder, 'lcd': self.lcd, 'replay': self.replay,
                **{f'attack {name}': attack for name, attack in self.attacks.items()},
                **{f'poster {name}': self.replay_of(name) for name in self.posters}}

    def replay_of(self, run: str) -> ReplayConfig:
        """Return the settings by which a run is replayed."""
        return replace(self.replay, **self.posters.get(run, {}))
