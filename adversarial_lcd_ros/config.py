# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Every setting of the package: default, range, unit and description, once.

Command line options, ROS parameters, YAML files and the documentation are made from these
frozen dataclasses. Field metadata holds what a range check and a help text need.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import Field, dataclass, field, fields
import math
from typing import Any, ClassVar, TypeVar

from adversarial_lcd_ros.errors import ConfigError, with_suggestions
from adversarial_lcd_ros.registry import (
    DEFENCES,
    NONE,
    PERTURBATIONS,
    SEARCHES,
    SURROGATES,
    TARGETS,
    Table,
)

MODES = ('query', 'surrogate', 'pass')
RETRIES = ('never', 'gained', 'set')
# What makes a map, from the one that believes every closure to the one that leaves out most.
BACK_ENDS = ('least_squares', 'huber', 'cauchy', 'gnc')
POSTERS = (NONE, 'cells', 'noise', 'chessboard')
TIERS, ANCHORS = 'tiers', 'anchors'

ConfigT = TypeVar('ConfigT', bound='Config')


def setting(default: Any, help: str, *, low: float | None = None, high: float | None = None,
            choices: tuple[str, ...] | Table | None = None, several: bool = False,
            empty: bool = False) -> Any:
    """
    Return a dataclass field with what is needed to check and to explain it.

    Choices are values, or a table of classes; ``several`` takes names of it between commas,
    ``empty`` none as well.
    """
    return field(default=default, metadata={
        'help': help, 'low': low, 'high': high, 'choices': choices, 'several': several,
        'empty': empty})


@dataclass(frozen=True)
class Config:
    """Base of all settings: checked on construction."""

    title: ClassVar[str] = ''

    def __post_init__(self) -> None:
        """Check the type and range of every field."""
        for entry in fields(self):
            _check(type(self).__name__, entry, getattr(self, entry.name))

    @classmethod
    def from_mapping(cls: type[ConfigT], values: Mapping[str, Any]) -> ConfigT:
        """
        Return the settings with the given values in place of defaults.

        Raises
        ------
        ConfigError
            A name is unknown, or a value of the wrong type or out of range.

        """
        known = {entry.name: entry for entry in fields(cls)}
        unknown = sorted(str(name) for name in values if name not in known)
        if unknown:
            raise ConfigError(f'unknown setting {with_suggestions(unknown, known)} for '
                              f'{cls.__name__}; there are: {", ".join(known)}')
        return cls(**{name: _widen(known[name], value) for name, value in values.items()})

    def changed(self, *but: str) -> str:
        """Return the settings that are not the default in words, some left out; '' if none."""
        return ', '.join(f'{entry.name} {getattr(self, entry.name)}' for entry in fields(self)
                         if entry.name not in but and getattr(self, entry.name) != entry.default)


def _widen(entry: Field[Any], value: Any) -> Any:
    # A whole number is a fine value for a real setting (YAML "1", command line "1").
    if isinstance(entry.default, float) and type(value) is int:
        return float(value)
    return value


def _check(owner: str, entry: Field[Any], value: Any) -> None:
    expected = type(entry.default)
    if type(value) is not expected:
        raise ConfigError(f'{owner}.{entry.name} = {value!r}: expected {expected.__name__}, '
                          f'found {type(value).__name__}')
    low, high, choices = (entry.metadata[key] for key in ('low', 'high', 'choices'))
    if isinstance(choices, Table):
        _check_names(f'{owner}.{entry.name}', entry, choices, value)
    elif choices is not None and value not in choices:
        raise ConfigError(f'{owner}.{entry.name} = {value!r}: expected one of '
                          f'{", ".join(choices)}')
    if isinstance(value, float) and not math.isfinite(value):
        raise ConfigError(f'{owner}.{entry.name} = {value}: expected a finite number')
    if (low is not None and value < low) or (high is not None and value > high):
        raise ConfigError(f'{owner}.{entry.name} = {value}: expected {low} to '
                          f'{"any" if high is None else high}')


