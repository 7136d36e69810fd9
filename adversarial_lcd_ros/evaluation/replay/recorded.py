# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Evaluation of what the nodes said while somebody recorded them: nothing is replayed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
import math
from pathlib import Path
import time
from typing import Any, TypeVar

import numpy as np

from adversarial_lcd_ros.attack.forging import change_between
from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.evaluation.replay.figures import label_run, make_figures
from adversarial_lcd_ros.evaluation.replay.offline import run_offline
from adversarial_lcd_ros.evaluation.replay.pictures import telling_pictures
from adversarial_lcd_ros.evaluation.replay.processes import Recording
from adversarial_lcd_ros.evaluation.replay.report import write_results
from adversarial_lcd_ros.evaluation.replay.supervision import Tell
from adversarial_lcd_ros.evaluation.results import ResultsFolder
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence
from adversarial_lcd_ros.messages.codec import (
    decode_attack_report,
    decode_graph,
    decode_loop_closure,
)
from adversarial_lcd_ros.messages.types import AttackReport, LoopClosure
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.bag_truth import BagTruth
from adversarial_lcd_ros.sequences.bagfile import (
    COMPRESSED_IMAGE,
    IMAGE,
    BagFile,
    is_bag,
)
from adversarial_lcd_ros.sequences.replay import read_messages

# The run of the attacker that was recorded, whose settings nobody recorded.
RECORDED = 'recorded'
_BEFORE, _GRAPHS, _DECISIONS, _REPORTS = 'graph_clean', 'graph', 'loop_closures', 'attack_report'
MessageT = TypeVar('MessageT', MultiTierGraph, LoopClosure, AttackReport)


@dataclass(frozen=True)
class Heard:
    """
    What a recording holds of one run.

    Attributes
    ----------
    run : Recording
        Of the frames of which all messages are there.
    has_reports : bool
        Without, the reports of the run know the edits and nothing else.
    notes : list of str
        What was left out, and why.

    """

    run: Recording
    has_reports: bool
    notes: list[str]


def is_recording(path: Path) -> bool:
    """Tell whether a path is a bag in which an attacker between builder and detector spoke."""
    if not is_bag(path):
        return False
    with BagFile(path) as bag:
        return {_BEFORE, _GRAPHS, _DECISIONS} <= set(_topics(bag))


def _topics(bag: BagFile) -> dict[str, str]:
    # By the last part of their names: nodes may have a namespace.
    return {topic.rsplit('/', 1)[-1]: topic for topic in bag.payload_topics()}


def read_recording(path: Path) -> Heard:
    """
    Return what a recording of the nodes holds, frame by frame.

    A recording made by hand starts and ends in the middle of something, and may lose messages:
    frames of which one is missing are left out, and counted.

    Raises
    ------
    SequenceError
        The bag is damaged, has none of the frames whole, or holds several replays.
    CodecError
        A payload is none.

    """
    with BagFile(path) as bag:
        topics = _topics(bag)
    clean = _by_stamp(path, topics[_BEFORE], decode_graph)
    forwarded = _by_stamp(path, topics[_GRAPHS], decode_graph)
    decisions = _by_stamp(path, topics[_DECISIONS], decode_loop_closure)
    reports = (_by_stamp(path, topics[_REPORTS], decode_attack_report) if _REPORTS in topics
               else {})
    whole = clean.keys() & forwarded.keys() & decisions.keys()
    stamps = sorted(whole & reports.keys() if reports else whole)
    if not stamps:
        raise SequenceError(f'bag {path}: no frame has a clean graph, a graph, a decision and a '
                            'report: record the four nodes of one run together')
    notes = [f'{missing} of {len(clean)} frames were left out: not all of their messages were '
             'recorded'] if (missing := len(clean) - len(stamps)) else []
    if not reports:
        notes.append('no attack reports were recorded: queries, budgets and what could not be '
                     'attacked are not known')
    found = [decisions[stamp] for stamp in stamps]
    known = set(stamps)
    orphans = sum(decision.match_stamp_ns not in {None, *known} for decision in found)
    if orphans:
        notes.append(f'{orphans} decisions name a match that was not recorded')
    return Heard(Recording(
        [clean[stamp] for stamp in stamps], [forwarded[stamp] for stamp in stamps],
        [decision if decision.match_stamp_ns in {None, *known} else
         replace(decision, match_stamp_ns=None, match_sequence=None) for decision in found],
        [reports[stamp] for stamp in stamps] if reports else
        [_report(clean[stamp], forwarded[stamp]) for stamp in stamps]), bool(reports), notes)


