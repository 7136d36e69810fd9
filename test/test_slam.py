# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Maps that can be worked out by hand, and what must hold of all of them."""

import json
import shutil
import subprocess
import sys
import zipfile

import cv2
from hypothesis import given
from hypothesis import strategies as st
from map_factory import SIGMA, closures, pairs, perfect_graph, quiet, square, wavy
import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_geometry import views

from adversarial_lcd_ros.config import BACK_ENDS
from adversarial_lcd_ros.errors import ConfigError
from adversarial_lcd_ros.slam import library
from adversarial_lcd_ros.slam.accuracy import (
    absolute_error_m,
    aligned,
    errors_m,
    relative_error,
)
from adversarial_lcd_ros.slam.back_ends import solve
from adversarial_lcd_ros.slam.closures import claim, consistent
from adversarial_lcd_ros.slam.essential import relative_pose
from adversarial_lcd_ros.slam.motions import between, chained, inverse, moved
from adversarial_lcd_ros.slam.odometry import drifting
from adversarial_lcd_ros.slam.pose_graph import PoseGraph, factors_of, poses_of, write_g2o

try:
    import gtsam
except ImportError:
    gtsam = None
needs_gtsam = pytest.mark.skipif(gtsam is None, reason='gtsam is not installed (extra slam; there '
                                 'are no wheels for Python 3.10)')


# --- motions and odometry ---------------------------------------------------

@given(st.integers(0, 2**16))
def test_steps_lead_along_the_path_that_they_are_of(seed):
    rng = np.random.default_rng(seed)
    truth = moved(wavy(30), 0.3 * rng.standard_normal((30, 6)))
    assert np.allclose(chained(truth[0], between(truth[:-1], truth[1:])), truth, atol=1e-9)
    assert np.allclose(inverse(truth) @ truth, np.eye(4), atol=1e-12)


def test_without_drift_the_odometry_is_the_truth_and_sigmas_stay_positive():
    quiet_one = drifting(wavy(), quiet(), 0.0, np.random.default_rng(1))
    assert np.allclose(chained(wavy()[0], quiet_one.steps), wavy())
    assert (quiet_one.sigma > 0).all()


def test_errors_of_the_odometry_are_as_large_as_its_sigmas_say():
    truth = wavy(3000, 3)
    config = quiet(drift_rotation_deg=0.5, drift_translation_m=0.02)
    drawn = drifting(truth, config, 2.0, np.random.default_rng(1))
    off = between(between(truth[:-1], truth[1:]), drawn.steps)
    error = np.concatenate([Rotation.from_matrix(off[:, :3, :3]).as_rotvec(), off[:, :3, 3]], 1)
    assert np.allclose((error / drawn.sigma).std(axis=0), 1.0, atol=0.05)


def test_a_biased_odometry_errs_the_same_way_at_every_step():
    truth = square(50)
    config = quiet(drift_model='biased', drift_rotation_share=0.0, drift_translation_share=0.0)
    drawn = drifting(truth, config, 1.0, np.random.default_rng(1))
    off = between(between(truth[:-1], truth[1:]), drawn.steps)
    assert np.allclose(off, off[0], atol=1e-12)
    assert not np.allclose(off[0], np.eye(4))


def test_one_seed_draws_one_odometry_and_trust_is_only_told():
    one, again = (drifting(wavy(), quiet(trust=trust), 1.0, np.random.default_rng(3))
                  for trust in (1.0, 4.0))
    assert np.array_equal(one.steps, again.steps)
    assert np.allclose(4 * one.sigma, again.sigma)


# --- claims -----------------------------------------------------------------

def test_right_closures_claim_the_truth_with_noise_and_false_ones_identity():
    truth, declared = wavy(), pairs((60, 10, False), (70, 20, True))
    edges = claim(declared, truth, quiet(), np.random.default_rng(0))
    off = between(edges.relative[:1], between(truth[[10]], truth[[60]]))
    assert 0 < np.linalg.norm(off[0, :3, 3]) < 0.3
    assert np.array_equal(edges.relative[1], np.eye(4))


def test_claims_by_features_are_asked_for_and_a_pair_without_a_pose_makes_no_edge():
    truth, declared = wavy(), pairs((60, 10, False), (70, 20, True), (80, 30, True))
    asked = []

    def measured(older, newer):
        asked.append((older, newer))
        return None if newer == 80 else 2 * np.eye(4)

    edges = claim(declared, truth, quiet(false_claim='essential'), np.random.default_rng(0),
                  measured)
    assert asked == [(20, 70), (30, 80)]
    assert list(edges.pairs.query) == [60, 70]
    assert np.array_equal(edges.relative[1], 2 * np.eye(4))


