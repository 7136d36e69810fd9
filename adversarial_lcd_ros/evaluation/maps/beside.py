# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Replays of one sequence that differ in settings of the detector, side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from adversarial_lcd_ros.config import LabelConfig, LcdConfig
from adversarial_lcd_ros.errors import EvaluationError
from adversarial_lcd_ros.evaluation.maps.cases import title_of
from adversarial_lcd_ros.evaluation.maps.inputs import MapInputs, read_inputs, section_of
from adversarial_lcd_ros.evaluation.results import CONFIGURATION, SUMMARY, read_json
from adversarial_lcd_ros.lcd.defences import defence_names
from adversarial_lcd_ros.sequences.sequence import Progress


def read_beside(folders: Sequence[Path], source: str | None = None, *, labelled: bool = False,
                progress: Progress | None = None) -> MapInputs:
    """
    Return what the maps of one or several results folders are made of.

    Of several, a run is called by its name and by what is no default of its detector and not the
    same in all of them. Whatever else maps need is from the first folder.

    Parameters
    ----------
    folders : sequence of Path
        Of the kind "replay", at least one.
    source, labelled, progress
        As for ``read_inputs``.

    Raises
    ------
    ConfigError
        As ``read_inputs``.
    EvaluationError
        As ``read_inputs``; or the folders are not of one sequence, are labelled by other rules,
        or two have the same detector.

    """
    first, *others = (read_inputs(
        folder, str(read_json(folder / SUMMARY)['sequence']), source,
        labelled=labelled and not number, progress=progress)
        for number, folder in enumerate(folders))
    if not others:
        return first
    configurations = [read_json(folder / CONFIGURATION) for folder in folders]
    for folder, configuration, other in zip(folders[1:], configurations[1:], others, strict=True):
        _check_alike(folders[0], first, folder, other)
        if section_of(configuration, LabelConfig) != section_of(configurations[0], LabelConfig):
            raise EvaluationError(f'{folders[0]} and {folder} are labelled by other rules: what '
                                  'is false in one may be right in the other')
    settings = detector_settings([section_of(configuration, LcdConfig)
                                  for configuration in configurations])
    runs = {title_of(run, setting): replace(declared, setting=setting)
            for setting, inputs in zip(settings, (first, *others), strict=True)
            for run, declared in inputs.runs.items()}
    if len(runs) < sum(len(inputs.runs) for inputs in (first, *others)):
        raise EvaluationError('nothing tells some runs apart: expected replays that differ in a '
                              f'setting of the detector, found {_listed(folders, settings)}')
    return replace(first, runs=runs)


def _check_alike(folder: Path, first: MapInputs, other_folder: Path, other: MapInputs) -> None:
    if (first.name != other.name or not np.array_equal(first.stamp_ns, other.stamp_ns)
            or not np.array_equal(first.truth, other.truth)):
        raise EvaluationError(f'{folder} is of {first.name}, {len(first.frame)} frames, and '
                              f'{other_folder} of {other.name}, {len(other.frame)} frames: '
                              'expected replays of the same frames of one sequence')


def _listed(folders: Sequence[Path], settings: Sequence[str]) -> str:
    return ', '.join(f'{folder} ({setting or "defaults"})'
                     for folder, setting in zip(folders, settings, strict=True))


def detector_settings(detectors: Sequence[LcdConfig]) -> list[str]:
    """Return for each detector, in words, what is not the same in all and is no default."""
    given = [_effective(detector) for detector in detectors]
    default = _effective(LcdConfig())
    differing = [name for name in default if len({values[name] for values in given}) > 1]
    return [', '.join(_in_words(name, values[name]) for name in differing
                      if values[name] != default[name]) for values in given]


def _effective(detector: LcdConfig) -> dict[str, Any]:
    values = {entry.name: asdict(detector)[entry.name] for entry in fields(detector)}
    del values['geometric_check']  # short for the defence
    return {**values, 'defences': tuple(defence_names(detector))}


def _in_words(name: str, value: Any) -> str:
    if name == 'defences':
        return ' and '.join(each.replace('_', ' ') for each in value)
    return str(value) if name == 'target' else f'{name.replace("_", " ")} {value}'
