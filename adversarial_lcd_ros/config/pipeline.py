# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""Settings of what makes graphs, decides on them, and stands in between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from adversarial_lcd_ros.config.base import Config, setting
from adversarial_lcd_ros.registry import (
    DEFENCES,
    NONE,
    PERTURBATIONS,
    SEARCHES,
    SURROGATES,
    TARGETS,
)

TIERS, ANCHORS = 'tiers', 'anchors'
MODES = ('query', 'surrogate', 'pass')
RETRIES = ('never', 'gained', 'set')


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
