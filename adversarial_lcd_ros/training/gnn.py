# Copyright 2026 adversarial_lcd_ros maintainers
# SPDX-License-Identifier: Apache-2.0

"""
Training of the network of the target gnn: PyTorch here, ONNX where it runs.

PyTorch is an extra, adversarial_lcd_ros[gnn]; only this module needs it.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from adversarial_lcd_ros.errors import ModelError
from adversarial_lcd_ros.lcd.targets.gnn import INPUTS, OUTPUT, network_inputs
from adversarial_lcd_ros.lcd.views import View, match_nodes
from adversarial_lcd_ros.sequences.sequence import Progress
from adversarial_lcd_ros.training.networks import Trainer
from adversarial_lcd_ros.training.pair_scores import LabelledPairs

if TYPE_CHECKING:
    import torch

EPOCHS = 200
STEPS, PAIRS = 2, 48
HIDDEN, EMBEDDING = 64, 32
LEARNING_RATE, WEIGHT_DECAY = 3e-3, 1e-4
OPSET = 14

Layers = list[tuple['torch.nn.Linear', 'torch.nn.Linear']]


def require_pytorch() -> None:
    """Raise ModelError unless there is what a network is trained with."""
    try:
        import onnx  # noqa: F401
        import torch  # noqa: F401
    except ImportError as error:
        raise ModelError(f'the target gnn needs PyTorch to be trained ({error}): pip install '
                         '"adversarial_lcd_ros[gnn]", or leave it out of --targets') from error


class GnnTrainer(Trainer):
    """Trains with PyTorch; ModelError without it."""

    def __init__(self) -> None:
        require_pytorch()

    def train(self, sequences: Sequence[LabelledPairs], path: Path, seed: int,
              progress: Progress | None = None) -> dict[str, Any]:
        """
        Train the network on labelled pairs, write it as ONNX, and return what its card says.

        An epoch is 2 steps of 48 pairs from each sequence, half of them loops.

        Parameters
        ----------
        sequences : sequence of LabelledPairs
        path : Path
            ONNX file to write.
        seed : int
            Of weights and draws: same pairs, same seed, same bytes on one machine.
        progress : callable, optional
            Called with epochs done and to do.

        """
        return _train(sequences, path, seed, progress)


def _train(sequences: Sequence[LabelledPairs], path: Path, seed: int, progress: Progress | None
           ) -> dict[str, Any]:
    import torch

    torch.manual_seed(seed)
    torch.use_deterministic_algorithms(True)
    rng = np.random.default_rng(seed)
    size = network_inputs(View(sequences[0].graphs[0]))[0].shape[1]
    layers: Layers = [(torch.nn.Linear(before, after), torch.nn.Linear(before, after, bias=False))
                      for before, after in ((size, HIDDEN), (HIDDEN, EMBEDDING))]
    slope = torch.nn.Parameter(torch.tensor([20.0, -8.0]))
    weights = [weight for pair in layers for layer in pair for weight in layer.parameters()]
    groups: list[dict[str, Any]] = [{'params': weights}, {'params': [slope], 'lr': 0.1}]
    optimiser = torch.optim.AdamW(groups, lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    views = [[View(graph) for graph in pairs.graphs] for pairs in sequences]
    losses = []
    for epoch in range(EPOCHS):
        for _ in range(STEPS):
            optimiser.zero_grad()
            loss = torch.stack([_loss(layers, slope, pairs, seen, rng)
                                for pairs, seen in zip(sequences, views, strict=True)]).mean()
            torch.autograd.backward([loss])
            optimiser.step()
            losses.append(float(loss.detach()))
        if progress:
            progress(epoch + 1, EPOCHS)
    _write_onnx(layers, path)
    return {'epochs': EPOCHS, 'pairs_an_epoch': STEPS * PAIRS * len(sequences),
            'loss_first': losses[0], 'loss_last': float(np.mean(losses[-10:])),
            'parameters': sum(weight.numel() for weight in weights)}


def _loss(layers: Layers, slope: torch.nn.Parameter, pairs: LabelledPairs, views: list[View],
          rng: np.random.Generator) -> torch.Tensor:
    """Return the cross entropy of a logistic decision on the root of the score, of some pairs."""
    import torch

    chosen = np.concatenate([rng.choice(np.flatnonzero(pairs.is_loop == kind), PAIRS // 2)
                             for kind in (True, False)])
    frames = np.unique(np.r_[pairs.query[chosen], pairs.reference[chosen]])
    embedding = {int(frame): _embed(layers, views[frame]) for frame in frames}
    scores = []
    for index in chosen:
        query, reference = int(pairs.query[index]), int(pairs.reference[index])
        match = match_nodes(views[query], views[reference])
        cosine = (embedding[query][match.query] * embedding[reference][match.reference]).sum(1)
        total = (torch.from_numpy(match.weight) * cosine.clamp(min=0)).sum()
        scores.append(total / max(views[query].features * views[reference].features, 1) ** 0.5)
    logit = slope[0] * torch.sqrt(torch.stack(scores) + 1e-6) + slope[1]
    truth = torch.from_numpy(pairs.is_loop[chosen].astype(np.float32))
    return torch.nn.functional.binary_cross_entropy_with_logits(logit, truth)


def _embed(layers: Layers, view: View) -> torch.Tensor:
    import torch

    rows, adjacency = map(torch.from_numpy, network_inputs(view))
    for number, (own, around) in enumerate(layers):
        rows = own(rows) + adjacency @ around(rows)
        rows = torch.relu(rows) if number + 1 < len(layers) else rows
    return torch.nn.functional.normalize(rows, dim=1)


def _write_onnx(layers: Layers, path: Path) -> None:
    """Write the network node by node: the same weights give the same bytes."""
    from onnx import TensorProto, checker, helper, numpy_helper, save

    nodes, initial, rows = [], [], INPUTS[0]

    def weight(name: str, values: NDArray[np.float32]) -> str:
        initial.append(numpy_helper.from_array(np.ascontiguousarray(values), name))
        return name

    for number, (own, around) in enumerate(layers):
        last = number + 1 == len(layers)
        parts = {'own': own, 'around': around}
        for name, layer in parts.items():
            matrix = weight(f'{name}{number}', layer.weight.detach().numpy().T)
            nodes.append(helper.make_node('MatMul', [rows, matrix], [f'{name}_rows{number}']))
        nodes += [
            helper.make_node('MatMul', [INPUTS[1], f'around_rows{number}'], [f'mixed{number}']),
            helper.make_node('Add', [f'own_rows{number}', f'mixed{number}'], [f'sum{number}']),
            helper.make_node('Add', [f'sum{number}', weight(f'bias{number}',
                                                            own.bias.detach().numpy())],
                             [OUTPUT if last else f'biased{number}'])]
        if not last:
            rows = f'rows{number}'
            nodes.append(helper.make_node('Relu', [f'biased{number}'], [rows]))
    shapes: tuple[list[str | int], list[str | int]] = (
        ['n', layers[0][0].in_features], ['n', 'n'])
    graph = helper.make_graph(
        nodes, 'gnn', [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)
                       for name, shape in zip(INPUTS, shapes, strict=True)],
        [helper.make_tensor_value_info(OUTPUT, TensorProto.FLOAT, ['n', EMBEDDING])], initial)
    model = helper.make_model(graph, producer_name='adversarial_lcd_ros', ir_version=8,
                              opset_imports=[helper.make_opsetid('', OPSET)])
    checker.check_model(model)
    save(model, str(path))
