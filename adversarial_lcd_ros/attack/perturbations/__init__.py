"""Choices of flips by name. A new one is one small file and one line in PERTURBATIONS."""

from __future__ import annotations

from adversarial_lcd_ros.attack.perturbations.base import Allowed, Perturbation
from adversarial_lcd_ros.attack.perturbations.eigencentrality import Eigencentrality
from adversarial_lcd_ros.attack.perturbations.random_flip import RandomFlip
from adversarial_lcd_ros.attack.perturbations.random_walk import RandomWalk
from adversarial_lcd_ros.attack.perturbations.shortest_path import ShortestPath
from adversarial_lcd_ros.errors import ConfigError

PERTURBATIONS: dict[str, type[Perturbation]] = {
    perturbation.name: perturbation
    for perturbation in (Eigencentrality, RandomWalk, ShortestPath, RandomFlip)
}

__all__ = ['PERTURBATIONS', 'Allowed', 'Perturbation', 'make_perturbation']


def make_perturbation(name: str) -> Perturbation:
    """Return the perturbation of that name; raises ConfigError."""
    if name not in PERTURBATIONS:
        raise ConfigError(f'no perturbation {name!r}; there are: {", ".join(PERTURBATIONS)}')
    return PERTURBATIONS[name]()
