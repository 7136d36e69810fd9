# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Attacks on pictures, before any graph is built: what somebody puts into the scene."""
