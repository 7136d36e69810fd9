# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Synthetic rows in the form of the paper recipe: no detector and no attack made them.

Decisions are drawn from given rates, so that what the statistics should find is known.
"""

import zlib

import numpy as np

from adversarial_lcd_ros.evaluation.metrics import effect
from adversarial_lcd_ros.evaluation.outcomes import right

SEQUENCES = ('synthetic_tour', 'synthetic_kitchen', 'synthetic_desk', 'synthetic_office')
# Chance that an attack turns a right decision over, at r = 3e-4; made up.
POWER = {('eigencentrality', 'svm_linear'): 0.02, ('eigencentrality', 'svm_poly'): 0.05,
         ('eigencentrality', 'naive_bayes'): 0.04, ('eigencentrality', 'svm_rbf'): 0.08,
         ('random_walk', 'svm_rbf'): 0.03, ('shortest_path', 'svm_rbf'): 0.06,
         ('random_flip', 'none'): 0.02, ('recall', 'none'): 0.35, ('optimum', 'none'): 0.6}


def make_row(sequence='synthetic_tour', target='wl', perturbation='eigencentrality',
             surrogate='svm_rbf', oracle='soft', mode='query', ratio=3e-4, seed=0, power=None,
             frames=60, positives=None, asked_target=None, nodes=300, search='stepwise',
             **settings):
    """Return a synthetic row; ``power`` is the chance that a right decision turns wrong."""
    if perturbation in ('recall', 'optimum'):
        search = perturbation
    if search != 'stepwise':
        perturbation, surrogate = search, 'none'
    tag = f'{sequence} {target} {perturbation} {surrogate} {mode} {ratio} {seed} {nodes}'
    rng = np.random.default_rng(zlib.crc32(tag.encode()))
    power = POWER[perturbation, surrogate] * ratio / 3e-4 if power is None else power
    kind = np.where(np.arange(frames) < (frames // 2 if positives is None else positives), 1,
                    -1).astype(np.int8)
    clean_right = np.random.default_rng(zlib.crc32(sequence.encode())).random(frames) < 0.9
    budget = int(ratio * nodes ** 2)
    turned = clean_right & (rng.random(frames) < power) & (budget > 0)
    before, after = (outcome_of(kind, state) for state in (clean_right, clean_right & ~turned))
    queries = np.where(turned, rng.integers(1, max(40 * budget, 1) + 1, frames), 40 * budget)
    queries = queries * (mode == 'query')
    edits = np.where(turned, np.minimum(queries // 40 + 1, budget), budget)
    change = effect(kind, before, after)
    return {
        'sequence': sequence, 'target': target, 'search': search,
        'perturbation': perturbation if search == 'stepwise' else '',
        'surrogate': surrogate if search == 'stepwise' else '',
        'oracle': oracle, 'mode': mode, 'ratio': ratio, 'edits': 'both',
        'queries_per_edit': 40, 'nodes': nodes, 'threshold': 0.5, 'judged': 'frames',
        'variant': '',
        'nodes_mean': nodes + 4.5,
        'edges_mean': 3.1 * nodes, 'seed': seed, 'frames': frames,
        'positives': int((kind > 0).sum()), 'negatives': int((kind < 0).sum()),
        'accuracy_clean': float(right(before).mean()),
        'accuracy_attacked': float(right(after).mean()),
        'balanced_clean': balanced(kind, before), 'balanced_attacked': balanced(kind, after),
        'decline_pp': change.decline_pp, 'suppressed': change.suppressed,
        'invented': change.invented, 'left_out': change.left_out,
        'invented_elsewhere': change.invented, 'unattackable': 0 if budget else frames,
        'edits_mean': float(edits.mean()), 'queries_mean': float(queries.mean()),
        'success_rate': float(turned.mean()), 'duration_s': 1.25,
        'asked_target': asked_target or target, 'name': f'{perturbation} {surrogate}',
        'frame_results': [
            {'stamp': int(index * 10**9), 'kind': int(kind[index]), 'clean': str(before[index]),
             'attacked': str(after[index]), 'edits': int(edits[index]),
             'queries': int(queries[index])} for index in range(frames)],
        **settings}


def outcome_of(kind, state):
    return np.select([(kind > 0) & state, kind > 0, state], ['TP', 'FN', 'TN'], 'FP')


def balanced(kind, outcome):
    if len(set(kind.tolist())) < 2:
        return None
    return float(np.mean([right(outcome)[kind == value].mean() for value in (1, -1)]))


def make_rows(seeds=(0, 1), sequences=SEQUENCES):
    """Return the synthetic rows of a whole table: surrogates, perturbations, budgets, targets."""
    rows = [make_row(sequence, 'wl', *method, mode=mode, seed=seed)
            for sequence in sequences for method in POWER for seed in seeds
            for mode in ('query', 'surrogate') if mode == 'query' or method[1] != 'none']
    rows += [make_row(sequence, 'wl', perturbation, surrogate, ratio=ratio, seed=seed)
             for sequence in sequences for ratio in (1e-4, 2e-4) for seed in seeds
             for perturbation, surrogate in POWER if surrogate in ('svm_rbf', 'none')]
    rows += [make_row(sequence, target, *method, seed=seed,
                      power=min(1.0, 3 * POWER[method]))
             for sequence in sequences for target in ('anchored', 'edges') for seed in seeds
             for method in (('eigencentrality', 'svm_rbf'), ('recall', 'none'))]
    rows += [make_row(sequence, 'anchored', 'recall', 'none', seed=seed, asked_target='wl',
                      power=0.12) for sequence in sequences for seed in seeds]
    rows += [make_row(sequence, 'wl', *method, nodes=50, seed=seed) for sequence in sequences
             for seed in seeds for method in (('eigencentrality', 'svm_rbf'), ('recall', 'none'))]
    return rows
