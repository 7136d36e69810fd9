# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The experiments of the paper: statistics over sequences, ranks, tables, figures, report."""