def test_consistent_claims_move_the_whole_stretch_by_one_motion():
    truth = wavy()
    declared = pairs(*((80 + i, 10 + i, True) for i in range(5)))
    claims = consistent(declared, truth)
    assert np.allclose(claims[0], np.eye(4))
    placed = truth[declared.match] @ claims
    motion = placed @ inverse(truth[declared.query])
    assert np.allclose(motion, motion[0], atol=1e-9)
    assert np.linalg.norm(motion[0, :3, 3]) > 1.0


def test_the_essential_matrix_finds_a_motion_up_to_the_depth_of_the_scene():
    rng = np.random.default_rng(4)
    point = rng.uniform((-2, -1.5, 3), (2, 1.5, 8), (80, 3))
    turn, shift = cv2.Rodrigues(np.array([0.02, 0.1, 0.01]))[0], np.array([0.5, 0.1, 0.2])
    newer, older = (500 * seen[:, :2] / seen[:, 2:] + (320, 240)
                    for seen in (point, point @ turn.T + shift))
    older, newer = views(older, newer)
    depth = float(np.median(point[:, 2]))
    pose = relative_pose(older, newer, 500.0, 1.0, depth)
    assert np.allclose(pose[:3, :3], turn, atol=1e-3)
    assert np.allclose(pose[:3, 3], shift, atol=0.01)
    doubled = relative_pose(older, newer, 500.0, 1.0, 2 * depth)
    assert np.allclose(doubled[:3, 3], 2 * pose[:3, 3])


def test_frames_without_common_features_have_no_relative_pose():
    older, newer = views(np.zeros((5, 2)), np.ones((5, 2)))
    assert relative_pose(older, newer, 500.0, 1.0, 2.0) is None


# --- accuracy ---------------------------------------------------------------

@given(st.integers(0, 2**16))
def test_a_map_that_is_moved_as_a_whole_is_as_good(seed):
    rng = np.random.default_rng(seed)
    truth = wavy(50)
    poses = moved(truth, 0.05 * rng.standard_normal((50, 6)))
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = Rotation.random(random_state=seed).as_matrix(), rng.normal(
        size=3)
    assert absolute_error_m(motion @ poses, truth) == pytest.approx(
        absolute_error_m(poses, truth), abs=1e-9)
    assert np.allclose(aligned(motion @ poses, truth), aligned(poses, truth), atol=1e-8)
    assert relative_error(motion @ poses, truth, 5).translation_m == pytest.approx(
        relative_error(poses, truth, 5).translation_m, abs=1e-9)


def test_no_motion_lays_a_map_better_over_the_truth():
    rng = np.random.default_rng(0)
    truth = wavy(50)
    poses = aligned(moved(truth, 0.1 * rng.standard_normal((50, 6))), truth)
    least = np.sqrt(np.mean(np.sum((poses - truth)[:, :3, 3] ** 2, axis=1)))
    for small in 0.01 * rng.standard_normal((50, 6)):
        other = moved(np.eye(4)[None], small[None])[0] @ poses
        assert np.sqrt(np.mean(np.sum((other - truth)[:, :3, 3] ** 2, axis=1))) > least


def test_a_camera_that_stood_still_has_an_error_too():
    still = np.tile(np.eye(4), (4, 1, 1))
    assert absolute_error_m(still, still) == 0
    assert absolute_error_m(square()[:1], square()[:1]) == 0
    assert relative_error(still, still, 4) is None


def test_the_absolute_error_is_that_of_evo(tmp_path):
    program = shutil.which('evo_ape')
    if program is None:
        pytest.skip('evo is not installed (a program of its own, never imported)')
    rng = np.random.default_rng(0)
    truth = wavy(200)
    poses = moved(truth, 0.2 * rng.standard_normal((200, 6)))
    for name, path in (('truth', truth), ('map', poses)):
        quaternion = Rotation.from_matrix(path[:, :3, :3]).as_quat()
        rows = np.c_[np.arange(200.0), path[:, :3, 3], quaternion]
        np.savetxt(tmp_path / f'{name}.txt', rows, fmt='%.17g')
    subprocess.run([program, 'tum', 'truth.txt', 'map.txt', '--align', '--save_results',
                    'out.zip', '--no_warnings'], cwd=tmp_path, check=True, timeout=120,
                   stdout=subprocess.DEVNULL)
    with zipfile.ZipFile(tmp_path / 'out.zip') as archive:
        rmse = json.loads(archive.read('stats.json'))['rmse']
    assert absolute_error_m(poses, truth) == pytest.approx(rmse, abs=1e-9)


