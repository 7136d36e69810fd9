# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Where the files that travel with the package, and those it provisions, are found."""

from __future__ import annotations

import os
from pathlib import Path

from adversarial_lcd_ros.errors import ModelError

PACKAGE = 'adversarial_lcd_ros'
OBJECT_MODEL = 'picodet_s_coco.onnx'
VOCABULARY, SURROGATE_DATA = 'vocabulary.npz', 'surrogate_data.npz'
_HERE = Path(__file__).resolve().parent


def share_path(relative: str) -> Path:
    """
    Return a file or folder that is installed under share/adversarial_lcd_ros.

    In a source checkout (also an editable or ``--symlink-install`` one) it is the checkout's
    own; otherwise that of the installation prefix around this package.

    Raises
    ------
    ModelError
        It is in neither place: the installation is incomplete.

    """
    checkout = _HERE.parent
    places = [checkout / relative] if (checkout / 'package.xml').is_file() else []
    places += [parent / 'share' / PACKAGE / relative for parent in _HERE.parents]
    for place in places:
        if place.exists():
            return place
    raise ModelError(f'{relative} is not installed: looked around {_HERE}; install the package '
                     'with "pip install ." or "colcon build"')


def model_path(name: str) -> Path:
    """Return an artefact that ships inside the package (vocabulary, trained targets)."""
    path = _HERE / 'models' / name
    if not path.is_file():
        shipped = ', '.join(sorted(p.name for p in path.parent.glob('*.*'))) or 'none'
        raise ModelError(f'no shipped model {name!r}; there are: {shipped}')
    return path


def target_path(chosen: str, target: str) -> Path:
    """
    Return the file of a trained target.

    Parameters
    ----------
    chosen : str
        That file, or a folder of a training that holds it; empty: the one that ships.
    target : str

    Raises
    ------
    ModelError
        The folder was trained without that target.

    """
    name = f'target_{target}.json'
    if not chosen:
        return model_path(name)
    path = Path(chosen)
    if not path.is_dir():
        return path
    if not (path / name).is_file():
        there = ', '.join(sorted(file.stem.removeprefix('target_')
                                 for file in path.glob('target_*.json'))) or 'none'
        raise ModelError(f'{path} has no decision for the target {target}; those trained there: '
                         f'{there}. Choose one of them, or train it with "adversarial-lcd train '
                         f'... --targets {target}"')
    return path / name


def cache_folder() -> Path:
    """
    Return the folder of provisioned files; ADVERSARIAL_LCD_CACHE overrides the XDG default.

    Raises
    ------
    ModelError
        The user has no home, and nothing else is said.

    """
    chosen = os.environ.get('ADVERSARIAL_LCD_CACHE')
    if chosen:
        return Path(chosen)
    base = os.environ.get('XDG_CACHE_HOME')
    if base:
        return Path(base) / PACKAGE
    try:
        return Path.home() / '.cache' / PACKAGE
    except RuntimeError as error:
        raise ModelError('this user has no home folder to keep models and graphs in: set '
                         'ADVERSARIAL_LCD_CACHE to a folder that can be written') from error


def object_model_path() -> Path:
    """Return the object model that ships or, where none does, where it would be provisioned."""
    shipped = _HERE / 'models' / OBJECT_MODEL
    return shipped if shipped.is_file() else provisioned_model_path()


def provisioned_model_path() -> Path:
    """Return where "adversarial-lcd fetch-model" puts an object model; it may not be there."""
    return cache_folder() / 'models' / OBJECT_MODEL
