# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The pictures of a report: query, match and attacked graph of telling frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.attack.images.posting import Posting
from adversarial_lcd_ros.config import ReplayConfig
from adversarial_lcd_ros.evaluation.pictures import Picture
from adversarial_lcd_ros.evaluation.replay.findings import strongest
from adversarial_lcd_ros.evaluation.replay.processes import Recording
from adversarial_lcd_ros.evaluation.replay.records import CLEAN, QueryRecord, runs_of
from adversarial_lcd_ros.evaluation.replay.telling import choose_records, describe
from adversarial_lcd_ros.graph_sequences.opening import GraphSequence
from adversarial_lcd_ros.sequences import Sequence as CameraSequence
from adversarial_lcd_ros.vision.panels import draw_attack

PICTURES = 6
BLANK_GREY = 64


def telling_pictures(sequence: CameraSequence | GraphSequence, clean: Recording,
                     runs: Mapping[str, Recording], records: Sequence[QueryRecord],
                     summary: Mapping[str, Any],
                     posters: Mapping[str, ReplayConfig] | None = None) -> list[Picture]:
    """
    Return query, match and attacked graph of telling frames of the strongest attack.

    ``posters``: how runs were replayed in which a poster hung; their pictures show it.
    """
    if not runs:
        return []
    attack = strongest(summary)
    name = str(attack['name']) if attack else CLEAN
    by_run = runs_of(records)
    chosen = choose_records(by_run[name], PICTURES)
    wanted = {record.stamp_ns for record in chosen} | {
        clean.clean[record.match_frame].stamp_ns for record in chosen
        if record.match_frame is not None}
    image = _images(sequence, wanted)
    run, hung = runs[name], (posters or {}).get(name)
    if hung is not None and not isinstance(sequence, GraphSequence):
        posting = Posting(hung, int(sequence.stamps_ns[0]))
        image = {stamp: posting.on_pixels(pixels, stamp) for stamp, pixels in image.items()}
    pictures = []
    for record in chosen:
        title, caption = describe(record, by_run[CLEAN][record.frame])
        match = run.clean[record.match_frame if record.match_frame is not None
                          else record.frame]
        pictures.append(Picture(f'{title} ({name})', caption, np.asarray(draw_attack(
            image[record.stamp_ns], run.clean[record.frame], image[match.stamp_ns], match,
            run.forwarded[record.frame]), np.uint8)))
    return pictures


def _images(sequence: CameraSequence | GraphSequence,
            wanted: set[int]) -> dict[int, NDArray[np.uint8]]:
    """Return the frames with these stamps; blank ones where there are only graphs."""
    if isinstance(sequence, GraphSequence):
        width, height = sequence.image_size
        return dict.fromkeys(wanted, np.full((height, width, 3), BLANK_GREY, np.uint8))
    return {frame.stamp_ns: frame.image() for frame in sequence.frames()
            if frame.stamp_ns in wanted}
