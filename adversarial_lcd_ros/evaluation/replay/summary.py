# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""summary.json: the figures of one evaluation, from its records."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import AttackConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import intervals
from adversarial_lcd_ros.evaluation.methods import attack_columns
from adversarial_lcd_ros.evaluation.metrics import (
    Metrics,
    effect,
    first_closure_latency_s,
    measure,
)
from adversarial_lcd_ros.evaluation.outcomes import FRAME_KINDS, right, told_kind
from adversarial_lcd_ros.evaluation.replay.behind import behind_check
from adversarial_lcd_ros.evaluation.replay.records import (
    CLEAN,
    NO_TRUTH,
    QueryRecord,
    column,
    decision_change,
    runs_of,
)
from adversarial_lcd_ros.evaluation.results import summary_document
from adversarial_lcd_ros.ground_truth.labels import ELSEWHERE, UNTOLD, WRONG
from adversarial_lcd_ros.lcd.defences import defence_names

KIND, SCHEMA = 'replay', 3
# What nobody can count without ground truth.
_NEED_LABELS = ('positives', 'negatives', 'tp', 'fn', 'fp', 'tn', 'wrong_matches', 'suppressed',
                'diverted', 'invented', 'regained', 'withdrawn', 'left_out', 'untold_matches',
                'declared_elsewhere', 'invented_elsewhere', 'diverted_elsewhere',
                'wrong_closures_unscored')


@dataclass(frozen=True)
class GraphStatistics:
    """How many graphs the builder sent in the clean run, and their mean size."""

    count: int
    nodes_mean: float
    edges_mean: float

    @classmethod
    def of(cls, nodes: Sequence[int], edges: Sequence[int]) -> GraphStatistics:
        """Return the statistics of graphs with the given node and edge counts."""
        if not nodes or len(nodes) != len(edges):
            raise EvaluationError(f'{len(nodes)} node counts and {len(edges)} edge counts: '
                                  'expected one of each for every graph, and at least one graph')
        return cls(len(nodes), float(np.mean(nodes)), float(np.mean(edges)))


def summarise(sequence: str, records: Sequence[QueryRecord],
              attacks: Mapping[str, AttackConfig | None], graphs: GraphStatistics, seed: int,
              lcd: LcdConfig | None = None, block_s: float = intervals.BLOCK_S,
              told_by: str = '') -> dict[str, Any]:
    """
    Return the figures of an evaluation (``as_document``: summary.json); undefined ones are None.

    Parameters
    ----------
    sequence : str
        Name of the sequence.
    records : sequence of QueryRecord
        From ``make_records``.
    attacks : mapping
        Settings of every attack by the name of its run; None where nobody knows them.
    graphs : GraphStatistics
        Of the clean run.
    seed : int
        Of the whole evaluation; also seeds the bootstrap.
    lcd : LcdConfig, optional
        Of the detector, to be named beside its figures.
    block_s : float
        Length of the bootstrap's blocks, seconds.
    told_by : str
        What told the labels, ``FrameLabels.told_by``.

    Raises
    ------
    EvaluationError
        Frames, graphs and decisions differ in number, or runs and attacks in name.

    """
    runs = runs_of(records)
    if list(runs) != [CLEAN, *attacks]:
        raise EvaluationError(f'runs {list(runs)}: expected {[CLEAN, *attacks]}')
    clean = runs.pop(CLEAN)
    if graphs.count != len(clean):
        raise EvaluationError(f'{graphs.count} graphs for {len(clean)} frames: the run lost or '
                              'repeated messages and gives no figure: run it again')
    block = intervals.block_frames(column(clean, 'stamp_ns'), block_s)
    kinds = Counter(record.kind for record in clean)
    summary = {
        'sequence': sequence, 'labelled': kinds[NO_TRUTH] < len(clean), 'frames': len(clean),
        'told_by': told_by, 'graphs': graphs.count, 'decisions': len(clean),
        'nodes_mean': graphs.nodes_mean, 'edges_mean': graphs.edges_mean,
        'positives': kinds['positive'], 'negatives': kinds['negative'],
        'not_scored': {name: kinds[name] for name in FRAME_KINDS[2:]},
        'clean': _run_figures(clean, block, seed),
        'attacks': [_attack_figures(name, attacks[name], clean, run, block, seed)
                    for name, run in runs.items()],
        'detector': None if lcd is None else detector_facts(lcd),
        'behind_check': _behind_check(attacks, clean, runs, block, seed),
        'notes': [], 'seed': seed,
        'bootstrap': {'block_s': block_s, 'block_frames': block, 'blocks': len(clean) / block,
                      'replicates': intervals.REPLICATES, 'level': intervals.LEVEL}}
    return summary if summary['labelled'] else _without_labels(summary)


