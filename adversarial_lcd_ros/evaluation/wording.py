# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The figures of summary.json in words and cells, for the report and the terminal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from adversarial_lcd_ros.evaluation.methods import method_of, surrogate_facts, whose
from adversarial_lcd_ros.registry import NONE

UNDEFINED = 'n/a'
_NARROW_SPACE = '\u202f'  # does not break the line
_MODE = {'query': 'query-guided', 'surrogate': 'surrogate only', 'pass': 'forwarded unchanged'}

Attack = Mapping[str, Any]


def attack_title(attack: Attack) -> str:
    """Return what an attack is, in words: its name, or else its settings."""
    if attack.get('name'):
        return str(attack['name'])
    if attack['mode'] == 'pass':
        return 'control: forwarded unchanged'
    unasked = attack['mode'] == 'surrogate' and not attack['surrogate']
    return f'{method_title(attack)}, {"no queries" if unasked else mode_title(attack["mode"])}'


def method_title(attack: Attack) -> str:
    """Return what looks for the flips of an attack, in words: a surrogate only if one ran."""
    title = method_of(attack).replace('_', ' ')
    if attack['surrogate'] in ('', NONE):
        return title
    return f'{title} + {surrogate_title(attack["surrogate"])}'


def surrogate_title(surrogate: str) -> str:
    """Return a surrogate in words."""
    return surrogate_facts(surrogate).title or surrogate.replace('_', ' ')


def mode_title(mode: str) -> str:
    """Return how an attack uses its queries, in words."""
    return _MODE.get(mode, mode)


def percent(value: float | None, digits: int = 1) -> str:
    """Return a share in percent."""
    return UNDEFINED if value is None else f'{100 * value:.{digits}f}{_NARROW_SPACE}%'


def number(value: float | None, digits: int = 1) -> str:
    """Return a number with a fixed count of decimals and thousands set apart."""
    return UNDEFINED if value is None else f'{value:,.{digits}f}'


def mean_count(value: float | None) -> str:
    """Return a mean of counts; decimals only where they say something."""
    return number(value, 1 if value is None or value < 100 else 0)


def _ratio(value: float | None) -> str:
    return UNDEFINED if value is None else f'{value:g}'


def points(value: float | None) -> str:
    """Return percentage points; what rounds to nothing has no sign."""
    return UNDEFINED if value is None else f'{round(value, 1) + 0.0:.1f}'


def interval(bounds: Sequence[float] | None, factor: float = 1.0) -> str:
    """Return the bounds of an interval."""
    if bounds is None:
        return ''
    return ' to '.join(f'{round(factor * bound, 1) + 0.0:.1f}' for bound in bounds)


def is_labelled(summary: Mapping[str, Any]) -> bool:
    """Tell whether there was ground truth to score decisions by."""
    return bool(summary.get('labelled', True))


def strongest(summary: Mapping[str, Any]) -> Attack | None:
    """Return the attack that took, or without ground truth changed, most; None without any."""
    attacks: list[Attack] = summary['attacks']
    if not is_labelled(summary):
        return max(attacks, key=lambda attack: int(attack['changed']), default=None)
    return max(attacks, key=lambda attack: -1e9 if attack['decline_pp'] is None
               else attack['decline_pp'], default=None)


def headline(summary: Mapping[str, Any]) -> str:
    """Return the main finding in one or two sentences."""
    if not summary['nodes_mean']:
        return (f'All {summary["graphs"]} graphs of {summary["sequence"]} are empty: no feature '
                'and no object was found in the pictures. Nothing could be recognised or '
                'attacked; the figures say nothing about the detector.')
    if not is_labelled(summary):
        return _headline_without_labels(summary)
    attack = strongest(summary)
    name, clean = summary['sequence'], summary['clean']
    if attack is None:
        return (f'Without an attack the detector reaches a balanced accuracy of '
                f'{percent(clean["balanced_accuracy"])} on {name}.')
    effort = _effort(summary, attack)
    if attack['decline_pp'] is None:
        kind = 'frames with a loop' if not summary['positives'] else 'frames at a new place'
        return (f'{name} has no {kind}, so no balanced accuracy can be given. With {effort}, '
                f'{_changes(summary, attack)}.')
    bounds = attack['decline_ci95']
    if bounds is not None and bounds[0] <= 0:
        return (f'No attack lowered the balanced accuracy on {name} beyond chance. The strongest, '
                f'{attack_title(attack)}{_owner(attack)}, changed it from '
                f'{percent(clean["balanced_accuracy"])} '
                f'to {percent(attack["balanced_accuracy"])}: a decline of '
                f'{points(attack["decline_pp"])} points (95{_NARROW_SPACE}% interval '
                f'{interval(bounds)}), with {effort}.{_papers_own(summary, attack)}')
    return (f'{_subject(attack)} took {points(attack["decline_pp"])} points off the balanced '
            f'accuracy of loop closure on {name}, from {percent(clean["balanced_accuracy"])} to '
            f'{percent(attack["balanced_accuracy"])} (95{_NARROW_SPACE}% interval of the decline '
            f'{interval(bounds)}), with {effort}. {sentence(_changes(summary, attack))}.'
            f'{_papers_own(summary, attack)}')


