# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

from pathlib import Path

import numpy as np
import pytest

from adversarial_lcd_ros.config import LabelConfig
from adversarial_lcd_ros.errors import ConfigError, EvaluationError
from adversarial_lcd_ros.graph import MultiTierGraph
from adversarial_lcd_ros.ground_truth.covisibility import find_covisibility, read_covisibility
from adversarial_lcd_ros.ground_truth.evidence import from_shares
from adversarial_lcd_ros.ground_truth.labelling import label_graphs
from adversarial_lcd_ros.ground_truth.labels import label_frames
from adversarial_lcd_ros.sequences import Trajectory

START_S = 1305031453
SECOND_NS = 1_000_000_000
SIZE = (640, 480)


def write(path, seen, **changes):
    arrays = {'percent': np.asarray(seen, np.uint8),
              'timestamp': START_S + np.arange(len(seen), dtype=float), **changes}
    np.savez(path, **{name: array for name, array in arrays.items() if array is not None})
    return path


def standing(count):
    # One pose throughout: by poses alone every frame shares everything with every other.
    stamps = START_S * SECOND_NS + np.arange(count) * SECOND_NS
    return Trajectory(stamps, np.zeros((count, 3)), np.tile([0.0, 0, 0, 1], (count, 1)))


def shares_of(count, pairs):
    share = np.eye(count)
    for one, other, forward, back in pairs:
        share[one, other], share[other, one] = forward, back
    return share


def test_shares_say_what_a_match_is():
    evidence = from_shares(shares_of(5, [(1, 0, .6, .5), (2, 0, .4, .3), (3, 0, .9, .1),
                                         (4, 0, .05, .2)]), LabelConfig())
    assert evidence.loop[:, 0].tolist() == [True, True, False, False, False]
    assert evidence.shared[:, 0].tolist() == [True, True, True, True, False]
    assert evidence.scaled[:, 0].tolist() == [False, False, False, True, False]
    assert not evidence.elsewhere[4, 0]  # one of the two sees a fifth of its surface in the other
    assert evidence.elsewhere[4, 1]
    for part in vars(evidence).values():
        assert np.array_equal(part, part.T)


def test_nothing_follows_from_shares_that_nobody_knows():
    evidence = from_shares(np.full((3, 3), np.nan), LabelConfig())
    assert not any(part.any() for part in vars(evidence).values())


def test_kinds_of_frames_by_shares():
    # 0 and 1 are old; 2 to 5 see nothing, 0 again, 1 from nearer, and a bit of 0.
    share = shares_of(6, [(3, 0, .8, .7), (4, 1, 1, .1), (5, 0, .2, .2)])
    poses = standing(6)
    labels = label_frames(poses, poses.stamp_ns, SIZE, LabelConfig(min_gap_s=2.0),
                          from_shares(share, LabelConfig()))
    assert labels.names == ['no_candidate', 'no_candidate', 'negative', 'positive', 'scale',
                            'between']
    assert labels.is_correct([3, 4, 4, 5], [0, 1, 0, 0]).tolist() == [True, True, False, False]
    assert labels.judge([3, 4, 4, 5, 5], [0, 1, 0, 0, -1]).tolist() == [
        'right', 'right', 'elsewhere', 'untold', '']
    assert labels.elsewhere[4, 0]
    assert not labels.elsewhere[5, 0]  # cannot be told


def test_frames_are_found_by_their_stamps(tmp_path):
    percent = np.arange(16).reshape(4, 4)
    known = read_covisibility(write(tmp_path / 'covisibility.npz', percent))
    stamps = standing(4).stamp_ns
    assert np.array_equal(known.shares(stamps[[1, 3]] + 200),
                          percent[np.ix_([1, 3], [1, 3])] / 100)
    with pytest.raises(EvaluationError, match='nothing of 1 of 2 frames'):
        known.shares(stamps[:2] + [0, SECOND_NS // 2])


@pytest.mark.parametrize('changes', [
    {'timestamp': None}, {'timestamp': np.zeros(3)}, {'timestamp': np.arange(3)},
    {'timestamp': np.array([0.0, np.nan, 2.0])}, {'percent': np.full((3, 3), 101, np.uint8)},
    {'percent': np.zeros((3, 2), np.uint8)}, {'percent': np.zeros((3, 3))}])
def test_files_of_something_else_are_refused(tmp_path, changes):
    path = write(tmp_path / 'covisibility.npz', np.zeros((3, 3)), **changes)
    with pytest.raises(EvaluationError, match='expected'):
        read_covisibility(path)


def test_file_that_is_cut_off_is_refused(tmp_path):
    path = write(tmp_path / 'covisibility.npz', np.zeros((3, 3)))
    path.write_bytes(path.read_bytes()[:100])
    with pytest.raises(EvaluationError, match='cannot be read'):
        read_covisibility(path)


def test_covisibility_beside_a_sequence_wins_over_its_poses(tmp_path):
    poses = standing(20)
    graphs = [MultiTierGraph(int(stamp), 'camera', number, *SIZE)
              for number, stamp in enumerate(poses.stamp_ns)]
    config = LabelConfig(min_gap_s=2.0)
    write(tmp_path / 'covisibility.npz', np.zeros((20, 20)))
    assert find_covisibility(tmp_path) == tmp_path / 'covisibility.npz'
    assert find_covisibility(tmp_path / 'walk.bag') == tmp_path / 'covisibility.npz'
    exact = label_graphs(graphs, poses, tmp_path, config)
    assert (exact.count('negative'), exact.told_by) == (18, 'co-visibility')
    by_poses = label_graphs(graphs, poses, tmp_path,
                            LabelConfig(min_gap_s=2.0, rule='overlap'))
    assert (by_poses.count('negative'), by_poses.told_by) == (0, 'poses alone')
    assert find_covisibility(Path('/nowhere')) is None


def test_contradicting_shares_are_refused():
    with pytest.raises(ConfigError, match='shared_share'):
        LabelConfig(shared_share=0.6)
