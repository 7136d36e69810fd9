# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The subcommands of adversarial-lcd, a module each: ``add`` declares its options."""
