# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a replay has shown, in sentences: of summary.json, for the report and the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from adversarial_lcd_ros.evaluation.methods import whose
from adversarial_lcd_ros.evaluation.wording import (
    NARROW_SPACE,
    UNDEFINED,
    Attack,
    attack_title,
    interval,
    mean_count,
    number,
    percent,
    points,
    sentence,
)


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
        return f'{_unsure(summary, attack)}{_papers_own(summary, attack)}'
    return (f'{_subject(attack)} took {points(attack["decline_pp"])} points off the balanced '
            f'accuracy of loop closure on {name}, from {percent(clean["balanced_accuracy"])} to '
            f'{percent(attack["balanced_accuracy"])} (95{NARROW_SPACE}% interval of the decline '
            f'{interval(bounds)}), with {effort}. {sentence(_changes(summary, attack))}.'
            f'{_papers_own(summary, attack)}')


def _unsure(summary: Mapping[str, Any], attack: Attack) -> str:
    """Return what the strongest attack came to, where its interval does not exclude chance."""
    name, effort = summary['sequence'], _effort(summary, attack)
    before, after = (percent(run['balanced_accuracy']) for run in (summary['clean'], attack))
    bounds = f'95{NARROW_SPACE}% interval {interval(attack["decline_ci95"])}'
    title = f'{attack_title(attack)}{_owner(attack)}'
    if round(attack['decline_pp'], 1) <= 0:
        return (f'No attack lowered the balanced accuracy on {name}: of {before}, {title}, left '
                f'{after} ({bounds} points), with {effort}.')
    return (f'The strongest attack on {name}, {title}, took {points(attack["decline_pp"])} points '
            f'off the balanced accuracy, from {before} to {after}, with {effort}. So few frames '
            f'leave open whether that is chance: {bounds}.')


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
    return [*told, 'All this takes somebody who can hang a sheet in two places, and no access to '
            'any message.' if _is_scene_alone(attack) else
            'All this takes somebody who can change graphs on their way from the builder '
            'to the detector, or who can publish in the name of the builder.']


def _is_scene_alone(attack: Attack) -> bool:
    """Tell whether a poster hung, and messages were left alone."""
    return bool(attack.get('poster')) and attack['mode'] == 'pass'


def _meaning_of_check(summary: Mapping[str, Any], attack: Attack) -> list[str]:
    behind = summary.get('behind_check')
    if not behind:
        return []
    row = next(row for row in behind['attacks'] if row['name'] == attack['name'])
    return [f'A geometric check behind the detector, of which the attack did not know, would '
            f'leave {row["invented"]} imagined and {row["suppressed"]} unrecognised places: it '
            'can refuse a false loop, but not bring back a lost one.']


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
    if _is_scene_alone(attack):
        hung = attack['poster']
        what = 'two posters over' if hung.get('sheets') == 2 else 'a poster of'
        return (f'{what} {percent(hung["share"], 0)} of the frame ({hung["kind"]}) at '
                f'{hung["spans"].replace(",", " and")} s, and no message changed')
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
