# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Candidates and decision among up to a hundred thousand keyframes."""

from dataclasses import replace

import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig, LcdConfig
from adversarial_lcd_ros.keyframes.database import Database
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.vision.builder import GraphBuilder

MARKS_S = {1_000: None, 10_000: 2e-3, 100_000: 10e-3}
REPLACED = 0.3
PLACES = 10
PERIOD_NS = 200_000_000
CANDIDATES, WINDOW = LcdConfig().candidates, LcdConfig().map_window


class Laps:
    """
    A robot that goes round and round: each lap is the tour again, seen a little differently.

    Of every frame 30 % of the words are replaced by words of other frames, and the weights scaled
    to sum to one; nodes and edges stay those of the frame.
    """

    def __init__(self, tour):
        self.tour, self.rng = tour, np.random.default_rng(0)
        self._words = np.concatenate([graph.word for graph in tour])

    def seen(self, frame, replaced=REPLACED):
        """Return a frame of the tour, the tour going on without end."""
        graph = self.tour[frame % len(self.tour)]
        gone = self.rng.random(len(graph.word)) < replaced
        word = np.where(gone, self.rng.choice(self._words, len(gone)), graph.word)
        word, first = np.unique(word, return_index=True)
        weight = graph.word_weight[first]
        return replace(graph, word=word, word_weight=weight / weight.sum(),
                       stamp_ns=frame * PERIOD_NS, sequence=frame)

    def queries(self, after):
        """Return ten revisits, and ten places never seen: of words of other frames throughout."""
        every = len(self.tour) // PLACES
        return [self.seen(after + 100 + every * place, replaced)
                for replaced in (REPLACED, 1.0) for place in range(PLACES)]


class Flat:
    """Brute force in numpy: one pass over the words of all keyframes."""

    def __init__(self, graphs):
        self._word = np.concatenate([graph.word for graph in graphs])
        self._weight = np.concatenate([graph.word_weight for graph in graphs])
        self._ends = np.cumsum([0, *(len(graph.word) for graph in graphs)])

    def scores(self, query):
        weight = np.zeros(self._word.max() + 1, np.float32)
        weight[query.word] = query.word_weight
        common = np.minimum(self._weight, weight[self._word])
        return np.diff(np.concatenate([[0.0], np.cumsum(common, dtype=np.float64)])[self._ends])


def best(score, count=CANDIDATES, window=WINDOW):
    """Return the most alike keyframes, none in another's window."""
    free, chosen = np.ones(len(score), bool), []
    for keyframe in np.argsort(-score, kind='stable'):
        if free[keyframe]:
            chosen.append(int(keyframe))
            free[max(0, keyframe - window):keyframe + window + 1] = False
        if len(chosen) == count:
            return chosen


@pytest.fixture(scope='module')
def laps(tour):
    with GraphBuilder(BuilderConfig(detector='none')) as builder:
        return Laps([builder.build(frame.image(), frame.stamp_ns) for frame in tour.frames()])


@pytest.fixture(scope='module')
def database():
    return Database()


@pytest.mark.parametrize('size', MARKS_S)
def test_candidates_beside_brute_force(record, laps, database, size):
    for frame in range(len(database), size):
        database.add(laps.seen(frame))
    queries, every = laps.queries(size), np.ones(size, bool)
    for query in queries:
        assert database.retrieve(query, every, CANDIDATES, WINDOW)[0] == best(
            database.scores(query))
    bytes_each = database.nbytes / size
    assert bytes_each < 30_000
    if size <= 10_000:
        rival, flat = 'brute force (numpy)', Flat([database[place] for place in range(size)])
        scores = flat.scores
    else:
        rival, scores = 'brute force (compiled)', database.scores
    record('database_query',
           f'{size} keyframes, candidates, {bytes_each / 1000:.0f} kB each beside the graph',
           lambda: [database.retrieve(query, every, CANDIDATES, WINDOW) for query in queries],
           rival, lambda: [best(scores(query)) for query in queries[::5]],
           MARKS_S[size], higher_is_better=False,
           ours_units=len(queries), rival_units=len(queries[::5]))


def test_candidates_beside_grakel(record, tour_graphs, laps):
    grakel = pytest.importorskip('grakel')
    database = Database()
    for frame in range(1000):
        database.add(laps.seen(frame))
    small = [as_grakel(graph) for graph in tour_graphs(100)]
    rival = grakel.WeisfeilerLehman(n_iter=3, base_graph_kernel=grakel.VertexHistogram)
    rival.fit([small[place % len(small)] for place in range(1000)])
    every, queries = np.ones(1000, bool), laps.queries(1000)
    record('database_query', '1000 keyframes, candidates',
           lambda: [database.retrieve(query, every, CANDIDATES, WINDOW) for query in queries],
           'GraKeL one against N (WL, h = 3, n = 100)', lambda: rival.transform(small[:1]),
           ours_units=len(queries))


@pytest.mark.parametrize('size', [1_000, 10_000])
@pytest.mark.parametrize('target', ['vbow', 'wl'])
def test_decision(record, laps, size, target):
    detector = LoopClosureDetector(LcdConfig(target=target))
    for frame in range(size):
        detector.remember(laps.seen(frame))
    queries = laps.queries(size)
    by_sorting = LoopClosureDetector(LcdConfig(target=target))
    by_sorting._database = Sorting()
    for frame in range(size):
        by_sorting.remember(detector._database[frame])
    assert [detector.judge(query) for query in queries] == [
        by_sorting.judge(query) for query in queries]
    mark = MARKS_S[size] if target == 'vbow' else None
    record('database_query', f'{size} keyframes, candidates and decision, target {target}',
           lambda: [detector.judge(query) for query in queries],
           'the same with brute force (compiled)',
           lambda: [by_sorting.judge(query) for query in queries],
           mark, higher_is_better=False, ours_units=len(queries), rival_units=len(queries))


class Sorting(Database):
    """Scores every keyframe, and sorts."""

    def retrieve(self, graph, admissible, count, window=0):
        score = np.where(admissible, self.scores(graph), -1)
        chosen = best(score, count, window)
        return chosen, score[chosen].tolist()


def as_grakel(graph):
    from grakel import Graph
    neighbours = {node: {} for node in range(graph.node_count)}
    for u, v in graph.edge.tolist():
        neighbours[u][v] = neighbours[v][u] = 1.0
    return Graph(neighbours, node_labels=dict(enumerate(graph.label.tolist())))
