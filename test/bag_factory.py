# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Tiny sequences of every supported source, for tests."""

import cv2
import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from adversarial_lcd_ros.messages.codec import typestore

WIDTH, HEIGHT = 64, 48
START_NS, PERIOD_NS = 1_305_031_229_528_748_000, 33_333_333
IMAGE, COMPRESSED = 'sensor_msgs/msg/Image', 'sensor_msgs/msg/CompressedImage'
POSE = 'geometry_msgs/msg/PoseStamped'
POSE_COVARIANCE = 'geometry_msgs/msg/PoseWithCovarianceStamped'
ODOMETRY, PATH = 'nav_msgs/msg/Odometry', 'nav_msgs/msg/Path'
TRANSFORM, TF = 'geometry_msgs/msg/TransformStamped', 'tf2_msgs/msg/TFMessage'
CAMERA_INFO = 'sensor_msgs/msg/CameraInfo'
TUM_TF = 'tf/msg/tfMessage'
TUM_TOPIC = '/camera/rgb/image_color'
TUM_CAMERA = '/openni_rgb_optical_frame'


def stamps(count=4):
    return [START_NS + k * PERIOD_NS for k in range(count)]


def picture(seed=0, width=WIDTH, height=HEIGHT):
    """Return a smooth BGR picture, which JPEG keeps well."""
    coarse = np.random.default_rng(seed).integers(0, 256, (4, 5, 3)).astype(np.uint8)
    return cv2.resize(coarse, (width, height), interpolation=cv2.INTER_CUBIC)


def encoded(image, suffix='.jpg'):
    return cv2.imencode(suffix, image)[1].tobytes()


def seconds(stamp_ns):
    return f'{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}'


def pose_line(stamp_ns, x=0.0):
    return f'{seconds(stamp_ns)} {x} 0 0 0 0 0 1'


def tum_folder(path, count=4, suffix='.jpg', truth=True):
    (path / 'rgb').mkdir(parents=True)
    rows = ['# color images', '# timestamp filename']
    for k, stamp in enumerate(stamps(count)):
        name = f'rgb/{seconds(stamp)}{suffix}'
        (path / name).write_bytes(encoded(picture(k), suffix))
        rows.append(f'{seconds(stamp)} {name}')
    (path / 'rgb.txt').write_text('\n'.join(rows) + '\n')
    if truth:
        (path / 'groundtruth.txt').write_text(
            '# timestamp tx ty tz qx qy qz qw\n'
            + '\n'.join(pose_line(stamp, float(k)) for k, stamp in enumerate(stamps(count))))
    return path


def noise(seed=0):
    """Return a grey picture full of corners."""
    coarse = np.random.default_rng(seed).integers(0, 256, (24, 32), np.uint8)
    return cv2.resize(coarse, (160, 120), interpolation=cv2.INTER_CUBIC)


def textured_folder(path, count=4):
    """Write a folder in TUM's layout whose frames have features."""
    tum_folder(path, count)
    for number, file in enumerate(sorted((path / 'rgb').iterdir())):
        file.write_bytes(encoded(noise(number)))
    return path


class Messages:
    """Messages of ROS 1 or ROS 2, made of a typestore."""

    def __init__(self, store):
        self._store, self._types = store, store.types

    def make(self, name, *values, **fields):
        return self._types[name](*values, **fields)

    def header(self, stamp_ns, frame_id):
        time = self.make('builtin_interfaces/msg/Time', *divmod(stamp_ns, 10**9))
        fields = {'stamp': time, 'frame_id': frame_id}
        if 'seq' in self._types['std_msgs/msg/Header'].__dataclass_fields__:
            fields['seq'] = 0
        return self.make('std_msgs/msg/Header', **fields)

    def image(self, stamp_ns, pixels, encoding='bgr8', frame_id='camera', padding=0):
        rows = pixels.reshape(pixels.shape[0], -1).view(np.uint8)
        padded = np.pad(rows, ((0, 0), (0, padding)), constant_values=77)
        return self.make(
            IMAGE, header=self.header(stamp_ns, frame_id), height=pixels.shape[0],
            width=pixels.shape[1], encoding=encoding, is_bigendian=0, step=padded.shape[1],
            data=padded.ravel())

    def compressed(self, stamp_ns, data, text='jpeg'):
        return self.make(COMPRESSED, header=self.header(stamp_ns, 'camera'), format=text,
                         data=np.frombuffer(data, np.uint8))

    def pose(self, stamp_ns, position, quaternion=(0.0, 0.0, 0.0, 1.0), frame_id='world'):
        return self.make(POSE, header=self.header(stamp_ns, frame_id), pose=self.make(
            'geometry_msgs/msg/Pose',
            position=self.make('geometry_msgs/msg/Point', *position),
            orientation=self.make('geometry_msgs/msg/Quaternion', *quaternion)))

    def pose_with_covariance(self, stamp_ns, position, quaternion=(0.0, 0.0, 0.0, 1.0),
                             frame_id='world'):
        plain = self.pose(stamp_ns, position, quaternion, frame_id)
        return self.make(POSE_COVARIANCE, header=plain.header, pose=self._covariant(plain.pose))

    def odometry(self, stamp_ns, position, quaternion=(0.0, 0.0, 0.0, 1.0), frame_id='odom',
                 child='base_link'):
        plain = self.pose(stamp_ns, position, quaternion, frame_id)
        zero = self.make('geometry_msgs/msg/Vector3', 0.0, 0.0, 0.0)
        return self.make(
            ODOMETRY, header=plain.header, child_frame_id=child, pose=self._covariant(plain.pose),
            twist=self.make('geometry_msgs/msg/TwistWithCovariance', twist=self.make(
                'geometry_msgs/msg/Twist', linear=zero, angular=zero), covariance=np.zeros(36)))

    def _covariant(self, pose):
        return self.make('geometry_msgs/msg/PoseWithCovariance', pose=pose,
                         covariance=np.zeros(36))

    def path(self, poses, frame_id='world'):
        return self.make(PATH, header=self.header(0, frame_id), poses=poses)

    def tf(self, *links):
        return self.make(TF, transforms=list(links))

    def camera_info(self, stamp_ns, frame_id):
        region = self.make('sensor_msgs/msg/RegionOfInterest', 0, 0, 0, 0, False)
        return self.make(
            CAMERA_INFO, header=self.header(stamp_ns, frame_id), height=HEIGHT, width=WIDTH,
            distortion_model='plumb_bob', d=np.zeros(5), k=np.eye(3).ravel(), r=np.eye(3).ravel(),
            p=np.zeros(12), binning_x=0, binning_y=0, roi=region)

    def link(self, stamp_ns, parent, child, position, quaternion=(0.0, 0.0, 0.0, 1.0)):
        return self.make(
            'geometry_msgs/msg/TransformStamped', header=self.header(stamp_ns, parent),
            child_frame_id=child, transform=self.make(
                'geometry_msgs/msg/Transform',
                translation=self.make('geometry_msgs/msg/Vector3', *position),
                rotation=self.make('geometry_msgs/msg/Quaternion', *quaternion)))


