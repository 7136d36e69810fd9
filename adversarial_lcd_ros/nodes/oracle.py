# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The detector as the attacker sees it: a topic for queries and one for answers."""

from __future__ import annotations

import math
import secrets
from threading import Condition
import time
from typing import TYPE_CHECKING

from std_msgs.msg import UInt8MultiArray

from adversarial_lcd_ros.attack.oracle import OracleSilentError
from adversarial_lcd_ros.errors import AdversarialLcdError, BudgetError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.payload import unwrap, wrap
from adversarial_lcd_ros.messages.types import LcdAnswer, LcdQuery
from adversarial_lcd_ros.nodes.diagnostics import Diagnostics
from adversarial_lcd_ros.nodes.endpoints import (
    create_payload_publisher,
    overridable,
    payload_qos,
)
from adversarial_lcd_ros.nodes.streams import SessionWatch

if TYPE_CHECKING:
    from adversarial_lcd_ros.nodes.runtime import PipelineNode

_LOOK_S = 0.01
_UNANSWERED = 3


class TopicOracle:
    """
    Asks the detector by topic; one query at a time, from a thread that is not the executor's.

    Two topics cost as much as a service and can be watched and recorded.

    Parameters
    ----------
    node : PipelineNode
    diagnostics : Diagnostics
        Counts queries, answers and silence.
    timeout_s : float
        Wait so long for an answer, seconds.

    """

    def __init__(self, node: PipelineNode, diagnostics: Diagnostics, timeout_s: float) -> None:
        self._diagnostics = diagnostics
        self._timeout_s = timeout_s
        self._changed = Condition()
        self._answer: LcdAnswer | None = None
        self._interrupted = False
        self._deadline_s = math.inf
        self._was_silent = False
        self._unanswered = 0
        # A random start: attackers that share a detector see each other's answers.
        self._id = secrets.randbits(62)
        self._queries = create_payload_publisher(node, 'query')
        self._restarts = SessionWatch(diagnostics, 'lcd', 'its keyframes are gone')
        self._answers = node.create_subscription(
            UInt8MultiArray, 'answer', diagnostics.guard('answer', self._on_answer),
            payload_qos(), raw=True, qos_overriding_options=overridable())

    def ask(self, graph: MultiTierGraph) -> LcdAnswer:
        """
        Return the detector's answer to a graph.

        Raises
        ------
        OracleSilentError
            No answer within the timeout, or ``interrupt`` was called.

        """
        deadline_s = min(time.monotonic() + self._timeout_s, self._deadline_s)
        self._await_listener(deadline_s)
        with self._changed:
            self._id += 1
            self._answer = None
        self._queries.publish(wrap(codec.encode_query(LcdQuery(self._id, graph))))
        self._diagnostics.count('published queries')
        with self._changed:
            self._changed.wait_for(lambda: self._answer is not None or self._interrupted,
                                   max(0.0, deadline_s - time.monotonic()))
            if self._answer is not None:
                self._was_silent = False
                return self._answer
            if self._interrupted:
                raise OracleSilentError('the query was interrupted')
        raise self._silence('no answer to a query')

    def end_at(self, deadline_s: float) -> None:
        """Wait for no answer beyond a time, as ``time.monotonic()`` tells it; inf: none."""
        self._deadline_s = deadline_s

    def interrupt(self, interrupted: bool = True) -> None:
        """Make the query under way and all later ones fail, or allow them again."""
        with self._changed:
            self._interrupted = interrupted
            self._changed.notify_all()

    def _await_listener(self, deadline_s: float) -> None:
        # Discovery may still be under way at the first query; once the detector was silent, a
        # topic without a listener is not waited for again.
        with self._changed:
            while not self._queries.get_subscription_count():
                if self._interrupted:
                    raise OracleSilentError('the query was interrupted')
                if self._was_silent or time.monotonic() >= deadline_s:
                    raise self._silence('nobody listens to queries')
                self._changed.wait(_LOOK_S)

    def _silence(self, what: str) -> AdversarialLcdError:
        """Return what ends the attack: the deadline, or a detector that says nothing."""
        self._unanswered += 1
        # The deadline often falls into a query; over several it has not even answered late.
        if (time.monotonic() >= self._deadline_s and self._unanswered < _UNANSWERED
                and self._queries.get_subscription_count()):
            return BudgetError(f'{what} before the deadline')
        self._was_silent = True
        error = OracleSilentError(f'{what} within {self._timeout_s:g} s or the deadline: is lcd '
                                  'running, and are query and answer remapped alike on both '
                                  'sides?')
        self._diagnostics.worry('queries without answer', str(error))
        return error

    def _on_answer(self, wire: bytes) -> None:
        answer = codec.decode_answer(unwrap(wire))
        self._restarts.note(answer.session)
        self._unanswered = 0
        with self._changed:
            if answer.id == self._id and self._answer is None:
                self._answer = answer
                self._changed.notify_all()
                self._diagnostics.count('received answers')
