"""
The command ``adversarial-lcd``: parse, call one function of the core, show what it returns.

Every module that costs time to import is imported by the subcommand that needs it.
"""

from __future__ import annotations

from argparse import ArgumentParser, Namespace, _SubParsersAction
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
import sys
from typing import TYPE_CHECKING, Any

from adversarial_lcd_ros import __version__
from adversarial_lcd_ros.config import (
    TARGETS,
    AttackConfig,
    BuilderConfig,
    LabelConfig,
    LcdConfig,
    ReplayConfig,
)
from adversarial_lcd_ros.errors import AdversarialLcdError
from adversarial_lcd_ros.settings import (
    add_config_options,
    chosen_settings,
    config_from_options,
    render_parameters,
)

if TYPE_CHECKING:
    from adversarial_lcd_ros.inspection import BagSummary

EXIT_OK, EXIT_ERROR, EXIT_INTERRUPTED = 0, 2, 130
DEMO_BAG = 'bags/flat_tour'
# Frames under way at once: the nodes work side by side, and nothing is lost.
LIVE_WINDOW = 4
TABLE_WIDTH = 150
# A class, and what its options start with where another class of the command has the name too.
EVALUATED = ((BuilderConfig, 'builder-'), (LcdConfig, 'lcd-'), (AttackConfig, ''),
             (LabelConfig, 'label-'), (ReplayConfig, 'replay-'))


def main(argv: Sequence[str] | None = None) -> int:
    """
    Run a subcommand and return the exit code.

    0: done; 2: the command line or an input is wrong, said in one line; 130: interrupted.
    """
    options = _parser().parse_args(argv)
    try:
        options.run(options)
    except AdversarialLcdError as error:
        print(f'error: {" ".join(str(error).split())}', file=sys.stderr)
        return EXIT_ERROR
    except KeyboardInterrupt:
        print('interrupted', file=sys.stderr)
        return EXIT_INTERRUPTED
    return EXIT_OK


def _parser() -> ArgumentParser:
    parser = ArgumentParser(
        prog='adversarial-lcd',
        description='Measure how easily graph-based loop closure detection is fooled.')
    parser.add_argument('--version', action='version', version=f'%(prog)s {__version__}')
    commands = parser.add_subparsers(metavar='COMMAND', required=True)
    for add in (_add_demo, _add_import, _add_evaluate, _add_report, _add_train, _add_fetch_model,
                _add_inspect, _add_params):
        add(commands)
    return parser


def _add(commands: _SubParsersAction[ArgumentParser], name: str, help: str,
         run: Callable[[Namespace], None]) -> ArgumentParser:
    parser = commands.add_parser(name, help=help, description=help)
    parser.set_defaults(run=run)
    return parser


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """Show a bar on stderr; yield what is to be called with the work done and the whole."""
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress, TimeRemainingColumn

    with Progress(*Progress.get_default_columns()[:2], MofNCompleteColumn(),
                  TimeRemainingColumn(), console=Console(stderr=True)) as bar:
        task = bar.add_task(title, total=None)
        yield lambda done, total: bar.update(task, completed=done, total=total)


