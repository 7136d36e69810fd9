"""Files that are there whole or not at all."""

import json
import os
import stat

import numpy as np
import pytest

from adversarial_lcd_ros import files


def test_what_breaks_off_leaves_the_old_file(tmp_path, monkeypatch):
    path = tmp_path / 'a.json'
    files.write_json(path, {'a': 1})

    def break_off(*arguments):
        raise OSError('no space left')
    monkeypatch.setattr(files.os, 'replace', break_off)
    with pytest.raises(OSError, match='no space'):
        files.write_json(path, {'a': 2})
    assert json.loads(path.read_text()) == {'a': 1}
    assert os.listdir(tmp_path) == ['a.json']


def test_what_is_no_number_becomes_null(tmp_path):
    files.write_json(tmp_path / 'a.json', {'a': [np.float64('nan'), np.int64(3), float('inf')]})
    assert json.loads((tmp_path / 'a.json').read_text()) == {'a': [None, 3, None]}


def test_others_may_read_it(tmp_path):
    (tmp_path / 'usual').write_text('')
    files.write_text(tmp_path / 'ours', '')
    modes = {stat.S_IMODE((tmp_path / name).stat().st_mode) for name in ('usual', 'ours')}
    assert len(modes) == 1
