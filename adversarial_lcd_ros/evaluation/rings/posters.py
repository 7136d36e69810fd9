# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
One poster in two places: which detectors then declare a loop between them.

Two places that certainly differ, an earlier and a later one. The poster is pasted into the earlier
frame with its two neighbours, and into the later one; graphs are built anew, and the detector
judges the later with all graphs before it as its map. Beside it stand two controls, which show
what the detector declares on its own: no poster, and another poster of the kind.

With depth beside the sequence the poster hangs on a wall, in true perspective, and its neighbours
see it from where they are; else it is seen nearly from the front.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import lru_cache
import itertools
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

from adversarial_lcd_ros.attack.images.poster import TWO_SPAN
from adversarial_lcd_ros.config import (
    POSTERS,
    BuilderConfig,
    Config,
    LabelConfig,
    LcdConfig,
    names_in,
    setting,
)
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.evaluation.rings.scene import BARE, OTHER, Condition, Scene
from adversarial_lcd_ros.evaluation.store import Row
from adversarial_lcd_ros.evaluation.streams import GraphSource, Stream, load_stream_graphs
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd.defences import make_defences
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.lcd.targets import builder_for
from adversarial_lcd_ros.registry import NONE, TARGETS
from adversarial_lcd_ros.vision.assembly import in_variant
from adversarial_lcd_ros.vision.builder import GraphBuilder

Checks = tuple[tuple[str, LcdConfig], ...]


@dataclass(frozen=True)
class PosterConfig(Config):
    """What hangs in the scene."""

    title: ClassVar[str] = 'posters'

    pairs: int = setting(15, 'Pairs of places on each sequence.', low=1, high=100_000)
    targets: str = setting('wl', 'Detectors, between commas.', choices=TARGETS, several=True)
    shares: str = setting('0.02, 0.05, 0.1', 'Shares of the frame, between commas.')
    kinds: str = setting('cells', 'Textures, between commas; those after the first, like the '
                         'controls, at the last share but where two hang.')
    two_share: float = setting(
        0.1, 'Share of two posters together, in opposite corners; 0: none hang.', low=0.0,
        high=TWO_SPAN / 2)
    seed: int = setting(42, 'Seed of pairs, textures, places and light.', low=0, high=2**31 - 1)


@dataclass(frozen=True, eq=False)
class PairTask:
    """
    A pair of places that certainly differ, and what is to be tried on it.

    Attributes
    ----------
    sequence : str
        Name.
    graphs : GraphSource
    builder : BuilderConfig
        Of the graphs that targets get which take any; others get the variant that they need.
    earlier, later : int
        Frames of the stream.
    elsewhere : bool, (n,)
        Frames that certainly show another place than the later one.
    conditions : tuple of Condition
    targets : tuple of str
    checks : tuple of (str, LcdConfig)
        Names of defences that have the last word on a loop, and the settings that they are in.
    lcd : LcdConfig
        Of the detectors, without them.
    focal : float
        Over the image width, where depth is known.
    seed : int

    """

    sequence: str
    graphs: GraphSource
    builder: BuilderConfig
    earlier: int
    later: int
    elsewhere: NDArray[np.bool_]
    conditions: tuple[Condition, ...]
    targets: tuple[str, ...]
    checks: Checks
    lcd: LcdConfig
    focal: float
    seed: int


def conditions_of(config: PosterConfig) -> list[Condition]:
    """Return what is tried: sizes, textures, two posters, and the controls; raises ConfigError."""
    kinds = names_in(config.kinds)
    try:
        shares = sorted(map(float, names_in(config.shares)))
    except ValueError:
        shares = [0.0]
    if not all(0 < share <= 1 for share in shares) or not set(kinds) <= set(POSTERS[1:]):
        raise ConfigError(f'shares {config.shares!r}, kinds {config.kinds!r}: expected shares of '
                          f'the frame, 0 to 1, and textures of {", ".join(POSTERS[1:])}')
    largest = shares[-1]
    found = [Condition(NONE, 0.0, 0, BARE)]
    found += [Condition(kinds[0], share) for share in shares]
    found += [Condition(kind, largest) for kind in kinds[1:]]
    if config.two_share:
        found.append(Condition(kinds[0], config.two_share, 2))
    return [*found, Condition(kinds[0], largest, 1, OTHER)]


def poster_streams(streams: Sequence[Stream]) -> list[Stream]:
    """Return one stream of each sequence: as no target asked for it if there is, the largest."""
    chosen: dict[str, Stream] = {}
    for stream in sorted(streams, key=lambda stream: (not stream.variant, stream.nodes)):
        chosen[stream.name] = stream
    return [chosen[name] for name in dict.fromkeys(stream.name for stream in streams)]


def poster_tasks(stream: Stream, config: PosterConfig, lcd: LcdConfig,
                 checks: Sequence[tuple[str, LcdConfig]], labels: LabelConfig) -> list[PairTask]:
    """
    Draw pairs of places of a sequence.

    Each later frame once; both neighbours of the earlier frame are certainly elsewhere, too.

    Raises
    ------
    ConfigError
        The sequence has no pictures: posters are pasted into them.

    """
    if stream.graphs.builder.detector == 'csv':
        raise ConfigError(f'{stream.name} has no pictures to paste a poster into')
    builder = stream.graphs.builder
    if stream.variant:
        builder = replace(builder, graph_variant=BuilderConfig.graph_variant)
    rng = np.random.default_rng(config.seed)
    known, tasks = stream.labels, list[PairTask]()
    for later in rng.permutation(len(known.kind)).tolist():
        apart = known.elsewhere[later, :known.candidates[later]]
        near = apart[:-2] & apart[1:-1] & apart[2:]
        if near.any():
            earlier = int(rng.choice(np.flatnonzero(near))) + 1
            tasks.append(PairTask(
                stream.name, stream.graphs, builder, earlier, later, known.elsewhere[later],
                tuple(conditions_of(config)), tuple(names_in(config.targets)), tuple(checks), lcd,
                labels.focal_length, config.seed + len(tasks)))
        if len(tasks) == config.pairs:
            break
    return tasks


