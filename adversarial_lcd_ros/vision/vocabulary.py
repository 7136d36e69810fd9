# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Visual words: a tree of binary centres with tf-idf weights (paper, Fig. 2a; DBoW)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.compiled.hamming import descend, lanes, nearest
from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.arrays import read_npz
from adversarial_lcd_ros.files.writing import replacing
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES

ROUNDS = 12
_MAX_BRANCHING, _MAX_DEPTH = 1024, 24
# Descriptors that are unpacked at a time: bounds the memory of training.
_CHUNK = 1 << 15


@dataclass(frozen=True, eq=False)
class Vocabulary:
    """
    A tree of binary centres; its leaves are the words.

    Attributes
    ----------
    centre : uint8, (b + b^2 + .. + b^d, 32)
        Levels one after the other. Children of node i of a level are i * b .. i * b + b - 1 of
        the next.
    idf : float32, (b^d,)
        ln(frames / frames with the word); 0 for a word that no training frame has.
    branching, depth : int
        b and d.

    Raises
    ------
    ModelError
        Shapes, types or values do not make a tree.

    """

    centre: NDArray[np.uint8]
    idf: NDArray[np.float32]
    branching: int
    depth: int

    def __post_init__(self) -> None:
        """Check shapes, types and values."""
        b, d = self.branching, self.depth
        # Bounds first: b^d of a hostile file takes for ever to compute.
        if not (2 <= b <= _MAX_BRANCHING and 1 <= d <= _MAX_DEPTH):
            raise ModelError(f'vocabulary of branching {b} and depth {d}: expected 2 to '
                             f'{_MAX_BRANCHING} and 1 to {_MAX_DEPTH}')
        if self.centre.dtype != np.uint8 or self.centre.shape != (
                sum(b ** level for level in range(1, d + 1)), DESCRIPTOR_BYTES):
            raise ModelError(f'vocabulary of branching {b} and depth {d}: found centres '
                             f'{self.centre.dtype}{self.centre.shape}')
        if self.idf.dtype != np.float32 or self.idf.shape != (b ** d,) or not (
                np.isfinite(self.idf).all() and (self.idf >= 0).all()):
            raise ModelError(f'vocabulary of {b ** d} words: found idf {self.idf.dtype}'
                             f'{self.idf.shape}; expected finite float32 >= 0 for each')

    @cached_property
    def _lanes(self) -> NDArray[np.uint64]:
        return lanes(self.centre)

    def words(self, descriptor: NDArray[np.uint8]) -> NDArray[np.uint32]:
        """
        Return the word of each ORB descriptor by descending the tree.

        At every level the nearest child by Hamming distance is taken, the first of equals.

        Parameters
        ----------
        descriptor : uint8, (k, 32)

        Returns
        -------
        uint32, (k,)

        """
        leaf: NDArray[np.int64] = descend(lanes(descriptor), self._lanes, self.branching,
                                          self.depth)
        return leaf.astype(np.uint32)

    def vector(self, words: NDArray[np.uint32]) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        """
        Return the vBoW vector of a frame: words, ascending, and L1-normalised tf-idf weights.

        Words without weight (idf 0) are left out.

        Parameters
        ----------
        words : uint32, (k,)
            Of all features of the frame.

        """
        word, count = np.unique(words, return_counts=True)
        weight = count * self.idf[word]
        known = weight > 0
        word, weight = word[known], weight[known]
        total = weight.sum()
        return word.astype(np.uint32), (weight / (total or 1)).astype(np.float32)

    def save(self, path: Path) -> None:
        """Write as npz; same vocabulary, same bytes."""
        with replacing(path) as stream:
            np.savez_compressed(stream, centre=self.centre, idf=self.idf,
                                shape=np.array([self.branching, self.depth]))

    @classmethod
    def load(cls, path: Path) -> Vocabulary:
        """Read a vocabulary that ``save`` wrote; raises ModelError."""
        try:
            arrays = read_npz(path, ('shape', 'centre', 'idf'))
            branching, depth = (int(value) for value in arrays['shape'])
            return cls(arrays['centre'], arrays['idf'], branching, depth)
        except (FileError, ModelError, TypeError, ValueError, OverflowError) as error:
            raise ModelError(f'{path} is no vocabulary: {error}; train one with '
                             '"adversarial-lcd train"') from error


