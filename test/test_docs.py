# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the pages say is there: links, anchors, commands, options, and what can be computed."""

from functools import cache
from pathlib import Path
import re

import pytest

from adversarial_lcd_ros.commands.parser import make_parser
from adversarial_lcd_ros.evaluation.paper.printed import misprints
from adversarial_lcd_ros.evaluation.paper.ranks import nemenyi_difference, rank_methods

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([ROOT / 'README.md', ROOT / 'CONTRIBUTING.md', ROOT / 'bags/README.md',
                *(ROOT / 'docs').rglob('*.md')])
# Explained at length, or made by a command.
LONG = ('tried.md', 'licences.md')
MOST_WORDS = 1500
OF_OTHER_PROGRAMS = {
    '--from-paths', '--ignore-src',  # rosdep
    '--params-file', '--ros-args', '--show-args', '--help',  # ROS
    '--nthreads', '--only', '--scale', '--strict', '--upgrade',  # dask, soak, mypy, lock
    '--stride'}  # benchmarks/live_ladder.py
CODE = re.compile(r'```.*?```|`[^`]+`', re.S)
COMMAND = re.compile(r'\badversarial-lcd ([a-z][a-z-]*)([^`\n]*)')
OPTION = re.compile(r'(?<![\w-])--[a-z][\w-]*')


def named(page):
    return page.relative_to(ROOT).as_posix()


@cache
def text_of(page):
    return page.read_text(encoding='utf-8')


@cache
def anchors(page):
    """Return the anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r'^#+ (.+)$', re.sub(r'```.*?```', '', text_of(page), flags=re.S), re.M)
    return {re.sub(r'[^\w\- ]', '', heading.lower()).strip().replace(' ', '-')
            for heading in headings}


@cache
def options():
    """Return the options of every subcommand."""
    commands = next(action for action in make_parser()._actions if action.choices)
    return {name: set(parser._option_string_actions) for name, parser in commands.choices.items()}


@pytest.mark.parametrize('page', PAGES, ids=named)
def test_links_lead_somewhere(page):
    for target in re.findall(r'\]\(([^)\s]+)\)', CODE.sub('', text_of(page))):
        if re.match(r'[a-z]+:', target):
            continue
        path, _, anchor = target.partition('#')
        place = (page.parent / path).resolve() if path else page
        assert place.exists(), f'{target}: there is no such file'
        if anchor:
            assert anchor in anchors(place), f'{target}: there is no such heading'


@pytest.mark.parametrize('page', PAGES, ids=named)
def test_commands_and_their_options_are_known(page):
    for command, rest in COMMAND.findall(text_of(page)):
        assert command in options(), command
        for option in OPTION.findall(rest):
            assert option in options()[command], f'{command} {option}'


@pytest.mark.parametrize('page', PAGES, ids=named)
def test_options_are_known(page):
    known = OF_OTHER_PROGRAMS.union(*options().values())
    assert set(OPTION.findall(text_of(page))) <= known


@pytest.mark.parametrize('page', PAGES, ids=named)
def test_targets_of_make_are_known(page):
    known = set(re.findall(r'^([a-z]+):', text_of(ROOT / 'Makefile'), re.M))
    assert set(re.findall(r'(?:^    |`)make ([a-z]+)', text_of(page), re.M)) <= known


@pytest.mark.parametrize('page', [page for page in PAGES if page.parent == ROOT / 'docs'
                                  and page.name not in LONG], ids=named)
def test_pages_that_explain_are_short(page):
    prose = re.sub(r'```.*?```', '', text_of(page), flags=re.S)
    lines = [line for line in prose.splitlines() if not line.startswith(('|', '    '))]
    assert len(' '.join(lines).split()) <= MOST_WORDS


@pytest.mark.parametrize('page', [page for page in PAGES if page.parent.name == 'results'],
                         ids=named)
def test_tables_say_what_made_them(page):
    assert re.match(r'(Made|Computed) by `', text_of(page))


def test_every_page_is_reached_from_the_readme():
    readme = set(re.findall(r'\]\(([^)#\s]+)', text_of(ROOT / 'README.md')))
    assert {named(page) for page in PAGES} - {'README.md'} <= readme


def test_every_cause_of_a_refusal_is_told():
    told = text_of(ROOT / 'docs/nodes.md')
    for path in (ROOT / 'adversarial_lcd_ros').rglob('*.py'):
        for cause in re.findall(r"\bcause ?= ?'([^']+)'", path.read_text(encoding='utf-8')):
            assert f'`{cause}`' in told, f'{path.name}: {cause}'


def numbers(title):
    """Return the rows of the table under a heading of statistics.md, as texts."""
    page = text_of(ROOT / 'docs/results/statistics.md')
    rows = [line for line in page.split(f'## {title}')[1].split('\n## ')[0].splitlines()
            if line.startswith('|')]
    return [[cell.strip() for cell in row.strip('|').split('|')] for row in rows[2:]]


def test_what_few_sequences_can_show():
    for count, least, critical, largest in numbers('N sequences'):
        clear = {method: {str(sequence): float(method) for sequence in range(int(count))}
                 for method in range(5)}
        found = [rank_methods({str(method): clear[method] for method in range(k)}).least_p
                 for k in (2, 3, 4, 5)]
        assert least.split(' / ') == ['< .001' if p < 0.0005 else f'{p:.3f}' for p in found]
        assert critical.split(' / ') == [f'{nemenyi_difference(k, int(count)):.2f}'
                                         for k in (3, 4, 5)]
        assert largest == '2 / 3 / 4'


def test_printed_figures_that_do_not_follow():
    rows = [(int(table), text, float(computed))
            for table, text, computed in numbers('Printed figures')]
    assert [(table, text.split(':')[0], computed) for table, text, computed in rows] == [
        (found.table, found.what, round(found.computed, 2)) for found in misprints()]
    assert [float(text.split(': ')[1]) for _, text, _ in rows] == [
        found.printed for found in misprints()]