def ros1_messages():
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg('geometry_msgs/TransformStamped[] transforms', TUM_TF))
    return store, Messages(store)


ROS2 = Messages(typestore())


def write_ros2(path, rows, plugin=StoragePlugin.MCAP):
    """Write a rosbag2 of rows (topic, type, stamp in ns, message)."""
    with Writer2(path, version=9, storage_plugin=plugin) as writer:
        _write(writer, typestore(), rows, typestore().serialize_cdr)
    return path


def write_ros1(path, rows, store):
    """Write a ROS 1 bag of rows (topic, type, stamp in ns, message)."""
    with Writer1(path) as writer:
        _write(writer, store, rows, store.serialize_ros1)
    return path


def _write(writer, store, rows, serialize):
    connections = {}
    for topic, kind, stamp_ns, message in rows:
        if topic not in connections:
            connections[topic] = writer.add_connection(topic, kind, typestore=store)
        writer.write(connections[topic], stamp_ns, serialize(message, kind))


def raw_rows(count=4, topic='/camera/image_raw', **options):
    return [(topic, IMAGE, stamp, ROS2.image(stamp, picture(k), **options))
            for k, stamp in enumerate(stamps(count))]


def jpeg_rows(count=4, topic='/image/compressed'):
    return [(topic, COMPRESSED, stamp, ROS2.compressed(stamp, encoded(picture(k))))
            for k, stamp in enumerate(stamps(count))]


def pose_rows(count=4, topic='/ground_truth', frame_id='world'):
    return [(topic, POSE, stamp, ROS2.pose(stamp, (float(k), 0.0, 0.0), frame_id=frame_id))
            for k, stamp in enumerate(stamps(count))]


# The mount in TUM's bags: /kinect (the markers) to the optical frame of the colour camera. The
# figures are made up, all different, and turn every axis.
TUM_MOUNT = (('/kinect', '/openni_camera', (0.01, -0.02, 0.03), (0.5, 0.5, 0.5, 0.5)),
             ('/openni_camera', '/openni_rgb_frame', (0.0, -0.045, 0.0), (0.0, 0.0, 0.0, 1.0)),
             ('/openni_rgb_frame', TUM_CAMERA, (0.0, 0.0, 0.0), (-0.5, 0.5, -0.5, 0.5)))


def tum_bag(path, pictures, frame_ns, truth_ns, position, quaternion, mount=TUM_MOUNT):
    """
    Write a ROS 1 bag with TUM's topics: colour, depth, and /tf with its chain of frames.

    position, quaternion: of /kinect in /world at truth_ns.
    """
    store, make = ros1_messages()
    rows = [(TUM_TOPIC, IMAGE, stamp, make.image(
        stamp, np.ascontiguousarray(image[:, :, ::-1]), 'rgb8', TUM_CAMERA))
        for stamp, image in zip(frame_ns, pictures, strict=True)]
    rows += [('/camera/depth/image', IMAGE, stamp, make.image(
        stamp, np.ones((HEIGHT, WIDTH), np.float32), '32FC1', TUM_CAMERA)) for stamp in frame_ns]
    for stamp, place, turn in zip(truth_ns, position, quaternion, strict=True):
        links = [make.link(stamp, '/world', '/kinect', place, turn)]
        links += [make.link(stamp, *link) for link in mount]
        rows += [('/tf', TUM_TF, stamp, make.make(TUM_TF, transforms=[link])) for link in links]
    return write_ros1(path, sorted(rows, key=lambda row: row[2]), store)