def train_vocabulary(frames: Sequence[NDArray[np.uint8]], branching: int = 16, depth: int = 3,
                     seed: int = 42) -> Vocabulary:
    """
    Cluster descriptors into a tree, level by level, and weigh the words by their rarity.

    k-majority: k-means under the Hamming distance, where a centre has each bit as most of its
    members have it. Everything is counted in integers: neither the machine nor its number of
    threads changes the outcome.

    Parameters
    ----------
    frames : sequence of uint8, (k, 32)
        Descriptors of each training frame.
    branching, depth : int
        b children a node, d levels: b^d words.
    seed : int
        Same seed, same vocabulary.

    Raises
    ------
    ModelError
        There are fewer descriptors than words.

    """
    descriptor = np.concatenate(list(frames)) if frames else np.zeros((0, DESCRIPTOR_BYTES),
                                                                      np.uint8)
    if len(descriptor) < branching ** depth:
        raise ModelError(f'{len(descriptor)} descriptors for {branching ** depth} words: '
                         'train on more frames, or ask for fewer words')
    rng = np.random.default_rng(seed)
    node: NDArray[np.int64] = np.zeros(len(descriptor), np.int64)
    levels = []
    for level in range(depth):
        centre = np.zeros((branching ** level, branching, DESCRIPTOR_BYTES), np.uint8)
        child = np.zeros_like(node)
        order = np.argsort(node, kind='stable')
        for members in np.split(order, np.flatnonzero(np.diff(node[order])) + 1):
            parent = node[members[0]]
            centre[parent], child[members] = _cluster(descriptor[members], branching, rng)
        levels.append(centre.reshape(-1, DESCRIPTOR_BYTES))
        node = node * branching + child
    size = [len(frame) for frame in frames]
    having = np.zeros(branching ** depth, np.int64)
    for words in np.split(node, np.cumsum(size)[:-1]):
        having[np.unique(words)] += 1
    idf = np.where(having > 0, np.log(len(frames) / np.maximum(having, 1)), 0)
    return Vocabulary(np.concatenate(levels), idf.astype(np.float32), branching, depth)


def _cluster(descriptor: NDArray[np.uint8], count: int, rng: np.random.Generator
             ) -> tuple[NDArray[np.uint8], NDArray[np.int64]]:
    """
    Return centres, uint8 (count, 32), and which of them is nearest to each descriptor, (k,).

    Where descriptors are too few for so many centres, the last ones repeat the first.
    """
    bits = lanes(descriptor)
    centre = _seeds(descriptor, bits, count, rng)
    member, distance = nearest(bits, lanes(centre))
    for _ in range(ROUNDS):
        before = member
        centre = _majorities(descriptor, member, centre)
        for empty in np.setdiff1d(np.arange(count), member):
            farthest = distance.argmax()
            if not distance[farthest]:
                centre[empty] = centre[0]
                continue
            centre[empty], distance[farthest] = descriptor[farthest], 0
        member, distance = nearest(bits, lanes(centre))
        if np.array_equal(member, before):
            break
    return centre, member


def _seeds(descriptor: NDArray[np.uint8], bits: NDArray[np.uint64], count: int,
           rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return first centres by k-means++: far ones are likelier (distances of bits are squares)."""
    chosen = [int(rng.integers(len(descriptor)))]
    _, distance = nearest(bits, lanes(descriptor[chosen]))
    while len(chosen) < count:
        total = np.cumsum(distance, dtype=np.int64)
        if not total[-1]:
            chosen.append(chosen[0])
            continue
        chosen.append(int(np.searchsorted(total, rng.integers(total[-1]), 'right')))
        distance = np.minimum(distance, nearest(bits, lanes(descriptor[chosen[-1:]]))[1])
    return descriptor[chosen]


def _majorities(descriptor: NDArray[np.uint8], member: NDArray[np.int64],
                centre: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return the centres of the members; one without members stays."""
    count = np.bincount(member, minlength=len(centre))
    ones = np.zeros((len(centre), 8 * DESCRIPTOR_BYTES), np.int64)
    for index in np.flatnonzero(count):
        chosen = np.flatnonzero(member == index)
        for start in range(0, len(chosen), _CHUNK):
            bits = np.unpackbits(descriptor[chosen[start:start + _CHUNK]], axis=1)
            ones[index] += bits.sum(axis=0, dtype=np.int64)
    moved = np.packbits(2 * ones > count[:, None], axis=1)
    return np.where(count[:, None] > 0, moved, centre)