def _check_names(what: str, entry: Field[Any], table: Table, value: Any) -> None:
    if not value and entry.metadata['empty']:
        return
    for name in names_in(value) if entry.metadata['several'] else [value]:
        try:
            table.check(name)
        except ConfigError as error:
            raise ConfigError(f'{what} = {value!r}: {error}') from error


def names_in(text: str) -> list[str]:
    """Return the names in a setting that takes several, between commas."""
    return [name.strip() for name in text.split(',')]


@dataclass(frozen=True)
class MessageLimits(Config):
    """The largest messages that are taken in: hostile ones must not cost time or memory."""

    title: ClassVar[str] = 'limits of messages'

    max_nodes: int = setting(
        10_000, 'Most nodes of a graph that is taken in.', low=1, high=1_000_000)
    max_edges: int = setting(
        200_000, 'Most edges of a graph that is taken in.', low=1, high=10_000_000)
    max_words: int = setting(
        20_000, 'Most visual words of a graph that is taken in.', low=1, high=1_000_000)
    max_pixels: int = setting(
        2 ** 25, 'Most pixels of an image that is taken in (width times height, as its header '
        'says); 2^25 is 8K.', low=1, high=2 ** 30)
    max_payload_bytes: int = setting(
        2 ** 24, 'Most bytes of a payload that is taken in.', low=1024, high=2 ** 30)


@dataclass(frozen=True)
class BuilderConfig(Config):
    """Camera image to multi-tier graph (paper, Fig. 2 a-c)."""

    title: ClassVar[str] = 'graph_builder'

    features: int = setting(
        300, 'Feature nodes in a graph, the strongest after spreading.', low=8, high=5000)
    detected_features: int = setting(
        1500, 'ORB features looked for in a frame; all of them count for the vBoW vector.',
        low=8, high=20000)
    fast_threshold: int = setting(
        10, 'FAST threshold of ORB, grey levels.', low=1, high=100)
    feature_neighbours: int = setting(
        6, 'Nearest features that a feature is joined with (k); of the variant tiers.', low=0,
        high=50)
    graph_variant: str = setting(
        TIERS, 'Which nodes are joined. tiers: every two objects, features with their objects and '
        'with each other. anchors: a node for the whole scene as well, for features outside all '
        'boxes, and no two features; the target symbio needs it.', choices=(TIERS, ANCHORS))
    detector: str = setting(
        'onnx', 'Where objects come from: the network (onnx), nowhere (none), a file of recorded '
        'detections (csv), or, in the node, the topic detections (topic).',
        choices=('onnx', 'none', 'csv', 'topic'))
    detections: str = setting(
        '', 'Detector csv: file with the columns timestamp,class,x,y,w,h,score, or, in commands, '
        "YOLO's folder of labels, named as the pictures; empty: the detections.csv of a sequence "
        'that has no images.')
    detections_tolerance_s: float = setting(
        0.01, 'Detectors csv and topic: largest offset in time between a frame and its '
        'detections, seconds.', low=0.0, high=1e3)
    model: str = setting(
        '', 'ONNX object model; empty: the one that ships.')
    vocabulary: str = setting('', 'Visual vocabulary (npz); empty: the one that ships.')
    object_score: float = setting(
        0.4, 'Least confidence of an object.', low=0.0, high=1.0)
    min_object_area: float = setting(
        0.002, 'Least area of an object as a fraction of the image.', low=0.0, high=1.0)
    max_object_area: float = setting(
        0.8, 'Largest area of an object as a fraction of the image.', low=0.0, high=1.0)
    border_margin: float = setting(
        0.02, 'Objects are dropped whose centre is closer to the border than this fraction of '
        'the width or height.', low=0.0, high=0.5)
    max_objects: int = setting(20, 'Most object nodes in a graph.', low=0, high=200)
    threads: int = setting(
        1, 'Threads of the network for one frame; 0: as many as cores.', low=0, high=256)


