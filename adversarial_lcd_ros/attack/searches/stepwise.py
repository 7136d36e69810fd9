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


class Stepwise(Search):
    """
    A perturbation proposes flips, a surrogate ranks them, the detector judges the first of them.

    The best of ``queries_per_edit`` flips is committed unless it lowers the loss, and the next
    flip is looked for from there, "until the attack is successful, or until the maximum query
    budget is exhausted". Without queries, what a surrogate trained beforehand ranks highest is
    flipped; which of the two trained ones, the one for loops or the one for other frames, is
    chosen by whether the graph's words were seen before.
    """

    name: ClassVar[str] = 'stepwise'
    own_settings: ClassVar[tuple[str, ...]] = (
        'perturbation', 'surrogate', 'gamma', 'sigma', 'surrogate_data', 'wl_iterations',
        'wl_features')

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
        allowed = Allowed(self._config.edits)
        x = node_features(hunt.clean)
        for _ in range(hunt.edit_budget):
            if hunt.over:
                return hunt.over
            pool = self._perturbation.propose(
                hunt.best, POOL_FACTOR * self._config.queries_per_edit, allowed, rng)
            if not len(pool):
                return 'no flip left to try'
            self._step(hunt, pool, allowed, learner, x)
        return hunt.over or 'edit budget spent'

    def _step(self, hunt: Hunt, pool: NDArray[np.int64], allowed: Allowed,
              learner: _Learner | None, x: NDArray[np.float64]) -> None:
        """Query flips of the pool, the most promising first, and commit the best."""
        check_time()
        before = hunt.best
        features = (flip_features(before, x, pool, self._config.wl_iterations,
                                  pooled=self._config.wl_features == 'pooled') if learner
                    else None)
        waiting = list(range(len(pool)))
        best: tuple[float, bool, MultiTierGraph] | None = None
        for asked in range(min(self._config.queries_per_edit, len(pool))):
            if learner and features is not None and (learner.refit() or not asked):
                waiting = learner.ranked(features, waiting)
            place = waiting.pop(0)
            allowed.mark(before, pool[place:place + 1])
            flipped = before.flip(pool[place:place + 1])
            try:
                loss, succeeded = hunt.ask(flipped)
            except BudgetError:
                break
            if learner and features is not None:
                learner.learn(features[place], loss - hunt.loss)
            if best is None or loss > best[0]:
                best = loss, succeeded, flipped
            if succeeded:
                break
        # A flip that lowers the loss is never committed; one without effect is, since a hard
        # oracle shows no effect before the decision turns.
        if best is not None and (best[1] or best[0] >= hunt.loss):
            hunt.keep(best[2], best[0], best[1])

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
