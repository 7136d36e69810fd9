"""
Log odds of a loop closure after every single flip of a graph, at once.

No attack on a black box has this: it looks into the detector. It is the yardstick for those that
ask (evaluation/frames/optimum.py).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.lcd import flip_kernels, kernels
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector, QueryNodes
from adversarial_lcd_ros.lcd.flip_kernels import Moments
from adversarial_lcd_ros.lcd.targets.scores import assign_objects, object_cosines, share
from adversarial_lcd_ros.lcd.views import View

_ROUNDING = 1e-13


@dataclass(frozen=True)
class _Flips:
    """
    Single flips of a graph: (k, 2) pairs, which of them are edges, and their lengths.

    ``changed`` holds the nodes whose edges differ from those of the graph before, if that was
    asked about the same pairs; else None.
    """

    view: View
    pairs: NDArray[np.int64]
    present: NDArray[np.bool_]
    length: NDArray[np.float32]
    moments: Moments
    changed: NDArray[np.int64] | None


class _Channel(Protocol):
    """One score of a target, averaged over each candidate's window."""

    def after(self, flips: _Flips) -> NDArray[np.float64]:
        """Return the score after each single flip, shape (k, candidates)."""
        ...


class _Edges:
    """``edge_score``: a flip changes the number of edges, and perhaps earns a credit."""

    def __init__(self, nodes: QueryNodes) -> None:
        self._nodes = nodes
        self._key, self._first = np.unique(nodes.comparison.credit[0], return_index=True)

    def after(self, flips: _Flips) -> NDArray[np.float64]:
        compared, average = self._nodes.comparison, self._nodes.average
        key, weight, owner = compared.credit
        graph = flips.view.graph
        now = kernels.total_of_common(graph.edge_key, key, weight, owner, len(compared))
        flipped = flips.pairs[:, 0] * graph.node_count + flips.pairs[:, 1]
        place = np.searchsorted(self._key, flipped)
        place[place == len(self._key)] = 0
        earns = self._key[place] == flipped if len(self._key) else np.zeros(len(place), bool)
        scores = np.empty((len(flipped), len(average)))
        for step, rows in ((1, ~flips.present), (-1, flips.present)):
            norm = np.maximum((graph.edge_count + step + compared.edges) / 2, 1)
            scores[rows] = average @ (now / norm)
            if len(self._key):
                credit = np.add.reduceat((average / norm)[:, owner].T * weight[:, None],
                                         self._first)
                scores[rows & earns] += step * credit[place[rows & earns]]
        return _settled(scores, average @ now)


class _Neighbourhoods:
    """``NeighbourhoodScore``: a flip changes what matches of its two ends add."""

    def __init__(self, nodes: QueryNodes) -> None:
        compared = nodes.comparison
        self._nodes = nodes
        self._feature, self._start = compared.match_x1, compared.match_start
        self._product = nodes.base.x0.astype(np.float64) @ self._feature.T.astype(np.float64)
        self._share = share(nodes.average, nodes.base.features, compared.features)[
            :, compared.match_owner].T.copy()
        self._change = np.zeros((0, len(nodes.average)))

    def after(self, flips: _Flips) -> NDArray[np.float64]:
        everything = np.arange(flips.view.graph.node_count)
        score = np.zeros(len(self._feature))
        kernels.write_match_scores(everything, flips.view.iterated(everything), self._start,
                                   self._feature, score)
        near = flip_kernels.near_products(everything, self._start[:-1], self._start[1:],
                                          flips.moments, self._product)
        if flips.changed is None:
            stale = np.arange(len(flips.pairs))
            self._change = np.zeros((len(flips.pairs), self._share.shape[1]))
        else:  # what a flip changes hangs on the edges of its ends alone
            touched = np.isin(everything, flips.changed)
            stale = np.flatnonzero(touched[flips.pairs[:, 0]] | touched[flips.pairs[:, 1]])
        self._change[stale] = flip_kernels.match_changes(
            flips.pairs[stale], flips.present[stale], flips.length[stale], flips.moments,
            self._start, self._feature, self._product, near, score, self._share)
        base = score @ self._share
        return _settled(base + self._change, base)


