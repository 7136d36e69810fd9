# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""What the command line reads, broken or hostile: one line, exit 2, nothing half written."""

import json
import os
from pathlib import Path
import resource
import shutil
import subprocess
import sys

import bag_factory as make
import numpy as np
import pytest
from test_files import BOMB

from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.graph_sequences.cache import load_graphs
from adversarial_lcd_ros.lcd.decision import FORMAT, Decision
from adversarial_lcd_ros.lcd.targets import TARGETS
from adversarial_lcd_ros.paths import model_path
from adversarial_lcd_ros.sequences import import_sequence
from adversarial_lcd_ros.training.model_folder import MODEL_CARD, trained_on
from adversarial_lcd_ros.vision.objects import ObjectDetector
from adversarial_lcd_ros.vision.vocabulary import Vocabulary

ROOT = Path(__file__).resolve().parents[1]
BAG = str(ROOT / 'bags' / 'flat_tour')


@pytest.fixture
def refused(capsys):
    """Return the one line that a command ends with, its exit code checked."""
    def run(*argv):
        assert main([str(part) for part in argv]) == 2
        *before, last = capsys.readouterr().err.splitlines()
        assert last.startswith('error: ')
        assert not any('Traceback' in line or line.startswith('error') for line in before)
        assert len(last) < 2000
        assert last.isprintable()
        return last
    return run


@pytest.mark.parametrize(('text', 'message'), [
    (f'{BOMB}attacks: *j', 'more than 50000 values'),
    ('attacks: ' + '[' * 5000, 'nested deeper'),
    ('attacks: &a\n- *a', 'part of itself'),
    ('attacks: [{name: x, ratio: 1e-4, ratio: 3e-4}]', "the key 'ratio' is there twice"),
    ('attacks: [{name: "a\\0b", mode: pass}]', 'not all of them can be printed'),
    ('attacks: [{name: x, 1: 2, zz: 3}]', 'unknown setting 1, zz'),
    ('attacks: [3]', 'no attack with a name'),
    ('attacks: [' + ', '.join(f'{{name: a{n}}}' for n in range(1001)) + ']', 'at most 1000'),
    ('protocol: frames\nattacks: [{ratio: ' + str([n / 1e6 for n in range(1, 3001)])
     + ', queries_per_edit: ' + str(list(range(1000))) + '}]', '3000000 combinations'),
    ('protocol: frames\nseeds: 100000\nattacks: [{queries_per_edit: '
     + str(list(range(11))) + '}]', '1100000 cells'),
    ('protocol: [a]\nattacks: [{name: x}]', 'the protocol is'),
])
def test_recipe_that_is_none(tmp_path, refused, text, message):
    path = tmp_path / 'recipe.yaml'
    path.write_text(text)
    line = refused('evaluate', BAG, '--recipe', path, '--output', tmp_path / 'out')
    assert message in line
    assert str(path) in line or 'unknown setting' in line
    assert not (tmp_path / 'out').exists()


@pytest.mark.parametrize(('text', 'message'), [
    ('lcd: {threshold: 0.1, threshold: 0.9}', 'there twice'),
    ('lcd: {candidates: ' + '9' * 5000 + '}', '4300 digits'),
    (f'{BOMB}lcd: *j', 'more than 50000 values'),
    ('lcd: {threshold: .nan}', 'no finite number'),
    ('lcd: {model: 2024-01-01}', 'expected str'),
    ('1: {a: 2}', 'unknown section 1'),
    ('lcd: {"\\e[1m": 1}', 'unknown setting \\x1b[1m'),
])
def test_settings_that_are_none(tmp_path, refused, text, message):
    path = tmp_path / 'settings.yaml'
    path.write_text(text)
    assert message in refused('evaluate', BAG, '--config', path, '--output', tmp_path / 'out')
    assert not (tmp_path / 'out').exists()


CARD = {'format': FORMAT, 'target': 'wl', 'channels': list(TARGETS['wl'].channels),
        'weights': [1.0] * len(TARGETS['wl'].channels), 'bias': 0.0}