def run_pair(task: PairTask) -> list[Row]:
    """Return a row for every condition, target and check of a pair."""
    with threadpool_limits(1), GraphBuilder(task.graphs.builder) as builder:
        graphs = load_stream_graphs(task.graphs)
        scene = scene_of(task, graphs)
        rows: list[Row] = []
        for condition in task.conditions:
            posted, on_wall = scene.posted(condition)
            made = {index: builder.build(image, graphs[index].stamp_ns, graphs[index].frame_id,
                                         graphs[index].sequence)
                    for index, image in posted.items()}
            about = {'sequence': task.sequence, 'earlier': task.earlier, 'later': task.later,
                     'kind': condition.kind, 'share': condition.share, 'count': condition.count,
                     'control': condition.control, 'on_wall': on_wall}
            rows += [{**about, **row} for row in _judged(task, graphs, made)]
    return rows


def scene_of(task: PairTask, graphs: Sequence[MultiTierGraph]) -> Scene:
    """Return the frames of a pair."""
    return Scene.read(task.graphs.source, graphs,
                      ((task.earlier, task.earlier - 1, task.earlier + 1), (task.later,)),
                      task.focal, task.seed)


def condition_of(row: Row) -> Condition:
    """Return what hung in the places of a row."""
    return Condition(row['kind'], row['share'], row['count'], row['control'])


def _judged(task: PairTask, graphs: Sequence[MultiTierGraph],
            made: dict[int, MultiTierGraph]) -> Iterator[Row]:
    """Yield what every detector, and every check behind it, declares on the later frame."""
    index_of = {graph.stamp_ns: index for index, graph in enumerate(graphs)}
    query = made[task.later]
    support: dict[tuple[str, int], float] = {}
    for target in task.targets:
        builder = builder_for(task.builder, target)
        suited = _clean_graphs(task.graphs, builder)
        detector = LoopClosureDetector(replace(task.lcd, target=target))
        for index in range(task.later):
            detector.remember(in_variant(made[index], builder) if index in made
                              else suited[index])
        decision = detector.judge(in_variant(query, builder))
        match = (index_of[decision.match_stamp_ns] if decision.match_stamp_ns is not None
                 else None)
        for name, config in (('none', task.lcd), *task.checks):
            stands = decision.is_loop and match is not None
            if stands and match is not None and name != 'none':
                if (name, match) not in support:
                    there = made.get(match, graphs[match])
                    support[name, match] = min(defence.support(query, there)
                                               for defence in make_defences(config))
                stands = support[name, match] >= 1
            yield {'target': target, 'check': name, 'declared': bool(stands),
                   'to_poster': bool(stands and match in made),
                   'elsewhere': bool(stands and match is not None and task.elsewhere[match])}


@lru_cache(4)
def _clean_graphs(source: GraphSource, builder: BuilderConfig) -> tuple[MultiTierGraph, ...]:
    """Return the graphs of a source in the variant of some settings; the latest are kept."""
    return tuple(in_variant(graph, builder) for graph in load_stream_graphs(source))


def poster_config(values: Any, path: Path) -> tuple[PosterConfig, Checks]:
    """
    Return the settings of the posters in a recipe, and the checks by name.

    Raises
    ------
    ConfigError
        They are not of the expected form.

    """
    if not isinstance(values, dict):
        raise ConfigError(f'recipe {path}, posters: expected settings by name, found {values!r}')
    checks = values.get('checks') or {}
    if not isinstance(checks, dict) or not all(isinstance(each, dict) for each in checks.values()):
        raise ConfigError(f'recipe {path}, checks of the posters: expected NAME: settings of the '
                          f'detector, found {checks!r}')
    known = {entry.name for entry in fields(PosterConfig)}
    try:
        config = PosterConfig.from_mapping(
            {name: ', '.join(map(str, value)) if isinstance(value, list) else value
             for name, value in values.items() if name != 'checks'})
        conditions_of(config)
        return config, tuple((name, LcdConfig.from_mapping(each))
                             for name, each in checks.items())
    except ConfigError as error:
        raise ConfigError(f'recipe {path}, posters: {error}; there are: '
                          f'{", ".join(sorted(known))}, checks') from error


def counts(rows: Sequence[Row]) -> list[Row]:
    """Return rows by sequence, condition, target and check: pairs, and loops declared."""
    def key(row: Row) -> tuple[Any, ...]:
        return tuple(row[name] for name in ('sequence', 'control', 'kind', 'count', 'share',
                                            'target', 'check'))
    found = []
    for _, group in itertools.groupby(sorted(rows, key=key), key):
        each = list(group)
        found.append({**{name: each[0][name] for name in (
            'sequence', 'control', 'kind', 'count', 'share', 'target', 'check')},
            'pairs': len(each), **{name: sum(row[name] for row in each)
                                   for name in ('declared', 'to_poster', 'elsewhere', 'on_wall')}})
    return found
