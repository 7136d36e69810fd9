# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A finished results folder of every kind, from made-up decisions."""

from paper_factory import make_row
from test_report import ATTACKS, COUNT, decide, make_labels, make_runs

from adversarial_lcd_ros.config import BACK_ENDS, LabelConfig, LcdConfig, MapConfig
from adversarial_lcd_ros.evaluation import results
from adversarial_lcd_ros.evaluation.certificates import run as certificates
from adversarial_lcd_ros.evaluation.certificates.page import write_page
from adversarial_lcd_ros.evaluation.detectors import run as targets
from adversarial_lcd_ros.evaluation.labels import run as label_runs
from adversarial_lcd_ros.evaluation.labels.page import PATH, render_page
from adversarial_lcd_ros.evaluation.maps.report import report_maps
from adversarial_lcd_ros.evaluation.maps.summary import SCHEMA, summarise_cases
from adversarial_lcd_ros.evaluation.paper.report import write_paper_report
from adversarial_lcd_ros.evaluation.replay.records import make_records, write_records
from adversarial_lcd_ros.evaluation.replay.report import write_report
from adversarial_lcd_ros.evaluation.replay.summary import GraphStatistics, as_document, summarise
from adversarial_lcd_ros.evaluation.rings.report import write_rings
from adversarial_lcd_ros.evaluation.store import open_store

KINDS = ('replay', 'frames', 'targets', 'labels', 'map', 'rings', 'certificates')


def replay(path, *, found=range(30, 60), lcd=None, labels=None):
    """Evaluate two made-up attacks on two walks; ``found``: frames with a loop before them."""
    made = folder(path, [lcd or LcdConfig(), labels or LabelConfig(), *ATTACKS.values()])
    records = make_records(make_labels(), decide(found), make_runs())
    summary = summarise('walks', records, ATTACKS,
                        GraphStatistics.of([300] * COUNT, [900] * COUNT), seed=1)
    made.write_json(results.SUMMARY, as_document(summary))
    write_records(path / results.RECORDS, records)
    write_report(path, summary, records, [])
    return path


def frames(path, *, power=0.3, sequences=('tour', 'desk'), lcd=None, labels=None):
    """Return cells of made-up attacks; ``power``: their chance to turn a decision over."""
    made = folder(path, [lcd or LcdConfig(), labels or LabelConfig()])
    threshold = (lcd or LcdConfig()).threshold
    with open_store(path) as store:
        for sequence in sequences:
            for seed in (42, 43):
                store.add(f'{sequence} {seed}', make_row(
                    sequence, perturbation='recall', surrogate='none', power=power, seed=seed,
                    threshold=threshold))
        store.add('of other settings', make_row('tour', seed=1))
        write_paper_report(made.path, [row for key, row in store.rows.items()
                                       if key != 'of other settings'])
    return path


def targets_folder(path, *, accuracy=0.75, lcd=None, labels=None):
    """Return a row of a target on pairs, and one live; ``accuracy``: balanced, of both."""
    settings = {'lcd': {'threshold': (lcd or LcdConfig()).threshold}}
    made = folder(path, [], {'sequences': [{'source': 'tour', **settings}]})
    row = {'sequence': 'tour', 'target': 'wl', 'nodes': 300, 'nodes_mean': 299.5, 'frames': 60,
           'scored': [0, 1], 'trained_on': False, 'references_trained_on': False,
           'geometric_check': False, 'labels': {'rule': (labels or LabelConfig()).rule},
           'positives': 9, 'negatives': 9, 'balanced_accuracy': accuracy, 'ci95': [0.5, 0.875],
           'average_precision': 0.9, 'recall_at_100_precision': None, 'mcc': 0.5,
           'precision': 0.9, 'recall': 0.8}
    rows = [{**row, 'protocol': 'pairs', 'n_pairs': 18, 'distinct_pairs': 17, 'seeds': 1},
            {**row, 'protocol': 'live', 'n_frames': 60, 'wrong_matches': 1,
             'declared_elsewhere': 2, 'untold_matches': 3,
             'latency_to_first_closure_s': 2.0, 'block': 6, 'outcomes': ','.join(
                 9 * ['TP'] + 9 * ['TN'] + 42 * [''])}]
    made.write_json(results.SUMMARY, results.summary_document(
        targets.KIND, targets.SCHEMA, rows))
    return path


def labels_folder(path, *, positive=20, labels=None):
    """Return the counts of a sequence's labels; ``positive``: its frames with a loop."""
    made = folder(path, [labels or LabelConfig()])
    row = {'sequence': 'tour', 'told_by': 'co-visibility', 'focal_length': 0.8,
           'focal_from': 'the setting', 'frames': 60, 'positive': positive, 'negative': 10,
           'scale': 2, 'between': 20, 'no_candidate': 8, 'no_ground_truth': 0,
           'loop_pairs': 40, 'pairs': 900, 'right_pairs': 80, 'scaled_pairs': 4,
           'wrong_pairs': 700}
    made.write_json(results.SUMMARY, results.summary_document(
        label_runs.KIND, label_runs.SCHEMA, [row]))
    (path / PATH).write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    render_page(path, row)
    return path


