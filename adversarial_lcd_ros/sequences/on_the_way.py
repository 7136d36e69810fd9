# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Recordings that were not imported: imported on the way, and kept in the user's cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict
import json
from pathlib import Path
from typing import Any

import numpy as np

from adversarial_lcd_ros import sequences
from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.files.digests import digest_of_parts
from adversarial_lcd_ros.paths import cache_folder
from adversarial_lcd_ros.sequences.bag_truth import TRUTH_FILE, TruthOptions
from adversarial_lcd_ros.sequences.bagfile import (
    COMPRESSED_IMAGE,
    IMAGE,
    BagFile,
    is_bag,
)
from adversarial_lcd_ros.sequences.companions import EVIDENCE
from adversarial_lcd_ros.sequences.damage import METADATA
from adversarial_lcd_ros.sequences.importing import (
    GROUND_TRUTH_TOPIC,
    IMAGE_TOPIC,
    import_sequence,
)
from adversarial_lcd_ros.sequences.sequence import Progress

IMPORTS = 'imports'
# The topics that the nodes listen to.
_REPLAYED = {'/image', IMAGE_TOPIC, GROUND_TRUTH_TOPIC}
_BLOCK = 1 << 20


def is_imported(path: Path) -> bool:
    """Tell whether the nodes can replay a path as it is: an imported bag, or one of payloads."""
    if not is_bag(path):
        return False
    with BagFile(path) as bag:
        payloads = set(bag.payload_topics())
        has_images = bool(bag.of_type(IMAGE, COMPRESSED_IMAGE))
        filled = {topic for topic, count in bag.counts.items() if count}
        return not bag.is_ros1 and (filled <= _REPLAYED | payloads if has_images
                                    else bool(payloads))


def imported(source: Path, options: Mapping[str, Any], *,
             tell: Callable[[str], None] = lambda text: None,
             bar: Callable[[str], AbstractContextManager[Progress]] | None = None) -> Path:
    """
    Return a bag that the nodes can replay: the source itself, or what an import makes of it.

    Imports are kept in the user's cache under a digest of the content of the source, the
    options and the code; they may be deleted at any time.

    Parameters
    ----------
    source : Path
        Anything that ``open_sequence`` opens.
    options : mapping
        Arguments of ``open_sequence`` that were given; with any, nothing is taken as it is.
    tell : callable
        Gets a line of text for each step.
    bar : callable, optional
        Returns, for a title, a context that gives what is called with (frames done, frames in
        all).

    Raises
    ------
    SequenceError
        As ``import_sequence``.

    """
    if not source.exists():
        raise SequenceError(f'there is no sequence {source}')
    if not options and is_imported(source):
        return source
    made_of = digest_of_parts(_parts(source, options))
    bag = cache_folder() / IMPORTS / made_of / source.resolve().stem
    if (bag / METADATA).is_file():
        tell(f'{source} was imported before: {bag}')
        return bag
    tell(f'{source} was not imported: importing it to {bag} (kept for the next time)')
    try:
        with (bar or _no_bar)(f'importing {source.name}') as progress:
            done = import_sequence(source, bag, progress=progress, **options)
    except BaseException:
        if bag.parent.is_dir() and not any(bag.parent.iterdir()):
            bag.parent.rmdir()
        raise
    tell(f'{done.frames} frames; {done.coverage}')
    return bag


def _no_bar(title: str) -> AbstractContextManager[Progress]:
    return nullcontext(lambda done, total: None)


def _parts(source: Path, options: Mapping[str, Any]) -> Iterator[bytes]:
    """Yield all that an import is made of, in blocks."""
    words = {name: str(value) for name, value in options.items() if name != 'truth'}
    truth = asdict(options.get('truth') or TruthOptions())
    extrinsics = truth.pop('extrinsics')
    yield json.dumps([source.name, words, truth], sort_keys=True).encode()
    yield b'' if extrinsics is None else np.asarray(extrinsics, np.float64).tobytes()
    files = _files(source)
    named = Path(words.get('ground_truth', ''))
    for path in (*files, *([named] if named.is_file() else []), *_code()):
        yield path.name.encode()
        try:
            with path.open('rb') as stream:
                while block := stream.read(_BLOCK):
                    yield block
        except OSError as error:
            raise SequenceError(f'{path} cannot be read: {error}') from error


def _files(source: Path) -> list[Path]:
    if source.is_dir():
        return [path for path in sorted(source.rglob('*'))
                if path.is_file() and not path.name.startswith('.')]
    return [source, *(path for name in (TRUTH_FILE, *EVIDENCE)
                      if (path := source.parent / name).is_file())]


def _code() -> list[Path]:
    return [path for folder in sequences.__path__ for path in sorted(Path(folder).rglob('*.py'))]
