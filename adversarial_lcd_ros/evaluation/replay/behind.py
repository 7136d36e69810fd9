# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What a geometric check behind the detector would leave of attacks that do not know of it.

Most back ends of SLAM have such a check, so a figure without one tells half of it. Nothing is run
again: each declared loop of every run is held against the check, and what fails is not declared.
An attacker who knew of the check could do better than this.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.evaluation.outcomes import outcomes
from adversarial_lcd_ros.evaluation.replay.records import QueryRecord, column
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.labels import UNTOLD
from adversarial_lcd_ros.lcd.defences import defence_names
from adversarial_lcd_ros.lcd.defences.geometric_check import GeometricCheck


def ask_check(records: Sequence[QueryRecord],
              graphs: Mapping[str, Sequence[MultiTierGraph]],
                 config: LcdConfig) -> list[QueryRecord]:
    """
    Return records that know how far the geometric check bears out each declared loop.

    Parameters
    ----------
    records : sequence of QueryRecord
        Of all runs.
    graphs : mapping of str to sequence of MultiTierGraph
        By name of the run, those that the detector was sent, frame by frame.
    config : LcdConfig
        Of the detector; says how many inliers are needed.

    """
    has_features = any(graph.node_count > graph.object_count
                       for run in graphs.values() for graph in run)
    if GeometricCheck.name in defence_names(config) or not has_features:
        return list(records)
    check = GeometricCheck(config)

    def support(record: QueryRecord) -> float | None:
        if not record.is_loop or record.match_frame is None:
            return None
        run = graphs[record.run]
        return check.support(run[record.frame], run[record.match_frame])

    return [replace(record, support=support(record)) for record in records]


def behind_check(run: Sequence[QueryRecord]) -> list[QueryRecord]:
    """Return the records of a run as they would be with the check behind the detector."""
    stands = [record.is_loop and (record.support is None or record.support >= 1)
              for record in run]
    declared = [replace(record, is_loop=loop) for record, loop in zip(run, stands, strict=True)]
    outcome = outcomes(column(declared, 'label'), column(declared, 'is_loop'),
                       column(declared, 'match_correct'),
                       column(declared, 'match_is') != UNTOLD)
    return [replace(record, outcome=str(found))
            for record, found in zip(declared, outcome, strict=True)]
