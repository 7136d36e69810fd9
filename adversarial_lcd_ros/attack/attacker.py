"""The man in the middle: clean graph in, perturbed graph out (paper, attack-module)."""

from __future__ import annotations

from dataclasses import dataclass, field
import math
from pathlib import Path
import time

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.memory import Memory
from adversarial_lcd_ros.attack.oracle import (
    Ask,
    Oracle,
    OracleSilentError,
    answer_logit,
    edit_budget,
)
from adversarial_lcd_ros.attack.perturbations import Allowed, make_perturbation
from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.attack.surrogates import Surrogate, make_surrogate
from adversarial_lcd_ros.codec import AttackReport, LcdAnswer
from adversarial_lcd_ros.config import AttackConfig
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.paths import model_path
from adversarial_lcd_ros.weisfeiler_lehman import node_features, pooled_features

POOL_FACTOR = 3
REFIT_EVERY = 10


@dataclass(frozen=True)
class AttackResult:
    """
    A graph as it is forwarded, and what was spent on it.

    Attributes
    ----------
    clean, perturbed : MultiTierGraph
    status : str
        success: the detector's decision changed (in surrogate mode: is predicted to);
        failure: it did not; skipped: nothing was tried, ``reason`` says why.
    edit_budget, query_budget, queries : int
    loss_before, loss_after : float
        Attack loss L of Eq. (1): log odds against the detector's answer to the clean graph.
    trace : tuple of float
        Largest loss after each query.

    """

    clean: MultiTierGraph
    perturbed: MultiTierGraph
    status: str
    reason: str = ''
    edit_budget: int = 0
    query_budget: int = 0
    queries: int = 0
    loss_before: float = 0.0
    loss_after: float = 0.0
    trace: tuple[float, ...] = ()

    @property
    def flips(self) -> NDArray[np.uint32]:
        """Pairs that differ between the clean and the forwarded graph, shape (k, 2)."""
        return self.clean.flips_to(self.perturbed)

    def report(self, duration_s: float = 0.0) -> AttackReport:
        """Return the message that tells whoever measures the attack."""
        return AttackReport(
            self.clean.stamp_ns, self.clean.frame_id, self.clean.sequence, self.status,
            self.reason, self.edit_budget, len(self.flips), self.query_budget, self.queries,
            self.loss_before, self.loss_after, duration_s)


@dataclass
class _Search:
    """State of one query-guided attack."""

    graph: MultiTierGraph
    oracle: Oracle
    is_loop: bool
    loss: float
    x: NDArray[np.float64]
    allowed: Allowed
    edits: int = 0
    features: list[NDArray[np.float64]] = field(default_factory=list)
    gains: list[float] = field(default_factory=list)
    trace: list[float] = field(default_factory=list)
    succeeded: bool = False

    def loss_of(self, answer: LcdAnswer) -> float:
        """Return the signed margin: -logit where the clean graph was a loop, else +logit."""
        logit = answer_logit(answer)
        return -logit if self.is_loop else logit


