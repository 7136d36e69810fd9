# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Training end to end on a tiny tour: what is written, that it repeats, what is refused."""

from dataclasses import replace
from functools import partial
import json
import sys

import bag_factory as make
import cv2
import numpy as np
import pytest

from adversarial_lcd_ros.attack.surrogate_data import SurrogateData
from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import BuilderConfig, LcdConfig
from adversarial_lcd_ros.errors import (
    ConfigError,
    EvaluationError,
    ModelError,
    SequenceError,
)
from adversarial_lcd_ros.lcd.detector import LoopClosureDetector
from adversarial_lcd_ros.paths import model_path
from adversarial_lcd_ros.sequences.part import SequencePart
from adversarial_lcd_ros.training import run as training_run
from adversarial_lcd_ros.training.plan import TRAINING_LABELS, TrainingPlan
from adversarial_lcd_ros.training.run import train
from adversarial_lcd_ros.training.sources import one_licence_each
from adversarial_lcd_ros.vision.vocabulary import Vocabulary

LAP, PERIOD_NS = 20, 500_000_000
PLAN = TrainingPlan(BuilderConfig(detector='none', features=60, detected_features=200),
                    # The places are textures, and no surface that an audit could find.
                    labels=replace(TRAINING_LABELS, rule='overlap'),
                    targets=('wl', 'vbow', 'symbio'), pairs=40, branching=4, depth=2,
                    flips_per_frame=2)


def view(place, lap):
    """Return what the camera sees: every place has a texture; the second lap is seen anew."""
    noise = np.random.default_rng(place).integers(0, 256, (24, 32), np.uint8)
    texture = cv2.resize(noise, (320, 240), interpolation=cv2.INTER_CUBIC)
    shift = np.float32([[1, 0.02 * lap, 3 * lap], [0, 1, 2 * lap]])
    return cv2.warpAffine(texture, shift, (320, 240), borderMode=cv2.BORDER_REFLECT)


@pytest.fixture(scope='module')
def tour(tmp_path_factory):
    """Two laps of twenty places five metres apart, in TUM's layout."""
    folder = tmp_path_factory.mktemp('data') / 'tour'
    (folder / 'rgb').mkdir(parents=True)
    images, poses = [], []
    for number in range(2 * LAP):
        lap, place = divmod(number, LAP)
        stamp_ns = make.START_NS + number * PERIOD_NS
        (folder / f'rgb/{number}.png').write_bytes(make.encoded(view(place, lap), '.png'))
        images.append(f'{make.seconds(stamp_ns)} rgb/{number}.png')
        poses.append(make.pose_line(stamp_ns, 5.0 * place + 0.05 * lap))
    (folder / 'rgb.txt').write_text('\n'.join(images))
    (folder / 'groundtruth.txt').write_text('\n'.join(poses))
    (folder / 'CREDITS.txt').write_text('made by a test')
    return folder


@pytest.fixture(scope='module')
def trained(tour, tmp_path_factory):
    output = tmp_path_factory.mktemp('trained') / 'models'
    return output, train([SequencePart(tour)], output, plan=PLAN)


def test_all_artefacts_are_there_and_load(trained):
    output, card = trained
    made = {'vocabulary.npz', 'target_wl.json', 'target_vbow.json', 'target_symbio.json',
            'surrogate_data.npz'}
    assert {path.name for path in output.iterdir()} == made | {'MODEL_CARD.json'}
    assert set(card['files']) == made
    assert [path.name for path in output.parent.iterdir()] == ['models']
    assert len(Vocabulary.load(output / 'vocabulary.npz').idf) == 16
    variants = [card['targets'][target]['graph_variant'] for target in PLAN.targets]
    assert variants == ['tiers', 'tiers', 'anchors']
    for target in PLAN.targets:
        LoopClosureDetector(LcdConfig(target=target, model=str(output / f'target_{target}.json')))
    assert len(SurrogateData.load(output / 'surrogate_data.npz').gain) == card[
        'surrogate_data']['flips'] > 0


def test_the_card_says_what_was_trained_on(trained):
    output, card = trained
    assert json.loads((output / 'MODEL_CARD.json').read_text()) == card
    sequence, = card['sequences']
    assert (sequence['frames'], sequence['frames_in_all']) == (40, 40)
    assert sequence['licence'] == 'see CREDITS.txt of the sequence'
    assert card['vocabulary']['frames'] == 20
    pairs, = card['targets']['wl']['training_pairs']
    # Every place is seen twice, and no two places look alike.
    assert pairs['loops'] == 20
    assert pairs['balanced_accuracy'] > 0.95
    points = card['targets']['wl']['operating_points']
    # Sixteen words retrieve few of the places that were seen before.
    assert 0 < points['loops'][0] <= 20
    assert points['min_gap_s'] == 3
    odds = [points['log_odds'][share] for share in ('1.00', '0.95', '0.90', '0.50')]
    assert odds == sorted(odds)


def test_same_seed_same_bytes(tour, trained, tmp_path):
    output, _ = trained
    train([SequencePart(tour)], tmp_path / 'again', plan=PLAN)
    for path in output.iterdir():
        assert path.read_bytes() == (tmp_path / 'again' / path.name).read_bytes(), path.name


def test_another_seed_is_another_vocabulary(tour, trained, tmp_path):
    train([SequencePart(tour)], tmp_path / 'other', seed=7, plan=PLAN)
    assert ((tmp_path / 'other/vocabulary.npz').read_bytes()
            != (trained[0] / 'vocabulary.npz').read_bytes())