# --- back ends --------------------------------------------------------------

def test_without_gtsam_one_line_says_what_to_do(monkeypatch):
    monkeypatch.setitem(sys.modules, 'gtsam', None)
    with pytest.raises(ConfigError, match=r'maps need gtsam.*\[slam\]') as caught:
        library.gtsam()
    assert '\n' not in str(caught.value)


# Two metres out along x in two steps; the closure says that the last pose is the first. All three
# edges are equally sure and share the contradiction: each is off by 2/3 m.
LINE = square()[:3]
BENT = [[0, 0, 0], [1 / 3, 0, 0], [2 / 3, 0, 0]]


@needs_gtsam
def test_least_squares_shares_a_contradiction_among_all_edges():
    solution = solve(perfect_graph(LINE, [(2, 0, True)]), 'least_squares', quiet())
    assert np.allclose(solution.poses[:, :3, 3], BENT, atol=1e-6)
    assert solution.kept.all()


@needs_gtsam
def test_huber_pulls_with_the_force_at_its_threshold():
    # Beyond k sigma a closure pulls with k / sigma: each of the two steps gives way k sigma.
    solution = solve(perfect_graph(LINE, [(2, 0, True)]), 'huber', quiet(huber=1.0))
    assert solution.poses[2, 0, 3] == pytest.approx(2 - 2 * 1.0 * SIGMA[3], abs=1e-3)
    assert solution.weight[0] == pytest.approx(1.0 / (1.8 / SIGMA[3]), rel=0.01)
    assert not solution.kept.any()


# Around a square with sides of two metres: 0 to 8, the right closure 8-0, the false one 4-0.
SQUARE = square()
CLOSED = [(8, 0, False), (4, 0, True)]


@needs_gtsam
def test_gnc_leaves_out_the_false_closure_of_a_square_and_least_squares_does_not():
    graph = perfect_graph(SQUARE, CLOSED)
    assert np.allclose(solve(graph, 'gnc', quiet()).poses, SQUARE, atol=1e-3)
    assert list(solve(graph, 'gnc', quiet()).kept) == [True, False]
    bent = solve(graph, 'least_squares', quiet()).poses
    # From pose 0 to pose 4 lead four steps, and the other way round four steps and the right
    # closure: 4 and 5 edges side by side. All are equally sure, so that they give way as springs
    # do, by 4 * 5 / 9 of what the false closure gives, and it stays off by the rest of 2 m.
    left = 2 / (1 + 20 / 9)
    assert np.allclose(bent[4, :3, 3], [left, left, 0], atol=1e-4)


@needs_gtsam
@pytest.mark.parametrize('back_end', BACK_ENDS)
def test_right_closures_mend_a_map_that_has_drifted(back_end):
    truth, config = wavy(150), quiet()
    rng = np.random.default_rng(5)
    odometry = drifting(truth, config, 3.0, rng)
    declared = pairs(*((frame, frame - 50, False) for frame in range(60, 150, 5)))
    graph = PoseGraph(truth[0], odometry, claim(declared, truth, config, rng))
    solution = solve(graph, back_end, config)
    assert (absolute_error_m(solution.poses, truth)
            < 0.7 * absolute_error_m(graph.dead_reckoning, truth))
    assert solution.kept.mean() > 0.8
    assert len(errors_m(solution.poses, truth)) == 150


@needs_gtsam
def test_a_graph_read_back_from_its_g2o_file_has_the_same_error(tmp_path):
    graph = perfect_graph(SQUARE, CLOSED)
    write_g2o(tmp_path / 'graph.g2o', graph)
    factors, values = gtsam.readG2o(str(tmp_path / 'graph.g2o'), True)
    own = factors_of(graph, anchored=False)
    assert factors.size() == len(SQUARE) - 1 + len(CLOSED)
    assert factors.error(values) == pytest.approx(own.graph.error(own.initial), rel=1e-6)
    assert np.allclose(poses_of(values), SQUARE, atol=1e-6)


@needs_gtsam
def test_a_young_map_knows_nothing_of_later_frames():
    graph = perfect_graph(SQUARE, CLOSED).first(5)
    assert len(solve(graph, 'gnc', quiet()).poses) == 5
    assert list(graph.closures.pairs.query) == [4]


def test_closures_can_be_made_without_gtsam():
    assert len(closures(SQUARE, CLOSED).pairs) == 2
