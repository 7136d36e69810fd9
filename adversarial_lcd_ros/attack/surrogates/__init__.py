"""Surrogates by name. A new one is one small file and one line in SURROGATES."""

from __future__ import annotations

from adversarial_lcd_ros.attack.surrogates.base import Surrogate
from adversarial_lcd_ros.attack.surrogates.svm_rbf import SvmRbf
from adversarial_lcd_ros.errors import ConfigError

SURROGATES: dict[str, type[Surrogate]] = {surrogate.name: surrogate for surrogate in (SvmRbf,)}

__all__ = ['SURROGATES', 'Surrogate', 'make_surrogate']


def make_surrogate(name: str) -> Surrogate | None:
    """Return the surrogate of that name, None for "none"; raises ConfigError."""
    if name == 'none':
        return None
    if name not in SURROGATES:
        raise ConfigError(f'no surrogate {name!r}; there are: none, {", ".join(SURROGATES)}')
    return SURROGATES[name]()
