# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd targets: what the detectors are worth before any attack."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import asdict
from pathlib import Path
import sys
from typing import TYPE_CHECKING

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_json_option,
    add_source_options,
    add_work_options,
    check_counts,
    imported_source,
    print_json,
    print_lines,
    progress_bar,
    source_options,
    tell,
)
from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.registry import TARGETS
from adversarial_lcd_ros.settings import add_config_options, add_models_option, chosen_settings

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.detectors.recipe import TargetSequence
    from adversarial_lcd_ros.evaluation.detectors.run import TargetTask
    from adversarial_lcd_ros.evaluation.streams import Stream

PROTOCOLS = ('pairs', 'live')
_CONFIGS = ((BuilderConfig, 'builder-'), (LcdConfig, 'lcd-'), (LabelConfig, 'label-'))


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'targets', 'Evaluate the detectors before any attack, on pairs and live.', _run)
    parser.usage = f'{parser.prog} [SEQUENCE ...] [OPTIONS]'
    parser.add_argument('sources', nargs='*', metavar='SEQUENCE',
                        help='bag, folder or bag of graphs with ground truth; PATH@FROM:TO takes '
                        'a part of its frames')
    parser.add_argument('--recipe', metavar='NAME', help='sequences with their settings: a '
                        'recipe that ships ("target", "defences"), or a .yaml file like it')
    parser.add_argument('--data', type=Path, default=Path('../shared/data'), metavar='FOLDER',
                        help='where the sequences of a recipe are (default: %(default)s)')
    parser.add_argument('--output', type=Path, default=Path('results/target'), metavar='FOLDER',
                        help='rows that are there are not run again (default: %(default)s)')
    parser.add_argument('--targets', nargs='+', metavar='NAME',
                        help=f'those to evaluate (default: {" ".join(TARGETS)}, or what the '
                        'recipe says)')
    parser.add_argument('--defences', nargs='+', metavar='NAMES',
                        help='each a value of --lcd-defences; a row each (default: that of the '
                        'detector, or what the recipe says)')
    parser.add_argument('--protocols', nargs='+', choices=PROTOCOLS, default=PROTOCOLS,
                        metavar='NAME', help='pairs, live, or both (default)')
    parser.add_argument('--nodes', nargs='+', type=int, metavar='N',
                        help='features of a graph, several for several sizes (default: that of '
                        'graph_builder, or what the recipe says)')
    parser.add_argument('--pairs', type=int, default=300, metavar='N',
                        help='most loops, and as many pairs of different places, of a draw '
                        '(default: %(default)s)')
    parser.add_argument('--draws', type=int, default=3, metavar='N',
                        help='draws of pairs, each with a seed of its own (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=401, metavar='N',
                        help='of the first draw (default: %(default)s)')
    add_work_options(parser)
    add_json_option(parser)
    add_source_options(parser)
    add_models_option(parser)
    for config, prefix in _CONFIGS:
        add_config_options(parser, config, prefix)


def _run(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.detectors.run import KIND, ROW_COLUMNS, SCHEMA, run_target
    from adversarial_lcd_ros.evaluation.detectors.tables import (
        TABLES,
        target_lines,
        target_tables,
    )
    from adversarial_lcd_ros.evaluation.results import SUMMARY, ResultsFolder, summary_document
    from adversarial_lcd_ros.evaluation.store import open_store
    from adversarial_lcd_ros.evaluation.workers import local_workers
    from adversarial_lcd_ros.files.writing import write_text

    check_counts(options, 'pairs', 'draws', 'jobs')
    sequences = _sequences(options)
    with open_store(options.output) as store:
        tasks = _tasks(options, sequences)
        results = ResultsFolder(options.output)
        results.write_setup([], sys.argv, options.seed,
                            {'sequences': [asdict(sequence) for sequence in sequences]})
        store.check([task.key for task in tasks], ROW_COLUMNS)
        left = [task for task in tasks if task.key not in store.rows]
        tell(f'{len(left)} of {len(tasks)} rows to make')
        with local_workers(options.jobs) as run, progress_bar('targets') as progress:
            progress(0, len(left))
            for done, (key, row) in enumerate(run(run_target, left)):
                store.add(key, row)
                progress(done + 1, len(left))
        rows = [store.rows[task.key] for task in tasks]
        summary = summary_document(KIND, SCHEMA, rows)
        results.write_json(SUMMARY, summary)
    write_text(options.output / TABLES, target_tables(rows))
    if options.json:
        print_json({'folder': str(options.output), **summary})
        return
    for title, lines in target_lines(rows):
        print_lines(title, lines)
    print(f'all figures: {options.output / TABLES}, {options.output / SUMMARY}')


def _sequences(options: Namespace) -> list[TargetSequence]:
    from adversarial_lcd_ros.evaluation.detectors.recipe import (
        Choices,
        named_sequences,
        recipe_sequences,
    )

    if bool(options.sources) == bool(options.recipe):
        raise ConfigError('expected either sequences or --recipe NAME')
    builder, lcd, labels = (chosen_settings(options, config) for config, _ in _CONFIGS)
    if 'target' in lcd:
        raise ConfigError('--lcd-target names one target: here --targets does')
    if 'defences' in lcd and options.defences:
        raise ConfigError('--lcd-defences and --defences: expected one of them')
    choices = Choices(builder, lcd, labels, tuple(options.nodes or ()),
                      tuple(options.targets or ()), tuple(options.defences or ()))
    if options.recipe:
        if source_options(options):
            raise ConfigError('how a recording is read is given for named sequences only: a '
                              'recipe names its own')
        return recipe_sequences(options.recipe, options.data, choices)
    return named_sequences([imported_source(source, options) for source in options.sources],
                           choices)


def _tasks(options: Namespace, sequences: list[TargetSequence]) -> list[TargetTask]:
    from adversarial_lcd_ros.evaluation.detectors.run import TargetTask
    from adversarial_lcd_ros.lcd.targets import needed_variant

    seeds = tuple(range(options.seed, options.seed + options.draws))
    return [TargetTask(stream, target, protocol, lcd, options.pairs, seeds, sequence.scored,
                       sequence.labels)
            for sequence in sequences
            for variant in dict.fromkeys(map(needed_variant, sequence.targets))
            for stream in _streams(sequence, options.cache, variant)
            for protocol in options.protocols for lcd in sequence.detectors
            for target in sequence.targets
            if needed_variant(target) == variant]


def _streams(sequence: TargetSequence, cache: Path | None, variant: str) -> list[Stream]:
    from adversarial_lcd_ros.evaluation.streams import open_streams

    with progress_bar(f'graphs of {Path(sequence.source).name}') as progress:
        return open_streams([sequence.source], sequence.nodes, sequence.builder, sequence.labels,
                            cache, progress, variant=variant)
