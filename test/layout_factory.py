# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tiny recordings in the layouts of published data sets, for tests."""

import bag_factory as make
import cv2
import numpy as np
from scipy.spatial.transform import Rotation

COUNT = 4
# Made up, and turning every axis: a camera on its body.
MOUNT = np.eye(4)
MOUNT[:3, :3] = Rotation.from_quat([0.1, -0.7, 0.1, 0.7]).as_matrix()
MOUNT[:3, 3] = 0.1, -0.2, 0.3


def poses(count=COUNT, seed=0):
    """Return made-up poses, float64 (count, 4, 4)."""
    matrices = np.tile(np.eye(4), (count, 1, 1))
    matrices[:, :3, :3] = Rotation.random(count, random_state=seed).as_matrix()
    matrices[:, :3, 3] = np.random.default_rng(seed).normal(size=(count, 3))
    return matrices


def write_rows(path, rows, separator=' '):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text('\n'.join(separator.join(
        str(value) if isinstance(value, str | int) else f'{value:.15g}' for value in row)
        for row in rows) + '\n')


def pictures(folder, names, seed=0):
    folder.mkdir(parents=True, exist_ok=True)
    for number, name in enumerate(names):
        (folder / name).write_bytes(
            make.encoded(make.picture(seed + number), f'.{name.rsplit(".", 1)[1]}'))


def depths(folder, names):
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        (folder / name).write_bytes(make.encoded(
            np.full((make.HEIGHT, make.WIDTH), 1500, np.uint16), '.png'))


def quaternion_rows(stamps, body, order):
    turns = Rotation.from_matrix(body[:, :3, :3]).as_quat()[:, order]
    return [[stamp, *place, *turn] for stamp, place, turn in
            zip(stamps, body[:, :3, 3].tolist(), turns.tolist(), strict=True)]


def euroc(path, truth='state_groundtruth_estimate0', body=None):
    """Write two cameras on a body."""
    body, stamps = poses() if body is None else body, make.stamps(COUNT)
    for number, camera in enumerate(('cam0', 'cam1')):
        folder = path / 'mav0' / camera
        pictures(folder / 'data', [f'{stamp}.png' for stamp in stamps], 10 * number)
        write_rows(folder / 'data.csv', [('#timestamp [ns]', 'filename'),
                                         *((stamp, f'{stamp}.png') for stamp in stamps)], ',')
        numbers = ', '.join(f'{value:.15g}' for value in MOUNT.ravel())
        (folder / 'sensor.yaml').write_text(
            'sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n'
            f'  data: [{numbers}]\nrate_hz: 20\nintrinsics: [45.5, 45, 32, 24]\n')
    write_rows(path / 'mav0' / truth / 'data.csv',
               [['#timestamp', 'x'], *quaternion_rows(stamps, body, [3, 0, 1, 2])], ',')
    return path


BASELINE = 0.54


def kitti(path):
    """Write sequence 07 with both grey cameras and the left colour one; return its folder."""
    folder = path / 'sequences' / '07'
    for seed, camera in enumerate(('image_0', 'image_1', 'image_2')):
        pictures(folder / camera, [f'{k:06d}.png' for k in range(COUNT)], 10 * seed)
    write_rows(folder / 'times.txt', [[0.1 * k] for k in range(COUNT)])
    shifts = {'P0:': 0.0, 'P1:': -BASELINE, 'P2:': 0.06}
    write_rows(folder / 'calib.txt', [
        [name, 50.5, 0, 32, 50.5 * shift, 0, 50.5, 24, 0, 0, 0, 1, 0]
        for name, shift in shifts.items()])
    write_rows(path / 'poses' / '07.txt', poses()[:, :3].reshape(-1, 12).tolist())
    return folder


def replica(path):
    room = path / 'room0'
    pictures(room / 'results', [f'frame{k:06d}.jpg' for k in range(COUNT)])
    depths(room / 'results', [f'depth{k:06d}.png' for k in range(COUNT)])
    write_rows(room / 'traj.txt', poses().reshape(-1, 16).tolist())
    (path / 'cam_params.json').write_text('{"camera": {"w": 64, "h": 48, "fx": 48.25}}')
    return room


def scannet(path):
    """Write a scene whose frame 1 has no pose."""
    pictures(path / 'color', [f'{k}.jpg' for k in range(COUNT)])
    depths(path / 'depth', [f'{k}.png' for k in range(COUNT)])
    for number, pose in enumerate(poses()):
        write_rows(path / 'pose' / f'{number}.txt',
                   (np.full((4, 4), -np.inf) if number == 1 else pose).tolist())
    write_rows(path / 'intrinsic' / 'intrinsic_color.txt',
               [[51.5, 0, 32, 0], [0, 51, 24, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
    return path


def openloris(path):
    """Write a colour and a fisheye camera on a robot's base, with a link between."""
    stamps = [make.seconds(stamp) for stamp in make.stamps(COUNT)]
    for seed, camera in enumerate(('color', 'fisheye1')):
        pictures(path / camera, [f'{stamp}.png' for stamp in stamps], 10 * seed)
        write_rows(path / f'{camera}.txt', [('#Time', 'data'), *(
            (stamp, f'{camera}/{stamp}.png') for stamp in stamps)])
    write_rows(path / 'groundtruth.txt', quaternion_rows(stamps, poses(), [0, 1, 2, 3]))
    turn = np.eye(4)
    turn[:3, :3] = Rotation.from_quat([0.5, 0.5, 0.5, 0.5]).as_matrix()
    storage = cv2.FileStorage(str(path / 'trans_matrix.yaml'), cv2.FILE_STORAGE_WRITE)
    storage.startWriteStruct('trans_matrix', cv2.FileNode_SEQ)
    for parent, child, matrix in (('base_link', 'd400_link', MOUNT),
                                  ('d400_link', 'd400_color_optical_frame', turn)):
        storage.startWriteStruct('', cv2.FileNode_MAP)
        storage.write('parent_frame', parent)
        storage.write('child_frame', child)
        storage.write('matrix', matrix)
        storage.endWriteStruct()
    storage.endWriteStruct()
    storage.release()
    storage = cv2.FileStorage(str(path / 'sensors.yaml'), cv2.FILE_STORAGE_WRITE)
    storage.startWriteStruct('d400_color_optical_frame', cv2.FileNode_MAP)
    storage.write('intrinsics', np.array([[61.5, 32.0, 61.0, 24.0]]))
    storage.endWriteStruct()
    storage.release()
    return path, MOUNT @ turn


def video(path, count=COUNT, rate_hz=10.0):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*'mp4v'), rate_hz,
                             (make.WIDTH, make.HEIGHT))
    for number in range(count):
        writer.write(make.picture(number))
    writer.release()
    return path