def _tell(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


# import ------------------------------------------------------------------------------------

def _add_import(commands: _SubParsersAction[ArgumentParser]) -> None:
    parser = _add(commands, 'import', 'Turn a recorded sequence into a bag.', _import)
    parser.add_argument('source', type=Path, help='TUM RGB-D folder, folder of images or of '
                        'walks, 7-Scenes sequence, ROS 1 bag, or rosbag2')
    parser.add_argument('destination', type=Path, help='bag to write (rosbag2, MCAP)')
    parser.add_argument('--topic', help='bags: topic of the frames, where several hold images')
    parser.add_argument('--ground-truth', metavar='FILE', help='poses in the form of TUM; for '
                        'bags also a topic of PoseStamped; none: use none (default: what the '
                        'source brings along)')
    parser.add_argument('--rate-hz', type=float, metavar='X', help='sources without time stamps: '
                        'frames per second (default: 30)')
    parser.add_argument('--raw-as', choices=('jpeg', 'png'), default='jpeg', help='how frames '
                        'that come uncompressed are stored (default: %(default)s)')
    parser.add_argument('--overwrite', action='store_true', help='replace a bag that is there')


def _import(options: Namespace) -> None:
    from adversarial_lcd_ros.sequences import import_sequence

    with progress_bar(f'importing {options.source.name}') as progress:
        done = import_sequence(
            options.source, options.destination, progress=progress, overwrite=options.overwrite,
            topic=options.topic, ground_truth=options.ground_truth, rate_hz=options.rate_hz,
            raw_as=options.raw_as)
    width, height = done.image_size
    print(f'{done.path}: {done.frames} frames of {width} x {height} pixels, {done.poses} poses, '
          f'{done.duration_s:.1f} s, {done.size_bytes / 1e6:.1f} MB')


# evaluate, demo, report --------------------------------------------------------------------

def _add_evaluate(commands: _SubParsersAction[ArgumentParser]) -> None:
    parser = _add(commands, 'evaluate',
                  'Replay a bag clean and attacked, and report what the attack cost.', _evaluate)
    parser.add_argument('bag', type=Path, help='bag with ground truth, made by "import"')
    _add_evaluation_options(parser, 'BAG [OPTIONS]')


def _add_demo(commands: _SubParsersAction[ArgumentParser]) -> None:
    parser = _add(commands, 'demo', 'Evaluate the tour that ships with the package.', _demo)
    _add_evaluation_options(parser, '[OPTIONS]')


def _add_evaluation_options(parser: ArgumentParser, usage: str) -> None:
    # argparse's own usage would be forty options long before the first explanation.
    parser.usage = f'{parser.prog} {usage}'
    parser.add_argument('--output', type=Path, default=Path('results'), metavar='FOLDER',
                        help='a folder named by the time is made in it, and "latest" '
                        '(default: %(default)s)')
    parser.add_argument('--recipe', default='quick', metavar='NAME',
                        help='the attacks: a recipe that ships, or a .yaml file like those in '
                        'config/recipes; settings of the attacker given here win over it '
                        '(default: %(default)s)')
    parser.add_argument('--rebuild', action='store_true',
                        help='run every attack from the images (default: the first one; the '
                        'others from its clean graphs)')
    parser.add_argument('--keep-recordings', action='store_true',
                        help='keep all graphs and decisions, as bags, in the results folder')
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='settings (YAML); options of the command line win over it')
    for config_class, prefix in EVALUATED:
        add_config_options(parser, config_class, prefix)


def _evaluate(options: Namespace) -> None:
    _evaluate_bag(options.bag, options)


def _demo(options: Namespace) -> None:
    from adversarial_lcd_ros.paths import share_path

    _evaluate_bag(share_path(DEMO_BAG), options)


def _evaluate_bag(bag: Path, options: Namespace) -> None:
    from rich.console import Console

    from adversarial_lcd_ros.evaluation.live import Plan, evaluate_live
    from adversarial_lcd_ros.evaluation.recipes import load_recipe
    from adversarial_lcd_ros.evaluation.tables import decline_table, figure_table
    from adversarial_lcd_ros.evaluation.wording import headline

    attacks = load_recipe(options.recipe, chosen_settings(options, AttackConfig))
    plan = Plan(config_from_options(options, BuilderConfig),
                config_from_options(options, LcdConfig),
                config_from_options(options, LabelConfig),
                replace(ReplayConfig(window=LIVE_WINDOW),
                        **chosen_settings(options, ReplayConfig)),
                attacks, rebuild=options.rebuild)
    folder, summary = evaluate_live(bag, options.output, plan, command_line=sys.argv, tell=_tell,
                                    keep_recordings=options.keep_recordings)
    # Where there is no terminal there is no width to keep to.
    console = Console(width=None if sys.stdout.isatty() else TABLE_WIDTH)
    console.print(figure_table(summary))
    console.print(decline_table(summary))
    console.print(headline(summary), soft_wrap=True)
    console.print(f'{summary["duration_s"]:.0f} s; report: {folder / "report.html"}',
                  soft_wrap=True)


def _add_report(commands: _SubParsersAction[ArgumentParser]) -> None:
    parser = _add(commands, 'report', 'Write the report of a results folder anew.', _report)
    parser.add_argument('folder', type=Path, nargs='?', default=Path('results/latest'),
                        help='results folder (default: %(default)s)')


