# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report on the paper's experiments, over synthetic rows (no detector made them)."""

import csv
import json
import random
import re
import shutil
import subprocess

import numpy as np
from page_links import Links
from paper_factory import SEQUENCES, make_row, make_rows
import pytest

from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.paper import curves, tables, verdicts
from adversarial_lcd_ros.evaluation.paper import plots as paper_plots
from adversarial_lcd_ros.evaluation.paper.drawn import first_of_targets
from adversarial_lcd_ros.evaluation.paper.exports import latex_escape, latex_table
from adversarial_lcd_ros.evaluation.paper.headline import headline
from adversarial_lcd_ros.evaluation.paper.markdown import markdown_tables
from adversarial_lcd_ros.evaluation.paper.ranks import rank_methods
from adversarial_lcd_ros.evaluation.paper.report import write_paper_report
from adversarial_lcd_ros.evaluation.paper.summaries import summarise_cells, summarise_methods
from adversarial_lcd_ros.evaluation.pictures import Picture, write_pictures

POWERS = {'svm_linear': 0.1, 'svm_poly': 0.2, 'naive_bayes': 0.3, 'svm_rbf': 0.5}


def surrogate_rows(powers=POWERS, sequences=SEQUENCES, **settings):
    return [make_row(sequence, surrogate=surrogate, power=power, frames=100, **settings)
            for sequence in sequences for surrogate, power in powers.items()]


