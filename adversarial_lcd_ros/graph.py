# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The multi-tier graph of a view, immutable, as a struct of numpy arrays."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
import hashlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from adversarial_lcd_ros.errors import GraphError

OBJECT_TIER = 0
FEATURE_TIER = 1
DESCRIPTOR_BYTES = 32
# Class of the object that is the whole scene, in graphs that have it: networks count below it.
SCENE_CLASS = 1 << 16

_NODE_ARRAYS = {
    'tier': (np.uint8, ()),
    'label': (np.uint32, ()),
    'position': (np.float32, (2,)),
    'size': (np.float32, (2,)),
    'score': (np.float32, ()),
    'descriptor': (np.uint8, (DESCRIPTOR_BYTES,)),
}


def _empty(dtype: type, *shape: int) -> Any:
    return field(default_factory=lambda: np.zeros(shape, dtype))


@dataclass(frozen=True, eq=False)
class MultiTierGraph:
    """
    Objects and visual features of one camera frame, and the distances between them.

    Tier 0 holds the semantic objects, the "main anchors" of the paper (Fig. 2c), tier 1 the
    visual features. Arrays are read-only; ``flip`` returns a new graph. Edges are undirected,
    stored once with source < target, sorted, without repeats: two graphs with the same edges
    have the same bytes.

    Attributes
    ----------
    stamp_ns : int
        Acquisition time of the frame, nanoseconds.
    frame_id : str
        Coordinate frame of the camera.
    sequence : int
        Number of the frame since the builder started.
    width, height : int
        Size of the image, pixels.
    tier : uint8, (n,)
        0 object, 1 feature. Objects come first.
    label : uint32, (n,)
        Class of an object, visual word of a feature.
    position : float32, (n, 2)
        Centre, pixels.
    size : float32, (n, 2)
        Width and height of an object's box; diameter of a feature's patch, twice. Pixels.
    score : float32, (n,)
        Confidence of an object, response of a feature.
    descriptor : uint8, (n, 32)
        ORB descriptor of a feature; zeros for an object.
    edge : uint32, (m, 2)
        Ends of every edge, source < target.
    edge_length : float32, (m,)
        Distance between the ends over the image diagonal, 0 to 1.
    word : uint32, (w,)
        Words of the vBoW vector, ascending. All features of the frame count, not the nodes only.
    word_weight : float32, (w,)
        Their tf-idf weights, L1-normalised.
    session : int
        Which run of the builder made it; 0 outside a node. Two graphs that differ in nothing
        else are equal.

    """

    stamp_ns: int
    frame_id: str
    sequence: int
    width: int
    height: int
    tier: NDArray[np.uint8] = _empty(np.uint8, 0)
    label: NDArray[np.uint32] = _empty(np.uint32, 0)
    position: NDArray[np.float32] = _empty(np.float32, 0, 2)
    size: NDArray[np.float32] = _empty(np.float32, 0, 2)
    score: NDArray[np.float32] = _empty(np.float32, 0)
    descriptor: NDArray[np.uint8] = _empty(np.uint8, 0, DESCRIPTOR_BYTES)
    edge: NDArray[np.uint32] = _empty(np.uint32, 0, 2)
    edge_length: NDArray[np.float32] = _empty(np.float32, 0)
    word: NDArray[np.uint32] = _empty(np.uint32, 0)
    word_weight: NDArray[np.float32] = _empty(np.float32, 0)
    session: int = 0

    def __post_init__(self) -> None:
        """Check every count, index and range; freeze the arrays."""
        count = len(self.tier)
        for name, (dtype, tail) in _NODE_ARRAYS.items():
            self._check_array(name, dtype, (count, *tail))
        edges, words = len(self.edge), len(self.word)
        self._check_array('edge', np.uint32, (edges, 2))
        self._check_array('edge_length', np.float32, (edges,))
        self._check_array('word', np.uint32, (words,))
        self._check_array('word_weight', np.float32, (words,))
        self._check_nodes()
        self._check_edges(count)
        if words and ((self.word[1:] <= self.word[:-1]).any() or self.word_weight.min() < 0):
            raise GraphError('vBoW words must ascend without repeats and have weights >= 0',
                             cause='word')

    def _check_array(self, name: str, dtype: type, shape: tuple[int, ...]) -> None:
        array = getattr(self, name)
        if not isinstance(array, np.ndarray) or array.dtype != dtype or array.shape != shape:
            found = (f'{array.dtype}{array.shape}' if isinstance(array, np.ndarray)
                     else type(array).__name__)
            raise GraphError(f'{name}: expected {np.dtype(dtype)}{shape}, found {found}',
                             cause='counts')
        if array.dtype.kind == 'f' and not np.isfinite(array).all():
            raise GraphError(f'{name}: {int((~np.isfinite(array)).sum())} values are not finite',
                             cause='not finite')
        array.flags.writeable = False

    def _check_nodes(self) -> None:
        if not 0 < self.width < 2**31 or not 0 < self.height < 2**31:
            raise GraphError(f'image size {self.width} x {self.height}: expected positive pixels',
                             cause='image size')
        if np.any(self.tier > FEATURE_TIER):
            raise GraphError(f'tier {int(self.tier.max())}: expected 0 (object) or 1 (feature)',
                             cause='tier')
        if (self.tier[1:] < self.tier[:-1]).any():
            raise GraphError('objects (tier 0) must come before features (tier 1)', cause='tier')

    def _check_edges(self, count: int) -> None:
        if not len(self.edge):
            return
        if self.edge.max() >= count:
            raise GraphError(f'edge to node {int(self.edge.max())}: the graph has {count} nodes',
                             cause='edge')
        if (self.edge[:, 0] >= self.edge[:, 1]).any():
            raise GraphError('every edge needs source < target (no self-loops)', cause='edge')
        if (self.edge_key[1:] <= self.edge_key[:-1]).any():
            raise GraphError('edges must be sorted by source, then target, without repeats',
                             cause='edge')
        if self.edge_length.min() < 0:
            raise GraphError(f'edge length {float(self.edge_length.min()):g}: expected >= 0',
                             cause='edge length')

    @property
    def node_count(self) -> int:
        """Number of nodes, n."""
        return len(self.tier)

    @property
    def edge_count(self) -> int:
        """Number of undirected edges, m."""
        return len(self.edge)

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(getattr(self, name).nbytes for name in (
            *_NODE_ARRAYS, 'edge', 'edge_length', 'word', 'word_weight'))

    @property
    def object_count(self) -> int:
        """Number of tier-0 nodes; they are nodes 0 .. object_count - 1."""
        return int(np.searchsorted(self.tier, FEATURE_TIER))

    @property
    def has_scene(self) -> bool:
        """Whether the last object is the whole scene (the graph variant "anchors")."""
        count = self.object_count
        return count > 0 and int(self.label[count - 1]) == SCENE_CLASS

    @property
    def found_objects(self) -> int:
        """Number of objects that a detector has found: all but the scene."""
        return self.object_count - self.has_scene

    @property
    def diagonal(self) -> float:
        """Image diagonal, pixels: the unit of edge lengths."""
        return float(np.hypot(self.width, self.height))

    @cached_property
    def edge_key(self) -> NDArray[np.int64]:
        """Every edge as source * n + target, ascending, shape (m,)."""
        key: NDArray[np.int64] = (self.edge[:, 0].astype(np.int64) * self.node_count
                                  + self.edge[:, 1])
        return key

    @cached_property
    def node_digest(self) -> bytes:
        """Digest of all that edge flips leave alone: the key of caches over nodes."""
        digest = hashlib.blake2b(digest_size=16)
        for name in _NODE_ARRAYS:
            digest.update(getattr(self, name).tobytes())
        return digest.digest()

    @cached_property
    def adjacency(self) -> sparse.csr_array:
        """The symmetric 0/1 adjacency matrix A of Eq. (2), float64, shape (n, n)."""
        return self._symmetric(np.ones(self.edge_count))

    def weighted_adjacency(self, scale: float = 0.1) -> sparse.csr_array:
        """
        Return the symmetric matrix of exp(-length / scale), shape (n, n).

        Parameters
        ----------
        scale : float
            Length (over the diagonal) at which the weight has fallen to 1/e.

        """
        return self._symmetric(np.exp(-self.edge_length.astype(np.float64) / scale))

    def _symmetric(self, value: NDArray[np.float64]) -> sparse.csr_array:
        source, target = self.edge[:, 0].astype(np.int64), self.edge[:, 1].astype(np.int64)
        return sparse.csr_array(
            (np.r_[value, value], (np.r_[source, target], np.r_[target, source])),
            shape=(self.node_count, self.node_count))

    def length_between(self, pairs: ArrayLike) -> NDArray[np.float32]:
        """
        Return the true geometric length over the diagonal between the ends of pairs.

        Parameters
        ----------
        pairs : int, (k, 2)
            Node indices.

        """
        ends = np.asarray(pairs, np.int64).reshape(-1, 2)
        offset = self.position[ends[:, 0]] - self.position[ends[:, 1]]
        length: NDArray[np.float32] = (np.hypot(offset[:, 0], offset[:, 1])
                                       / np.float32(self.diagonal)).astype(np.float32)
        return length

    def has_edges(self, pairs: ArrayLike) -> NDArray[np.bool_]:
        """Tell for each of the (k, 2) node pairs whether the graph has that edge."""
        return self._find(self._pair_keys(pairs))[1]

    def _find(self, key: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return where in ``edge_key`` keys are or would be, and whether they are."""
        place = np.searchsorted(self.edge_key, key)
        if not self.edge_count:
            return place, np.zeros(len(key), bool)
        found: NDArray[np.bool_] = self.edge_key[np.minimum(place, self.edge_count - 1)] == key
        return place, found

    def _pair_keys(self, pairs: ArrayLike) -> NDArray[np.int64]:
        ends = np.asarray(pairs, np.int64).reshape(-1, 2)
        if ends.size and (ends.min() < 0 or ends.max() >= self.node_count):
            raise GraphError(f'flip of node {int(ends.max())}: the graph has {self.node_count}')
        if np.any(ends[:, 0] == ends[:, 1]):
            raise GraphError('flip of a node with itself: self-loops are not edges')
        source, target = np.minimum(ends[:, 0], ends[:, 1]), np.maximum(ends[:, 0], ends[:, 1])
        key: NDArray[np.int64] = source * self.node_count + target
        return key

    def flip(self, pairs: ArrayLike) -> MultiTierGraph:
        """
        Return a new graph in which every given pair has changed between edge and no edge.

        One flip of an undirected edge is one edit of the budget (paper, Sec. 3.3). An added edge
        gets its true geometric length.

        Parameters
        ----------
        pairs : int, (k, 2)
            Node indices, in any order, without repeats.

        Raises
        ------
        GraphError
            A pair repeats, joins a node with itself, or names a node that is not there.

        """
        key = np.sort(self._pair_keys(pairs))
        if (key[1:] == key[:-1]).any():
            raise GraphError('a pair is flipped twice: each flip must be another pair')
        place, present = self._find(key)
        keep = np.ones(self.edge_count, bool)
        keep[place[present]] = False
        added = key[~present]
        ends = np.stack([added // self.node_count, added % self.node_count], axis=1)
        merged = np.concatenate([self.edge_key[keep], added])
        order = np.argsort(merged, kind='stable')
        edge = np.concatenate([self.edge[keep], ends.astype(np.uint32)])[order]
        length = np.concatenate([self.edge_length[keep], self.length_between(ends)])[order]
        return self._with_edges(edge, length, merged[order])

    def with_edges(self, edge: NDArray[np.uint32], length: NDArray[np.float32]
                   ) -> MultiTierGraph:
        """Return the graph with other edges, (m, 2), and their lengths; raises GraphError."""
        key: NDArray[np.int64] = edge[:, 0].astype(np.int64) * self.node_count + edge[:, 1]
        graph = self._with_edges(edge, length, key)
        graph._check_edges(self.node_count)
        return graph

    def _with_edges(self, edge: NDArray[np.uint32], length: NDArray[np.float32],
                    key: NDArray[np.int64]) -> MultiTierGraph:
        """Return this graph with other edges; its nodes need no second check, nor digest."""
        graph = object.__new__(MultiTierGraph)
        vars(graph).update({name: getattr(self, name) for name in self.__dataclass_fields__},
                           edge=edge, edge_length=length, edge_key=key,
                           node_digest=self.node_digest)
        graph._check_array('edge', np.uint32, edge.shape)
        graph._check_array('edge_length', np.float32, (len(edge),))
        return graph

    def flips_to(self, other: MultiTierGraph) -> NDArray[np.uint32]:
        """
        Return the pairs, shape (k, 2), whose flip turns this graph's edges into the other's.

        Raises
        ------
        GraphError
            The nodes differ: the graphs are not perturbations of each other.

        """
        if other is self:
            return np.zeros((0, 2), np.uint32)
        if self.node_digest != other.node_digest:
            raise GraphError('the nodes of the two graphs differ: edge flips cannot relate them')
        # Both ascend: the stable sort only merges them. An edge of both comes twice.
        merged = np.sort(np.concatenate([self.edge_key, other.edge_key]), kind='stable')
        twice = np.zeros(len(merged), bool)
        twice[:-1] = merged[1:] == merged[:-1]
        key = merged[~(twice | np.roll(twice, 1))]
        return np.stack([key // max(self.node_count, 1), key % max(self.node_count, 1)],
                        axis=1).astype(np.uint32)

    def __eq__(self, other: object) -> bool:
        """Tell whether every field but the session is equal, arrays byte by byte."""
        if not isinstance(other, MultiTierGraph):
            return NotImplemented
        return all(np.array_equal(getattr(self, name), getattr(other, name))
                   for name in self.__dataclass_fields__ if name != 'session')

    __hash__ = None  # type: ignore[assignment]
