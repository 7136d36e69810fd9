# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What a stream of frames or graphs gives away: gaps, repeats, jumps in time, restarts."""

from __future__ import annotations

from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.nodes.diagnostics import Diagnostics

# No camera pauses so long unnoticed; a clock that is set may jump by years.
JUMP_NS = 60_000_000_000
_REMEMBERED_SESSIONS = 16


class StampWatch:
    """
    Notices stamps that repeat, go back, or jump ahead.

    Parameters
    ----------
    diagnostics : Diagnostics
        Counts, and warns.
    what : str
        What the stamps are of, in the plural.

    """

    def __init__(self, diagnostics: Diagnostics, what: str) -> None:
        self._diagnostics, self._what = diagnostics, what
        self._stamp_ns: int | None = None

    def note_stamp(self, stamp_ns: int) -> None:
        """Take the stamp of the next message."""
        last_ns, self._stamp_ns = self._stamp_ns, stamp_ns
        if last_ns is None or last_ns < stamp_ns <= last_ns + JUMP_NS:
            return
        step_s = (stamp_ns - last_ns) / 1e9
        if stamp_ns == last_ns:
            self._worry('repeated stamps', f'stamp {stamp_ns} ns came twice')
        elif stamp_ns < last_ns:
            self._worry('stamps that went back',
                        f'stamp {stamp_ns} ns is {-step_s:g} s before the last one')
        else:
            self._worry('stamps that jumped',
                        f'stamp {stamp_ns} ns is {step_s:g} s after the last one')

    def _worry(self, name: str, text: str, by: int = 1) -> None:
        self._diagnostics.worry(f'{self._what}: {name}', f'{self._what}: {text}', by)


class GraphWatch(StampWatch):
    """Notices what graphs tell beside their stamps: numbers that are missing, and sessions."""

    def __init__(self, diagnostics: Diagnostics, what: str = 'graphs') -> None:
        super().__init__(diagnostics, what)
        self._sequence = -1
        self._sessions: list[int] = []

    def note(self, graph: MultiTierGraph) -> None:
        """Take the next graph."""
        last = self._sequence
        self._sequence = graph.sequence
        if self._is_new_session(graph.session):
            self._stamp_ns = graph.stamp_ns
            return
        if last >= 0 and graph.sequence > last + 1:
            self._worry('missing', f'after number {last} came {graph.sequence}: those between '
                        'were lost or refused', graph.sequence - last - 1)
        elif graph.sequence == last:
            self._worry('repeated', f'number {last} came twice: is there a second publisher?')
        elif graph.sequence < last:
            self._worry('out of order', f'after number {last} came {graph.sequence}: a builder '
                        'started again, or a second publisher')
        self.note_stamp(graph.stamp_ns)

    def _is_new_session(self, session: int) -> bool:
        """Tell whether another run of the builder made this graph than the one before."""
        if not session or self._sessions[-1:] == [session]:
            return False
        first = not self._sessions
        again = session in self._sessions
        self._sessions = [*(one for one in self._sessions if one != session),
                          session][-_REMEMBERED_SESSIONS:]
        if again:
            self._worry('of several builders', 'two builders publish at once')
        elif not first:
            self._worry('restarts', 'the builder was started again: its numbers begin anew')
        return not first


class SessionWatch:
    """Notices that whoever sends, the detector say, was started again."""

    def __init__(self, diagnostics: Diagnostics, who: str, effect: str) -> None:
        self._diagnostics, self._who, self._effect = diagnostics, who, effect
        self._session = 0

    def note(self, session: int) -> None:
        """Take the session of the next message; 0 tells nothing."""
        if session and self._session and session != self._session:
            self._diagnostics.worry(f'restarts of {self._who}',
                                    f'{self._who} was started again: {self._effect}')
        self._session = session or self._session