def test_a_vocabulary_can_be_reused_on_the_command_line(tour, trained, tmp_path, capsys):
    settings = tmp_path / 'settings.yaml'
    settings.write_text('graph_builder: {detector: none, features: 60, detected_features: 200}')
    output, vocabulary = tmp_path / 'models', trained[0] / 'vocabulary.npz'
    command = ['train', str(tour), '--output', str(output), '--vocabulary', str(vocabulary),
               '--targets', 'vbow', '--flips-per-frame', '0', '--licence', 'CC0',
               '--config', str(settings)]
    assert main(command) == 0
    assert 'vbow: balanced accuracy on the training pairs' in capsys.readouterr().out
    assert (output / 'vocabulary.npz').read_bytes() == vocabulary.read_bytes()
    assert not (output / 'surrogate_data.npz').exists()
    card = json.loads((output / 'MODEL_CARD.json').read_text())
    assert card['vocabulary']['reused'] == 'vocabulary.npz'
    assert card['sequences'][0]['licence'] == 'CC0'
    assert card['settings']['labels']['min_gap_s'] == 3.0
    assert main(command) == 2
    assert 'exists already' in capsys.readouterr().err


def test_overwrite_replaces_artefacts_and_nothing_else(tour, tmp_path):
    output = tmp_path / 'models'
    output.mkdir()
    (output / 'target_edges.json').write_text('of an earlier training')
    (output / 'notes.txt').write_text('mine')
    train([SequencePart(tour)], output, plan=PLAN, overwrite=True)
    assert (output / 'notes.txt').read_text() == 'mine'
    assert not (output / 'target_edges.json').exists()
    assert (output / 'MODEL_CARD.json').exists()


def without_truth(tour, tmp_path):
    folder = make.tum_folder(tmp_path / 'blind', truth=False)
    return [SequencePart(folder)], PLAN


def first_lap(tour, tmp_path):
    return [SequencePart(tour, 0.0, 0.5)], PLAN


def no_frame(tour, tmp_path):
    return [SequencePart(tour, 0.0, 0.01)], PLAN


def many_words(tour, tmp_path):
    return [SequencePart(tour)], TrainingPlan(PLAN.builder, depth=4)


@pytest.mark.parametrize(('case', 'kind', 'message'), [
    (without_truth, SequenceError, 'blind has no ground truth'),
    (first_lap, EvaluationError, 'frames 0 to 19 of 40: 20 frames with 0 pairs that are loops'),
    (no_frame, SequenceError, 'which has 40 frames, holds none'),
    (many_words, ModelError, 'descriptors for 65536 words'),
], ids=lambda value: getattr(value, '__name__', ''))
def test_what_cannot_be_trained_on_is_refused_and_leaves_nothing(tour, tmp_path, case, kind,
                                                                 message):
    sources, plan = case(tour, tmp_path)
    with pytest.raises(kind, match=message):
        train(sources, tmp_path / 'out/models', plan=plan)
    assert list((tmp_path / 'out').iterdir()) == []


def test_a_network_without_pytorch_is_refused_before_the_work(tour, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'torch', None)
    monkeypatch.setattr(training_run, 'open_source', None)
    with pytest.raises(ModelError, match=r'pip install "adversarial_lcd_ros\[gnn\]"'):
        train([SequencePart(tour)], tmp_path / 'models', plan=TrainingPlan(targets=('gnn',)))


def test_a_network_of_an_earlier_training_is_used_without_pytorch(tour, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, 'torch', None)
    plan = replace(PLAN, targets=('gnn',), flips_per_frame=0,
                   networks=model_path('target_gnn.onnx').parent)
    card = train([SequencePart(tour)], tmp_path / 'models', plan=plan)
    assert ((tmp_path / 'models/target_gnn.onnx').read_bytes()
            == model_path('target_gnn.onnx').read_bytes())
    assert card['targets']['gnn']['operating_points']['loops'][0] > 0
    with pytest.raises(ModelError, match=r'has no target_gnn\.onnx: expected the folder'):
        train([SequencePart(tour)], tmp_path / 'other', plan=replace(plan, networks=tmp_path))


@pytest.mark.parametrize(('text', 'part'), [
    ('a/b', (0.0, 1.0)), ('a/b@0:0.5', (0.0, 0.5)), ('a@b@.25:1', (0.25, 1.0))])
def test_parts_are_read(text, part):
    source = SequencePart.parse(text)
    assert (source.start, source.stop) == part
    assert '@' not in source.path.name or source.path.name == 'a@b'


@pytest.mark.parametrize('text', ['a@', 'a@half', 'a@0.5', 'a@0.5:0.5', 'a@0:1.5', 'a@-1:1',
                                  'a@nan:1'])
def test_wrong_parts_are_refused(text):
    with pytest.raises(SequenceError, match=r'such as .*0:0\.5'):
        SequencePart.parse(text)


def test_an_existing_path_may_hold_an_at(tmp_path):
    (tmp_path / 'tour@0:0.5').mkdir()
    assert SequencePart.parse(str(tmp_path / 'tour@0:0.5')).stop == 1.0


@pytest.mark.parametrize('wrong', [
    partial(TrainingPlan, targets=()), partial(TrainingPlan, targets=('wl', 'wl')),
    partial(TrainingPlan, targets=('gnn2',)), partial(TrainingPlan, pairs=0),
    partial(TrainingPlan, vocabulary_stride=0), partial(TrainingPlan, flips_per_frame=-1)])
def test_a_plan_is_checked(wrong):
    with pytest.raises(ConfigError, match=r'expected|no target'):
        wrong()


def test_licences_are_one_for_each_sequence():
    source = SequencePart.parse('tour')
    assert one_licence_each([source], ['CC0']) == ['CC0']
    assert one_licence_each([source], []) == ['']
    with pytest.raises(SequenceError, match='2 licences for 1 sequences'):
        one_licence_each([source], ['CC0', 'CC BY 4.0'])
