# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""gtsam, which only maps need: imported when first used, and missed in one line."""

from __future__ import annotations

import importlib
from typing import Any

from adversarial_lcd_ros.errors import ConfigError


def gtsam() -> Any:
    """
    Return the module gtsam.

    Raises
    ------
    ConfigError
        It is not installed, or cannot be loaded.

    """
    try:
        return importlib.import_module('gtsam')
    except ImportError as error:
        raise ConfigError(
            f'maps need gtsam, which cannot be imported ({error}): pip install '
            '"adversarial_lcd_ros[slam]", which has it from Python 3.11 on') from error