def folder(path, sections, extra=None):
    """Return a results folder with settings and versions and nothing else."""
    path.mkdir(parents=True)
    made = results.ResultsFolder(path)
    made.write_setup(sections, ['adversarial-lcd', 'evaluate'], 1, extra)
    return made


def map_folder(path, *, off_m=0.5, lcd=None, labels=None):
    """Return made-up maps of two runs; ``off_m``: how far that under attack is off."""
    made = folder(path, [MapConfig(), lcd or LcdConfig(), labels or LabelConfig()])
    truth = [[float(x), float(x % 3), 0.0] for x in range(12)]
    with open_store(path) as store:
        for draw in range(2):
            for run, error_m in (('clean', 0.1), ('attack', off_m)):
                store.add(f'{run} {draw}', map_case(run, draw, truth, error_m))
        rows = list(store.rows.values())
    summary = results.summary_document('map', SCHEMA, summarise_cases(rows), {
        'sequence': 'tour', 'frames': 12, 'first_loop': None, 'period_s': 0.5, 'focal_px': 500.0,
        'seed': 42, 'claims': [],
        'shown': [{'key': f'{run} 0', 'run': run, 'setting': '', 'checked': False,
                   'stage': 'whole'} for run in ('clean', 'attack')],
        'runs': [{'run': run, 'setting': '', 'right': 1, 'false': 1, 'untold': 2, 'unlocated': 0}
                 for run in ('clean', 'attack')]})
    made.write_json(results.SUMMARY, summary)
    report_maps(path)
    return path


def map_case(run, draw, truth, error_m):
    figures = {'ate_m': error_m + 0.01 * draw, 'rpe_m': 0.01, 'rpe_deg': 0.5, 'right_kept': 1,
               'false_kept': 0, 'duration_s': 0.1, 'kept': [1, 0],
               'path': [[x + error_m, y, z] for x, y, z in truth]}
    return {'run': run, 'stage': 'whole', 'frames': 12, 'drift': 1.0, 'draw': draw, 'added': None,
            'consistent': False, 'missing': None, 'checked': False, 'setting': '',
            'claims': '', 'right': 1, 'false': 1, 'unposed': 0,
            'back_ends': dict.fromkeys(('odometry', *BACK_ENDS), figures), 'truth': truth,
            'closures': [[9, 1, False], [11, 2, True]]}


def ring_row(detector, search, name, outcomes, aware=True, seed=42, **more):
    """Return a cell of a made-up attack; ``outcomes``: kind, outcome clean, and attacked."""
    frames = [{'stamp': stamp, 'kind': kind, 'clean': clean, 'attacked': attacked,
               'attacked_is': 'elsewhere' if attacked == 'FP' else '', 'edits': 3, 'queries': 5,
               'nodes_moved': 2, 'node_budget': 4, 'edit_budget': 3}
              for stamp, (kind, clean, attacked) in enumerate(outcomes)]
    return {'sequence': 'tour', 'target': 'wl', 'detector': detector, 'threshold': 0.5,
            'name': name, 'search': search, 'aware': aware, 'ratio': 3e-4, 'variant': '',
            'seed': seed, 'frame_results': frames, **more}


def rings_folder(path, *, lost=1, lcd=None, labels=None):
    """Return an attack on edges and one on nodes; ``lost``: loops that they suppress, of 9."""
    made = folder(path, [lcd or LcdConfig(), labels or LabelConfig()])
    found = [(1, 'TP', 'FN' if at < lost else 'TP') for at in range(9)] + [(-1, 'TN', 'TN')] * 9
    threshold = (lcd or LcdConfig()).threshold
    rows = [ring_row('', search, search, found, threshold=threshold)
            for search in ('recall', 'replay')]
    write_rings(made.path, rows, [], [])
    return path


def certificates_folder(path, *, held=5, lcd=None, labels=None):
    """Return the certificates of a detector; ``held``: loops certified against 2 flips, of 8."""
    made = folder(path, [lcd or LcdConfig(), labels or LabelConfig()])
    loops = [7, 6, held]
    row = {'sequence': 'tour', 'target': 'edges', 'defences': 'length_check', 'changed': '',
           'told_by': 'co-visibility', 'nodes': 299.5, 'budget': 2, 'certify_ms': 17.0,
           'classes': {'new places': {'frames': 4, 'right': 4, 'certified': [4, 4, 2]},
                       'loops': {'frames': 8, 'right': 7, 'certified': loops}},
           'accuracy': [(new / 4 + loop / 8) / 2
                        for new, loop in zip((4, 4, 2), loops, strict=True)],
           'ci95': [0.25, 0.75]}
    made.write_json(results.SUMMARY, results.summary_document(
        certificates.KIND, certificates.SCHEMA, [row]))
    write_page(path, [row], ['adversarial-lcd', 'evaluate'])
    return path


MAKERS = dict(zip(KINDS, (replay, frames, targets_folder, labels_folder, map_folder,
                          rings_folder, certificates_folder), strict=True))
