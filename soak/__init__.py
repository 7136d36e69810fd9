# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""An hour of faults: what is promised, what came of it, and how often (docs/reliability.md)."""
