# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
What the topics carry, as types: decisions, queries, answers, reports, detections.

Graphs are in ``graph``; ``codec`` makes payloads of all of them. Fields are those of the messages
in msg_schemas.
"""

from __future__ import annotations

from dataclasses import dataclass, field
import math

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.graph import MultiTierGraph

# Log odds beyond are of a probability that is 0 or 1 in double precision.
MAX_LOGIT = 700.0


def log_odds(probability: float) -> float:
    """Return ln(p / (1 - p)); infinite for 0 and 1, and beyond."""
    if not 0.0 < probability < 1.0:
        return math.copysign(math.inf, probability - 0.5)
    return math.log(probability) - math.log1p(-probability)


@dataclass(frozen=True)
class LoopClosure:
    """
    What the detector decided on one graph.

    Attributes
    ----------
    stamp_ns, frame_id, sequence
        Of the graph decided on.
    is_loop : bool
        Probability at or above the detector's threshold.
    probability : float
        Calibrated probability of a loop closure, 0 to 1.
    match_stamp_ns, match_sequence : int or None
        Best matching keyframe; None without a candidate outside the temporal gap.
    vbow_score : float
        DBoW L1 score with the match, 0 to 1.
    candidates : int
        Number of keyframes compared with the graph.
    log_odds : float, optional
        Of the probability, which rounds to 0 or 1 far out; made from it if not given.
    session, match_session : int
        Which run of the detector decided, and which run of the builder made the matching
        keyframe: numbers start again with each. 0: not known. Not compared.

    """

    stamp_ns: int
    frame_id: str
    sequence: int
    is_loop: bool
    probability: float
    match_stamp_ns: int | None = None
    match_sequence: int | None = None
    vbow_score: float = 0.0
    candidates: int = 0
    log_odds: float = field(default=math.nan)
    session: int = field(default=0, compare=False)
    match_session: int = field(default=0, compare=False)

    def __post_init__(self) -> None:
        """Make the log odds from the probability where they were not given."""
        _complete(self)


@dataclass(frozen=True)
class LcdQuery:
    """A graph that the detector shall judge without remembering it."""

    id: int
    graph: MultiTierGraph


@dataclass(frozen=True)
class LcdAnswer:
    """The detector's answer to the query of the same id."""

    id: int
    is_loop: bool
    is_soft: bool
    probability: float
    log_odds: float = field(default=math.nan)
    session: int = field(default=0, compare=False)

    def __post_init__(self) -> None:
        """Make the log odds from the probability where they were not given."""
        _complete(self)


def _complete(judged: LoopClosure | LcdAnswer) -> None:
    if math.isnan(judged.log_odds):
        object.__setattr__(judged, 'log_odds', log_odds(judged.probability))


@dataclass(frozen=True)
class AttackReport:
    """
    What the attacker did to one graph; the fields are those of AttackReport.msg.

    Attributes
    ----------
    status : str
        success, failure or skipped.
    edit_budget, edits, query_budget, queries : int
        Granted and spent.
    loss_before, loss_after : float
        Attack loss of the clean and of the forwarded graph; above 0 is success.
    duration_s : float
        From the graph's arrival to its publication, seconds.
    node_budget, nodes_moved : int
        Nodes that might be changed, and that were; 0 in recordings of version 1.

    """

    stamp_ns: int
    frame_id: str
    sequence: int
    status: str
    reason: str = ''
    edit_budget: int = 0
    edits: int = 0
    query_budget: int = 0
    queries: int = 0
    loss_before: float = 0.0
    loss_after: float = 0.0
    duration_s: float = 0.0
    node_budget: int = 0
    nodes_moved: int = 0


@dataclass(frozen=True, eq=False)
class FrameDetections:
    """
    What a detector of the user's own has found in one frame.

    Attributes
    ----------
    stamp_ns, frame_id
        Of the frame.
    label : uint32, (k,)
        Class.
    box : float32, (k, 4)
        x, y of the upper left corner, width, height, pixels; may reach beyond the image.
    score : float32, (k,)
        Confidence, 0 to 1.

    """

    stamp_ns: int
    frame_id: str
    label: NDArray[np.uint32]
    box: NDArray[np.float32]
    score: NDArray[np.float32]
