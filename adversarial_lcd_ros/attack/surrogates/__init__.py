"""Surrogates by name. A new one is one small file and one line in SURROGATES."""

from __future__ import annotations

from collections.abc import Callable

from adversarial_lcd_ros.attack.surrogates.ard import RelevanceDetermination
from adversarial_lcd_ros.attack.surrogates.base import Surrogate
from adversarial_lcd_ros.attack.surrogates.kernel import Kernel
from adversarial_lcd_ros.attack.surrogates.naive_bayes import NaiveBayes
from adversarial_lcd_ros.attack.surrogates.svm_linear import SvmLinear
from adversarial_lcd_ros.attack.surrogates.svm_poly import SvmPoly
from adversarial_lcd_ros.attack.surrogates.svm_rbf import SvmRbf
from adversarial_lcd_ros.attack.surrogates.svr import SupportVectorRegression
from adversarial_lcd_ros.errors import ConfigError

SURROGATES: dict[str, Callable[[Kernel], Surrogate]] = {
    surrogate.name: surrogate
    for surrogate in (SvmRbf, SvmLinear, SvmPoly, NaiveBayes, SupportVectorRegression,
                      RelevanceDetermination)
}

__all__ = ['SURROGATES', 'Kernel', 'Surrogate', 'make_surrogate']


def make_surrogate(name: str, kernel: Kernel | None = None) -> Surrogate | None:
    """Return the surrogate of that name, None for "none"; raises ConfigError."""
    if name == 'none':
        return None
    if name not in SURROGATES:
        raise ConfigError(f'no surrogate {name!r}; there are: none, {", ".join(SURROGATES)}')
    return SURROGATES[name](kernel or Kernel())
