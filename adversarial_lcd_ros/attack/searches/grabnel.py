# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
GRABNEL: Bayesian optimisation over edge flips (Wan et al., NeurIPS 2021, Sec. 3), a rival.

Written anew from the publication. What it leaves to the user is set here: batches of five, since
a fit costs more than five queries, and ten random queries to begin with. Features are pooled over
the graph: node by node a regression on some thousand of them takes minutes a graph.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.deadline import check_time
from adversarial_lcd_ros.attack.perturbations import Allowed, make_perturbation
from adversarial_lcd_ros.attack.search import Hunt, Search
from adversarial_lcd_ros.attack.surrogates import Kernel
from adversarial_lcd_ros.attack.surrogates.ard import RelevanceDetermination
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import BudgetError, ConfigError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.weisfeiler_lehman.continuous import flip_features, node_features

START, BATCH = 10, 5
PARENTS, ROUNDS = 3, 10
LEAST_POPULATION, POPULATION_SHARE = 100, 10


@dataclass
class _Known:
    """
    All graphs queried on a frame: features, as differences to the clean graph's, and losses.

    Attributes
    ----------
    base : float64, (d,)
        Features of the graph that the present stage starts from; of the clean one they are 0.

    """

    base: NDArray[np.float64] = field(default_factory=lambda: np.zeros(1))
    features: list[NDArray[np.float64]] = field(default_factory=list)
    losses: list[float] = field(default_factory=list)


class Grabnel(Search):
    """
    A Bayesian linear regression on WL features chooses what is queried.

    One edit a stage, and the queries divided over the stages. Within one, the next flips are
    those with the largest expected improvement over the largest loss so far, found among a
    population that is half random, half mutated from its three best, in ten rounds. The
    regression is fitted anew to all queries of the frame before each batch; its relevance
    determination leaves few features in it.
    """

    name: ClassVar[str] = 'grabnel'
    title: ClassVar[str] = 'GRABNEL'
    rank: ClassVar[int] = 20
    colour: ClassVar[str] = '#b07d12'
    marker: ClassVar[str] = 'P'
    own_settings: ClassVar[tuple[str, ...]] = ('wl_iterations',)
    query_share: ClassVar[float] = 10.0  # choosing a query takes so many times its own time

    def __init__(self, config: AttackConfig) -> None:
        super().__init__(config)
        if config.mode == 'surrogate':
            raise ConfigError('search "grabnel" chooses by what queries tell: found mode '
                              '"surrogate", expected "query"')
        self._random = make_perturbation('random_flip')

    def hunt(self, hunt: Hunt, rng: np.random.Generator) -> str:
        """Commit the best flip of stage after stage; return why it ended."""
        known, x = _Known(), node_features(hunt.clean)
        committed: set[int] = set()
        population = max(hunt.oracle.budget // POPULATION_SHARE, LEAST_POPULATION)
        for stages in range(hunt.edit_budget, 0, -1):
            if hunt.over:
                break
            # On the same graph a flip has one answer: it is asked about once a stage.
            allowed = Allowed(self.config.edits, set(committed))
            share = -(-hunt.oracle.left // stages)
            if not self._stage(hunt, known, x, allowed, share, population, rng):
                return 'no flip left to try'
            clean, changed = hunt.clean.node_count, hunt.clean.flips_to(hunt.best)
            committed = {int(u) * clean + int(v) for u, v in changed}
        return hunt.over or 'edit budget spent'

    def _stage(self, hunt: Hunt, known: _Known, x: NDArray[np.float64], allowed: Allowed,
               share: int, population: int, rng: np.random.Generator) -> bool:
        """Query flips of the best graph so far and commit the best; tell if there was any."""
        before, count = hunt.best, 0
        best: tuple[float, bool, NDArray[np.int64], NDArray[np.float64]] | None = None
        while count < share and not hunt.oracle.exhausted and not (best and best[1]):
            pairs, features = self._chosen(before, known, x, allowed, population, rng)
            if not len(pairs):
                break
            for place in range(min(len(pairs), share - count)):
                pair = pairs[place:place + 1]
                allowed.mark(before, pair)
                try:
                    loss, succeeded = hunt.ask(before.flip(pair))
                except BudgetError:
                    break
                count += 1
                known.features.append(features[place])
                known.losses.append(loss)
                if best is None or (succeeded, loss) > (best[1], best[0]):
                    best = loss, succeeded, pair, features[place]
                if succeeded:
                    break
        if best is not None and (best[1] or best[0] >= hunt.loss):
            hunt.keep(before.flip(best[2]), best[0], best[1])
            known.base = best[3]
        return count > 0 or bool(hunt.oracle.exhausted)

    def _chosen(self, graph: MultiTierGraph, known: _Known, x: NDArray[np.float64],
                allowed: Allowed, population: int, rng: np.random.Generator
                ) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return flips to query next, (k, 2), and the features of the graphs they lead to."""
        check_time()
        model = RelevanceDetermination(Kernel())
        ready = len(known.losses) >= START and model.fit(np.array(known.features),
                                                         np.array(known.losses))
        if not ready:
            missing = START - len(known.losses) if len(known.losses) < START else BATCH
            pairs = self._random.propose(graph, missing, allowed, rng)
            return pairs, self._features(graph, known, x, pairs)
        best = max(known.losses)
        pairs = self._random.propose(graph, population, allowed, rng)
        features = self._features(graph, known, x, pairs)
        if not len(pairs):
            return pairs, features
        for left in range(ROUNDS, -1, -1):
            worth = model.expected_improvement(features, best)
            order = np.argsort(-worth, kind='stable')[:BATCH]
            if not left:
                break
            pairs = allowed.filter(graph, np.concatenate([
                pairs[order],
                _mutated(pairs[order[:PARENTS]], population // 2, graph.node_count, rng),
                self._random.propose(graph, population // 2, allowed, rng)]))
            features = self._features(graph, known, x, pairs)
        return pairs[order], features[order]

    def _features(self, graph: MultiTierGraph, known: _Known, x: NDArray[np.float64],
                  pairs: NDArray[np.int64]) -> NDArray[np.float64]:
        return known.base + flip_features(graph, x, pairs, self.config.wl_iterations)


def _mutated(pairs: NDArray[np.int64], count: int, nodes: int, rng: np.random.Generator
             ) -> NDArray[np.int64]:
    """Return ``count`` copies of pairs in turn, each with one end moved to any node."""
    moved = pairs[np.arange(count) % len(pairs)]
    moved[np.arange(count), rng.integers(2, size=count)] = rng.integers(nodes, size=count)
    return moved