@pytest.mark.parametrize(('change', 'message'), [
    ({'bias': float('nan')}, 'NaN is no number'),
    ({'bias': 10**400}, 'too large'),
    ({'bias': 1e308}, 'expected 3 finite weights and a bias, from'),
    ({'weights': []}, 'expected 3 finite weights'),
    ({'weights': None}, 'no trained decision'),
    ({'operating_points': [1.0]}, 'expected 51 operating points that fall'),
    ({'operating_points': [*range(51)]}, 'expected 51 operating points that fall'),
    ({'operating_points': [1e308] * 51}, 'expected 51 operating points that fall'),
    ({'operating_points': 3}, 'no trained decision'),
    ({'target': 'vbow'}, 'was trained for target vbow'),
    ({'card': 3}, 'no trained decision'),
])
def test_decision_that_is_none(tmp_path, change, message):
    path = tmp_path / 'target_wl.json'
    path.write_text(json.dumps({**CARD, **change}))
    with pytest.raises(ModelError, match=message):
        Decision.load(path, 'wl', TARGETS['wl'].channels)


@pytest.mark.parametrize('text', [
    '{}', '[]', '{"sequences": [3]}', '{"sequences": [{"name": "a", "part": ["x", "y"]}]}',
    '{"sequences": [{"name": "a", "part": []}]}', '[' * 100_000])
def test_card_that_is_none_does_not_tell_what_was_trained_on(tmp_path, text):
    (tmp_path / MODEL_CARD).write_text(text)
    assert trained_on(tmp_path / 'target_wl.json', 'a') is None


def arrays_of(name):
    with np.load(model_path(name)) as arrays:
        return dict(arrays)


def test_vocabulary_whose_shape_would_take_for_ever(tmp_path):
    arrays = arrays_of('vocabulary.npz')
    for shape in ([16, 10**8], [10**9, 2], [-1, 3], [16], [16.0, np.nan]):
        np.savez(tmp_path / 'v.npz', **{**arrays, 'shape': np.array(shape)})
        with pytest.raises(ModelError, match='is no vocabulary'):
            Vocabulary.load(tmp_path / 'v.npz')


@pytest.mark.parametrize(('name', 'array'), [
    ('gain', np.full(1600, np.nan)), ('gain', np.zeros((1600, 2))),
    ('features', np.zeros(3)), ('features', np.array('text')), ('word_score', np.zeros((2, 2))),
    ('is_loop', np.zeros(1600)),
])
def test_surrogate_data_that_is_none(tmp_path, name, array):
    np.savez(tmp_path / 's.npz', **{**arrays_of('surrogate_data.npz'), name: array})
    with pytest.raises(ModelError, match=r's\.npz'):
        SurrogateData.load(tmp_path / 's.npz')


def test_cache_of_graphs_that_unfolds(tmp_path):
    np.savez_compressed(tmp_path / 'g.npz', payload=np.zeros(8 << 20, np.uint8),
                        length=np.array([8 << 20]))
    with pytest.raises(Exception, match=r'holds no graphs.*unfolds'):
        load_graphs(tmp_path / 'g.npz')


@pytest.fixture
def results(tmp_path):
    """Return a results folder with every file that a report is made of, all of them empty."""
    folder = tmp_path / 'results'
    folder.mkdir()
    for name in ('summary.json', 'configuration.json', 'environment.json'):
        (folder / name).write_text('{}')
    (folder / 'per_query.csv').write_text('')
    return folder


@pytest.mark.parametrize(('name', 'content'), [
    ('summary.json', '{}'), ('summary.json', 'text'), ('summary.json', '[]'),
    ('summary.json', '{"attacks": 3}'), ('summary.json', '[' * 100_000),
    ('per_query.csv', b'\xff\xfe'), ('per_query.csv', 'a,b\n'), ('per_query.csv', None)])
