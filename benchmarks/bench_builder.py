# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Camera image to graph: by stage, and with two frames under way."""

from collections import deque

import cv2
import pytest

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import AdversarialLcdError
from adversarial_lcd_ros.paths import model_path, object_model_path
from adversarial_lcd_ros.vision.assembly import assemble
from adversarial_lcd_ros.vision.builder import GraphBuilder
from adversarial_lcd_ros.vision.features import FeatureExtractor, spread, to_grey
from adversarial_lcd_ros.vision.objects import ObjectDetector, filter_objects
from adversarial_lcd_ros.vision.vocabulary import Vocabulary

FRAMES = 60
AT_ONCE = 2
CONFIG = BuilderConfig()


@pytest.fixture(scope='module')
def images(tour):
    try:
        object_model_path()
    except AdversarialLcdError as error:
        pytest.skip(str(error))
    return [frame.image() for frame in tour.frames(stop=FRAMES)]


def in_parallel(builder, images):
    under_way = deque()
    for number, image in enumerate(images):
        under_way.append(builder.begin(image, number))
        if len(under_way) > AT_ONCE:
            under_way.popleft().graph()
    for building in under_way:
        building.graph()


def test_frames_beside_one_after_the_other(record, images):
    height, width = images[0].shape[:2]
    with GraphBuilder(CONFIG, AT_ONCE) as builder:
        record('builder', f'{width} x {height}, {CONFIG.features} features, objects, a frame',
               lambda: in_parallel(builder, images), 'one frame after the other',
               lambda: [builder.build(image, number) for number, image in enumerate(images)],
               1 / 30, higher_is_better=False, ours_units=len(images), rival_units=len(images))


def test_stages(record, images):
    vocabulary = Vocabulary.load(model_path('vocabulary.npz'))
    extractor = FeatureExtractor(CONFIG.detected_features, CONFIG.fast_threshold)
    detector = ObjectDetector(object_model_path(), CONFIG.object_score, CONFIG.threads)
    image = images[len(images) // 2]
    height, width = image.shape[:2]
    jpeg = cv2.imencode('.jpg', image)[1]
    grey = to_grey(image)
    features = extractor.extract(grey)
    words = vocabulary.words(features.descriptor)
    kept = spread(features, CONFIG.features, width, height)
    objects = filter_objects(detector.detect(image), width, height, CONFIG)
    stages = {
        'decode JPEG': lambda: cv2.imdecode(jpeg, cv2.IMREAD_COLOR),
        'ORB': lambda: extractor.extract(grey),
        'words': lambda: vocabulary.words(features.descriptor),
        'objects, one thread': lambda: detector.detect(image),
        'assembly': lambda: assemble(
            features[kept], words[kept], objects, vocabulary.vector(words),
            CONFIG, width=width, height=height, stamp_ns=0,
            frame_id='camera', sequence=0)}
    with GraphBuilder(CONFIG) as builder:
        for stage, run in stages.items():
            record('builder', f'stage {stage}', run, 'the whole frame',
                   lambda: builder.build(image, 0))
