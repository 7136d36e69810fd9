# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""How much accuracy was lost: labels, protocols, statistics, report."""