def test_results_that_are_none(results, refused, name, content):
    if content is None:
        (results / name).unlink()
    else:
        (results / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert str(results) in refused('report', results)
    assert not (results / 'report.html').exists()


@pytest.mark.parametrize('row', ['{"key": "a"}', '{"key": "a", "key": "a"}', '[]', '3', 'x',
                                 '{"key": "a", "x": NaN}', '{"key": ' + '[' * 5000])
def test_rows_of_targets_that_are_none(tmp_path, refused, row):
    """Every row that this run would make is there already, but holds only its key."""
    options = ('targets', BAG, '--targets', 'vbow', '--protocols', 'live', '--jobs', '1',
               '--builder-detector', 'none', '--builder-features', '20', '--cache',
               tmp_path / 'cache', '--output', tmp_path / 'out')
    (tmp_path / 'out').mkdir()
    cells = tmp_path / 'out' / 'cells.jsonl'
    if row != '{"key": "a"}':
        cells.write_text(f'{row}\n')
        assert 'cells.jsonl, line 1' in refused(*options)
        return
    assert main([str(part) for part in options]) == 0
    (finished,) = cells.read_text().splitlines()
    cells.write_text(json.dumps({'key': json.loads(finished)['key']}) + '\n')
    assert 'sequence, target, protocol' in refused(*options)


def constant_model(path, output, *, location=None):
    """Write a YOLO export that gives the same rows for any image."""
    onnx = pytest.importorskip('onnx')
    helper, tensors = onnx.helper, onnx.TensorProto
    rows = onnx.numpy_helper.from_array(np.asarray(output, np.float32), 'rows')
    if location is not None:
        rows.ClearField('raw_data')
        rows.data_location = tensors.EXTERNAL
        rows.external_data.add(key='location', value=location)
    nodes = [helper.make_node('ReduceMean', ['images'], ['mean'], keepdims=0),
             helper.make_node('Mul', ['mean', 'zero'], ['none']),
             helper.make_node('Add', ['rows', 'none'], ['out'])]
    graph = helper.make_graph(
        nodes, 'g', [helper.make_tensor_value_info('images', tensors.FLOAT, [1, 3, 64, 64])],
        [helper.make_tensor_value_info('out', tensors.FLOAT, np.shape(output))],
        [rows, onnx.numpy_helper.from_array(np.float32(0), 'zero')])
    path.write_bytes(helper.make_model(graph, ir_version=8, opset_imports=[
        helper.make_opsetid('', 13)]).SerializeToString())
    return path


def huge_model(path):
    """Write a model of some hundred bytes that makes an array of 13 GB when it is loaded."""
    onnx = pytest.importorskip('onnx')
    helper, tensors = onnx.helper, onnx.TensorProto
    nodes = [helper.make_node('ConstantOfShape', ['shape'], ['rows']),
             helper.make_node('ReduceMean', ['images'], ['mean'], keepdims=0),
             helper.make_node('Add', ['rows', 'mean'], ['out'])]
    graph = helper.make_graph(
        nodes, 'g', [helper.make_tensor_value_info('images', tensors.FLOAT, [1, 3, 64, 64])],
        [helper.make_tensor_value_info('out', tensors.FLOAT, [1, 84, 40_000_000])],
        [onnx.numpy_helper.from_array(np.array([1, 84, 40_000_000]), 'shape')])
    path.write_bytes(helper.make_model(graph, ir_version=8, opset_imports=[
        helper.make_opsetid('', 13)]).SerializeToString())
    return path


@pytest.mark.parametrize(('row', 'message'), [
    ([1, 2, 30, np.nan, 0.9, 5], 'a box of NaN'), ([1, 2, np.inf, 40, 0.9, 5], 'a box of NaN'),
    ([1, 2, 30, 40, 1e30, 5], 'scores from 1e+30'), ([1, 2, 30, 40, 0.9, -1], 'class -1'),
    ([1, 2, 30, 40, 0.9, 1e20], 'class 1e'), ([1, 2, 30, 40, 0.9, np.nan], 'class nan')])
def test_network_that_gives_nonsense(tmp_path, refused, row, message):
    model = constant_model(tmp_path / 'model.onnx', [[row] * 7])
    line = refused('build', BAG, tmp_path / 'graphs', '--model', model)
    assert message in line
    assert os.listdir(tmp_path) == ['model.onnx']


def test_network_that_gives_nonsense_of_no_confidence_works(tmp_path):
    model = constant_model(tmp_path / 'model.onnx', [[[np.nan, np.inf, -1, 2, 0.1, 5]] * 7])
    assert not len(ObjectDetector(model, 0.4).detect(np.zeros((48, 64, 3), np.uint8)))


def test_network_that_takes_all_memory(tmp_path):
    before = resource.getrlimit(resource.RLIMIT_AS)
    with pytest.raises(ModelError, match='onnx'):
        ObjectDetector(huge_model(tmp_path / 'model.onnx'), 0.4)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


def test_network_whose_weights_are_elsewhere(tmp_path):
    (tmp_path / 'secret').write_bytes(bytes(168))
    (tmp_path / 'model').mkdir()
    (tmp_path / 'model' / 'link').symlink_to(tmp_path / 'secret')
    for location in ('../secret', str(tmp_path / 'secret'), 'link', '/dev/zero', 'missing'):
        model = constant_model(tmp_path / 'model' / 'model.onnx', np.ones((1, 7, 6)),
                               location=location)
        with pytest.raises(ModelError, match='cannot be loaded'):
            ObjectDetector(model, 0.4)


@pytest.mark.parametrize('content', [b'', b'not a network' * 30, bytes(1000)])
def test_network_that_is_none(tmp_path, refused, content):
    (tmp_path / 'model.onnx').write_bytes(content)
    assert 'model.onnx cannot be loaded' in refused(
        'build', BAG, tmp_path / 'graphs', '--model', tmp_path / 'model.onnx')


@pytest.fixture
def pictures(tmp_path):
    folder = tmp_path / 'source'
    make.textured_folder(folder, 3)
    return folder


def test_link_out_of_the_source_is_not_followed_into_the_bag(tmp_path, pictures, refused):
    (pictures / 'LICENSE').symlink_to('/etc/passwd')
    line = refused('import', pictures, tmp_path / 'bag')
    assert 'LICENSE is a link out of its folder' in line
    assert not (tmp_path / 'bag').exists()
    assert refused('build', pictures, tmp_path / 'bag', '--detector', 'none') == line
    assert not (tmp_path / 'bag').exists()
    (pictures / 'LICENSE').unlink()
    (pictures / 'TERMS').write_text('free')
    (pictures / 'LICENSE').symlink_to('TERMS')
    assert (import_sequence(pictures, tmp_path / 'bag').path / 'LICENSE').read_text() == 'free'


def test_picture_that_never_ends(tmp_path, pictures, refused):
    picture = sorted((pictures / 'rgb').iterdir())[1]
    picture.unlink()
    picture.symlink_to('/dev/zero')
    assert picture.name in refused('import', pictures, tmp_path / 'bag')
    assert not (tmp_path / 'bag').exists()


def test_bag_does_not_replace_what_a_link_leads_to(tmp_path, pictures, refused):
    import_sequence(pictures, tmp_path / 'precious')
    before = (tmp_path / 'precious' / 'precious.mcap').read_bytes()
    (tmp_path / 'bag').symlink_to('precious')
    assert 'is a link to precious' in refused('import', pictures, tmp_path / 'bag', '--overwrite')
    assert (tmp_path / 'precious' / 'precious.mcap').read_bytes() == before


def command(*argv, **options):
    return subprocess.run([sys.executable, '-m', 'adversarial_lcd_ros.cli', *map(str, argv)],
                          stderr=subprocess.PIPE, text=True, check=False, timeout=120, cwd=ROOT,
                          **options)


def test_output_that_cannot_be_written_is_one_line():
    with open('/dev/full', 'w') as full:
        done = command('params', stdout=full)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        'error: [Errno 28] No space left on device; what was finished before is kept']


