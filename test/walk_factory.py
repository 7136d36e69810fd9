# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""A short walk and back in pictures, with settings under which its graphs are attacked at once."""

from contextlib import contextmanager

import bag_factory as make

from adversarial_lcd_ros.cli import main
from adversarial_lcd_ros.config import BuilderConfig, LabelConfig, LcdConfig
from adversarial_lcd_ros.evaluation import workers

NODES = 20
PLACES = 6
LABELS = LabelConfig(rule='distance', min_gap_s=0.1)
RECIPE = """
protocol: frames
seeds: 2
frames: 2
defaults: {nodes: 20, ratio: 0.02, queries_per_edit: 2}
attacks:
  - perturbation: [random_flip, shortest_path]
    surrogate: none
  - search: recall
    oracle: [soft, hard]
  - search: optimum
"""


def walk_folder(path):
    """Write a folder in TUM's layout: six places, three metres apart, each seen twice."""
    count = 2 * PLACES
    make.textured_folder(path, count)
    stamps = make.stamps(count)
    for number, stamp in enumerate(stamps):
        picture = make.noise(number % PLACES).astype(int) + number // PLACES
        (path / f'rgb/{make.seconds(stamp)}.jpg').write_bytes(
            make.encoded(picture.clip(0, 255).astype('uint8')))
    (path / 'groundtruth.txt').write_text('# timestamp tx ty tz qx qy qz qw\n' + '\n'.join(
        make.pose_line(stamp, 3.0 * (number % PLACES)) for number, stamp in enumerate(stamps)))
    return path


def command_on_a_walk(name, folder, vocabulary, monkeypatch, **settings):
    """Return a function that runs a command on a short walk in a folder, in this process."""
    @contextmanager
    def one_process(jobs):
        yield map
    monkeypatch.setattr(workers, 'local_workers', one_process)
    walk_folder(folder / 'walk')
    settings = {
        'cache': folder / 'cache', 'output': folder / 'out', **settings,
        'builder-detector': 'none', 'builder-vocabulary': vocabulary,
        'builder-detected-features': 60, 'lcd-min-gap-s': 0.1, 'lcd-map-window': 0,
        'label-rule': 'distance', 'label-min-gap-s': 0.1}

    def run(*more):
        options = [text for option, value in settings.items()
                   for text in (f'--{option}', str(value))]
        return main([name, str(folder / 'walk'), *options, *more])
    return run


def builder_config(vocabulary):
    return BuilderConfig(detector='none', vocabulary=vocabulary, features=NODES,
                         detected_features=60)


def lcd_config(lcd_model):
    return LcdConfig(model=lcd_model, min_gap_s=0.1, map_window=0)
