# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""adversarial-lcd compare: what changed between results folders of one kind."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from adversarial_lcd_ros.commands.common import (
    Commands,
    add_command,
    add_json_option,
    print_json,
    print_rows,
    tell,
)
from adversarial_lcd_ros.errors import ConfigError, EvaluationError

if TYPE_CHECKING:
    from adversarial_lcd_ros.evaluation.comparison import Comparison, Difference
    from adversarial_lcd_ros.evaluation.kinds.base import Figure

PICTURE = Path('results/comparison.svg')


def add(commands: Commands) -> None:
    """Declare the command."""
    parser = add_command(
        commands, 'compare', 'Show what changed between two or more results folders of one kind: '
        'figures, settings, versions.', _compare)
    parser.add_argument('folders', type=Path, nargs='+', metavar='RESULTS',
                        help='results folders; the others are compared with the first')
    parser.add_argument('--picture', type=Path, default=PICTURE,
                        metavar='FILE', help='the main figures with their intervals, as SVG '
                        '(default: %(default)s)')
    add_json_option(parser)


def _compare(options: Namespace) -> None:
    compare_folders(options.folders, options.picture, as_json=options.json)


def compare_folders(folders: Sequence[Path], path: Path = PICTURE, *,
                    as_json: bool = False) -> None:
    """Print what changed between results folders, and write the picture of it."""
    from adversarial_lcd_ros.evaluation.comparison import compare

    if path.suffix != '.svg':
        raise ConfigError(f'--picture {path}: expected a name that ends in .svg')
    comparison = compare(folders)
    if len(folders) > 1 and len({folder.resolve() for folder in folders}) == 1:
        tell(f'warning: all {len(folders)} are the same results folder; "evaluate --output" '
             'makes another one to compare it with')
    for warning in comparison.warnings:
        tell(f'warning: {warning}')
    picture = _write_picture(comparison, path)
    if as_json:
        print_json({**comparison.as_dict(), 'picture': str(picture) if picture else None})
        return
    _show(comparison)
    if picture:
        print(picture)


def _write_picture(comparison: Comparison, path: Path) -> Path | None:
    from adversarial_lcd_ros.evaluation.comparison_plot import draw_comparison
    from adversarial_lcd_ros.files.writing import write_text

    drawn = draw_comparison(comparison)
    if drawn is None:
        return None
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_text(path, drawn.decode())
    except OSError as error:
        raise EvaluationError(f'{path} cannot be written: {error.strerror}; name another place '
                              'with --picture') from error
    return path


def _show(comparison: Comparison) -> None:
    runs = [f'{number}: {Path(run).name}' for number, run in enumerate(comparison.runs, 1)]
    changed = [line for line in comparison.figures if line.changed]
    if changed:
        print_rows('Figures that changed (95 % interval)', [{
            'of': line.row, 'figure': f'{line.name}{", " + line.unit if line.unit else ""}',
            **{run: _cell(figure) for run, figure in zip(runs, line.figures, strict=True)},
            **{f'{number + 1} - 1': _signed(line.difference(number))
               for number in range(1, len(runs))}} for line in changed])
    print(f'{len(comparison.figures) - len(changed)} of {len(comparison.figures)} figures are '
          'the same')
    for title, found in (('Settings', comparison.settings), ('Versions', comparison.versions)):
        if found:
            print_rows(f'{title} that differ', [_difference(entry, runs) for entry in found])
        else:
            print(f'{title} are the same')


def _cell(figure: Figure | None) -> str:
    if figure is None:
        return 'not there'
    if figure.value is None:
        return 'undefined'
    digits = 1 if figure.unit else 3
    if figure.interval is None:
        return f'{figure.value:.{digits}f}'
    low, high = figure.interval
    return f'{figure.value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})'


def _signed(difference: float | None) -> str:
    return '' if difference is None else f'{difference:+.3f}'


def _difference(entry: Difference, runs: list[str]) -> dict[str, str]:
    return {'name': entry.name, **{run: 'not there' if value is None else str(value)
                                   for run, value in zip(runs, entry.values, strict=True)}}
