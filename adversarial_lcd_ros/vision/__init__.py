# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Camera image -> multi-tier graph: features, words, objects."""