class Attacker:
    """
    Perturbs graphs within a query and an edit budget.

    ``process`` never changes its input, and the same seed, graph and answers give the same
    bytes. What it knows of the detector is the answers to its queries.
    """

    def __init__(self, config: AttackConfig | None = None) -> None:
        self.config = config or AttackConfig()
        self._perturbation = make_perturbation(self.config.perturbation)
        self._memory: Memory | None = None
        self._trained: dict[bool, Surrogate] = {}
        if self.config.mode == 'surrogate':
            self._load_surrogate()

    def _load_surrogate(self) -> None:
        if self.config.surrogate == 'none':
            raise ConfigError('mode "surrogate" needs a surrogate: found surrogate "none"')
        path = (Path(self.config.surrogate_data) if self.config.surrogate_data
                else model_path('surrogate_data.npz'))
        data = SurrogateData.load(path)
        self._trained = data.fit(lambda: make_surrogate(self.config.surrogate))
        self._memory = Memory(data)

    def process(self, graph: MultiTierGraph, ask: Ask) -> AttackResult:
        """
        Return the graph to forward in place of the given one.

        Parameters
        ----------
        graph : MultiTierGraph
            Clean graph from the builder.
        ask : callable
            Puts a graph before the detector and returns its LcdAnswer; may raise
            OracleSilentError, which ends the attack on this graph.

        """
        edits = edit_budget(graph.node_count, self.config.ratio)
        queries = 0
        if self.config.mode == 'query':
            queries = min(edits * self.config.queries_per_edit, self.config.max_queries)
        likely_loop = self._memory.recall(graph) if self._memory else False
        if self.config.mode == 'pass':
            return AttackResult(graph, graph, 'skipped', 'mode is pass', edits)
        if not edits:
            return AttackResult(graph, graph, 'skipped', 'edit budget below one')
        rng = np.random.default_rng((self.config.seed, graph.sequence))
        if self.config.mode == 'surrogate':
            return self._surrogate_only(graph, edits, likely_loop, rng)
        if queries < 2:
            return AttackResult(graph, graph, 'skipped', 'query budget below two', edits, queries)
        return self._query_guided(graph, edits, queries, ask, rng)

    def _query_guided(self, graph: MultiTierGraph, edits: int, queries: int, ask: Ask,
                      rng: np.random.Generator) -> AttackResult:
        deadline = (time.monotonic() + self.config.deadline_ms / 1e3
                    if self.config.deadline_ms else math.inf)
        oracle = Oracle(ask, queries, deadline)
        try:
            answer = oracle(graph)
        except OracleSilentError:
            return AttackResult(graph, graph, 'skipped', 'no answer', edits, queries, oracle.used)
        search = _Search(graph, oracle, answer.is_loop, 0.0, node_features(graph),
                         Allowed(self.config.edits))
        search.loss = before = search.loss_of(answer)
        if answer.probability == 0 and answer.is_soft:
            reason = 'nothing to compare with'
        else:
            reason = self._run(search, edits, rng)
        return AttackResult(graph, search.graph, 'success' if search.succeeded else 'failure',
                            reason, edits, queries, oracle.used, before, search.loss,
                            tuple(search.trace))

    def _run(self, search: _Search, edits: int, rng: np.random.Generator) -> str:
        """Commit flip after flip; return why it ended."""
        while search.edits < edits:
            if search.oracle.exhausted:
                return search.oracle.exhausted
            pool = self._perturbation.propose(
                search.graph, POOL_FACTOR * self.config.queries_per_edit, search.allowed, rng)
            if not len(pool):
                return 'no flip left to try'
            try:
                self._try_flips(search, pool)
            except OracleSilentError:
                return 'no answer'
            if search.succeeded:
                return ''
        return 'edit budget spent'

    def _try_flips(self, search: _Search, pool: NDArray[np.int64]) -> None:
        """Query flips of the pool, the most promising first, and commit the best."""
        surrogate = make_surrogate(self.config.surrogate)
        features = self._flip_features(search, pool) if surrogate else None
        best: tuple[float, MultiTierGraph] | None = None
        waiting = list(range(len(pool)))
        for turn in range(min(self.config.queries_per_edit, len(pool))):
            if search.oracle.exhausted:
                break
            if surrogate and features is not None and turn % REFIT_EVERY == 0:
                waiting = self._ranked(surrogate, search, features, waiting)
            place = waiting.pop(0)
            search.allowed.mark(search.graph, pool[place:place + 1])
            flipped = search.graph.flip(pool[place:place + 1])
            answer = search.oracle(flipped)
            loss = search.loss_of(answer)
            if features is not None:
                search.features.append(features[place])
                search.gains.append(loss - search.loss)
            if best is None or loss > best[0]:
                best = loss, flipped
            search.trace.append(max(loss, search.trace[-1] if search.trace else search.loss))
            if answer.is_loop != search.is_loop:
                search.succeeded = True
                break
        # A flip that lowers the loss is never committed; one without effect is, since a hard
        # oracle shows no effect before the decision turns.
        if best is not None and best[0] >= search.loss:
            search.loss, search.graph = best
            search.edits += 1

    @staticmethod
    def _ranked(surrogate: Surrogate, search: _Search, features: NDArray[np.float64],
                waiting: list[int]) -> list[int]:
        """Return the waiting flips by falling prediction; as they were before it can predict."""
        if not search.gains or not surrogate.fit(np.array(search.features),
                                                 np.array(search.gains)):
            return waiting
        order = np.argsort(-surrogate.predict(features[waiting]), kind='stable')
        return [waiting[place] for place in order]

    def _flip_features(self, search: _Search, pool: NDArray[np.int64]) -> NDArray[np.float64]:
        return flip_features(search.graph, search.x, pool, self.config.wl_iterations)

    def _surrogate_only(self, graph: MultiTierGraph, edits: int, likely_loop: bool,
                        rng: np.random.Generator) -> AttackResult:
        """Flip what the trained surrogate ranks highest; no query."""
        surrogate = self._trained.get(likely_loop)
        if surrogate is None:
            return AttackResult(graph, graph, 'skipped', 'no surrogate for this answer', edits)
        allowed = Allowed(self.config.edits)
        pool = self._perturbation.propose(graph, POOL_FACTOR * edits, allowed, rng)
        score = surrogate.predict(
            flip_features(graph, node_features(graph), pool, self.config.wl_iterations))
        chosen = np.argsort(-score, kind='stable')[:edits]
        return AttackResult(graph, graph.flip(pool[chosen]), 'success', 'predicted', edits,
                            loss_after=float(score[chosen].max(initial=0.0)))


def flip_features(graph: MultiTierGraph, x: NDArray[np.float64], pairs: NDArray[np.int64],
                  iterations: int) -> NDArray[np.float64]:
    """
    Return how each single flip changes the pooled WL features, times n, shape (k, 2 d H).

    Differences carry over between frames, where phi(G') itself mostly tells the frame.

    Parameters
    ----------
    graph : MultiTierGraph
    x : float64, (n, d)
        Initial node features.
    pairs : int, (k, 2)
    iterations : int
        H.

    """
    base = pooled_features(graph, x, iterations)
    rows = [pooled_features(graph.flip(pair), x, iterations) - base for pair in pairs]
    return graph.node_count * np.array(rows).reshape(len(pairs), len(base))
