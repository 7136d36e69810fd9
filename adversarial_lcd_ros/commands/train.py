# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd train: vocabulary, decisions and surrogate data from sequences."""

from __future__ import annotations

from argparse import Namespace
from dataclasses import replace
from pathlib import Path
import sys

from adversarial_lcd_ros.commands.common import Commands, add_command, progress_bar
from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.settings import add_config_option, chosen_settings, config_from_options


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'train', 'Learn vocabulary, decisions and surrogate data from sequences with '
        'ground truth.', _train)
    parser.add_argument('sequences', nargs='+', metavar='SEQUENCE',
                        help='bag, folder or ROS 1 bag with ground truth; PATH@FROM:TO takes a '
                        'part of its frames, PATH@0:0.5 the first half')
    parser.add_argument('--output', type=Path, default=Path('models'), metavar='FOLDER',
                        help='where the artefacts and their card go (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=42, metavar='N',
                        help='seed of every random choice (default: %(default)s)')
    parser.add_argument('--targets', nargs='+', metavar='NAME',
                        help='targets to train; the first answers the queries of the surrogate '
                        'data (default: all but gnn, which needs PyTorch)')
    parser.add_argument('--vocabulary', type=Path, metavar='FILE',
                        help='use this vocabulary (npz) instead of training one')
    parser.add_argument('--networks', type=Path, metavar='FOLDER',
                        help='use the networks of the training in this folder, as of gnn, '
                        'instead of training them')
    parser.add_argument('--vocabulary-stride', type=int, default=2, metavar='N',
                        help='every how many frames one is used for the vocabulary (default: '
                        '%(default)s)')
    parser.add_argument('--pairs', type=int, default=600, metavar='N',
                        help='most loops, and most pairs of different places, of a sequence '
                        '(default: %(default)s)')
    parser.add_argument('--flips-per-frame', type=int, default=8, metavar='N',
                        help='flips queried on each frame of the first SEQUENCE for the surrogate '
                        'data; 0: make none (default: %(default)s)')
    parser.add_argument('--licence', action='append', default=[], metavar='TEXT',
                        help='licence of the pictures, for the card: once for each SEQUENCE, in '
                        'their order (default: the CREDITS or LICENSE file beside them)')
    parser.add_argument('--overwrite', action='store_true',
                        help='replace the artefacts of an earlier training')
    add_config_option(parser, 'graph_builder, lcd and labels')


def _train(options: Namespace) -> None:
    from adversarial_lcd_ros.sequences.part import SequencePart
    from adversarial_lcd_ros.training.plan import TRAINING_LABELS, TrainingPlan, default_targets
    from adversarial_lcd_ros.training.run import train

    sources = [SequencePart.parse(text) for text in options.sequences]
    builder = config_from_options(options, BuilderConfig)
    if options.vocabulary:
        builder = replace(builder, vocabulary=str(options.vocabulary))
    plan = TrainingPlan(
        builder, config_from_options(options, LcdConfig),
        replace(TRAINING_LABELS, **chosen_settings(options, LabelConfig)),
        tuple(options.targets or default_targets()), options.pairs, options.vocabulary_stride,
        flips_per_frame=options.flips_per_frame, networks=options.networks)
    card = train(sources, options.output, seed=options.seed, plan=plan, stage=progress_bar,
                 overwrite=options.overwrite, command_line=['adversarial-lcd', *sys.argv[1:]],
                 licences=options.licence)
    for target, trained in card['targets'].items():
        accuracy = ', '.join(f'{pairs["balanced_accuracy"]:.3f} of {sequence["name"]}'
                             for sequence, pairs in zip(card['sequences'],
                                                        trained['training_pairs'], strict=True))
        print(f'{target}: balanced accuracy on the training pairs {accuracy}')
    print(options.output)