def _files_of_at_most(count):
    # Beyond this a write fails, as on a full disk; Python ignores the signal that comes with it.
    resource.setrlimit(resource.RLIMIT_FSIZE, (count, count))


@pytest.mark.parametrize('argv', [
    ('import', 'SOURCE', 'OUT/bag'), ('build', 'SOURCE', 'OUT/bag', '--detector', 'none')])
def test_full_disk_leaves_nothing_half_written(tmp_path, pictures, argv):
    out = tmp_path / 'out'
    out.mkdir()
    places = {'SOURCE': pictures, 'OUT/bag': out / 'bag'}
    done = command(*(places.get(part, part) for part in argv), preexec_fn=lambda:
                   _files_of_at_most(4096), env=os.environ | {
                       'ADVERSARIAL_LCD_CACHE': str(tmp_path), 'NUMBA_DISABLE_CACHING': '1'})
    assert done.returncode == 2, done.stderr
    assert 'cannot be' in done.stderr.splitlines()[-1]
    assert 'Traceback' not in done.stderr
    assert os.listdir(out) == []


def test_shared_cases_are_all_refused(tmp_path, refused):
    folder = ROOT.parent / 'shared' / 'cases' / 'files'
    if not folder.is_dir():
        pytest.skip(f'{folder} is not on this machine')
    for path in sorted(folder.iterdir()):
        copy = Path(shutil.copy(path, tmp_path / path.name))
        options = {'.onnx': ('build', BAG, tmp_path / 'g', '--model', copy),
                   '.csv': ('build', BAG, tmp_path / 'g', '--detector', 'csv', '--detections',
                            copy),
                   '.yaml': ('evaluate', BAG, '--recipe', copy, '--output', tmp_path / 'out')}
        chosen = options[path.suffix]
        if path.name.startswith('cfg_'):
            chosen = ('evaluate', BAG, '--config', copy, '--output', tmp_path / 'out')
        refused(*chosen)