def detector_facts(lcd: LcdConfig) -> dict[str, Any]:
    """Return what has to be known of a detector wherever its figures are quoted."""
    return {'target': lcd.target, 'threshold': lcd.threshold, 'defences': defence_names(lcd)}


def _behind_check(attacks: Mapping[str, AttackConfig | None], clean: Sequence[QueryRecord],
                  runs: Mapping[str, Sequence[QueryRecord]], block: int,
                  seed: int) -> dict[str, Any] | None:
    """Return the figures with a geometric check behind the detector; None if it was not asked."""
    if not any(record.support is not None for record in clean):
        return None
    before = behind_check(clean)
    behind = {name: behind_check(run) for name, run in runs.items()}
    rows = [{'name': name, **asdict(run_metrics(run)), **_lost(before, run, block, seed)}
            for name, run in behind.items()]
    return {'clean': asdict(run_metrics(before)), 'attacks': rows}


def _lost(clean: Sequence[QueryRecord], run: Sequence[QueryRecord], block: int,
          seed: int) -> dict[str, Any]:
    """Return what a run lost against the clean one."""
    kind, before, after = column(clean, 'label'), column(clean, 'outcome'), column(run, 'outcome')
    return {**asdict(effect(kind, before, after)),
            'decline_ci95': intervals.decline_interval(
                told_kind(kind, before, after), right(before), right(after), block, seed)}


