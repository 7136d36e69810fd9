# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd evaluate and demo: a bag replayed clean and attacked, or an experiment."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import replace
from pathlib import Path
import sys
from typing import TYPE_CHECKING, Any

from adversarial_lcd_ros.commands import evaluate_frames, maps
from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_json_option,
    add_source_options,
    imported_source,
    make_console,
    print_json,
    print_lines,
    print_rows,
    source_options,
    tell,
)
from adversarial_lcd_ros.config import (
    AttackConfig,
    BuilderConfig,
    LabelConfig,
    LcdConfig,
    MapConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.settings import (
    add_config_option,
    add_config_options,
    add_models_option,
    chosen_settings,
    config_from_options,
)
from adversarial_lcd_ros.start import ros_problem

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.replay.plan import Plan

RECIPE = 'quick'
DEMO_BAG = 'bags/flat_tour'
# Frames under way at once: the nodes work side by side, and nothing is lost.
LIVE_WINDOW = 4
# A node that hangs, or refused a frame, is noticed: until then any attack may take its time, also
# on a machine that is busy with other work.
LIVE_TIMEOUT_S = 600.0
# A class, and what its options start with where another class of the command has the name too.
EVALUATED = ((BuilderConfig, 'builder-'), (LcdConfig, 'lcd-'), (AttackConfig, ''),
             (LabelConfig, 'label-'), (ReplayConfig, 'replay-'), (MapConfig, maps.PREFIX))


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'evaluate',
        'Replay a bag clean and attacked, or run a recipe of many attacks over sequences, and '
        'report what the attacks cost.', _evaluate)
    parser.add_argument('sources', nargs='+', metavar='SEQUENCE',
                        help='recording of any form that "import" reads, imported on the way, or '
                        'a bag made by "build"; with a recipe '
                        'of the protocol "frames" any number of bags or folders, also parts of '
                        'them (PATH@FROM:TO, PATH@0.5:1 is the second half)')
    _add_evaluation_options(parser, 'SEQUENCE [SEQUENCE ...] [OPTIONS]')
    evaluate_frames.add_options(parser)
    add_source_options(parser)


def add_demo(commands: Commands) -> None:
    """Declare the command ``demo``."""
    parser = add_command(
        commands, 'demo', 'Evaluate the tour that ships with the package.', _demo)
    _add_evaluation_options(parser, '[OPTIONS]')


def _add_evaluation_options(parser: ArgumentParser, usage: str) -> None:
    # argparse's own usage would be forty options long before the first explanation.
    parser.usage = f'{parser.prog} {usage}'
    parser.add_argument('--output', type=Path, default=Path('results'), metavar='FOLDER',
                        help='a folder named by the time is made in it, and "latest" '
                        '(default: %(default)s); with the protocol "frames" it is the folder '
                        'itself, and what is finished there is not run again (default: '
                        'results/RECIPE)')
    parser.add_argument('--recipe', metavar='NAME',
                        help='the attacks: a recipe that ships, or a .yaml file like those in '
                        'config/recipes; settings of the attacker given here win over it '
                        f'(default: {RECIPE}; of a recording of the nodes, what was recorded)')
    parser.add_argument('--rebuild', action='store_true',
                        help='run every attack from the images (default: the first one; the '
                        'others from its clean graphs)')
    parser.add_argument('--keep-recordings', action='store_true',
                        help='keep all graphs and decisions, as bags, in the results folder')
    parser.add_argument('--sweep-labels', action='store_true',
                        help='show whether the conclusion hangs on the thresholds of the labels '
                        '(also label_sweep.csv)')
    parser.add_argument('--map', action='store_true',
                        help='make maps of the closures, too, as "map" does')
    add_config_option(parser)
    add_json_option(parser)
    add_models_option(parser)
    for config_class, prefix in EVALUATED:
        add_config_options(parser, config_class, prefix)


