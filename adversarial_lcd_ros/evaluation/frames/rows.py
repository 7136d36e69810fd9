# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The row of a finished cell in cells.jsonl."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation.frames.attacked import FrameResult
from adversarial_lcd_ros.evaluation.frames.cells import Cell
from adversarial_lcd_ros.evaluation.metrics import balanced_accuracy, effect
from adversarial_lcd_ros.evaluation.outcomes import UNTOLD_MATCH, Outcomes, outcomes, right
from adversarial_lcd_ros.ground_truth.labels import ELSEWHERE, NEGATIVE, POSITIVE, RIGHT, UNTOLD

_TRACE_POINTS = 8
# What the columns hold, for whoever reads rows that another run has written.
_TEXT, _NUMBER, _FIGURE = (str,), (int, float), (int, float, type(None))
ROW_COLUMNS: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(('sequence', 'target', 'asked_target', 'perturbation', 'surrogate', 'oracle',
                     'mode', 'edits', 'judged', 'variant', 'name', 'versions', 'moved'), _TEXT),
    'sealed': (bool,),
    **dict.fromkeys(('ratio', 'queries_per_edit', 'nodes', 'threshold', 'seed', 'frames',
                     'positives', 'negatives', 'suppressed', 'invented', 'left_out',
                     'invented_elsewhere', 'unattackable', 'refused',
                     'duration_s', 'query_s', 'search_s', 'judge_s'), _NUMBER),
    **dict.fromkeys(('nodes_mean', 'edges_mean', 'accuracy_clean', 'accuracy_attacked',
                     'balanced_clean', 'balanced_attacked', 'decline_pp', 'edits_mean',
                     'nodes_moved_mean', 'queries_mean', 'success_rate',
                     'unexplained_clean_mean', 'unexplained_mean'), _FIGURE),
    'frame_results': (list,)}
_FRAME_COLUMNS: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(('stamp', 'kind', 'edits', 'queries', 'edit_budget', 'nodes_moved',
                     'node_budget'), (int,)),
    **dict.fromkeys(('clean', 'attacked', 'status'), _TEXT)}


def make_row(cell: Cell, seed: int, sequence: str,
             results: Sequence[FrameResult]) -> dict[str, Any]:
    """
    Return the row of a finished cell, ready for JSON (docs/results_folder.md lists its columns).

    Parameters
    ----------
    cell : Cell
    seed : int
    sequence : str
        Name.
    results : sequence of FrameResult
        The attacked frames in order of time.

    """
    kind = np.array([result.kind for result in results], np.int8)
    before = _outcomes(kind, results, 'clean')
    after = _outcomes(kind, results, 'attacked')
    change = effect(kind, before, after)
    turned = [result.clean.is_loop != result.attacked.is_loop for result in results]
    attacks = [result.result for result in results]
    seconds = {name: sum(getattr(result, name) for result in results)
               for name in ('query_s', 'search_s', 'judge_s')}
    return {
        'sequence': sequence, **cell.settings, 'name': cell.name, 'seed': seed,
        'nodes_mean': _mean([attack.clean.node_count for attack in attacks]),
        'edges_mean': _mean([attack.clean.edge_count for attack in attacks]),
        'frames': len(results), 'positives': int((kind == POSITIVE).sum()),
        'negatives': int((kind == NEGATIVE).sum()),
        'accuracy_clean': _accuracy(before), 'accuracy_attacked': _accuracy(after),
        'balanced_clean': balanced_accuracy(kind, before),
        'balanced_attacked': balanced_accuracy(kind, after),
        'decline_pp': change.decline_pp, 'suppressed': change.suppressed,
        'invented': change.invented, 'left_out': change.left_out,
        'invented_elsewhere': sum(
            result.attacked_is == ELSEWHERE and (was, now) == ('TN', 'FP')
            for result, was, now in zip(results, before, after, strict=True)),
        'unattackable': sum(attack.edit_budget + attack.node_budget < 1
                            or attack.status == 'skipped' for attack in attacks),
        'edits_mean': _mean([attack.change.edits for attack in attacks]),
        'nodes_moved_mean': _mean([attack.change.nodes for attack in attacks]),
        'queries_mean': _mean([attack.queries for attack in attacks]),
        'success_rate': _mean(turned), 'refused': sum(result.refused != '' for result in results),
        'unexplained_clean_mean': _counted(results, 'unexplained_clean'),
        'unexplained_mean': _counted(results, 'unexplained'),
        'frame_results': [_frame(*entry) for entry in zip(results, before, after, strict=True)],
        'duration_s': sum(seconds.values()), **seconds}


def are_frames(results: Sequence[Any]) -> bool:
    """Tell whether ``frame_results`` of a row that was read are of frames."""
    return all(isinstance(frame, dict) and all(
        isinstance(frame.get(name), kinds) for name, kinds in _FRAME_COLUMNS.items())
        for frame in results)


def _outcomes(kind: NDArray[np.int8], results: Sequence[FrameResult],
              which: str) -> Outcomes:
    return outcomes(
        kind, np.array([getattr(result, which).is_loop for result in results], bool),
        np.array([getattr(result, f'{which}_is') == RIGHT for result in results], bool),
        np.array([getattr(result, f'{which}_is') != UNTOLD for result in results], bool))


def _accuracy(outcome: Outcomes) -> float | None:
    return _mean(right(outcome[outcome != UNTOLD_MATCH]))


def _mean(values: Sequence[float] | NDArray[Any]) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _counted(results: Sequence[FrameResult], name: str) -> float | None:
    """Return a mean over the frames on which it was counted."""
    found = (getattr(result, name) for result in results)
    return _mean([count for count in found if count is not None])


def _frame(result: FrameResult, before: str, after: str) -> dict[str, Any]:
    attack = result.result
    last = len(attack.trace) - 1
    shown = sorted({round(place) for place in np.linspace(0, max(last, 0), _TRACE_POINTS)})
    return {'stamp': attack.clean.stamp_ns, 'kind': result.kind, 'clean': str(before),
            'attacked': str(after), 'attacked_is': result.attacked_is,
            'edit_budget': attack.edit_budget, 'edits': attack.change.edits,
            'node_budget': attack.node_budget, 'nodes_moved': attack.change.nodes,
            'unexplained_clean': result.unexplained_clean, 'unexplained': result.unexplained,
            'refused': result.refused, 'queries': attack.queries,
            'status': attack.status, 'reason': attack.reason,
            'loss_before': round(attack.loss_before, 4),
            'loss_after': round(attack.loss_after, 4),
            'trace': [round(attack.trace[place], 4) for place in shown if place <= last]}