def _report(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.report import report_folder

    print(report_folder(options.folder))


# train -------------------------------------------------------------------------------------

def _add_train(commands: _SubParsersAction[ArgumentParser]) -> None:
    parser = _add(commands, 'train', 'Learn vocabulary, decisions and surrogate data from '
                  'sequences with ground truth.', _train)
    parser.add_argument('sequences', nargs='+', metavar='SEQUENCE',
                        help='bag, folder or ROS 1 bag with ground truth; PATH@FROM:TO takes a '
                        'part of its frames, PATH@0:0.5 the first half')
    parser.add_argument('--output', type=Path, default=Path('models'), metavar='FOLDER',
                        help='where the artefacts and their card go (default: %(default)s)')
    parser.add_argument('--seed', type=int, default=42, metavar='N',
                        help='seed of every random choice (default: %(default)s)')
    parser.add_argument('--targets', nargs='+', choices=TARGETS, default=TARGETS, metavar='NAME',
                        help='targets to train; the first answers the queries of the surrogate '
                        f'data (default: {" ".join(TARGETS)})')
    parser.add_argument('--vocabulary', type=Path, metavar='FILE',
                        help='use this vocabulary (npz) instead of training one')
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
    parser.add_argument('--config', type=Path, metavar='FILE',
                        help='settings (YAML) of graph_builder, lcd and labels')


def _train(options: Namespace) -> None:
    from adversarial_lcd_ros.evaluation.training_run import TRAINING_LABELS, TrainingPlan, train
    from adversarial_lcd_ros.evaluation.training_sources import TrainingSource, with_licences

    sources = with_licences([TrainingSource.parse(text) for text in options.sequences],
                            options.licence)
    builder = config_from_options(options, BuilderConfig)
    if options.vocabulary:
        builder = replace(builder, vocabulary=str(options.vocabulary))
    plan = TrainingPlan(
        builder, config_from_options(options, LcdConfig),
        replace(TRAINING_LABELS, **chosen_settings(options, LabelConfig)),
        tuple(options.targets), options.pairs, options.vocabulary_stride,
        flips_per_frame=options.flips_per_frame)
    card = train(sources, options.output, seed=options.seed, plan=plan, stage=progress_bar,
                 overwrite=options.overwrite, command_line=['adversarial-lcd', *sys.argv[1:]])
    for target, trained in card['targets'].items():
        accuracy = ', '.join(f'{pairs["balanced_accuracy"]:.3f} of {sequence["name"]}'
                             for sequence, pairs in zip(card['sequences'],
                                                        trained['training_pairs'], strict=True))
        print(f'{target}: balanced accuracy on the training pairs {accuracy}')
    print(options.output)


# fetch-model, params -----------------------------------------------------------------------

def _add_fetch_model(commands: _SubParsersAction[ArgumentParser]) -> None:
    parser = _add(commands, 'fetch-model', 'Fetch the default object model, unless it is there.',
                  _fetch_model)
    parser.add_argument('--destination', type=Path, metavar='FILE',
                        help='ONNX file to write; if not given, where the nodes look for it')


def _fetch_model(options: Namespace) -> None:
    from adversarial_lcd_ros.provision import fetch_object_model

    print(fetch_object_model(options.destination, progress=_tell))


def _add_params(commands: _SubParsersAction[ArgumentParser]) -> None:
    _add(commands, 'params', 'Print the ROS parameter file of all nodes, with the defaults.',
         lambda _: print(render_parameters(), end=''))


# inspect -----------------------------------------------------------------------------------

def _add_inspect(commands: _SubParsersAction[ArgumentParser]) -> None:
    parser = _add(commands, 'inspect', 'Print what a bag or a payload holds.', _inspect)
    parser.add_argument('path', type=Path, help='rosbag2 folder, .mcap, .db3 or .bag file, or a '
                        'file with the payload of one message')


def _inspect(options: Namespace) -> None:
    from adversarial_lcd_ros.inspection import inspect_bag, inspect_payload
    from adversarial_lcd_ros.sequences.bagfile import is_bag

    if options.path.is_file() and not is_bag(options.path):
        _show_payload(*inspect_payload(options.path))
    else:
        _show_bag(inspect_bag(options.path))


def _show_bag(bag: BagSummary) -> None:
    from rich.console import Console
    from rich.table import Table

    console = Console()
    topics = Table('topic', 'type', 'messages', 'payload',
                   title=f'{bag.path}: {bag.duration_s:.1f} s', title_justify='left')
    graphs = Table('topic', 'nodes n', 'edges m', 'objects',
                   title='graphs: mean (least to largest)', title_justify='left')
    for topic in bag.topics:
        topics.add_row(topic.name, topic.type, str(topic.count), topic.payload)
        if topic.graphs:
            sizes = (topic.graphs.nodes, topic.graphs.edges, topic.graphs.objects)
            graphs.add_row(topic.name, *(f'{mean:.1f} ({least:.0f} to {largest:.0f})'
                                         for least, mean, largest in sizes))
    console.print(topics)
    if graphs.row_count:
        console.print(graphs)


def _show_payload(name: str, content: Any) -> None:
    from rich.console import Console

    from adversarial_lcd_ros.graph import MultiTierGraph

    console = Console(highlight=False)
    graph = content if isinstance(content, MultiTierGraph) else getattr(content, 'graph', None)
    if graph is None:
        console.print(content, soft_wrap=True)
        return
    number = f' {content.id}' if graph is not content else ''
    console.print(f'{name}{number}: n = {graph.node_count}, m = {graph.edge_count}, '
                  f'{graph.object_count} objects, {graph.width} x {graph.height} pixels, '
                  f'sequence {graph.sequence}, stamp {graph.stamp_ns} ns, frame '
                  f'{graph.frame_id!r}', soft_wrap=True)


if __name__ == '__main__':
    sys.exit(main())
