# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Which maps are made of a replay, and of which closures each."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.config import MapConfig
from adversarial_lcd_ros.evaluation.maps.cases import (
    CONSISTENT,
    ESSENTIAL,
    WHOLE,
    YOUNG,
    Case,
    choice_of,
)
from adversarial_lcd_ros.evaluation.maps.inputs import LEAST_FRAMES, Declared, MapInputs
from adversarial_lcd_ros.slam.closures import Pairs

# Sweeps: how much the odometry drifts, false closures added, and right ones left out.
DRIFTS = (3.0, 5.0)
ADDED = (0, 1, 3, 10, 30)
MISSING = (0.0, 0.5, 0.9, 1.0)


def plan_cases(inputs: MapInputs, config: MapConfig, *, sweeps: bool,
               claims: Sequence[str] = ()) -> Iterator[Case]:
    """
    Yield the maps to be made, draw by draw.

    Parameters
    ----------
    inputs : MapInputs
    config : MapConfig
    sweeps : bool
        Vary the drift, add false closures, and leave out right ones, too.
    claims : sequence of str
        Names of ``CLAIMS`` beside those of the settings, for the runs that can have them.

    """
    whole = len(inputs.frame)
    young = min(config.young_frames or inputs.first_loop or whole, whole)
    # Where the first loop comes at once, or never, there is one map.
    stages = ([(YOUNG, young)] if LEAST_FRAMES <= young < whole else []) + [(WHOLE, whole)]
    for draw in range(config.draws):
        for stage, frames in stages:
            for declared in inputs.runs.values():
                yield from _as_declared(declared, stage, frames, draw, claims)
            if sweeps:
                yield from _swept(inputs, stage, frames, draw, claims)
        if sweeps:
            clean = _first(inputs)
            for drift in (1.0, *DRIFTS):
                for missing in MISSING:
                    yield Case(clean.run, WHOLE, whole, drift, draw, missing=missing,
                               setting=clean.setting)


def _as_declared(declared: Declared, stage: str, frames: int, draw: int,
                 claims: Sequence[str]) -> Iterator[Case]:
    case = Case(declared.run, stage, frames, 1.0, draw, setting=declared.setting)
    yield case
    if declared.stands is not None:
        yield replace(case, checked=True)
    for name in claims:
        if can_claim(declared, name):
            yield replace(case, claims=name)


def can_claim(declared: Declared, claims: str) -> bool:
    """
    Tell whether closures of a run can claim something.

    Features that an attack changed are not kept with the results; and one false closure agrees
    with itself, whatever it claims.
    """
    if claims == ESSENTIAL:
        return declared.is_clean
    return claims != CONSISTENT or int(declared.pairs.is_false.sum()) > 1


def _first(inputs: MapInputs) -> Declared:
    return next(iter(inputs.runs.values()))  # a clean run


def _swept(inputs: MapInputs, stage: str, frames: int, draw: int,
           claims: Sequence[str]) -> Iterator[Case]:
    clean = _first(inputs)
    worst = max((run for run in inputs.runs.values() if run.setting == clean.setting),
                key=lambda run: int(run.pairs.is_false.sum()))
    for drift in DRIFTS:
        for declared in [clean] + [worst] * (worst is not clean):
            for name in ('', *(name for name in claims if can_claim(declared, name))):
                yield Case(declared.run, stage, frames, drift, draw, setting=declared.setting,
                           claims=name)
    for drift in (1.0, *DRIFTS):
        for added in ADDED if drift == 1.0 else (ADDED[0], ADDED[-1]):
            for consistent in (False, True)[:1 + (added > 1)]:
                yield Case(clean.run, stage, frames, drift, draw, added, consistent,
                           setting=clean.setting)


def pairs_of(inputs: MapInputs, case: Case, config: MapConfig) -> Pairs:
    """Return the closures of a case, right and false, of the whole sequence."""
    declared = inputs.runs[case.declared]
    pairs = declared.pairs
    if case.checked and declared.stands is not None:
        return pairs.chosen(declared.stands)
    if case.added is None and case.missing is None:
        return pairs
    right = pairs.chosen(~pairs.is_false)
    rng = choice_of(config, case.draw)
    if case.missing is not None:
        return right.chosen(rng.permutation(len(right)) >= round(case.missing * len(right)))
    elsewhere = np.zeros((0, 0), bool) if inputs.elsewhere is None else inputs.elsewhere
    false = _false_pairs(elsewhere[:case.frames], int(case.added or 0), rng,
                         consistent=case.consistent)
    return Pairs(np.r_[right.query, false[:, 0]], np.r_[right.match, false[:, 1]],
                 np.r_[right.is_false, np.ones(len(false), bool)])


def _false_pairs(elsewhere: NDArray[np.bool_], count: int, rng: np.random.Generator, *,
                 consistent: bool) -> NDArray[np.int64]:
    """Return pairs (query, match) of different places: scattered, or a stretch and its double."""
    table = np.argwhere(elsewhere)
    if not consistent or not len(table):
        chosen = rng.permutation(len(table))[:count]
        return table[np.sort(chosen)].astype(np.int64)
    best = table[:0]
    for start in table[rng.permutation(len(table))[:200]]:
        run = start + np.arange(count)[:, None]
        run = run[(run < elsewhere.shape).all(axis=1)]
        run = run[elsewhere[run[:, 0], run[:, 1]]]
        best = run if len(run) > len(best) else best
        if len(best) == count:
            break
    return best.astype(np.int64)