@dataclass(frozen=True)
class LcdConfig(Config):
    """Loop closure detector: graphs to decisions (paper, target-LCD)."""

    title: ClassVar[str] = 'lcd'

    target: str = setting('wl', 'How two graphs are compared.', choices=TARGETS)
    model: str = setting(
        '', 'Trained target (JSON), or the folder of a training; empty: the one that ships.')
    candidates: int = setting(
        5, 'Keyframes that vBoW retrieves for the graph to decide on.', low=1, high=1000)
    min_gap_s: float = setting(
        8.0, 'Keyframes younger than this are no candidates, seconds.', low=0.0, high=1e6)
    map_window: int = setting(
        1, 'Temporal consistency: a candidate is scored together with this many keyframes '
        'before and after it.', low=0, high=20)
    kept_loops: float = setting(
        0.99, 'Operating point: share of the loops met in training that the decision keeps at '
        'probability 0.5; the fewer, the more a loop has to show.', low=0.5, high=1.0)
    threshold: float = setting(
        0.5, 'A loop closure is declared from this probability on.', low=0.0, high=1.0)
    defences: str = setting(
        NONE, 'What stands between graphs and decisions; several, in their order, between commas.',
        choices=DEFENCES, several=True)
    geometric_check: bool = setting(
        False, 'Declare a loop only if the features of both frames agree on one camera motion: '
        'short for the defence of that name.')
    geometric_inliers: int = setting(
        20, 'Geometric check: least matches that agree; the default is for graphs of about 300 '
        'features.', low=8, high=100_000)
    geometric_threshold_px: float = setting(
        3.0, 'Geometric check: largest distance of a match from its epipolar line, pixels.',
        low=0.01, high=1000.0)
    geometric_hull: float = setting(
        0.0, 'Geometric check: least share of the frame, of either, that the convex hull of the '
        'matches that agree covers; 0: not looked at.', low=0.0, high=1.0)
    length_factor: float = setting(
        2.0, 'Length check: how many times as long as in one frame an edge that recurs may be in '
        'the other.', low=1.0, high=1000.0)
    length_slack: float = setting(
        0.01, 'Length check: what is added to that, over the image diagonal.', low=0.0, high=1.0)
    rederive_neighbours: int = setting(
        6, 'Rederive, rederive_check: nearest features that a feature is joined with, as '
        'feature_neighbours of graph_builder.', low=0, high=50)
    nearest_neighbours: int = setting(
        12, 'Nearest_check: nearest features (K) that a feature may be joined with; at least '
        'feature_neighbours of graph_builder.', low=0, high=10_000)
    common_share: float = setting(
        0.136, 'Defence common_part: least share of the features in what both frames see that '
        'match in place; the default is for graphs of about 300 features.', low=0.001, high=1.0)
    hard_answers: bool = setting(
        False, 'Answer queries with the decision only, not with the probability.')
    max_keyframes: int = setting(
        100_000, 'Most keyframes remembered; further graphs are judged but not stored.',
        low=1, high=10_000_000)
    max_keyframe_mb: int = setting(
        4096, 'Most memory of keyframes, MB; further graphs are judged but not stored. A graph '
        'of 300 features takes about 0.1.', low=1, high=10_000_000)


