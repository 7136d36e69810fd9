# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tables of a replay: rows for reports and for the terminal; printing is the command line's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.replay.findings import is_labelled


def decline_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the table of what attacks took or changed, one row an attack: heading to cell."""
    if not is_labelled(summary):
        return _change_rows(summary)
    clean = summary['clean']
    return [{
        'attack': wording.attack_title(attack),
        'ratio r': wording.ratio(attack['ratio']),
        'edits': wording.mean_count(attack['edits_mean']),
        'queries': wording.mean_count(attack['queries_mean']),
        'balanced accuracy': (f'{wording.percent(clean["balanced_accuracy"])} → '
                              f'{wording.percent(attack["balanced_accuracy"])}'),
        'decline, points': wording.points(attack['decline_pp']),
        '95 % interval': wording.interval(attack['decline_ci95']) or wording.UNDEFINED,
        'suppressed': f'{attack["suppressed"]} of {clean["tp"]}',
        'invented': f'{attack["invented"]} of {clean["tn"]}',
        'certainly elsewhere': str(attack['invented_elsewhere']),
        'cannot be told': str(attack['left_out']),
        'unattackable': f'{attack["unattackable"]} of {summary["frames"]}',
    } for attack in summary['attacks']]


def figure_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the figures of the detector, one row a run: heading to cell."""
    rows = _scored_rows(summary) if is_labelled(summary) else _declared_rows(summary)
    counted = summary.get('unexplained_edges')
    if counted:
        names = ['clean', *(attack['name'] for attack in summary['attacks'])]
        for name, row in zip(names, rows, strict=True):
            row['unexplained edges'] = (f'{wording.mean_count(counted[name]["mean"])} '
                                        f'(in {counted[name]["graphs"]} graphs)')
    return rows


def behind_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return what a geometric check behind the detector would leave, one row an attack."""
    found = summary.get('behind_check')
    if not found:
        return []
    clean = found['clean']
    title_of = {attack['name']: wording.attack_title(attack) for attack in summary['attacks']}
    return [{
        'attack': title_of[row['name']],
        'balanced accuracy': (f'{wording.percent(clean["balanced_accuracy"])} → '
                              f'{wording.percent(row["balanced_accuracy"])}'),
        'decline, points': wording.points(row['decline_pp']),
        '95 % interval': wording.interval(row['decline_ci95']) or wording.UNDEFINED,
        'suppressed': f'{row["suppressed"]} of {clean["tp"]}',
        'invented': f'{row["invented"]} of {clean["tn"]}',
    } for row in found['attacks']]


def _scored_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    runs = [('before', summary['clean'])]
    runs += [(wording.attack_title(attack), attack) for attack in summary['attacks']]
    return [{
        'run': title,
        'accuracy': wording.percent(run['accuracy']),
        'balanced': wording.percent(run['balanced_accuracy']),
        '95 % interval': (wording.interval(run['balanced_accuracy_ci95'], 100.0)
                          or wording.UNDEFINED),
        'precision': wording.percent(run['precision']),
        'recall': wording.percent(run['recall']),
        'recall at 100 % precision': wording.percent(run['recall_at_100_precision']),
        'average precision': wording.number(run['average_precision'], 3),
        'MCC': wording.number(run['mcc'], 3),
        'wrong matches': str(run['wrong_matches']),
        'certainly elsewhere': str(run['declared_elsewhere']),
    } for title, run in runs]


def _change_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    return [{
        'attack': wording.attack_title(attack),
        'ratio r': wording.ratio(attack['ratio']),
        'edits': wording.mean_count(attack['edits_mean']),
        'queries': wording.mean_count(attack['queries_mean']),
        'changed': f'{attack["changed"]} of {summary["frames"]}',
        'success rate': wording.percent(attack['success_rate']),
        'silenced': str(attack['silenced']),
        'raised': str(attack['raised']),
        'other match': str(attack['redirected']),
        'unattackable': f'{attack["unattackable"]} of {summary["frames"]}',
    } for attack in summary['attacks']]


def _declared_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    runs = [('before', {**summary['clean'], 'agreement': 1.0})]
    runs += [(wording.attack_title(attack), attack) for attack in summary['attacks']]
    return [{
        'run': title,
        'loops declared': f'{run["loops_declared"]} of {summary["frames"]}',
        'decisions as in the clean run': wording.percent(run['agreement']),
    } for title, run in runs]


def sweep_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return what each run would be worth by other labels, one row a run and labels."""
    return [{
        'labels': row['labels'],
        'run': row['run'],
        'loops / new places': f'{row["positives"]} / {row["negatives"]}',
        'balanced': wording.percent(row['balanced_accuracy']),
        'decline, points': wording.number(row['decline_pp']),
        'suppressed': str(row['suppressed']),
        'invented': str(row['invented']),
    } for row in summary['label_sweep']]
