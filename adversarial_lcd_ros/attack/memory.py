"""What an attacker remembers of the graphs that went by."""

from __future__ import annotations

from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.keyframes import Database

MIN_GAP_NS = 8_000_000_000


class Memory:
    """
    Guesses, without a query, whether the detector will see a loop.

    A man in the middle sees the words of every graph. A new graph that shares more of them with
    an old one than a bound learned from queried graphs is taken for a loop.
    """

    def __init__(self, data: SurrogateData) -> None:
        self._bound = data.loop_bound()
        self._database = Database()

    def recall(self, graph: MultiTierGraph) -> bool:
        """Tell whether the graph probably closes a loop, then remember it."""
        is_loop = best_score(self._database, graph) >= self._bound
        self._database.add(graph)
        return is_loop


def best_score(database: Database, graph: MultiTierGraph) -> float:
    """Return the largest DBoW score with a graph at least eight seconds older, 0 if none."""
    old = database.admissible(graph.stamp_ns, MIN_GAP_NS)
    return float(database.scores(graph)[old].max(initial=0.0))