@dataclass(frozen=True)
class AttackConfig(Config):
    """The man in the middle (paper, attack-module)."""

    title: ClassVar[str] = 'attacker'

    mode: str = setting(
        'query', 'query: query-guided; surrogate: no queries, stepwise by a surrogate trained '
        'beforehand; pass: forward unchanged.', choices=MODES)
    search: str = setting(
        'stepwise', 'What is changed, and how it is looked for: edges, flip after flip as in the '
        'paper, by our own recall, or by Bayesian optimisation as in GRABNEL; or, beyond the '
        'paper, nodes (move_nodes) or the whole graph (replay).', choices=SEARCHES)
    perturbation: str = setting(
        'eigencentrality', 'Stepwise: how candidate flips are chosen.', choices=PERTURBATIONS)
    surrogate: str = setting(
        'svm_rbf', 'Stepwise: model that predicts the attack loss of a perturbed graph.',
        choices=SURROGATES)
    retry: str = setting(
        'gained', 'Stepwise: what becomes of flips that were asked about and not chosen. never: '
        'they are not asked about again; gained: those that gained are; set: the same as never, '
        "but the best three are chosen at once, after three edits' worth of queries.",
        choices=RETRIES)
    gamma: str = setting(
        'paper', 'Width of the kernels rbf and poly: 1 / (2 sigma^2) as in Eq. (8), or '
        'scikit-learn\'s "scale", 1 / (d Var).', choices=('paper', 'scale'))
    sigma: float = setting(
        0.0, 'Gamma paper: sigma, in standard deviations of a feature; 0: the root of '
        'the summed variance of all.', low=0.0, high=1e6)
    ratio: float = setting(
        3e-4, 'Perturbation ratio r: floor(r n^2) edges may be flipped.', low=0.0, high=1.0)
    queries_per_edit: int = setting(
        40, 'Query budget of a graph, for each edit that it allows.', low=0, high=100_000)
    max_queries: int = setting(
        100_000, 'Query budget of a graph, whatever its edit budget.', low=0, high=10_000_000)
    deadline_ms: float = setting(
        0.0, 'After this time the best graph so far is forwarded, milliseconds, in the node '
        'counted from its arrival; 0: no deadline.', low=0.0, high=1e7)
    surrogate_data: str = setting(
        '', 'Surrogate mode: queried flips (npz) that the surrogate learns from; empty: those '
        'that ship.')
    wl_iterations: int = setting(
        2, 'Iterations H of the Weisfeiler-Lehman features of Eq. (4)-(6).', low=1, high=10)
    wl_features: str = setting(
        'pooled', 'Features of a perturbed graph: pooled over its nodes, which carries over '
        'between frames, or node by node as in Eq. (5) (query mode only).',
        choices=('pooled', 'per_graph'))
    echoes: str = setting(
        'both', 'Recall: edges that it replays or erases, those between features or those at '
        'objects; both: the answers tell which, and without queries features.',
        choices=('both', 'features', 'objects'))
    lengths: bool = setting(
        False, 'Recall: only edges that are about as long in the graph of the past as here, as '
        'a length check asks for (a factor of two).')
    nearest: int = setting(
        0, 'Recall: only edges added, and to one of so many nearest features, as a check passes '
        'that makes edges again and is not sure of k; 0: all.', low=0, high=10_000)
    moved: str = setting(
        'close', 'Move_nodes: which features are moved: those that keep most edges of the past '
        'among themselves (close), or some far apart before these, so that their hull is large '
        '(spread).', choices=('close', 'spread'))
    nodes_moved: int = setting(
        40, 'Move_nodes: most features that are moved, their edges with them.', low=2,
        high=100_000)
    edits: str = setting(
        'both', 'Which flips are allowed: add edges, delete edges, or both.',
        choices=('both', 'add', 'delete'))
    seed: int = setting(42, 'Seed of every random choice.', low=0, high=2**31 - 1)


@dataclass(frozen=True)
class ReplayConfig(Config):
    """Replay of a bag."""

    title: ClassVar[str] = 'bag_replay'

    lockstep: bool = setting(
        False, 'Publish a frame, wait for the decision with the same stamp: nothing is lost.')
    window: int = setting(
        1, 'Lockstep: frames that may be under way at once.', low=1, high=8)
    rate: float = setting(
        1.0, 'Speed of a replay in real time, as a multiple of the recorded one.',
        low=1e-3, high=1e3)
    start_s: float = setting(0.0, 'Seconds of the bag to skip.', low=0.0, high=1e9)
    duration_s: float = setting(
        0.0, 'Seconds of the bag to replay; 0: to its end.', low=0.0, high=1e9)
    stride: int = setting(1, 'Every how many frames one is replayed.', low=1, high=100_000)
    loop: int = setting(
        1, 'How often the bag is replayed; stamps go on rising.', low=1, high=1_000_000)
    clock: bool = setting(True, 'Publish /clock.')
    start_timeout_s: float = setting(
        30.0, 'Wait so long for the other nodes at the start, seconds, and anew while one of '
        'them is loading or compiling. 0: as long as it takes.', low=0.0, high=1e6)
    poster: str = setting(
        NONE, 'A poster that is pasted into frames on their way to graph_builder: cells, noise or '
        'a chessboard.', choices=POSTERS)
    poster_share: float = setting(
        0.05, 'Poster: share of the frame that it covers, two sheets together.', low=0.001,
        high=1.0)
    poster_sheets: int = setting(
        1, 'Poster: sheets; two hang in opposite corners of one square.', low=1, high=2)
    poster_spans: str = setting(
        '', 'Poster: when it is seen, FROM:TO in seconds of the bag, several between commas.')
    poster_seed: int = setting(
        42, 'Poster: seed of its texture, place and light.', low=0, high=2**31 - 1)
    timeout_s: float = setting(
        30.0, 'In lockstep wait so long for a decision, and at the end for the rest, seconds.',
        low=0.1, high=1e6)


