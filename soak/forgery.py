# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Graphs that were forged, changed, cut, replayed or reordered, at the gate of sealed ones."""

from __future__ import annotations

from collections import Counter, deque
from dataclasses import replace
import secrets
import time

import numpy as np

from adversarial_lcd_ros.errors import CodecError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.messages import codec
from adversarial_lcd_ros.messages.authentic import Gate
from adversarial_lcd_ros.messages.sealing import SEAL_BYTES, Sealer
from soak.inputs import graph
from soak.outcome import Outcome, Slope, resident_mb

_SECOND, _START = 10**9, 10**18
_MAX_AGE_S = 10.0
_KEPT = 50
# So many hostile messages for each that is good; a new run of the builder after so many good ones.
_HOSTILE, _RUN = 20, 500
_SAMPLES = 60


class Stream:
    """A builder that is now and then started again, and what somebody on its way can do."""

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng(seed)
        self._graphs = [graph(nodes, nodes) for nodes in (3, 12, 40)]
        self._key = secrets.token_bytes(32)
        self._foreign = Sealer(secrets.token_bytes(32), _START)
        self.gate = Gate(self._key, _MAX_AGE_S)
        self.now_ns = _START
        self._sent: deque[bytes] = deque(maxlen=_KEPT)
        self._withheld: deque[bytes] = deque(maxlen=_KEPT)
        self._earlier: deque[bytes] = deque(maxlen=_KEPT)
        self._number = self._run = 0
        self._begin()

    def _begin(self) -> None:
        self._earlier.extend(self._sent)
        self._earlier.extend(self._withheld)
        self._sent.clear()
        self._withheld.clear()
        self._run += 1
        self._sealer, self._number = Sealer(self._key, self.now_ns), 0

    def good(self) -> bytes:
        """Return the next graph of the builder; some of those before it never arrive."""
        self.now_ns += _SECOND // 100
        if self._number >= _RUN:
            self._begin()
        if self._rng.random() < 0.2:
            self._withheld.append(self._next())
        self._sent.append(self._next())
        return self._sent[-1]

    def _next(self) -> bytes:
        self._number += 1
        payload = codec.encode_graph(replace(self._any_graph(), sequence=self._number), self._run)
        return self._sealer.seal(payload, self.now_ns)

    def _any_graph(self) -> MultiTierGraph:
        return self._graphs[int(self._rng.integers(len(self._graphs)))]

    def hostile(self) -> tuple[str, bytes]:
        """Return what is sent in its place, and what it is."""
        rng, last = self._rng, self._sent[-1]
        kind = ('forged', 'changed', 'cut', 'grown', 'stripped', 'spliced', 'replayed',
                'reordered', 'of an earlier run')[int(rng.integers(9))]
        some = self._sent[int(rng.integers(len(self._sent)))]
        place = int(rng.integers(len(last)))
        if kind == 'forged':
            return kind, self._foreign.seal(last[:-SEAL_BYTES], self.now_ns)
        if kind == 'changed':
            changed = bytearray(last)
            changed[place] ^= 1 << int(rng.integers(8))
            return kind, bytes(changed)
        if kind == 'cut':
            return kind, last[:place]
        if kind == 'grown':
            return kind, last[:place] + rng.bytes(int(rng.integers(1, 9))) + last[place:]
        if kind == 'stripped':
            return kind, last[:-SEAL_BYTES]
        if kind == 'spliced' and some is not last:
            return kind, last[:-SEAL_BYTES] + some[-SEAL_BYTES:]
        if kind == 'reordered' and self._withheld:
            return kind, self._withheld[int(rng.integers(len(self._withheld)))]
        if kind == 'of an earlier run' and self._earlier:
            return kind, self._earlier[int(rng.integers(len(self._earlier)))]
        return 'replayed', some


def forge(count: int, seed: int = 0) -> Outcome:
    """Send so many hostile messages to a gate, and good ones between them."""
    outcome = Outcome('forged, changed, cut, replayed and reordered graphs under a key',
                      'refused; each good graph taken')
    stream, slope = Stream(seed), Slope()
    causes: Counter[str] = Counter()
    good, began_s = 0, time.process_time()
    for number in range(count):
        if number % _HOSTILE == 0:
            good += 1
            try:
                stream.gate.take(stream.good(), stream.now_ns)
            except CodecError as error:
                outcome.outcomes[f'BROKEN good graph refused: {error.cause}'] += 1
        kind, message = stream.hostile()
        try:
            stream.gate.take(message, stream.now_ns)
            outcome.outcomes[f'BROKEN {kind} graph taken'] += 1
        except CodecError as error:
            outcome.outcomes[f'{kind}: refused'] += 1
            causes[error.cause] += 1
        if number % max(count // _SAMPLES, 1) == 0:
            slope.add(number, resident_mb())
    outcome.note = (f'{good:,} good graphs between them, all taken' if not outcome.broken else
                    f'{good:,} good graphs between them') + (
        f'; refused as {", ".join(f"{name} {causes[name]:,}" for name in sorted(causes))}; '
        f'{time.process_time() - began_s:.0f} s; {slope.text(10_000, "per 10,000 messages")}')
    return outcome
