# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Every script of examples/ runs as it stands, and the first prints what the README says."""

from functools import cache
from pathlib import Path
import re
import subprocess
import sys

import pytest

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = sorted((ROOT / 'examples').glob('*.py'))


@cache
def run(script):
    """Return what a script prints, started from a clone's top."""
    done = subprocess.run([sys.executable, str(script)], cwd=ROOT, capture_output=True, text=True,
                          timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize('script', EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(script):
    assert run(script).strip()


def test_the_frame_of_the_readme():
    """The first picture's caption and ten lines of Python tell the same."""
    readme = ' '.join((ROOT / 'README.md').read_text(encoding='utf-8').split())
    caption = readme[readme.index('*Frame 90'):]
    edges = re.search(r'adds (\d+) edges \(red\) to (\d+)', caption).groups()
    chances = re.search(r'goes from ([\d.]+) to ([\d.]+\d)', caption).groups()
    text = run(ROOT / 'examples' / 'attack_one_frame.py')
    assert text.startswith('frame 90: {} of {} edges flipped'.format(*edges))
    assert 'probability of a loop: {} -> {}'.format(*chances) in text


def test_docs_show_the_examples_to_the_letter():
    page = (ROOT / 'docs' / 'python.md').read_text(encoding='utf-8')
    blocks = re.findall(r'```python\n(.*?)```', page, re.S)
    sources = [path.read_text(encoding='utf-8') for path in EXAMPLES]
    assert blocks
    for block in blocks:
        assert any(block in source for source in sources), block


def test_importing_the_package_loads_next_to_nothing():
    code = ('import sys, adversarial_lcd_ros; '
            'print(sorted({"numpy", "cv2", "rclpy", "networkx"} & set(sys.modules)))')
    done = subprocess.run([sys.executable, '-c', code], cwd=ROOT, capture_output=True, text=True,
                          check=True)
    assert done.stdout.strip() == '[]'


def test_every_name_of_the_door_is_there():
    import adversarial_lcd_ros

    for name in adversarial_lcd_ros.__all__:
        assert getattr(adversarial_lcd_ros, name) is not None
    with pytest.raises(AttributeError, match='no attribute'):
        adversarial_lcd_ros.nothing  # noqa: B018