def _without_labels(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return the summary with None for all that ground truth would be needed for."""
    def unknown(figures: Mapping[str, Any]) -> dict[str, Any]:
        return {name: None if name in _NEED_LABELS else value for name, value in figures.items()}

    return {**unknown(summary), 'clean': unknown(summary['clean']), 'behind_check': None,
            'attacks': [unknown(attack) for attack in summary['attacks']]}


def as_document(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return a summary as it stands in summary.json: rows are runs, the clean one first."""
    rows = [{'name': CLEAN, **summary['clean']}, *summary['attacks']]
    return summary_document(KIND, SCHEMA, rows, {
        name: value for name, value in summary.items() if name not in ('clean', 'attacks')})


def from_document(document: Mapping[str, Any]) -> dict[str, Any]:
    """
    Return the summary that ``as_document`` was given.

    Raises
    ------
    EvaluationError
        The document is of something else.

    """
    found = document.get('kind'), document.get('schema')
    if found != (KIND, SCHEMA) or not document.get('rows'):
        raise EvaluationError(f'summary.json is of the kind {found[0]!r}, schema {found[1]!r}: '
                              f'expected {KIND!r}, {SCHEMA}, with rows; run the evaluation again')
    clean, *attacks = document['rows']
    rest = {name: value for name, value in document.items()
            if name not in ('kind', 'schema', 'rows')}
    return {**rest, 'clean': {name: value for name, value in clean.items() if name != 'name'},
            'attacks': attacks}


def run_metrics(run: Sequence[QueryRecord]) -> Metrics:
    """Return the figures of the records of one run."""
    return measure(column(run, 'label'), column(run, 'is_loop'),
                   column(run, 'probability').astype(np.float64), column(run, 'match_correct'),
                   column(run, 'match_is') != UNTOLD)


def _run_figures(run: Sequence[QueryRecord], block: int, seed: int) -> dict[str, Any]:
    kind, outcome = column(run, 'label'), column(run, 'outcome')
    return {
        **asdict(run_metrics(run)),
        'loops_declared': sum(record.is_loop for record in run),
        'balanced_accuracy_ci95': intervals.balanced_accuracy_interval(
            told_kind(kind, outcome), right(outcome), block, seed),
        # Joins that certainly share nothing, on whatever frame.
        'declared_elsewhere': sum(record.is_loop and record.match_is == ELSEWHERE
                                  for record in run),
        # Outside the scored frames a closure with another place is still wrong.
        'wrong_closures_unscored': sum(
            record.is_loop and record.match_is in (WRONG, ELSEWHERE) and not record.outcome
            for record in run),
        'first_closure_latency_s': first_closure_latency_s(
            column(run, 'stamp_ns'), kind, outcome)}


def _attack_figures(name: str, config: AttackConfig | None, clean: Sequence[QueryRecord],
                    run: Sequence[QueryRecord], block: int, seed: int) -> dict[str, Any]:
    # Of an attack that was only recorded nobody knows the settings.
    known = attack_columns(config or AttackConfig())
    settings = {**known, **{shown: getattr(config or AttackConfig(), field) for shown, field in (
        ('ratio', 'ratio'), ('mode', 'mode'), ('edit_kinds', 'edits'), ('seed', 'seed'))}}
    if config is None:
        settings = dict.fromkeys(settings)
    return {
        'name': name, **settings, 'decisions': len(run), **_effort(run),
        **_run_figures(run, block, seed), **_lost(clean, run, block, seed),
        **_changes(clean, run),
        **{f'{what}_elsewhere': sum(record.effect == what and record.match_is == ELSEWHERE
                                    for record in run) for what in ('invented', 'diverted')}}


def _changes(clean: Sequence[QueryRecord], run: Sequence[QueryRecord]) -> dict[str, Any]:
    """Count the decisions that changed, whatever is right."""
    found = Counter(map(decision_change, clean, run))
    changed = len(run) - found['']
    attacked = sum(not _unattackable(record) for record in run)
    return {
        'silenced': found['silenced'], 'raised': found['raised'],
        'redirected': found['redirected'], 'changed': changed,
        # Of the frames that could be attacked; the others cannot be won.
        'success_rate': changed / attacked if attacked else None,
        'agreement': found[''] / len(run)}


def _effort(run: Sequence[QueryRecord]) -> dict[str, Any]:
    # Means are over all frames: those that could not be attacked count with nothing spent.
    attacked = [record for record in run if not _unattackable(record)]
    skipped = Counter(record.reason or 'no reason given' for record in run
                      if _unattackable(record))
    status = Counter(record.status for record in run)
    queries, duration_s = _known(run, 'queries'), _known(run, 'duration_s')
    return {
        'edits_mean': _mean(_known(run, 'edits')),
        'edit_budget_mean': _mean(_known(run, 'edit_budget')),
        'nodes_moved_mean': _mean(_known(run, 'nodes_moved')),
        'queries_mean': _mean(queries),
        'queries_mean_attacked': _mean(_known(attacked, 'queries')),
        'queries_total': None if queries is None else int(queries.sum()),
        'unattackable': len(run) - len(attacked), 'unattackable_reasons': dict(skipped),
        'success': status['success'], 'failure': status['failure'],
        **{f'duration_ms_{name}': (None if duration_s is None
                                   else 1e3 * float(np.quantile(duration_s, share)))
           for name, share in (('median', 0.5), ('p99', 0.99))}}


def _known(run: Sequence[QueryRecord], name: str) -> NDArray[np.float64] | None:
    """Return a column of numbers; None if empty, or if nobody reported them."""
    values = column(run, name)
    return None if not len(values) or None in values else values.astype(np.float64)


def _mean(values: NDArray[np.float64] | None) -> float | None:
    return None if values is None else float(np.mean(values))


def _unattackable(record: QueryRecord) -> bool:
    return record.status == 'skipped' or (record.edit_budget == 0 and not record.node_budget)
