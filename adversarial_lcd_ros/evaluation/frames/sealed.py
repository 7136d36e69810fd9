# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
A builder and a detector that share a key, and somebody between them who has none.

Every clean graph of a stream is sealed and opened by the code of the nodes (``sealing``,
``authentic``), by a clock that says the stamp of the present frame. On a frame that is attacked
two payloads may come, and none leaves a trace in the gate.

* Who sends a graph of the past brings back its message as it went by, seal and all.
* Who changed anything puts the seal of the present message behind it: he can make no other.

What is refused reaches no detector: there is no decision on the frame, hence no loop.
"""

from __future__ import annotations

from copy import deepcopy
import secrets

from adversarial_lcd_ros.config import LcdNodeConfig
from adversarial_lcd_ros.errors import CodecError, EvaluationError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages.authentic import Gate
from adversarial_lcd_ros.messages.codec import encode_graph
from adversarial_lcd_ros.messages.sealing import SEAL_BYTES, Sealer

_KEY_BYTES = 32


class SealedWire:
    """
    Carries the graphs of one stream.

    Parameters
    ----------
    max_age_s : float
        Of the gate; that of the node ``lcd`` if not given.

    """

    def __init__(self, max_age_s: float = LcdNodeConfig.max_age_s) -> None:
        self._key = secrets.token_bytes(_KEY_BYTES)
        self._gate = Gate(self._key, max_age_s)
        self._sealer: Sealer | None = None
        self._session = 0
        self._gone_by: dict[bytes, bytes] = {}

    def carry(self, clean: MultiTierGraph) -> None:
        """
        Let a graph through as the builder sends it.

        Raises
        ------
        EvaluationError
            It is refused: what is measured here would be no attack.

        """
        sealed = self._sealed(clean)
        try:
            self._gate.take(sealed, clean.stamp_ns)
        except CodecError as error:
            raise EvaluationError(
                f'clean graph {clean.sequence} at {clean.stamp_ns} ns is refused '
                f'({error.cause}: {error}): expected graphs of one builder in their order; '
                'attacks on sealed graphs cannot be measured on this sequence') from error
        self._gone_by[_content(clean)] = sealed

    def arrives(self, clean: MultiTierGraph, forwarded: MultiTierGraph
                ) -> tuple[MultiTierGraph | None, str]:
        """
        Return the graph that the detector gets in place of a clean one, or why it gets none.

        Parameters
        ----------
        clean : MultiTierGraph
            That the builder sends now.
        forwarded : MultiTierGraph
            That the attacker sends in its place.

        Returns
        -------
        graph : MultiTierGraph or None
        cause : str
            Of the refusal (docs/defences.md); empty if it is taken.

        """
        sealed, payload = self._sealed(clean), encode_graph(forwarded)
        sent = payload + sealed[-SEAL_BYTES:]
        if sent != sealed:
            sent = self._gone_by.get(_content(forwarded), sent)
        try:
            return deepcopy(self._gate).take(sent, clean.stamp_ns), ''
        except CodecError as error:
            return None, error.cause

    def _sealed(self, graph: MultiTierGraph) -> bytes:
        # The builder is started again with each session.
        if self._sealer is None or graph.session != self._session:
            self._sealer, self._session = Sealer(self._key, graph.stamp_ns), graph.session
        return self._sealer.seal(encode_graph(graph), graph.stamp_ns)


def _content(graph: MultiTierGraph) -> bytes:
    """Return what tells a graph from others whatever its stamp: its nodes and edges."""
    return graph.node_digest + graph.edge.tobytes()