@dataclass(frozen=True)
class LabelConfig(Config):
    """Which pairs of frames are a loop, from ground truth only (docs/labels.md)."""

    title: ClassVar[str] = 'labels'

    rule: str = setting(
        'auto', 'How two views are judged: by co-visibility or depth images where they lie '
        'beside the recording, else by an audit (auto); by what can be shown in the pictures '
        'under the true poses (audit); or from poses alone, by the overlap that they may have '
        '(overlap) or by distance and angle (distance).',
        choices=('auto', 'audit', 'overlap', 'distance'))
    loop_share: float = setting(
        0.5, 'Auto: least share of a loop, of the surface of either view, that the other sees.',
        low=0.0, high=1.0)
    shared_share: float = setting(
        0.3, 'Auto: least share, of the surface of one of two views, at which a match is right; '
        'where the other has less in common, it is a change of scale.', low=0.0, high=1.0)
    elsewhere_share: float = setting(
        0.1, 'Auto: pairs of which either view shares less are different places, and a match '
        'that names one is wrong.', low=0.0, high=1.0)
    positive_overlap: float = setting(
        0.6, 'Least view overlap of a loop, seen from both sides.', low=0.0, high=1.0)
    possible_overlap: float = setting(
        0.4, 'View overlap, seen from both sides, below which a match is wrong, a camera has '
        'looked elsewhere, and a frame that has no other candidates is at a new place.',
        low=0.0, high=1.0)
    negative_overlap: float = setting(
        0.1, 'Pairs whose view overlap is below this from either side are different places; '
        'the band between is left out.', low=0.0, high=1.0)
    positive_distance_m: float = setting(
        0.5, 'Largest distance of a loop, metres (also under the overlap rule).',
        low=0.0, high=1e3)
    positive_angle_deg: float = setting(
        25.0, 'Largest angle of a loop, degrees (also under the overlap rule).',
        low=0.0, high=180.0)
    negative_distance_m: float = setting(
        2.0, 'Distance rule: two views are different places from this distance on, metres.',
        low=0.0, high=1e6)
    negative_angle_deg: float = setting(
        60.0, 'Distance rule: or from this angle on, degrees.', low=0.0, high=180.0)
    positive_index: int = setting(
        2, 'Ground truth by index: largest difference of a loop.', low=0, high=10_000)
    negative_index: int = setting(
        10, 'Ground truth by index: least difference of two places.', low=1, high=100_000)
    min_gap_s: float = setting(
        8.0, 'A loop joins frames at least this far apart in time, seconds.',
        low=0.0, high=1e6)
    pose_tolerance_s: float = setting(
        0.05, 'Largest offset in time between a frame and its ground truth pose, seconds.',
        low=0.0, high=1e3)
    focal_length: float = setting(
        0.82, 'Focal length over the image width (TUM: 525 / 640).', low=0.1, high=10.0)

    def __post_init__(self) -> None:
        """Check the ranges, and that no pair can be a loop and two places at once."""
        super().__post_init__()
        ascending = (('negative_overlap', 'possible_overlap'),
                     ('possible_overlap', 'positive_overlap'),
                     ('elsewhere_share', 'shared_share'),
                     ('shared_share', 'loop_share'),
                     ('positive_distance_m', 'negative_distance_m'),
                     ('positive_angle_deg', 'negative_angle_deg'),
                     ('positive_index', 'negative_index'))
        for low, high in ascending:
            if getattr(self, low) >= getattr(self, high):
                raise ConfigError(f'LabelConfig.{low} = {getattr(self, low)}: expected less than '
                                  f'{high} = {getattr(self, high)}')