def _settled(total: NDArray[np.float64], base: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sums with 0 where all terms of the base were taken away, not what rounding left."""
    return np.where(total > _ROUNDING * base, total, 0)


class _Objects:
    """``ObjectScore``: only flips between an object and a feature change an object's row."""

    def __init__(self, nodes: QueryNodes) -> None:
        self._nodes = nodes
        self._feature = nodes.comparison.object_x1
        self._scores = np.zeros((0, len(nodes.average)))
        self._product = nodes.base.x0.astype(np.float64) @ self._feature.T.astype(np.float64)

    def after(self, flips: _Flips) -> NDArray[np.float64]:
        if flips.changed is None or (flips.changed < flips.view.objects).any():
            self._scores = self._all(flips)
        return self._scores

    def _all(self, flips: _Flips) -> NDArray[np.float64]:
        nodes, view = self._nodes.comparison, flips.view
        cosine = object_cosines(view, nodes)
        total = np.array([assign_objects(cosine[:, nodes.objects_of(place)])[2].sum()
                          for place in range(len(nodes))])
        scores = np.tile(share(total, view.objects, nodes.objects), (len(flips.pairs), 1))
        touching = np.flatnonzero((flips.pairs[:, 0] < view.objects)
                                  & (flips.pairs[:, 1] >= view.objects))
        flipped = self._cosines(flips, touching)
        for node in np.unique(flips.pairs[touching, 0]):
            mine = flips.pairs[touching, 0] == node
            for place in range(len(nodes)):
                columns = nodes.objects_of(place)
                if nodes.same_class[node, columns].any():
                    best = _reassigned(cosine[:, columns], node, flipped[mine, columns])
                    norm = np.sqrt(view.objects * float(nodes.objects[place]))
                    scores[touching[mine], place] = best / norm
        return scores @ self._nodes.average.T

    def _cosines(self, flips: _Flips, touching: NDArray[np.intp]) -> NDArray[np.float64]:
        """Return the cosines of the touched object after each flip, (k, objects)."""
        objects = np.arange(flips.view.objects)
        first = np.zeros(len(objects), np.int64)
        near = flip_kernels.near_products(objects, first, first + len(self._feature),
                                          flips.moments, self._product)
        cosine: NDArray[np.float64] = flip_kernels.object_rows(
            flips.pairs[touching, 0], flips.pairs[touching, 1], flips.present[touching],
            flips.length[touching], flips.moments, self._feature, self._product,
            near.reshape(len(objects), len(self._feature)),
            self._nodes.comparison.same_class)
        return cosine


def _reassigned(cosine: NDArray[np.float64], node: int,
                rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Return the summed cosine of the best assignment with one object's row replaced.

    Whatever that object is assigned to, the others are assigned as without both.

    Parameters
    ----------
    cosine : float64, (objects, references)
    node : int
        The object.
    rows : float64, (k, references)
        In its place.

    """
    others = np.delete(cosine, node, axis=0)
    choices = [(rows[:, column], *_total(np.delete(others, column, axis=1)))
               for column in range(cosine.shape[1])]
    if len(cosine) > cosine.shape[1]:
        choices.append((np.zeros(len(rows)), *_total(others)))
    value = np.stack([own + rest for own, rest, _ in choices])
    # Assignments maximise the sum of all cosines; only those above 0 count.
    counted = np.stack([np.maximum(own, 0) + above for own, _, above in choices])
    best: NDArray[np.float64] = counted[value.argmax(axis=0), np.arange(len(rows))]
    return best


def _total(cosine: NDArray[np.float64]) -> tuple[float, float]:
    chosen = cosine[linear_sum_assignment(cosine, maximize=True)]
    return float(chosen.sum()), float(np.maximum(chosen, 0).sum())


# Scores of a target, in the order of its channels. Of targets without an entry, flips are made
# and judged one by one.
CHANNELS: dict[str, tuple[Callable[[QueryNodes], _Channel], ...]] = {
    'wl': (_Edges, _Neighbourhoods, _Objects),
    'edges': (_Edges,),
}
IMMUNE = ('descriptors', 'vbow')
# Those that feel a flip only where an end is an object.
AT_OBJECTS = ('anchored', 'objects')


class FlipScorer:
    """
    Exact log odds of single flips of graphs that share their nodes.

    All flips of a graph are scored the sooner the fewer edges differ from the graph before: the
    steps of a greedy search cost half of the first.

    Attributes
    ----------
    detector : LoopClosureDetector
        Must not store further keyframes meanwhile.

    """

    def __init__(self, detector: LoopClosureDetector, graph: MultiTierGraph) -> None:
        self.detector = detector
        self._nodes = detector.query_nodes(graph)
        self._target = detector.config.target
        self._before: MultiTierGraph | None = None
        if self._nodes.candidates:
            rows = self._nodes.base.x0.astype(np.float64)
            self._product = rows @ rows.T
            self._channels = [make(self._nodes) for make in CHANNELS.get(self._target, ())]

    def logits(self, graph: MultiTierGraph, pairs: ArrayLike | None = None
               ) -> NDArray[np.float64]:
        """
        Return the detector's log odds after each single flip of a graph, shape (k,).

        Parameters
        ----------
        graph : MultiTierGraph
            With the nodes of the one that this was made for.
        pairs : int, (k, 2), optional
            Default: all n (n - 1) / 2, in the order of ``numpy.triu_indices``.

        """
        ends = (None if pairs is None
                else np.sort(np.asarray(pairs, np.int64).reshape(-1, 2), axis=1))
        if not self._nodes.candidates:
            every = graph.node_count * (graph.node_count - 1) // 2
            return np.full(every if ends is None else len(ends), -np.inf)
        flips = self._flips(graph, ends)
        if not self._channels:
            return self._judged(flips)
        scores = np.stack([channel.after(flips) for channel in self._channels], axis=2)
        logits = self.detector.decision.logit(scores)
        # Along few candidates numpy's maximum is slow: turned around it takes a tenth.
        best: NDArray[np.float64] = np.ascontiguousarray(logits.T).max(axis=0)
        return best

    def _flips(self, graph: MultiTierGraph, pairs: NDArray[np.int64] | None) -> _Flips:
        view = View(graph, self._nodes.base)
        moments = flip_kernels.moments(view.x0, view.incidence, self._product)
        before, self._before = self._before, graph if pairs is None else None
        if pairs is not None:
            return _Flips(view, pairs, graph.has_edges(pairs), graph.length_between(pairs),
                          moments, None)
        ends, length = self._everything
        changed = None if before is None else kernels.changed_nodes(
            before.edge_key, before.edge_length, graph.edge_key, graph.edge_length,
            graph.node_count)
        return _Flips(view, ends, graph.has_edges(ends), length, moments, changed)

    @cached_property
    def _everything(self) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """All pairs of nodes, and their lengths."""
        graph = self._nodes.base.graph
        ends = np.stack(np.triu_indices(graph.node_count, 1), axis=1)
        return ends, graph.length_between(ends)

    def _judged(self, flips: _Flips) -> NDArray[np.float64]:
        """Return the log odds after each flip by making those that the target can feel."""
        graph, objects = flips.view.graph, flips.view.objects
        logits = np.full(len(flips.pairs), self.detector.log_odds(graph).max())
        if self._target not in IMMUNE:
            felt = (flips.pairs[:, 0] < objects) | (self._target not in AT_OBJECTS)
            for place in np.flatnonzero(felt):
                flipped = graph.flip(flips.pairs[place])
                logits[place] = self.detector.log_odds(flipped).max()
        return logits


def flip_logits(detector: LoopClosureDetector, graph: MultiTierGraph,
                pairs: ArrayLike | None = None) -> NDArray[np.float64]:
    """Return the log odds after each single flip, shape (k,); see ``FlipScorer.logits``."""
    return FlipScorer(detector, graph).logits(graph, pairs)
