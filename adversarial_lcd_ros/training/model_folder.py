# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A folder of trained artefacts: complete with its card, or not there."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
import hashlib
from pathlib import Path
import tempfile
from typing import Any

from adversarial_lcd_ros.errors import FileError, ModelError
from adversarial_lcd_ros.files.reading import read_json
from adversarial_lcd_ros.paths import SURROGATE_DATA, VOCABULARY
from adversarial_lcd_ros.sequences.part import SequencePart

MODEL_CARD = 'MODEL_CARD.json'
_MAX_CARD_BYTES = 1 << 22
_TARGET, _NETWORK = 'target_{}.json', 'target_{}.onnx'
_OURS = (VOCABULARY, SURROGATE_DATA, MODEL_CARD, _TARGET.format('*'), _NETWORK.format('*'))


def decision_file(target: str) -> str:
    """Return the name of the file with the decision of a target."""
    return _TARGET.format(target)


def network_file(target: str) -> str:
    """Return the name of the file with the network of a target that has one."""
    return _NETWORK.format(target)


@contextmanager
def model_folder(output: Path, *, overwrite: bool = False) -> Iterator[Path]:
    """
    Yield a hidden folder to fill, which takes its place when the block ends without an error.

    Parameters
    ----------
    output : Path
        Where it is to be.
    overwrite : bool
        Replace the artefacts of an earlier training; other files of the folder stay.

    Raises
    ------
    ModelError
        The folder is there and not empty (without ``overwrite``), or cannot be written.

    """
    output = output.resolve()
    _check_free(output, overwrite)
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f'.{output.name}.', suffix='.partial',
                                         dir=output.parent) as hidden:
            # The temporary folder is its owner's alone; the one below has the usual mode.
            work = Path(hidden) / output.name
            work.mkdir()
            yield work
            _check_free(output, overwrite)
            _move(work, output)
    except OSError as error:
        raise ModelError(f'{output} cannot be written: {error}') from error


def _check_free(output: Path, overwrite: bool) -> None:
    if output.exists() and not output.is_dir():
        raise ModelError(f'{output} is a file: expected a folder, or nothing')
    if not overwrite and output.is_dir() and any(output.iterdir()):
        raise ModelError(f'{output} exists already: choose another folder, or replace the '
                         'artefacts in it with --overwrite')


def _move(work: Path, output: Path) -> None:
    if not output.exists():
        work.rename(output)
        return
    # The card goes first and comes last: as long as it is there, all files belong together.
    (output / MODEL_CARD).unlink(missing_ok=True)
    for old in [file for pattern in _OURS for file in output.glob(pattern)]:
        old.unlink()
    for made in sorted(work.iterdir(), key=lambda file: file.name == MODEL_CARD):
        made.replace(output / made.name)


def file_digests(folder: Path) -> dict[str, dict[str, Any]]:
    """Return size and SHA-256 of every file of a folder, by name."""
    return {file.name: {'bytes': file.stat().st_size,
                        'sha256': hashlib.sha256(file.read_bytes()).hexdigest()}
            for file in sorted(folder.iterdir())}


def trained_on(decision: Path, source: str,
               scored: tuple[float, float] = (0.0, 1.0)) -> bool | None:
    """
    Tell whether a decision was trained on frames of a sequence.

    Parameters
    ----------
    decision : Path
        File beside which its card is.
    source : str
        ``PATH`` or ``PATH@FROM:TO``; sequences are told by the name of their folder.
    scored : (float, float)
        From and to which fraction of that part.

    Returns
    -------
    bool or None
        None if there is no card to tell.

    """
    try:
        card = read_json(decision.parent / MODEL_CARD, _MAX_CARD_BYTES)
        sequences = [(str(entry['name']), float(entry['part'][0]), float(entry['part'][1]))
                     for entry in card['sequences']]
    except (FileError, ValueError, LookupError, TypeError, OverflowError):
        return None
    part = SequencePart.parse(source)
    length = part.stop - part.start
    begin, end = (part.start + length * fraction for fraction in scored)
    name = part.path.resolve().stem
    return any(trained == name and start < end and begin < stop
               for trained, start, stop in sequences)