def words_of(rows):
    cells = summarise_cells(rows)
    return headline(summarise_methods(cells), tables.main_ratio(cells))


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Report folder of a whole synthetic table, and its rows."""
    rows = make_rows(seeds=(0, 1), sequences=SEQUENCES[:2])
    folder = tmp_path_factory.mktemp('paper')
    write_paper_report(folder, rows)
    return folder, rows


def test_page_is_one_file_with_everything_in_it(whole):
    page = (whole[0] / 'report.html').read_text()
    links = Links(page)
    assert links.sources
    assert all(source.startswith('data:image/') for source in links.sources)
    assert not re.search(r'(url\(|@import|<script|<link)', page)
    assert 'width=device-width' in page
    for text in ('What was run', 'Surrogates (Tables 3 and 4)', 'Perturbations (Table 5)',
                 'Budgets (Table 6)', 'Queries and success', 'Share of the optimum',
                 'Attacks by target', 'other data', 'Before you read the figures',
                 'synthetic_kitchen', 'asked wl', 'This run left no pictures', '120 of 120'):
        assert text in links.text or text in page, text
    assert 'None' not in links.text
    assert 'nan' not in re.findall(r'\w+', links.text)


def test_exports_hold_the_same_figures(whole):
    folder, rows = whole
    summary = json.loads((folder / 'summary.json').read_text())['rows']
    with (folder / 'cells.csv').open(newline='') as stream:
        cells = list(csv.DictReader(stream))
    with (folder / 'summary.csv').open(newline='') as stream:
        table = list(csv.DictReader(stream))
    assert len(cells) == len(rows)
    assert len(table) == len(summary) == len(rows) / 2
    assert {'sequence', 'target', 'perturbation', 'surrogate', 'oracle', 'mode', 'ratio',
            'nodes_mean', 'seeds', 'accuracy_clean', 'accuracy_attacked', 'decline_pp', 'ci95',
            'share_of_optimum', 'edits_mean', 'queries_mean'} <= set(summary[0])
    assert float(table[0]['decline_pp']) == summary[0]['decline_pp']
    assert float(table[0]['ci95_low']) == summary[0]['ci95'][0]
    assert 'frame_results' not in cells[0]
    assert sorted(path.name for path in folder.iterdir()) == [
        'cells.csv', 'report.html', 'summary.csv', 'summary.json', 'tables.md',
        'tables.tex']


def test_order_of_rows_does_not_matter(tmp_path):
    rows = surrogate_rows(sequences=SEQUENCES[:1])
    pages = []
    for seed in range(2):
        random.Random(seed).shuffle(rows)
        pages.append(write_paper_report(tmp_path, rows).read_bytes())
    assert pages[0] == pages[1]


def test_nothing_and_duplicates_are_refused(tmp_path):
    with pytest.raises(EvaluationError, match='no cell is finished'):
        write_paper_report(tmp_path, [])
    rows = surrogate_rows(sequences=SEQUENCES[:1])
    with pytest.raises(EvaluationError, match='counted twice'):
        write_paper_report(tmp_path, [*rows, rows[0]])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize('rows', [
    [make_row()], [make_row(positives=60)], [make_row(perturbation='optimum', surrogate='none')],
    [make_row(power=0.0, nodes=50)], [make_row(mode='pass', power=0.0)]])
def test_a_single_cell_gives_a_page(rows, tmp_path):
    text = Links(write_paper_report(tmp_path, rows).read_text()).text
    assert 'synthetic_tour' in text
    assert 'Surrogates (Tables' not in text


def test_pictures_of_the_folder_are_shown(tmp_path):
    image = np.full((20, 30, 3), 128, np.uint8)
    write_pictures(tmp_path, [Picture(f'Frame <{number}>', 'A & B', image)
                              for number in range(8)])
    text = write_paper_report(tmp_path, [make_row()]).read_text()
    assert text.count('<figure>') == 6
    assert 'Frame &lt;5&gt;' in text
    assert 'left no pictures' not in text


def test_markdown_has_a_line_an_attack_and_a_column_a_sequence():
    rows = [make_row(sequence, target=target, perturbation=name, surrogate=surrogate, seed=seed,
                     frames=100, power=power, nodes=50 if sequence == SEQUENCES[2] else 300)
            for sequence in SEQUENCES[:3] for target in ('anchored', 'wl') for seed in (0, 1)
            for name, surrogate, power in (('recall', 'none', 0.4), ('optimum', 'none', 0.8),
                                           ('eigencentrality', 'svm_rbf', 0.1))]
    for row in rows:
        row['nodes'] = 300
    cells = summarise_cells(rows)
    text = markdown_tables(cells, summarise_methods(cells), 3e-4)
    about, _, usual, _, *lines = text.splitlines()
    assert 'r = 0.0003.' in about
    assert usual.startswith('Unless said otherwise: 300 features')
    assert lines[0] == ('| `wl` | frames | edits | queries | synthetic_kitchen | synthetic_tour | '
                        'mean | of the optimum |')
    assert [line.split(' | ')[0] for line in lines[2:6]] == [
        '| before', '| recall, query-guided', '| eigencentrality + SVM-RBF, query-guided',
        '| optimum (yardstick)']
    recall = next(cell for cell in cells if cell['sequence'] == SEQUENCES[0]
                  and (cell['target'], cell['method']) == ('wl', 'recall'))
    fields = lines[3].split(' | ')
    assert fields[1] == '200 (100 different)'
    assert fields[5].startswith(f'{recall["decline_pp"]:.1f} (')
    assert lines[7].endswith('allows an edit: synthetic_desk.')
    assert lines[11].startswith('| `anchored` |')


def test_headline_is_of_the_black_box_attack():
    rows = [make_row(sequence, perturbation=name, surrogate='none', power=power, frames=200)
            for sequence in SEQUENCES for name, power in (('recall', 0.4), ('optimum', 0.8))]
    text = words_of(rows)
    assert 'strongest black-box attack on target wl (recall, query-guided, 300 features)' in text
    assert 'over 4 sequences' in text
    assert 'of what the greedy optimum' in text


def test_headline_is_of_the_usual_size_of_graph():
    rows = [make_row(sequence, perturbation=name, surrogate=surrogate, power=power, nodes=nodes)
            for sequence in SEQUENCES[:2]
            for name, surrogate, power, nodes in (
                ('recall', 'none', 0.3, 300), ('eigencentrality', 'svm_rbf', 0.1, 300),
                ('recall', 'none', 0.9, 1000))]
    assert '(recall, query-guided, 300 features)' in words_of(rows)


def test_headline_says_whose_what_the_papers_took_and_where_it_works():
    rows = [make_row(sequence, target, name, surrogate, power=power, judged=judged, frames=200)
            for sequence in SEQUENCES
            for target, judged, name, surrogate, power in (
                ('wl', 'frames', 'recall', 'none', 0.4),
                ('wl', 'frames', 'eigencentrality', 'svm_rbf', 0.05),
                ('symbio', 'pairs', 'eigencentrality', 'svm_rbf', 0.3),
                ('symbio', 'pairs', 'shortest_path', 'svm_rbf', 0.6))]
    text = words_of(rows)
    assert "(recall, query-guided, 300 features), this project's own, took" in text
    assert 'at threshold 0.5, judged against the map.' in text
    methods = {(method['target'], method['method']): wording.points(method['decline_pp'])
               for method in summarise_methods(summarise_cells(rows))}
    assert ("The paper's own (eigencentrality + SVM-RBF, query-guided) took "
            f'{methods["wl", "eigencentrality"]} points') in text
    assert ("The paper's own took most from target symbio (eigencentrality + SVM-RBF, "
            'query-guided, 300 features, threshold 0.5, judged by pairs): '
            f'{methods["symbio", "eigencentrality"]} points') in text
    assert text.endswith('There shortest path + SVM-RBF, query-guided took most, '
                         f'{methods["symbio", "shortest_path"]} points.')
    alone = words_of([row for row in rows if (row['target'], row['perturbation'])
                      == ('wl', 'eigencentrality')])
    assert "features), the paper's own, took" in alone
    assert "The paper's own (" not in alone


def test_of_attacks_that_took_the_same_the_usual_one_is_named():
    rows = [make_row(queries_per_edit=count, variant=variant, power=0.0)
            for count in (1, 40) for variant in ('', 'retry never')]
    assert 'was eigencentrality + SVM-RBF, query-guided, 300 features' in words_of(rows)
    assert 'query-guided, 1 query an edit, 300 features' in words_of(rows[:1])


def test_the_first_table_of_each_target_is_open(tmp_path):
    rows = [make_row(sequence, target, name, 'svm_rbf', judged=judged, queries_per_edit=queries)
            for sequence in SEQUENCES[:2]
            for target, judged in (('wl', 'frames'), ('symbio', 'pairs'))
            for queries in (1, 40) for name in ('eigencentrality', 'random_walk')]
    found = tables.perturbation_tables(summarise_cells(rows))
    # Of settings as complete the usual one comes first.
    assert [(table.setting['target'], table.setting['queries_per_edit'])
            for table in first_of_targets(found)] == [('wl', 40), ('symbio', 40)]
    page = write_paper_report(tmp_path, rows).read_text()
    for table in found:
        start = 'h3 class="setting"' if table.setting['queries_per_edit'] == 40 else 'summary'
        assert f'<{start}>{table.title.capitalize()}</{start[:2] if start[0] == "h" else start}>' \
            in page
    assert 'Perturbations, symbio by pairs.' in page


def test_pairs_have_a_map_of_their_own():
    rows = [make_row(target=target, judged=judged, power=power, frames=100)
            for target in ('wl', 'symbio') for judged, power in (('frames', 0.2), ('pairs', 0.6))]
    frames, pairs = curves.target_maps(summarise_cells(rows), 3e-4)
    assert (frames.setting['judged'], pairs.setting['judged']) == ('frames', 'pairs')
    assert np.all(pairs.declines > frames.declines)


def test_another_threshold_is_another_setting():
    rows = [make_row(sequence, perturbation=name, surrogate='none', power=power, threshold=level)
            for sequence in SEQUENCES[:2] for level, power in ((0.5, 0.3), (0.9, 0.1))
            for name in ('recall', 'optimum', 'eigencentrality') if name != 'eigencentrality'
            or level == 0.5]
    cells = summarise_cells(rows)
    assert len(cells) == len(rows)
    optimum = {(cell['sequence'], cell['threshold']): cell['decline_pp'] for cell in cells
               if cell['method'] == 'optimum'}
    for cell in cells:
        if cell['method'] == 'recall':
            assert cell['share_of_optimum'] == pytest.approx(
                cell['decline_pp'] / optimum[cell['sequence'], cell['threshold']])
    assert '| recall, query-guided, threshold 0.9 |' in markdown_tables(
        cells, summarise_methods(cells), 3e-4)


def test_headline_says_when_there_is_nothing():
    assert words_of([make_row(power=0.0)]).startswith('No black-box attack lowered')
    assert words_of([make_row(positives=60)]).startswith('No attack was measured')
    assert 'One sequence says nothing' in words_of([make_row(power=0.5)])
    rows = [make_row(SEQUENCES[0], power=1.0), make_row(SEQUENCES[1], power=0.0)]
    assert 'leave open whether it holds on others' in words_of(rows)


def test_verdict_follows_the_data():
    def verdict(powers, sequences=SEQUENCES):
        table, = tables.surrogate_tables(summarise_cells(surrogate_rows(powers, sequences)))
        return verdicts.verdict(table)

    assert 'ranking comes out in the means: SVM-RBF' in verdict(POWERS)
    assert 'Beyond chance with 4 sequences: SVM-RBF and SVM-linear.' in verdict(POWERS)
    turned = verdict(dict(zip(POWERS, [0.5, 0.3, 0.2, 0.1], strict=True)))
    assert 'does not come out: SVM-linear' in turned
    mixed = verdict(dict(zip(POWERS, [0.3, 0.2, 0.1, 0.5], strict=True)))
    assert 'leader leads here too, but its ranking' in mixed
    assert 'all took the same, 0.0 points' in verdict(dict.fromkeys(POWERS, 0.0))
    assert 'One sequence cannot tell' in verdict(POWERS, SEQUENCES[:1])
    assert 'none of this is beyond chance' in verdict(POWERS, SEQUENCES[:2])


def test_verdict_over_budgets():
    rows = [make_row(sequence, perturbation=name, ratio=ratio, power=power, frames=200)
            for sequence in SEQUENCES[:2] for ratio, ahead in ((1e-4, 0.1), (3e-4, 0.6))
            for name, power in (('eigencentrality', ahead), ('random_walk', 0.3))]
    table, = tables.budget_tables(summarise_cells(rows))
    assert [line.title for line in table.lines] == ['0.0001', '0.0003']
    assert 'most at 1 of 2 ratios' in verdicts.verdict(table)


def test_tables_compare_one_thing_at_a_time():
    cells = summarise_cells(make_rows(seeds=(0,), sequences=SEQUENCES[:2]))
    found = tables.perturbation_tables(cells)
    assert found[0].columns == ('random flip', 'random walk', 'shortest path',
                                'eigencentrality', 'recall', 'optimum (yardstick)')
    # Transfer is no column, the yardstick is not ranked, and the best is never the yardstick.
    assert [table.setting['target'] for table in found].count('anchored') == 1
    assert 'optimum (yardstick)' not in {
        method.name for method in found[0].ranking.methods}
    assert found[0].lines[0].strongest['method'] == 'recall'
    assert {entry['surrogate'] for entry in found[0].lines[0].entries} == {'svm_rbf', 'none', ''}


def test_sequences_without_a_column_are_left_out_and_told():
    rows = surrogate_rows()[:-1]
    found = tables.surrogate_tables(summarise_cells(rows))
    assert found[0].mean.entries[0]['sequences'] == sorted(SEQUENCES[:3])
    assert len(found[0].ranking.sequences) == 3
    texts = verdicts.warnings(summarise_cells(rows), found)
    assert any(text.startswith('synthetic_office is not in the mean and the ranks of table 3 (')
               for text in texts)


def test_a_sequence_that_trained_the_detector_is_no_test_of_it():
    seen = SEQUENCES[0], 'wl'
    rows = [make_row(sequence, target=target, trained_on=(sequence, target) == seen)
            for sequence in SEQUENCES[:2] for target in ('wl', 'edges')]
    texts = [text for text in verdicts.warnings(summarise_cells(rows), []) if 'training' in text]
    assert texts == [f'{SEQUENCES[0]} was seen in training by wl: it is no test of what they are '
                     'worth.']


def test_warnings():
    rows = [make_row(SEQUENCES[0], positives=60), make_row(SEQUENCES[1], frames=40),
            make_row(SEQUENCES[2], nodes=50)]
    texts = ' '.join(verdicts.warnings(summarise_cells(rows), []))
    assert 'synthetic_tour has no new places' in texts
    assert 'synthetic_kitchen: 20 different frames with a loop and 20 at' in texts
    assert 'in 1 of 3 cells, 100.0' in texts
    assert 'Seeds: 1 ' in texts
    again = [make_row(SEQUENCES[1], frames=40, seed=seed) for seed in range(10)]
    assert '20 different frames' in ' '.join(verdicts.warnings(summarise_cells(again), []))
    ten = [make_row(seed=seed, frames=200) for seed in range(10)]
    assert verdicts.warnings(summarise_cells(ten), []) == []


def test_query_curves_end_at_the_share_turned():
    rows = [make_row(sequence, search='recall', seed=seed, frames=200)
            for sequence in SEQUENCES[:2] for seed in (0, 1)]
    setting = {name: rows[0][name] for name in tables.SETTING}
    curve, = curves.query_curves(rows, setting, 3e-4)
    assert np.all(np.diff(curve.share) >= 0)
    turned = [sum(frame['attacked'] != frame['clean'] for row in rows
                  if row['sequence'] == sequence for frame in row['frame_results'])
              / sum(frame['clean'] in ('TP', 'TN') for row in rows
                    if row['sequence'] == sequence for frame in row['frame_results'])
              for sequence in SEQUENCES[:2]]
    assert curve.share[-1] == pytest.approx(np.mean(turned))
    assert curves.query_curves(rows, {**setting, 'target': 'edges'}, 3e-4) == []


def test_map_of_targets_holds_transfer():
    rows = [make_row(target=target, search='recall', power=power,
                     asked_target=asked, frames=100)
            for target, asked, power in (('wl', 'wl', 0.4), ('anchored', 'anchored', 0.6),
                                         ('anchored', 'wl', 0.2))]
    found, = curves.target_maps(summarise_cells(rows), 3e-4)
    assert found.attacks == ('recall, query-guided', 'recall, query-guided, asked wl')
    assert found.targets == ('wl', 'anchored')
    assert found.transfer
    assert found.declines == pytest.approx(np.array(
        [[rows[0]['decline_pp'], rows[1]['decline_pp']],
         [rows[0]['decline_pp'], rows[2]['decline_pp']]]))
    assert curves.target_maps(summarise_cells(rows[:1]), 3e-4) == []


@pytest.mark.parametrize('count', [2, 3, 9])
def test_critical_difference_diagram_of_many_and_few(count):
    ranking = rank_methods({f'method {index}': {f's{row}': float(index * row)
                                                for row in range(4)} for index in range(count)})
    assert paper_plots.critical_difference(ranking, 4.4).startswith(b'<?xml')


def test_latex_is_escaped_and_whole():
    assert latex_escape('a_b & 50% {x} \\ ~^#$') == (
        r'a\_b \& 50\% \{x\} \textbackslash{} \textasciitilde{}\textasciicircum{}\#\$')
    table, = tables.surrogate_tables(summarise_cells(
        [{**row, 'sequence': row['sequence'] + '_50%'} for row in surrogate_rows()]))
    text = latex_table(table)
    assert text.count(r'\begin{table}') == text.count(r'\end{table}') == 1
    assert r'synthetic\_tour\_50\%' in text
    body = [line for line in text.splitlines() if line.endswith(r'\\')]
    assert len(body) == 1 + len(SEQUENCES) + 1
    assert {len(re.findall(r'(?<!\\)&', line)) for line in body} == {5}
    assert text.count(r'\textbf{') == len(SEQUENCES) + 1
    rules = [text.index(rule) for rule in (r'\toprule', r'\midrule', r'\bottomrule')]
    assert rules == sorted(rules)


def test_latex_compiles(whole, tmp_path):
    if shutil.which('pdflatex') is None:
        pytest.skip('pdflatex is not on this machine')
    shutil.copy(whole[0] / 'tables.tex', tmp_path)
    (tmp_path / 'page.tex').write_text(
        '\\documentclass{article}\\usepackage{booktabs}\\begin{document}\n'
        '\\input{tables}\n\\end{document}\n')
    done = subprocess.run(['pdflatex', '-interaction=nonstopmode', '-halt-on-error', 'page.tex'],
                          cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stdout[-2000:]


def test_a_sequence_without_new_places_reports_what_was_suppressed(tmp_path):
    rows = [make_row(positives=60, power=0.5, seed=seed) for seed in (1, 2)]
    cell, = summarise_cells(rows)
    assert cell['decline_pp'] is None
    write_paper_report(tmp_path, rows)
    told = f'{wording.mean_count(cell["suppressed"])} of {wording.mean_count(cell["found_clean"])}'
    assert f'| {told} | - |' in (tmp_path / 'tables.md').read_text()
    page = (tmp_path / 'report.html').read_text()
    assert f'<td data-name="suppressed">{told}</td>' in page
    assert f'suppressed {told} loops found on synthetic_tour' in headline(
        [], 3e-4, [cell])