@dataclass(frozen=True)
class MapConfig(Config):
    """What closures do to a map: odometry, front end and back ends (docs/map.md)."""

    title: ClassVar[str] = 'map'

    drift_model: str = setting(
        'independent', 'Errors of the odometry: drawn at every step (independent), or once for '
        'the whole run (biased).', choices=('independent', 'biased'))
    drift_rotation_deg: float = setting(
        0.2, 'Odometry: standard deviation of a step about each axis, degrees.',
        low=0.0, high=180.0)
    drift_rotation_share: float = setting(
        0.01, 'Odometry: and this share of the rotation of the step.', low=0.0, high=10.0)
    drift_translation_m: float = setting(
        0.002, 'Odometry: standard deviation of a step along each axis, metres.',
        low=0.0, high=1e3)
    drift_translation_share: float = setting(
        0.02, 'Odometry: and this share of the length of the step.', low=0.0, high=10.0)
    trust: float = setting(
        1.0, 'What a back end takes the errors of the odometry for, as a multiple of what they '
        'are.', low=1e-3, high=1e3)
    right_claim: str = setting(
        'noisy_truth', 'Relative pose that a right closure claims: the true one with noise '
        '(noisy_truth), or that of the essential matrix of the features (essential).',
        choices=('noisy_truth', 'essential'))
    false_claim: str = setting(
        'identity', 'Relative pose that a false closure claims: the camera is where it was '
        '(identity); all of a run by one displacement, that of the first, as views of a sheet '
        'that hangs in two places do (consistent); or that of the essential matrix of the '
        'features (essential).', choices=('identity', 'consistent', 'essential'))
    closure_rotation_deg: float = setting(
        1.0, 'Closures: standard deviation about each axis, degrees.', low=1e-3, high=180.0)
    closure_translation_m: float = setting(
        0.05, 'Closures: standard deviation along each axis, metres.', low=1e-6, high=1e3)
    scene_depth_m: float = setting(
        2.0, 'Claim essential: depth of the scene that gives the translation its length, metres.',
        low=1e-3, high=1e4)
    essential_threshold_px: float = setting(
        3.0, 'Claim essential: largest distance of a match from its epipolar line, pixels.',
        low=0.01, high=1000.0)
    huber: float = setting(
        1.345, 'Back end huber: standard deviations from which on a closure counts less.',
        low=1e-3, high=1e6)
    cauchy: float = setting(
        2.385, 'Back end cauchy: standard deviations at which a closure counts half.',
        low=1e-3, high=1e6)
    gnc_probability: float = setting(
        0.99, 'Back end gnc: share of right closures that its bound on errors lets pass.',
        low=0.5, high=0.999999)
    rpe_s: float = setting(
        1.0, 'Relative pose error: over pairs of frames this far apart, seconds.',
        low=1e-3, high=1e6)
    young_frames: int = setting(
        0, 'Frames of the young map; 0: up to the first frame that by ground truth has a loop.',
        low=0, high=1_000_000)
    draws: int = setting(
        5, 'Draws of the odometry; intervals are over them.', low=1, high=1000)
    seed: int = setting(42, 'Seed of all draws.', low=0, high=2**31 - 1)


@dataclass(frozen=True)
class GraphBuilderNodeConfig(Config):
    """What the graph_builder node has beside BuilderConfig."""

    title: ClassVar[str] = 'graph_builder node'

    queue_depth: int = setting(
        10, 'Camera frames that may wait; older ones give way. 1: always the newest.',
        low=1, high=1000)
    frames_at_once: int = setting(
        2, 'Frames whose objects are looked for side by side; graphs leave in the order of '
        'their frames.', low=1, high=64)
    detections_wait_ms: float = setting(
        300.0, 'Detector topic: a frame waits so long for its detections, milliseconds; then its '
        'graph goes out without objects. At most queue_depth frames wait.', low=0.0, high=1e6)
    key: str = setting(
        '', 'File of a key, as "adversarial-lcd key" makes it: graphs are sealed with it; empty: '
        'they are not.')