def _subject(attack: Attack) -> str:
    """Return the attack of a headline: its name, and whose it is."""
    owner = _owner(attack)
    return f'The attack {attack_title(attack)}{owner}{"," if owner else ""}'


def _owner(attack: Attack) -> str:
    owner = {'paper': "the paper's", 'ours': "this project's own"}.get(whose(attack))
    return f', {owner}' if owner else ''


def _papers_own(summary: Mapping[str, Any], strongest_attack: Attack) -> str:
    """Return a sentence on the paper's own attack beside the strongest, if it is another."""
    own = [attack for attack in summary['attacks'] if attack['decline_pp'] is not None
           and attack['perturbation'] == 'eigencentrality' and attack is not strongest_attack]
    if not own or strongest_attack['perturbation'] == 'eigencentrality':
        return ''
    best = max(own, key=lambda attack: float(attack['decline_pp']))
    return (f" The paper's own ({attack_title(best)}) took {points(best['decline_pp'])} points "
            f'({interval(best["decline_ci95"]) or UNDEFINED}).')


def detector_title(detector: Mapping[str, Any] | None) -> str:
    """Return what has to be known of the detector beside its figures, in words."""
    if not detector:
        return ''
    defences = [name.replace('_', ' ') for name in detector['defences']]
    return (f'detector {detector["target"]}, threshold {detector["threshold"]:g}, '
            f'{"behind " + ", ".join(defences) if defences else "no defence"}')


def meaning(summary: Mapping[str, Any]) -> list[str]:
    """Return what the figures mean for a robot, in plain sentences; none without an attack."""
    attack = strongest(summary)
    if attack is None or not is_labelled(summary) or not summary['nodes_mean']:
        return []
    told = []
    if attack['suppressed']:
        told.append(f'Of {summary["clean"]["tp"]} places that the robot recognised, '
                    f'{attack["suppressed"]} went unrecognised under {attack_title(attack)}: its '
                    'drift would not be corrected there.')
    if attack['invented']:
        told.append(f'At {attack["invented"]} of {summary["clean"]["tn"]} places where it had '
                    'never been it believed to be back: each such loop can bend the map, and one '
                    'can be enough.')
    if not told:
        told.append('On this sequence no attack made the robot miss or imagine a place.')
    told += _meaning_of_check(summary, attack)
    return [*told, 'All this takes somebody who can change graphs on their way from the builder '
            'to the detector, or who can publish in the name of the builder.']


def _meaning_of_check(summary: Mapping[str, Any], attack: Attack) -> list[str]:
    behind = summary.get('behind_check')
    if not behind:
        return []
    row = next(row for row in behind['attacks'] if row['name'] == attack['name'])
    return [f'A geometric check behind the detector, of which the attack did not know, would '
            f'leave {row["invented"]} imagined and {row["suppressed"]} unrecognised places: it '
            'can refuse a false loop, but not bring back a lost one.']