def _by_stamp(path: Path, topic: str, decode: Callable[[bytes], MessageT]) -> dict[int, MessageT]:
    messages = read_messages(path, topic, decode)
    stamps = [message.stamp_ns for message in messages]
    if len(set(stamps)) < len(stamps):
        twice = next(stamp for at, stamp in enumerate(stamps) if stamp in stamps[:at])
        raise SequenceError(f'bag {path}, {topic}: two messages for the frame at {twice} ns: the '
                            'recording holds several replays or attackers; record one')
    return dict(zip(stamps, messages, strict=True))


def _report(clean: MultiTierGraph, forwarded: MultiTierGraph) -> AttackReport:
    # What the two graphs say; the rest is not known.
    change = change_between(clean, forwarded)
    return AttackReport(clean.stamp_ns, clean.frame_id, clean.sequence, 'failure',
                        edits=change.edits, nodes_moved=change.nodes)


def evaluate_recording(bag: Path, output: Path, lcd: LcdConfig, labels: LabelConfig, *,
                       source: Mapping[str, Any] | None = None, seed: int = 42,
                       command_line: Sequence[str] = (),
                       tell: Tell = lambda text: None,
                       ) -> tuple[Path, dict[str, Any]]:
    """
    Report on a recorded attack; return the results folder and the summary.

    The recorded decisions are taken as they are. Those of the clean run were never made: the
    detector makes them now, of the recorded clean graphs, with the settings given. How many of
    the recorded decisions it repeats on the graphs that it got tells whether these are the
    settings of the recorded detector.

    Parameters
    ----------
    bag : Path
        With graph_clean, graph, loop_closures and, as far as there, attack_report and images.
    output : Path
        Folder in which the results folder is made.
    lcd, labels
        Settings.
    source : mapping, optional
        Arguments of ``open_sequence`` that tell of the ground truth.
    seed : int
        Of the bootstrap.
    command_line : sequence of str
        Kept with the results.
    tell : callable
        Gets a line of text for each step.

    Raises
    ------
    AdversarialLcdError
        See ``read_recording`` and ``BagTruth``.

    """
    started_s = time.monotonic()
    tell(f'{bag} is a recording of the nodes: its decisions are taken as they are')
    heard = read_recording(bag)
    run = heard.run
    sequence = _sequence(bag, run, dict(source or {}), tell)
    tell('the decisions of a clean run, made now of the recorded clean graphs')
    clean = Recording(run.clean, run.clean, list(run_offline(run.clean, lcd)[0].decisions), [])
    notes = [*heard.notes, _agreement(run, lcd)]
    for note in notes:
        tell(note)
    records, summary = make_figures(
        sequence.name, label_run(sequence, clean, labels), clean, {RECORDED: run},
        {RECORDED: None}, lcd, seed, reported=heard.has_reports)
    summary['notes'] = notes
    summary['duration_s'] = time.monotonic() - started_s
    folder = ResultsFolder.create(output)
    folder.write_setup([lcd, labels], command_line, seed, {'source': str(bag.resolve())})
    write_results(folder, summary, records, telling_pictures(
        sequence, clean, {RECORDED: run}, records, summary))
    return folder.finish(), summary


def _sequence(bag: Path, run: Recording, source: dict[str, Any],
              tell: Tell) -> CameraSequence | GraphSequence:
    """Return the images of the recording, for pictures, or else its graphs alone."""
    with BagFile(bag) as opened:
        has_images = bool(opened.of_type(IMAGE, COMPRESSED_IMAGE))
    if has_images:
        try:
            return open_sequence(bag, **source)
        except SequenceError as error:
            tell(f'without pictures: {error}')
    first = run.clean[0]
    stamps = np.array([graph.stamp_ns for graph in run.clean], np.int64)
    with BagFile(bag) as opened:
        truth = BagTruth(opened, stamps, ('', first.frame_id), source.get('truth'),
                         source.get('stamps')).find(source.get('ground_truth'))
    return GraphSequence(bag.resolve().stem, run.clean, truth.trajectory,
                         (first.width, first.height), bag)


def _agreement(run: Recording, lcd: LcdConfig) -> str:
    again = run_offline(run.forwarded, lcd)[0].decisions
    same = sum(now.is_loop == then.is_loop and now.match_stamp_ns == then.match_stamp_ns
               and math.isclose(now.probability, then.probability, abs_tol=1e-6)
               for now, then in zip(again, run.decisions, strict=True))
    text = (f'with the settings given, the detector repeats {same} of {len(again)} recorded '
            'decisions on the graphs that it got')
    return text if same == len(again) else (
        f'{text}: the recorded one had other settings (--lcd-...), or had seen other frames '
        'before; what follows compares it with another detector')
