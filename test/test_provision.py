# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""The object model: fetched once, verified always, never half there. No test downloads."""

import hashlib
import json
import os
from pathlib import Path
import sys
from zipfile import ZipFile

import pytest

from adversarial_lcd_ros import paths, provision
from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.paths import object_model_path

WEIGHTS, NETWORK, CONVERTED = b'weights', b'network', b'converted model'
# What the stand-in for the converter does: it fails where PyPI's ROS libraries would be loaded.
EXPORT = f"""
import os
def export(model, weights, out, opset_version):
    assert 'LD_LIBRARY_PATH' not in os.environ, 'LD_LIBRARY_PATH'
    assert open(model, 'rb').read() == {NETWORK!r} and opset_version == {provision.OPSET}
    open(out, 'wb').write({CONVERTED!r})
"""


def digest(data):
    return hashlib.sha256(data).hexdigest()


def write_wheel(path, files):
    path.parent.mkdir(parents=True)
    with ZipFile(path, 'w') as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


@pytest.fixture
def registry(monkeypatch):
    """Stand-ins for the two wheels; returns their files and the list of downloads."""
    files = {
        provision.SOURCE: {
            f'{provision.SOURCE_FOLDER}/model.pdmodel': NETWORK,
            f'{provision.SOURCE_FOLDER}/model.pdiparams': WEIGHTS,
            f'{provision.SOURCE_FOLDER}/infer_cfg.yml': b'label_list: [person, chair]\n'},
        provision.CONVERTER: {'paddle2onnx/__init__.py': EXPORT},
    }
    downloads = []

    def download(requirement, folder, *options):
        downloads.append(requirement)
        wheel = write_wheel(folder / 'x.whl', files[requirement])
        monkeypatch.setitem(known, requirement, (provision.sha256(wheel),))
        return wheel

    known = {}
    monkeypatch.setattr(provision, 'WHEEL_SHA256', known)
    monkeypatch.setattr(provision, '_download', download)
    monkeypatch.setattr(provision, 'SOURCE_SHA256', {
        'model.pdmodel': digest(NETWORK), 'model.pdiparams': digest(WEIGHTS)})
    monkeypatch.setattr(provision, 'MODEL_SHA256', digest(CONVERTED))
    monkeypatch.setattr(provision, '_converter_python', lambda: ('3.11', sys.executable))
    monkeypatch.setattr(provision, 'SHIPPED', Path('nowhere'))
    return files, downloads


def test_model_is_made_once_with_its_card(registry, tmp_path, monkeypatch):
    _, downloads = registry
    monkeypatch.setenv('LD_LIBRARY_PATH', '/opt/of/the/ros/wheels')
    told = []
    path = provision.fetch_object_model(tmp_path / 'models' / 'pico.onnx', told.append)
    assert path.read_bytes() == CONVERTED
    card = json.loads(path.with_suffix('.json').read_text())
    assert card['classes'] == ['person', 'chair']
    assert (card['licence'], card['sha256']) == ('Apache-2.0', digest(CONVERTED))
    assert sorted(os.listdir(path.parent)) == ['pico.json', 'pico.onnx']
    assert len(told) == 3
    assert provision.fetch_object_model(path, told.append) == path
    assert len(downloads) == 2
    assert len(told) == 3


def test_corrupted_model_is_refused_and_left_alone(registry, tmp_path):
    path = tmp_path / 'pico.onnx'
    path.write_bytes(b'damaged')
    with pytest.raises(ModelError) as refused:
        provision.fetch_object_model(path)
    for part in (str(path), digest(b'damaged'), digest(CONVERTED), 'delete'):
        assert part in str(refused.value)
    assert path.read_bytes() == b'damaged'


@pytest.mark.parametrize(('requirement', 'member', 'data', 'message'), [
    (provision.SOURCE, f'{provision.SOURCE_FOLDER}/model.pdiparams', b'tampered', 'pdiparams'),
    (provision.CONVERTER, 'paddle2onnx/__init__.py', EXPORT.replace('converted', 'other'),
     digest(b'other model')),
    (provision.CONVERTER, 'paddle2onnx/__init__.py', 'raise OSError("no such library")',
     'failed: OSError: no such library'),
])
def test_what_is_not_as_expected_leaves_nothing_behind(
        registry, tmp_path, requirement, member, data, message):
    registry[0][requirement][member] = data
    with pytest.raises(ModelError, match=message):
        provision.fetch_object_model(tmp_path / 'models' / 'pico.onnx')
    assert os.listdir(tmp_path / 'models') == []


def test_python_without_converter_is_told_before_any_download(tmp_path, monkeypatch):
    monkeypatch.setattr(provision, '_pythons', lambda: iter([('3.13', sys.executable)]))
    monkeypatch.setattr(provision, '_download', None)
    with pytest.raises(ModelError, match=r'3\.12, 3\.11, 3\.10; .*leave out --anew'):
        provision.fetch_object_model(tmp_path / 'pico.onnx', anew=True)


