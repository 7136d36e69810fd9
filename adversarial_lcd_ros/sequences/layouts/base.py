# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the layouts of published recordings share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from adversarial_lcd_ros.errors import SequenceError
from adversarial_lcd_ros.poses.frame_poses import read_poses
from adversarial_lcd_ros.poses.pose_files import mounted
from adversarial_lcd_ros.poses.trajectory import Trajectory
from adversarial_lcd_ros.sequences.sequence import Sequence

NO_TRUTH = 'none'


@dataclass(frozen=True)
class Options:
    """
    How a recording is opened.

    Attributes
    ----------
    camera : str or None
        Which of its cameras; None: the layout's own choice, which a note tells.
    ground_truth : Path, str or None
        A file of poses, 'none', or None: what the recording brings along.
    rate_hz : float or None
        Of recordings without stamps.
    has_extrinsics : bool
        The caller knows where the camera sits, and mounts the poses himself.

    """

    camera: str | None = None
    ground_truth: Path | str | None = None
    rate_hz: float | None = None
    has_extrinsics: bool = False

    def trajectory(self, stamps_ns: ArrayLike, own: Callable[[], Trajectory | None],
                   mount: Callable[[], NDArray[np.float64]] | None = None) -> Trajectory | None:
        """
        Return the ground truth of frames at some stamps.

        Parameters
        ----------
        stamps_ns : int64, (n,)
        own : callable
            Reads the poses of the recording.
        mount : callable, optional
            Reads where the camera sits in their frame, float64 (4, 4); not asked where the
            caller knows.

        """
        if self.ground_truth == NO_TRUTH:
            return None
        if self.ground_truth is not None:
            return read_poses(Path(self.ground_truth), stamps_ns)
        poses = own()
        if poses is None or mount is None or self.has_extrinsics:
            return poses
        return mounted(poses, mount())


@dataclass(frozen=True)
class Layout:
    """
    A layout in which recordings are published.

    Attributes
    ----------
    name : str
    sign : str
        The files that name it, for people.
    find : callable
        Returns the folder of the recording that a path names, and the camera if the path names
        one; None where the path is no such recording. Looks at names alone.
    open : callable
        Opens the recording in that folder.
    has_stamps : bool
        A rate would contradict its stamps.

    """

    name: str
    sign: str
    find: Callable[[Path], tuple[Path, str | None] | None]
    open: Callable[[Path, Options], Sequence]
    has_stamps: bool = True


def choose_camera(folder: Path, layout: str, cameras: list[str],
                  wanted: str | None) -> tuple[str, tuple[str, ...]]:
    """
    Return the camera to take, and what is to be said about the others.

    Parameters
    ----------
    folder : Path
    layout : str
        Its name, for people.
    cameras : list of str
        Those of the recording, the usual one first; at least one.
    wanted : str or None
        The one that was asked for.

    Raises
    ------
    SequenceError
        The camera that was asked for is not there.

    """
    if wanted is not None and wanted not in cameras:
        raise SequenceError(f'{folder} ({layout}) has no camera {wanted!r}: expected one of '
                            f'{", ".join(cameras)}')
    chosen = wanted or cameras[0]
    others = [camera for camera in cameras if camera != chosen]
    if wanted or not others:
        return chosen, ()
    return chosen, (f'{folder.name} ({layout}): frames of {chosen}; not taken: '
                    f'{", ".join(others)} (--camera)',)
