# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The picture of why: flips that attacks ask about, and what targets feel, over one frame."""

from __future__ import annotations

from collections.abc import Iterator
import io
from pathlib import Path
from typing import Any

import cv2
import matplotlib
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.evaluation.frames.pictures import frame_image
from adversarial_lcd_ros.evaluation.frames.why import ASKED, Sensitivity, Why
from adversarial_lcd_ros.evaluation.page import INK, STYLE
from adversarial_lcd_ros.evaluation.pictures import WHY, WHY_NARROW, WHY_TEXT
from adversarial_lcd_ros.evaluation.results import PICTURES
from adversarial_lcd_ros.files.writing import write_bytes, write_json
from adversarial_lcd_ros.graph import MultiTierGraph

_PANEL_IN = {WHY: 3.3, WHY_NARROW: 2.1}  # width
_DPI = {WHY: 130, WHY_NARROW: 170}
_FONT = {WHY: 9.0, WHY_NARROW: 8.0}
_COLUMNS = {WHY: 4, WHY_NARROW: 2}
_FADED = 0.62  # of the camera picture towards white
# What takes nothing is grey, what takes most is dark red.
_PALETTE = matplotlib.colors.LinearSegmentedColormap.from_list(
    'taken', ['#8d99a8', '#e8a13a', '#c0392b', '#7d0f0f'])

_Panel = tuple[str, NDArray[np.int64], bool]  # title, flips, whether nodes show what they weigh


def write_why(folder: Path, why: Why | None) -> None:
    """
    Write the picture, for wide and narrow pages, and what it says, under ``folder/pictures``.

    Parameters
    ----------
    folder : Path
        Results folder.
    why : Why or None
        From ``explain``; None: only what an earlier run has left is removed.

    """
    place = folder / PICTURES
    place.mkdir(exist_ok=True)
    if why is None:
        for name in (WHY_TEXT, WHY, WHY_NARROW):
            (place / name).unlink(missing_ok=True)
        return
    for name in (WHY, WHY_NARROW):
        write_bytes(place / name, draw_why(why, name))
    write_json(place / WHY_TEXT, {'caption': caption(why), 'sentences': sentences(why)})


def caption(why: Why) -> str:
    """Return what the picture is of."""
    graph = why.targets[0].graph
    against = ('one given reference' if why.judged == 'pairs' else 'the map')
    who = 'both targets find' if len(why.targets) > 1 else 'the target finds'
    return (f'{why.stream.name}, frame {graph.sequence}, a loop that {who}, judged '
            f'against {against}; {graph.node_count} nodes, {why.edits} edits allowed. Three '
            f'panels: the first {ASKED} flips that an attack asks about. The last: the {ASKED} '
            'flips that take most, and nodes the larger the more the answer changes by all flips '
            'there. Colour: log odds taken, from none (grey) to what each edit has to take on '
            'average to turn the decision over, or more (dark red).')


def sentences(why: Why) -> list[str]:
    """Return the figures of the picture, a sentence or two for each target."""
    lines = []
    for seen in why.targets:
        best = ', '.join(f'{name} {_number(_best(seen, pairs))}'
                         for name, pairs in seen.asked.items())
        lines.append(
            f'{seen.target} finds this loop by {_number(seen.margin)} log odds above its '
            f'threshold: each of {why.edits} edits has to take {_number(_needed(why, seen))} on '
            f'average. The strongest of all {len(seen.taken):,} single flips takes '
            f'{_number(float(seen.taken.max()))}, and {100 * seen.felt:.0f} % change the answer '
            f'at all. The best of the first {ASKED} asked about: {best}.')
    return lines


