# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The paper's search: flip after flip, the best of a few queried ones (Sec. 3.3 to 3.5).

The paper says only to query until success. A flip that lowers the loss is never committed here:
the best of a bad lot walks downhill and spends edits on it. One without effect is committed: with
hard answers nothing shows an effect before the decision turns. Features of a surrogate are
differences to the unflipped graph, on constants instead of batch statistics: phi(G') itself mostly
tells the frame, and rows computed at different times have to stay comparable.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.deadline import check_time
from adversarial_lcd_ros.attack.memory import Memory
from adversarial_lcd_ros.attack.perturbations import Allowed, make_perturbation
from adversarial_lcd_ros.attack.search import Hunt, Search
from adversarial_lcd_ros.attack.searches.tries import Tries
from adversarial_lcd_ros.attack.surrogate_data import SurrogateData, data_path
from adversarial_lcd_ros.attack.surrogates import Kernel, Surrogate, make_surrogate
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import BudgetError, ConfigError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.registry import NONE
from adversarial_lcd_ros.weisfeiler_lehman.continuous import flip_features, node_features

POOL_FACTOR = 3
REFIT_ROWS = 10
REFIT_SHARE = 5


@dataclass
class _Learner:
    """A surrogate that is refitted to the queried flips of one frame."""

    surrogate: Surrogate
    features: list[NDArray[np.float64]] = field(default_factory=list)
    gains: list[float] = field(default_factory=list)
    fitted_rows: int = 0
    ready: bool = False

    def learn(self, features: NDArray[np.float64], gain: float) -> None:
        self.features.append(features)
        self.gains.append(gain)

    def refit(self) -> bool:
        """Fit to all rows once enough of them are new; tell whether predictions changed."""
        # A fit costs more the more rows there are: each wants a fifth more than the last one had.
        if len(self.gains) < self.fitted_rows + max(REFIT_ROWS, self.fitted_rows // REFIT_SHARE):
            return False
        self.fitted_rows = len(self.gains)
        self.ready = self.surrogate.fit(np.array(self.features), np.array(self.gains))
        return True

    def ranked(self, features: NDArray[np.float64], waiting: list[int]) -> list[int]:
        """Return waiting rows by falling prediction; as they were before it can predict."""
        if not self.ready:
            return waiting
        order = np.argsort(-self.surrogate.predict(features[waiting]), kind='stable')
        return [waiting[place] for place in order]


@dataclass(frozen=True, eq=False)
class _Queried:
    """A flip, shape (1, 2), and what the detector says of the graph with it."""

    pairs: NDArray[np.int64]
    loss: float
    succeeded: bool


class Stepwise(Search):
    """
    A perturbation proposes flips, a surrogate ranks them, the detector judges the first of them.

    The best of ``queries_per_edit`` flips is committed unless it lowers the loss, and the next
    flip is looked for from there, "until the attack is successful, or until the maximum query
    budget is exhausted"; ``retry`` says what becomes of the others. Without queries, what a
    surrogate trained beforehand ranks highest is flipped; which of the two trained ones, the one
    for loops or the one for other frames, is chosen by whether the graph's words were seen before.
    """

    name: ClassVar[str] = 'stepwise'
    own_settings: ClassVar[tuple[str, ...]] = (
        'perturbation', 'surrogate', 'retry', 'gamma', 'sigma', 'surrogate_data',
        'wl_iterations', 'wl_features')

    def __init__(self, config: AttackConfig) -> None:
        super().__init__(config)
        self._config = config
        if config.mode == 'surrogate' and config.surrogate == NONE:
            raise ConfigError('mode "surrogate" needs a surrogate: found surrogate "none"')
        self._perturbation = make_perturbation(config.perturbation)
        self._memory = Memory()
        self._trained: dict[bool, Surrogate] = {}
        if config.mode == 'surrogate':
            if config.wl_features == 'per_graph':
                raise ConfigError('wl_features "per_graph" belong to one frame\'s nodes: mode '
                                  '"surrogate" needs "pooled"')
            loaded = SurrogateData.load(data_path(config))
            self._bound = loaded.loop_bound()
            self._trained = loaded.fit(self._surrogate)

    def _surrogate(self) -> Surrogate | None:
        return make_surrogate(self._config.surrogate,
                              Kernel(self._config.gamma, self._config.sigma))

    def observe(self, graph: MultiTierGraph) -> None:
        """Remember a graph's words, where no query tells what the detector sees in it."""
        if self._trained:
            self._memory.add(graph)

    def hunt(self, hunt: Hunt, rng: np.random.Generator) -> str:
        """Commit flip after flip; return why it ended."""
        surrogate = self._surrogate()
        learner = _Learner(surrogate) if surrogate else None
        tries = Tries(self._config.retry, self._config.edits)
        x = node_features(hunt.clean)
        left = hunt.edit_budget
        while left:
            if hunt.over:
                return hunt.over
            size = tries.step_size(left)
            pool = tries.pool(self._perturbation, hunt.best,
                              POOL_FACTOR * size * self._config.queries_per_edit, rng)
            if not len(pool):
                return 'no flip left to try'
            self._commit(hunt, self._queried(hunt, pool, size, tries, learner, x), size, tries)
            left -= size
        return hunt.over or 'edit budget spent'

    def _queried(self, hunt: Hunt, pool: NDArray[np.int64], size: int, tries: Tries,
                 learner: _Learner | None, x: NDArray[np.float64]) -> list[_Queried]:
        """Return what the detector says of flips of the pool, the most promising asked first."""
        check_time()
        before, found = hunt.best, list[_Queried]()
        features = (flip_features(before, x, pool, self._config.wl_iterations,
                                  pooled=self._config.wl_features == 'pooled') if learner
                    else None)
        waiting = list(range(len(pool)))
        count = min(size * self._config.queries_per_edit, hunt.oracle.left)
        if size > 1 and count > 1:
            count -= 1  # several flips at once take a query of their own
        for asked in range(min(count, len(pool))):
            if learner and features is not None and (learner.refit() or not asked):
                waiting = learner.ranked(features, waiting)
            place = waiting.pop(0)
            tries.asking(before, pool[place])
            try:
                loss, succeeded = hunt.ask(before.flip(pool[place:place + 1]))
            except BudgetError:
                break
            if learner and features is not None:
                learner.learn(features[place], loss - hunt.loss)
            tries.asked(pool[place], loss - hunt.loss)
            found.append(_Queried(pool[place:place + 1], loss, succeeded))
            if succeeded:
                break
        return found

    @staticmethod
    def _commit(hunt: Hunt, found: list[_Queried], size: int, tries: Tries) -> None:
        """Make the best flip part of the graph, or the best few if they are better together."""
        # A flip that lowers the loss is never committed; one without effect is, since a hard
        # oracle shows no effect before the decision turns.
        chosen = sorted((one for one in found if one.succeeded or one.loss >= hunt.loss),
                        key=lambda one: (not one.succeeded, -one.loss))[:size]
        if not chosen:
            return
        before, pairs = hunt.best, chosen[0].pairs
        hunt.keep(before.flip(pairs), chosen[0].loss, chosen[0].succeeded)
        if len(chosen) > 1 and not hunt.over:
            together = np.concatenate([one.pairs for one in chosen])
            graph = before.flip(together)
            loss, succeeded = hunt.ask(graph)
            if succeeded or loss >= hunt.loss:
                pairs = together
                hunt.keep(graph, loss, succeeded)
        tries.committed(pairs)

    def guess(self, graph: MultiTierGraph, edit_budget: int,
              rng: np.random.Generator) -> MultiTierGraph:
        """Flip what the trained surrogate ranks highest."""
        similar = self._memory.similar(graph, 1)
        likely_loop = bool(similar) and similar[0][1] >= self._bound
        surrogate = self._trained.get(likely_loop)
        if surrogate is None:
            return graph
        pool = self._perturbation.propose(graph, POOL_FACTOR * edit_budget,
                                          Allowed(self._config.edits), rng)
        if not len(pool):
            return graph
        check_time()
        score = surrogate.predict(
            flip_features(graph, node_features(graph), pool, self._config.wl_iterations))
        return graph.flip(pool[np.argsort(-score, kind='stable')[:edit_budget]])