def behind_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return what a geometric check behind the detector would leave, one row an attack."""
    found = summary.get('behind_check')
    if not found:
        return []
    clean = found['clean']
    title_of = {attack['name']: attack_title(attack) for attack in summary['attacks']}
    return [{
        'attack': title_of[row['name']],
        'balanced accuracy': (f'{percent(clean["balanced_accuracy"])} → '
                              f'{percent(row["balanced_accuracy"])}'),
        'decline, points': points(row['decline_pp']),
        '95 % interval': interval(row['decline_ci95']) or UNDEFINED,
        'suppressed': f'{row["suppressed"]} of {clean["tp"]}',
        'invented': f'{row["invented"]} of {clean["tn"]}',
    } for row in found['attacks']]


def _headline_without_labels(summary: Mapping[str, Any]) -> str:
    attack, frames = strongest(summary), summary['frames']
    clean = (f'Without an attack the detector declared {summary["clean"]["loops_declared"]} loops '
             f'in {frames} frames of {summary["sequence"]}')
    unknown = 'Without ground truth nobody can say which of them are right'
    if attack is None:
        return f'{clean}. {unknown}.'
    which = 'strongest attack' if len(summary['attacks']) > 1 else 'attack'
    return (f'{clean}. The {which}, {attack_title(attack)}, changed '
            f'{attack["changed"]} decisions ({percent(attack["success_rate"])} of the frames that '
            f'could be attacked): loops silenced {attack["silenced"]}, raised {attack["raised"]}, '
            f'declared with another frame {attack["redirected"]}, with '
            f'{_effort(summary, attack)}. {unknown}.')


def _effort(summary: Mapping[str, Any], attack: Attack) -> str:
    if attack.get('nodes_moved_mean'):
        return (f'{mean_count(attack["nodes_moved_mean"])} of {number(summary["nodes_mean"], 0)} '
                'nodes changed in a graph on average')
    return (f'{mean_count(attack["edits_mean"])} of {number(summary["edges_mean"], 0)} edges '
            'flipped in a graph on average')


def _changes(summary: Mapping[str, Any], attack: Attack) -> str:
    found = summary['clean']['tp']
    silent = summary['clean']['tn']
    return (f'{attack["suppressed"]} of {found} loops that had been found were lost, and loops '
            f'were invented in {attack["invented"]} of {silent} frames that had rightly been '
            f'left alone{_certain(attack)}')


def _certain(attack: Attack) -> str:
    text = ''
    if attack['invented_elsewhere'] != attack['invented']:
        text = f' ({attack["invented_elsewhere"]} of them certainly elsewhere)'
    if attack['left_out']:
        were = 'frame was' if attack['left_out'] == 1 else 'frames were'
        text += (f'; {attack["left_out"]} {were} left out, because nobody can tell whether '
                 'the match is right')
    return text


def sentence(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def decline_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    """Return the table of what attacks took or changed, one row an attack: heading to cell."""
    if not is_labelled(summary):
        return _change_rows(summary)
    clean = summary['clean']
    return [{
        'attack': attack_title(attack),
        'ratio r': _ratio(attack['ratio']),
        'edits': mean_count(attack['edits_mean']),
        'queries': mean_count(attack['queries_mean']),
        'balanced accuracy': (f'{percent(clean["balanced_accuracy"])} → '
                              f'{percent(attack["balanced_accuracy"])}'),
        'decline, points': points(attack['decline_pp']),
        '95 % interval': interval(attack['decline_ci95']) or UNDEFINED,
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
            row['unexplained edges'] = (f'{mean_count(counted[name]["mean"])} '
                                        f'(in {counted[name]["graphs"]} graphs)')
    return rows


def _scored_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    runs = [('before', summary['clean'])]
    runs += [(attack_title(attack), attack) for attack in summary['attacks']]
    return [{
        'run': title,
        'accuracy': percent(run['accuracy']),
        'balanced': percent(run['balanced_accuracy']),
        '95 % interval': interval(run['balanced_accuracy_ci95'], 100.0) or UNDEFINED,
        'precision': percent(run['precision']),
        'recall': percent(run['recall']),
        'recall at 100 % precision': percent(run['recall_at_100_precision']),
        'average precision': number(run['average_precision'], 3),
        'MCC': number(run['mcc'], 3),
        'wrong matches': str(run['wrong_matches']),
        'certainly elsewhere': str(run['declared_elsewhere']),
    } for title, run in runs]


def _change_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    return [{
        'attack': attack_title(attack),
        'ratio r': _ratio(attack['ratio']),
        'edits': mean_count(attack['edits_mean']),
        'queries': mean_count(attack['queries_mean']),
        'changed': f'{attack["changed"]} of {summary["frames"]}',
        'success rate': percent(attack['success_rate']),
        'silenced': str(attack['silenced']),
        'raised': str(attack['raised']),
        'other match': str(attack['redirected']),
        'unattackable': f'{attack["unattackable"]} of {summary["frames"]}',
    } for attack in summary['attacks']]


def _declared_rows(summary: Mapping[str, Any]) -> list[dict[str, str]]:
    runs = [('before', {**summary['clean'], 'agreement': 1.0})]
    runs += [(attack_title(attack), attack) for attack in summary['attacks']]
    return [{
        'run': title,
        'loops declared': f'{run["loops_declared"]} of {summary["frames"]}',
        'decisions as in the clean run': percent(run['agreement']),
    } for title, run in runs]