def draw_why(why: Why, name: str = WHY) -> bytes:
    """
    Return the picture as JPEG.

    Parameters
    ----------
    why : Why
    name : str
        ``WHY``: a row a target; ``WHY_NARROW``: two panels a row.

    """
    columns, width = _COLUMNS[name], _PANEL_IN[name]
    per_target = 4 // columns
    graph = why.targets[0].graph
    height = width * graph.height / graph.width + 0.55
    rows = per_target * len(why.targets)
    with matplotlib.rc_context({**STYLE, 'axes.titlesize': _FONT[name]}):
        figure = Figure(figsize=(columns * width, rows * height + 0.2 * len(why.targets)),
                        layout='constrained', dpi=_DPI[name])
        parts = np.atleast_1d(figure.subfigures(len(why.targets), 1))
        for part, seen in zip(parts, why.targets, strict=True):
            needed = _needed(why, seen)
            part.suptitle(
                f'target {seen.target}: each edit has to take {_number(needed)} log odds',
                fontsize=_FONT[name] + 1.0, fontweight='bold', x=0.01, ha='left')
            image = _faded(frame_image(why.stream, seen.graph))
            for axes, panel in zip(part.subplots(per_target, columns).ravel(), _panels(seen),
                                   strict=True):
                _draw(axes, image, seen, needed, *panel)
        stream = io.BytesIO()
        figure.savefig(stream, format='jpg', pil_kwargs={'quality': 85})
    return stream.getvalue()


def _panels(seen: Sensitivity) -> Iterator[_Panel]:
    for name, pairs in seen.asked.items():
        yield f'{name}\nbest of {len(pairs)} takes {_number(_best(seen, pairs))}', pairs, False
    yield (f'what it feels: {100 * seen.felt:.0f} % of all flips\n'
           f'strongest takes {_number(float(seen.taken.max()))}', seen.strongest, True)


def _draw(axes: Any, image: NDArray[np.uint8], seen: Sensitivity, needed: float, title: str,
          pairs: NDArray[np.int64], with_nodes: bool) -> None:
    graph = seen.graph
    axes.imshow(image, extent=(0, graph.width, graph.height, 0))
    axes.add_collection(LineCollection(graph.position[graph.edge], colors='#5a6b7d',
                                       linewidths=0.25, alpha=0.35))
    share = np.clip(seen.taken_by(pairs) / max(needed, 1e-12), 0.0, 1.0)
    order = np.argsort(share, kind='stable')  # the strongest on top
    axes.add_collection(LineCollection(
        graph.position[pairs[order]], colors=_PALETTE(share[order]),
        linewidths=0.8 + 1.0 * share[order]))
    _nodes(axes, graph, seen.at_node if with_nodes else None)
    axes.set_title(title, color=INK)
    axes.set(xlim=(0, graph.width), ylim=(graph.height, 0), xticks=[], yticks=[])
    axes.spines[:].set_visible(False)


def _nodes(axes: Any, graph: MultiTierGraph, weight: NDArray[np.float64] | None) -> None:
    is_object = np.arange(graph.node_count) < graph.object_count
    size = np.where(is_object, 26.0, 3.0)
    if weight is not None and weight.max() > 0:
        size = 3.0 + 50.0 * weight / weight.max()
    for kind, colour, marker in ((~is_object, '#2e8064', 'o'), (is_object, '#2f5d8a', 's')):
        axes.scatter(*graph.position[kind].T, s=size[kind], c=colour, marker=marker,
                     linewidths=0.4, edgecolors='white', zorder=3)


def _needed(why: Why, seen: Sensitivity) -> float:
    """Return the log odds that each edit has to take on average to turn the decision over."""
    return seen.margin / max(why.edits, 1)


def _best(seen: Sensitivity, pairs: NDArray[np.int64]) -> float:
    return float(seen.taken_by(pairs).max(initial=0.0))


def _faded(image: NDArray[np.uint8]) -> NDArray[np.uint8]:
    grey = cv2.cvtColor(image, cv2.COLOR_BGR2RGB).astype(np.float32)
    return np.asarray(255 * _FADED + (1 - _FADED) * grey, np.uint8)


def _number(value: float) -> str:
    """Return log odds with two digits that count."""
    return '0' if abs(value) < 5e-5 else f'{value:.2g}' if abs(value) < 10 else f'{value:.0f}'