def _evaluate(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.recipes import FRAMES, SAMPLED, read_recipe
    from adversarial_lcd_ros.evaluation.replay.recorded import is_recording

    path = Path(options.sources[0])
    # An attack that is asked for is made anew, of the clean graphs.
    if (options.recipe is None and not chosen_settings(options, AttackConfig)
            and len(options.sources) == 1 and is_recording(path)):
        evaluate_frames.refuse_options(options)
        _report_recording(path, options)
        return
    options.recipe = options.recipe or RECIPE
    if read_recipe(options.recipe)[1]['protocol'] in SAMPLED:
        options.sources = [imported_source(source, options) for source in options.sources]
        evaluate_frames.run(options)
        return
    evaluate_frames.refuse_options(options)
    if len(options.sources) != 1:
        raise ConfigError(f'recipe {options.recipe} replays one bag, found '
                          f'{len(options.sources)}: name one, or a recipe of the protocol '
                          f'"{FRAMES}" such as paper')
    # Wrong settings are told before the minutes that an import may take.
    plan = _plan(options)
    _evaluate_bag(Path(imported_source(options.sources[0], options, replayed=True)), plan,
                  options)


def _report_recording(bag: Path, options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.replay.recorded import evaluate_recording

    _show(*evaluate_recording(
        bag, options.output, config_from_options(options, LcdConfig),
        config_from_options(options, LabelConfig), source=source_options(options),
        command_line=sys.argv, tell=tell), options)


def _demo(options: Namespace) -> None:
    from adversarial_lcd_ros.paths import share_path

    options.recipe = options.recipe or RECIPE
    _evaluate_bag(share_path(DEMO_BAG), _plan(options), options)


def _plan(options: Namespace) -> Plan:
    problem = ros_problem()
    if problem:
        raise ConfigError(problem)
    if options.map:
        maps.check(options)

    from adversarial_lcd_ros.evaluation.replay.plan import Plan
    from adversarial_lcd_ros.evaluation.replay.recipe import load_recipe
    from adversarial_lcd_ros.lcd.targets import builder_for

    recipe = load_recipe(options.recipe, chosen_settings(options, AttackConfig))
    lcd = config_from_options(options, LcdConfig)
    return Plan(builder_for(config_from_options(options, BuilderConfig), lcd.target), lcd,
                config_from_options(options, LabelConfig),
                replace(ReplayConfig(window=LIVE_WINDOW, timeout_s=LIVE_TIMEOUT_S),
                        **chosen_settings(options, ReplayConfig)),
                recipe.attacks, rebuild=options.rebuild, sweep_labels=options.sweep_labels,
                posters=recipe.posters)


def _evaluate_bag(bag: Path, plan: Plan, options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.replay.run import evaluate_live

    if options.map:
        maps.check_source(bag)
    folder, summary = evaluate_live(bag, options.output, plan, command_line=sys.argv, tell=tell,
                                    keep_recordings=options.keep_recordings)
    _show(folder, summary, options)


def _show(folder: Path, summary: dict[str, Any], options: Namespace) -> None:
    """Print the tables and the main finding of an evaluation."""
    from adversarial_lcd_ros.evaluation.replay.findings import headline, is_labelled
    from adversarial_lcd_ros.evaluation.replay.summary import as_document
    from adversarial_lcd_ros.evaluation.replay.tables import sweep_rows
    from adversarial_lcd_ros.evaluation.terminal import replay_lines

    made = maps.make([folder], options) if options.map else None
    if options.json:
        print_json({'folder': str(folder), **as_document(summary),
                    **({} if made is None else {'map': made})})
        return
    console = make_console()
    print_lines(*replay_lines(summary))
    if 'label_sweep' in summary:
        print_rows('The same decisions by other labels', sweep_rows(summary))
    if made is not None:
        maps.show_runs(made)
    console.print(headline(summary))
    if is_labelled(summary):
        console.print(f'Labels by {summary["told_by"]}.', soft_wrap=True)
    console.print(f'{summary["duration_s"]:.0f} s; report: {folder / "report.html"}',
                  soft_wrap=True)
