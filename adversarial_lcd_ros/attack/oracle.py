# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The black box, with what an attack may spend on it.

It counts and refuses outside the search: a budget is enforced, not trusted. At the deadline no
query is begun any more, and the best graph so far goes out: a late graph would show, a weak attack
does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import math
import time

import numpy as np

from adversarial_lcd_ros.config import LcdConfig
from adversarial_lcd_ros.errors import AdversarialLcdError, BudgetError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.types import MAX_LOGIT, LcdAnswer

# What a detector of one's own may answer: the probability of a loop, or whether it is one.
Answer = LcdAnswer | float | bool
Ask = Callable[[MultiTierGraph], Answer]
HARD_LOGIT = 1.0
DEADLINE = 'deadline'


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
    """
    Return the log odds in a soft answer; +-1 for a hard one, which tells the side only.

    They are the answer's own: a probability is 1 in double precision from log odds of 37 on, and
    a search would not see there what a flip gains.
    """
    if not answer.is_soft:
        return HARD_LOGIT if answer.is_loop else -HARD_LOGIT
    return min(max(answer.log_odds, -MAX_LOGIT), MAX_LOGIT)


def as_answer(answer: Answer) -> LcdAnswer:
    """
    Return what a detector said as an answer: a number is soft, a truth value hard.

    Raises
    ------
    AdversarialLcdError
        It is neither, or no probability.

    """
    if isinstance(answer, LcdAnswer):
        return answer
    if isinstance(answer, bool | np.bool_):
        return LcdAnswer(0, bool(answer), False, float(answer))
    if isinstance(answer, float | int | np.number) and 0 <= answer <= 1:
        return LcdAnswer(0, bool(answer >= LcdConfig.threshold), True, float(answer))
    raise AdversarialLcdError(f'the detector answered {answer!r}: expected a probability from 0 '
                              'to 1, True or False, or an LcdAnswer')


@dataclass
class Oracle:
    """
    Asks the detector, counts, and stops.

    Attributes
    ----------
    ask : callable
        Graph in; out an LcdAnswer, the probability of a loop, or whether it is one.
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
    def left(self) -> int:
        """Queries that are left."""
        return self.budget - self.used

    @property
    def exhausted(self) -> str:
        """Why no further query is granted; empty while one is."""
        if self.used >= self.budget:
            return 'query budget spent'
        if time.monotonic() >= self.deadline_s:
            return DEADLINE
        return ''

    def __call__(self, graph: MultiTierGraph) -> LcdAnswer:
        """
        Spend one query.

        Raises
        ------
        BudgetError
            None is left.
        AdversarialLcdError
            The answer is none.

        """
        if self.exhausted:
            raise BudgetError(f'query {self.used + 1} of {self.budget}: {self.exhausted}')
        self.used += 1
        return as_answer(self.ask(graph))
