# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The report of the rings: one HTML file that needs nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from adversarial_lcd_ros.evaluation import wording
from adversarial_lcd_ros.evaluation.page import data_uri, load_template
from adversarial_lcd_ros.evaluation.pictures import read_pictures
from adversarial_lcd_ros.evaluation.results import CONFIGURATION, ENVIRONMENT, read_json
from adversarial_lcd_ros.evaluation.rings.page import SEALED, refused, unexplained
from adversarial_lcd_ros.evaluation.rings.summaries import LEVELS
from adversarial_lcd_ros.evaluation.rings.tables import (
    Rank,
    matrices,
    poster_table,
    ranking,
)


def rings_html(folder: Path, summary: Mapping[str, Any], curves: bytes) -> str:
    """
    Return the report of a results folder.

    Parameters
    ----------
    folder : Path
        Has pictures, settings and environment of the run.
    summary : mapping
        The content of its summary.json.
    curves : bytes
        Its ``ring_curves``, SVG.

    """
    ranks = ranking(summary)
    page: str = load_template('rings.html.j2').render(
        headline=headline(ranks), ranks=ranks, unexplained=unexplained, refused=refused,
        sealed=(SEALED.replace('**', '') if any(row.get('sealed') for row in summary['rows'])
                else ''), levels=LEVELS, matrices=matrices(summary['rows']),
        posters=poster_table(summary['posters']) if summary['posters'] else None,
        sequences=list(dict.fromkeys(row['sequence'] for row in summary['rows'])),
        curves=data_uri(curves, 'svg+xml'),
        pictures=[(title, caption, data_uri(image, 'jpeg'))
                  for title, caption, image in read_pictures(folder)],
        configuration=read_json(folder / CONFIGURATION),
        environment=read_json(folder / ENVIRONMENT), wording=wording)
    return page


def headline(ranks: Sequence[Rank]) -> str:
    """Return in sentences what attacks leave without a defence, and behind the best one."""
    target = ranks[0].target
    here = [rank for rank in ranks if rank.target == target]
    bare = next((rank for rank in here if rank.defence == 'none'), here[-1])
    said = [f'Before any attack {target} has a balanced accuracy of '
            f'{wording.percent(bare.clean)}{_over(len(bare.each))}.']
    for place, whose in ((0, 'the strongest attack on each frame that flips edges within the '
                             'usual budget'), (len(LEVELS) - 1, 'the strongest of all attacks')):
        known = [rank for rank in here if rank.held[place] is not None]
        if bare.held[place] is None:
            continue
        best = max([bare, *known], key=lambda rank: rank.held[place] or 0.0)
        said.append(f'Without a defence, {whose} leaves {wording.percent(bare.held[place])}; '
                    + ('no defence that was tried leaves more.' if best is bare else
                       f'behind {best.defence}, {wording.percent(best.held[place])} are left.'))
    return ' '.join([*said, *map(_refusing, here)]).rstrip()


def _refusing(rank: Rank) -> str:
    """Return what a defence leaves that refuses graphs; '' for any other."""
    if rank.unharmed[-1] in (None, rank.held[-1]):
        return ''
    return (f'{wording.sentence(rank.defence)} refuse what was changed, with an alarm each: '
            f'counting that as a failed attack, {wording.percent(rank.unharmed[-1])} are left.')


def _over(sequences: int) -> str:
    return f' (mean of {sequences} sequences)' if sequences > 1 else ''
