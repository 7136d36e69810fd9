# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the closures of a replay do to the map: many draws, back ends, pictures."""