@dataclass(frozen=True)
class LcdNodeConfig(Config):
    """What the lcd node has beside LcdConfig."""

    title: ClassVar[str] = 'lcd node'

    max_queries_per_s: int = setting(
        10_000, 'Queries beyond so many in a second are refused. Graphs that wait are decided '
        'before any query in any case.', low=1, high=10_000_000)
    key: str = setting(
        '', 'File of the key of graph_builder: graphs that are not sealed with it, or come again, '
        'late or out of order, are refused; empty: all are taken.')
    max_age_s: float = setting(
        10.0, 'Under a key: graphs sealed longer ago, or ahead, are refused, seconds by the '
        'clocks of both machines; 0: not looked at.', low=0.0, high=1e6)


@dataclass(frozen=True)
class AttackerNodeConfig(Config):
    """What the attacker node has beside AttackConfig."""

    title: ClassVar[str] = 'attacker node'

    query_timeout_s: float = setting(
        2.0, 'Wait so long for the answer to a query, seconds; then the best graph so far is '
        'forwarded.', low=1e-3, high=1e4)
    max_backlog: int = setting(
        10, 'Once more graphs than this wait, the attack under way ends and the waiting ones '
        'are forwarded unchanged.', low=1, high=100_000)


@dataclass(frozen=True)
class BagReplayNodeConfig(Config):
    """What the bag_replay node has beside ReplayConfig."""

    title: ClassVar[str] = 'bag_replay node'

    bag: str = setting('', 'Bag to replay: a rosbag2 folder, or an .mcap or .db3 file.')
    record: str = setting(
        '', 'Bag (MCAP) to write the graphs, decisions and attack reports of this replay to; '
        'empty: none.')
    record_frames: bool = setting(
        True, 'Record what is replayed, too: camera frames, poses, detections.')
    key: str = setting(
        '', 'Lockstep: file of the key of lcd, where it has one; frames whose graph lcd refuses '
        'for its seal are not waited for. Empty: every frame is.')


@dataclass(frozen=True)
class MapBuilderNodeConfig(Config):
    """The map_builder node: decisions and odometry to a map (docs/map.md)."""

    title: ClassVar[str] = 'map_builder node'

    back_end: str = setting(
        'cauchy', 'What makes the map, frame by frame (iSAM2): gnc needs all frames at once.',
        choices=BACK_ENDS[:3])
    odometry: str = setting(
        'topic', 'Where the odometry is from: the topic odom, or the topic ground_truth with '
        'drift (truth).', choices=('topic', 'truth'))
    drift: float = setting(
        1.0, 'Odometry truth: errors, as a multiple of those of the command "map".',
        low=0.0, high=1e3)
    odometry_tolerance_s: float = setting(
        0.05, 'Largest offset in time between a decision and its odometry, seconds.',
        low=0.0, high=1e3)
    step_rotation_deg: float = setting(
        0.3, 'What the map takes the error of the odometry from frame to frame for, about each '
        'axis, degrees.', low=1e-3, high=180.0)
    step_translation_m: float = setting(
        0.01, 'And along each axis, metres.', low=1e-6, high=1e3)
    closure_rotation_deg: float = setting(
        5.0, 'A closure claims that the camera is where it was: within so much about each axis, '
        'degrees.', low=1e-3, high=180.0)
    closure_translation_m: float = setting(
        0.2, 'And along each axis, metres.', low=1e-6, high=1e3)
    max_poses: int = setting(
        20_000, 'Most poses of a map; decisions beyond are counted and left out.', low=2,
        high=1_000_000)
    map_frame: str = setting('map', 'Name of the frame that the map is in.')
    odom_frame: str = setting(
        'odom', 'Name of the frame that the odometry is in, where its messages have none.')
    seed: int = setting(42, 'Odometry truth: seed of its errors.', low=0, high=2**31 - 1)
