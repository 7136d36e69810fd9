# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Who can do what, what stops it, and what stops that: attacks beside defences, and posters."""
