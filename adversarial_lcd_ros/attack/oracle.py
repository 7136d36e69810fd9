"""The black box, with what an attack may spend on it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
import time

from adversarial_lcd_ros.codec import LcdAnswer
from adversarial_lcd_ros.errors import AdversarialLcdError, BudgetError
from adversarial_lcd_ros.graph import MultiTierGraph

Ask = Callable[[MultiTierGraph], LcdAnswer]
HARD_LOGIT = 1.0
MAX_LOGIT = 700.0


class OracleSilentError(AdversarialLcdError):
    """The detector did not answer a query in time."""


def edit_budget(nodes: int, ratio: float) -> int:
    """
    Return floor(r n^2), the number of edges that may be flipped (paper, Sec. 3.3).

    Parameters
    ----------
    nodes : int
        n.
    ratio : float
        Perturbation ratio r.

    """
    # 1e-4 * 100^2 is 0.999.. in binary; the budget that was meant is 1.
    return math.floor(ratio * nodes * nodes + 1e-9)


def answer_logit(answer: LcdAnswer) -> float:
    """Return the log odds in a soft answer; +-1 for a hard one, which tells the side only."""
    if not answer.is_soft:
        return HARD_LOGIT if answer.is_loop else -HARD_LOGIT
    chance = answer.probability
    if chance <= 0 or chance >= 1:
        return math.copysign(MAX_LOGIT, chance - 0.5)
    return math.log(chance) - math.log1p(-chance)


@dataclass
class Oracle:
    """
    Asks the detector, counts, and stops.

    Attributes
    ----------
    ask : callable
        Graph in, LcdAnswer out.
    budget : int
        Most queries.
    deadline_s : float
        ``time.monotonic()`` after which no query is begun; inf without a deadline.
    used : int
        Queries spent.

    """

    ask: Ask
    budget: int
    deadline_s: float = math.inf
    used: int = 0

    @property
    def exhausted(self) -> str:
        """Why no further query is granted; empty while one is."""
        if self.used >= self.budget:
            return 'query budget spent'
        if time.monotonic() >= self.deadline_s:
            return 'deadline'
        return ''

    def __call__(self, graph: MultiTierGraph) -> LcdAnswer:
        """
        Spend one query.

        Raises
        ------
        BudgetError
            None is left.

        """
        if self.exhausted:
            raise BudgetError(f'query {self.used + 1} of {self.budget}: {self.exhausted}')
        self.used += 1
        return self.ask(graph)
