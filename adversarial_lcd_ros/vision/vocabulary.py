"""Visual words: a binary k-means tree with tf-idf weights (paper, Fig. 2a; DBoW)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray
from sklearn.cluster import KMeans

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.graph import DESCRIPTOR_BYTES

ROUNDS = 12


def signs(descriptor: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return descriptors, uint8 (k, 32), as +-1 float32 (k, 256): hamming = (256 - dot) / 2."""
    bits = np.unpackbits(descriptor, axis=1).astype(np.float32)
    return 2 * bits - 1


@dataclass(frozen=True)
class Vocabulary:
    """
    A tree of binary centres; its leaves are the words.

    Attributes
    ----------
    centre : uint8, (depth levels stacked: b + b^2 + .. + b^d, 32)
        Children of node i of a level are i * b .. i * b + b - 1 of the next. Children that no
        training descriptor fell to repeat their first sibling, and are never chosen.
    idf : float32, (b^d,)
        ln(frames / frames with the word); 0 for a word that no training frame has.
    branching, depth : int
        b and d.

    """

    centre: NDArray[np.uint8]
    idf: NDArray[np.float32]
    branching: int
    depth: int

    def __post_init__(self) -> None:
        """Check shapes and unpack the centres."""
        b, d = self.branching, self.depth
        nodes = sum(b ** level for level in range(1, d + 1))
        if b < 2 or d < 1 or self.centre.shape != (nodes, DESCRIPTOR_BYTES) or (
                self.centre.dtype != np.uint8 or self.idf.shape != (b ** d,)
                or not np.isfinite(self.idf).all()):
            raise ModelError(f'vocabulary of branching {b} and depth {d}: found centres '
                             f'{self.centre.shape} and idf {self.idf.shape}')
        levels, start = [], 0
        for level in range(1, d + 1):
            levels.append(signs(self.centre[start:start + b ** level]).reshape(-1, b, 256))
            start += b ** level
        object.__setattr__(self, '_levels', levels)

    def words(self, descriptor: NDArray[np.uint8]) -> NDArray[np.uint32]:
        """
        Return the word of each ORB descriptor by descending the tree.

        Parameters
        ----------
        descriptor : uint8, (k, 32)

        Returns
        -------
        uint32, (k,)

        """
        node = np.zeros(len(descriptor), np.int64)
        bits = signs(descriptor)
        levels: list[NDArray[np.float32]] = self._levels  # type: ignore[attr-defined]
        for centres in levels:
            # Grouped by node: one small matrix product for each node that is reached.
            order = np.argsort(node, kind='stable')
            groups = np.flatnonzero(np.diff(node[order], prepend=-1))
            child = np.zeros(len(node), np.int64)
            for members in np.split(order, groups[1:]):
                if len(members):
                    child[members] = (bits[members] @ centres[node[members[0]]].T).argmax(axis=1)
            node = node * self.branching + child
        return node.astype(np.uint32)

    def vector(self, words: NDArray[np.uint32]) -> tuple[NDArray[np.uint32], NDArray[np.float32]]:
        """
        Return the vBoW vector of a frame: words, ascending, and L1-normalised tf-idf weights.

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
        """Write as npz."""
        np.savez_compressed(path, centre=self.centre, idf=self.idf,
                            shape=np.array([self.branching, self.depth]))

    @classmethod
    def load(cls, path: Path) -> Vocabulary:
        """Read a vocabulary; raises ModelError."""
        try:
            with np.load(path, allow_pickle=False) as arrays:
                branching, depth = (int(value) for value in arrays['shape'])
                return cls(arrays['centre'], arrays['idf'], branching, depth)
        except (OSError, ValueError, KeyError, BadZipFile) as error:
            raise ModelError(f'{path} is no vocabulary: {error!r}; train one with '
                             '"adversarial-lcd train"') from error


def train_vocabulary(frames: Sequence[NDArray[np.uint8]], branching: int = 16, depth: int = 3,
                     seed: int = 42) -> Vocabulary:
    """
    Cluster descriptors into a tree, level by level, and weigh the words by their rarity.

    k-means on +-1 vectors, whose centres are rounded to the nearest binary descriptor (the
    majority of each bit).

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
    descriptor = np.concatenate(list(frames)) if frames else np.zeros((0, 32), np.uint8)
    if len(descriptor) < branching ** depth:
        raise ModelError(f'{len(descriptor)} descriptors for {branching ** depth} words: '
                         'train on more frames, or ask for fewer words')
    rng = np.random.default_rng(seed)
    node = np.zeros(len(descriptor), np.int64)
    levels = []
    for level in range(depth):
        centres = np.zeros((branching ** level, branching, DESCRIPTOR_BYTES), np.uint8)
        child = np.zeros(len(node), np.int64)
        order = np.argsort(node, kind='stable')
        for members in np.split(order, np.flatnonzero(np.diff(node[order])) + 1):
            parent = node[members[0]]
            centres[parent] = _split(descriptor[members], branching, rng)
            child[members] = (signs(descriptor[members])
                              @ signs(centres[parent]).T).argmax(axis=1)
        levels.append(centres.reshape(-1, DESCRIPTOR_BYTES))
        node = node * branching + child
    unweighted = Vocabulary(np.concatenate(levels), np.ones(branching ** depth, np.float32),
                            branching, depth)
    having = np.zeros(branching ** depth)
    for frame in frames:
        having[np.unique(unweighted.words(frame))] += 1
    idf = np.where(having > 0, np.log(len(frames) / np.maximum(having, 1)), 0)
    return Vocabulary(unweighted.centre, idf.astype(np.float32), branching, depth)


def _split(descriptor: NDArray[np.uint8], branching: int,
           rng: np.random.Generator) -> NDArray[np.uint8]:
    """Return b binary centres of descriptors, uint8 (b, 32)."""
    distinct = np.unique(descriptor, axis=0)
    if len(distinct) <= branching:
        return np.concatenate([distinct, np.repeat(distinct[:1], branching - len(distinct), 0)])
    model = KMeans(branching, init='k-means++', n_init=1, max_iter=ROUNDS, algorithm='lloyd',
                   random_state=int(rng.integers(2**31)))
    model.fit(signs(descriptor))
    return np.packbits(model.cluster_centers_ > 0, axis=1)