def test_the_model_that_ships_needs_no_network_and_no_converter(tmp_path, monkeypatch):
    monkeypatch.setattr(provision, '_download', None)
    monkeypatch.setattr(provision, '_pythons', lambda: iter([('3.13', sys.executable)]))
    path = provision.fetch_object_model(tmp_path / 'pico.onnx')
    assert provision.sha256(path) == provision.MODEL_SHA256
    assert json.loads(path.with_suffix('.json').read_text())['sha256'] == provision.MODEL_SHA256
    assert sorted(os.listdir(tmp_path)) == ['pico.json', 'pico.onnx']


def test_a_damaged_model_that_ships_is_not_passed_on(tmp_path, monkeypatch):
    (tmp_path / 'shipped.onnx').write_bytes(b'damaged')
    monkeypatch.setattr(provision, 'SHIPPED', tmp_path / 'shipped.onnx')
    with pytest.raises(ModelError, match='install it again'):
        provision.fetch_object_model(tmp_path / 'models' / 'pico.onnx')
    assert os.listdir(tmp_path / 'models') == []


def test_another_python_on_the_path_serves_the_converter(tmp_path, monkeypatch):
    for name, code in (('python3.12', 127), ('python3.11', 0)):  # 3.12: a shim, nothing behind it
        script = tmp_path / name
        script.write_text(f'#!/bin/sh\nexit {code}\n')
        script.chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path))
    found = list(provision._pythons())
    assert found[1:] == [('3.11', str(tmp_path / 'python3.11'))]


def test_failed_download_says_what_pip_said(tmp_path, monkeypatch):
    pip = tmp_path / 'python'
    pip.write_text('#!/bin/sh\necho "WARNING: old" >&2\n'
                   'echo "ERROR: No matching distribution found" >&2\nexit 1\n')
    pip.chmod(0o755)
    monkeypatch.setattr(sys, 'executable', str(pip))
    with pytest.raises(ModelError, match=r'paddlelabel-ml==1\.0\.0 failed: ERROR: No matching'):
        provision._download(provision.SOURCE, tmp_path)


def test_folder_that_cannot_be_written_is_named(registry, tmp_path):
    (tmp_path / 'file').write_text('')
    with pytest.raises(ModelError, match=r'cannot be written .*ADVERSARIAL_LCD_CACHE'):
        provision.fetch_object_model(tmp_path / 'file' / 'pico.onnx')


def test_the_builder_looks_for_the_model_that_ships_first(monkeypatch, tmp_path):
    monkeypatch.setenv('ADVERSARIAL_LCD_CACHE', str(tmp_path))
    assert provision.fetch_object_model() == object_model_path() == provision.SHIPPED
    monkeypatch.setattr(paths, '_HERE', tmp_path)
    assert object_model_path() == tmp_path / 'models' / 'picodet_s_coco.onnx'


def test_wheel_of_another_digest_is_neither_unpacked_nor_run(registry, tmp_path, monkeypatch):
    """A wheel of the converter's name on another index once ran before its result was refused."""
    files, _ = registry
    ran = tmp_path / 'ran'
    files[provision.CONVERTER]['paddle2onnx/__init__.py'] = f'open({str(ran)!r}, "w")' + EXPORT
    honest = provision._download

    def download(requirement, folder, *options):
        wheel = honest(requirement, folder, *options)
        if requirement == provision.CONVERTER:
            monkeypatch.setitem(provision.WHEEL_SHA256, requirement, (digest(b'the real one'),))
        return wheel

    monkeypatch.setattr(provision, '_download', download)
    with pytest.raises(ModelError, match='none of the wheels of paddle2onnx'):
        provision.fetch_object_model(tmp_path / 'models' / 'pico.onnx')
    assert not ran.exists()
    assert os.listdir(tmp_path / 'models') == []


def test_pip_is_told_every_digest_and_takes_no_other_wheel(tmp_path):
    """pip itself refuses a wheel of the right name and version on an index that is not PyPI."""
    index = tmp_path / 'index'
    name, version = provision.CONVERTER.split('==')
    write_wheel(index / f'{name}-{version}-py3-none-any.whl', {
        'paddle2onnx/__init__.py': 'raise SystemExit("it ran")',
        f'{name}-{version}.dist-info/METADATA': f'Name: {name}\nVersion: {version}\n',
        f'{name}-{version}.dist-info/WHEEL': 'Wheel-Version: 1.0\n'})
    with pytest.raises(ModelError, match=r'(?i)hash'):
        provision._download(provision.CONVERTER, tmp_path / 'to', '--no-index', '--find-links',
                            str(index))
    assert not list((tmp_path / 'to').glob('*.whl'))
