# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The sequences of an experiment: labels and a digest here, graphs where they are attacked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
import hashlib
from pathlib import Path

from adversarial_lcd_ros.config import ANCHORS, BuilderConfig, LabelConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.files.digests import digest_of
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence, holds_graphs, open_graphs
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.labels import FrameLabels
from adversarial_lcd_ros.messages.codec import encode_graph
from adversarial_lcd_ros.sequences import open_sequence
from adversarial_lcd_ros.sequences.part import SequencePart
from adversarial_lcd_ros.sequences.sequence import Progress

_KEPT = 6


@dataclass(frozen=True)
class GraphSource:
    """
    Where graphs are, or what they are built from; equal sources have equal graphs.

    Attributes
    ----------
    source : str
        As for ``open_graphs``.
    builder : BuilderConfig
    cache : Path or None
        Folder of built graphs; None: the user's.
    digest : str
        Of the graphs, hexadecimal.

    """

    source: str
    builder: BuilderConfig
    cache: Path | None
    digest: str


@dataclass(frozen=True, eq=False)
class Stream:
    """
    A sequence with graphs of one size, ready to draw frames from.

    Attributes
    ----------
    name : str
    nodes : int
        Features of a graph, the builder's setting.
    nodes_mean : float
    graphs : GraphSource
    labels : FrameLabels
    digest : str
        Of graphs and labels, hexadecimal.
    variant : str
        That its targets need; '': they take any.

    """

    name: str
    nodes: int
    nodes_mean: float
    graphs: GraphSource
    labels: FrameLabels
    digest: str
    variant: str = ''

    @cached_property
    def pairs_digest(self) -> str:
        """Digest of graphs, labels and the relation of all pairs, hexadecimal."""
        return digest_of(self.digest.encode() + self.labels.relation.tobytes())


def open_streams(sources: Sequence[str], nodes: Iterable[int], builder: BuilderConfig,
                 config: LabelConfig, cache: Path | None, progress: Progress,
                 own_labels: Mapping[str, LabelConfig] | None = None, variant: str = ''
                 ) -> list[Stream]:
    """
    Open, and where needed build, the graphs of every sequence and size; label the frames.

    Parameters
    ----------
    sources : sequence of str
        As for ``open_graphs``.
    nodes : iterable of int
        Sizes: features of a graph.
    builder : BuilderConfig
        All other settings of the graphs. A sequence of detections without pictures takes those
        in place of the network.
    config : LabelConfig
    cache : Path or None
        Folder of built graphs; None: the user's.
    progress : callable
        Called with frames done and to do, of one sequence after the other.
    own_labels : mapping, optional
        Settings of labels in place of ``config``, by name of the sequence.
    variant : str
        That the targets need, whatever the settings of the graphs say; '': they take any.

    Raises
    ------
    AdversarialLcdError
        A sequence cannot be opened, has no ground truth or no frame that could be attacked, or
        has the name of another one.

    """
    streams: list[Stream] = []
    for source in sources:
        taken = {stream.name for stream in streams}
        settings = _for_source(source, replace(
            builder, graph_variant=variant or builder.graph_variant))
        labels: FrameLabels | None = None
        for size in nodes:
            sized = replace(settings, features=size)
            sequence = open_graphs(source, sized, cache, progress)
            if sequence.name in taken:
                raise EvaluationError(f'two sequences are called {sequence.name}: rename one of '
                                      'the folders, or leave one out')
            if variant == ANCHORS and not all(graph.has_scene for graph in sequence.graphs):
                raise EvaluationError(
                    f'{source} has graphs without a node for the scene, and a target needs it: '
                    f'"adversarial-lcd build --graph-variant {ANCHORS}" makes such graphs, or '
                    'leave that target out')
            # Stamps are the same in graphs of any size.
            labels = labels or label_sequence(
                sequence, (own_labels or {}).get(sequence.name, config))
            digest = graphs_digest(sequence.graphs)
            counts = [graph.node_count for graph in sequence.graphs]
            streams.append(Stream(sequence.name, size, sum(counts) / len(counts),
                                  GraphSource(source, sized, cache, digest), labels,
                                  _with_labels(digest, labels), variant))
    return streams


def _for_source(source: str, builder: BuilderConfig) -> BuilderConfig:
    path = SequencePart.parse(source).path
    if builder.detector == 'onnx' and not holds_graphs(path) and open_sequence(path).detections:
        return replace(builder, detector='csv')
    return builder


def label_sequence(sequence: GraphSequence, config: LabelConfig) -> FrameLabels:
    """
    Label the frames of a sequence.

    Raises
    ------
    EvaluationError
        There is no ground truth, or neither a loop nor a new place.

    """
    if sequence.trajectory is None:
        raise EvaluationError(f'{sequence.name} has no ground truth: without it nobody knows '
                              'which decisions are right; name it with --ground-truth '
                              '("adversarial-lcd inspect" tells what there is), or import it so')
    labels = label_graphs(sequence.graphs, sequence.trajectory, sequence.source, config)
    if not labels.kind.any():
        raise EvaluationError(f'{sequence.name}: none of {len(labels.kind)} frames is a loop or '
                              'a new place: take a longer part, or set labels (min_gap_s is '
                              f'{config.min_gap_s:g} s)')
    return labels


def graphs_digest(graphs: Iterable[MultiTierGraph]) -> str:
    """Return a digest of all bytes of some graphs, hexadecimal."""
    digest = hashlib.blake2b(digest_size=16)
    for graph in graphs:
        digest.update(encode_graph(graph))
    return digest.hexdigest()


def _with_labels(graphs: str, labels: FrameLabels) -> str:
    arrays = (labels.kind, labels.possible, labels.elsewhere, labels.candidates)
    return digest_of(graphs.encode() + b''.join(array.tobytes() for array in arrays))


@lru_cache(_KEPT)
def load_stream_graphs(source: GraphSource) -> tuple[MultiTierGraph, ...]:
    """
    Return the graphs of a source; a process keeps those that it used last.

    Raises
    ------
    EvaluationError
        They are not those that were opened: another machine built them differently, or the
        source has changed.

    """
    graphs = tuple(open_graphs(source.source, source.builder, source.cache).graphs)
    if graphs_digest(graphs) != source.digest:
        raise EvaluationError(f'{source.source} gives other graphs here than where the '
                              'experiment was started: expected the same files, vocabulary '
                              'and releases of the libraries on every machine')
    return graphs
