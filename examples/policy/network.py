"""Network of the policy: features, a classifier of twists, and both as an ONNX graph."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from onnx import ModelProto, TensorProto, helper, numpy_helper
from sklearn.neural_network import MLPClassifier

from wayproof.harness.interface.policy_tensors import OBSERVATION

FORWARD = (-0.2, 0.0, 0.25, 0.5, 0.75, 1.0)
TURN = (-1.0, -0.6, -0.3, -0.1, 0.0, 0.1, 0.3, 0.6, 1.0)
TWISTS = np.array([(f, t) for f in FORWARD for t in TURN])
"""Classes (54, 2): forward velocity and yaw rate as shares of the body's limits."""

INPUTS = ("scan", "goal", "velocity", "reference")
"""Tensors that the policy takes."""

LAYERS = (128, 128)
"""Number of neurons of the hidden layers."""

NEAR_M = 0.5
"""Distance at which a return counts half, m."""

Samples = dict[str, np.ndarray]


class Network(NamedTuple):
    """Weights (in, out) and biases (out,) of each layer."""

    weights: list[np.ndarray]
    biases: list[np.ndarray]


def features(inputs: Samples) -> np.ndarray:
    """Features (n, m) of tensors (n, ...), as `onnx_model` computes them."""
    scan, goal = inputs["scan"], inputs["goal"]
    near = NEAR_M / (scan + NEAR_M)
    away = np.sqrt((goal * goal).sum(axis=1, keepdims=True))
    parts = (near, 0.1 * scan, goal / (away + 1.0), 0.1 * away, 1.0 / (away + 1.0))
    return np.concatenate([*parts, inputs["velocity"], inputs["reference"]], axis=1)


def nearest_twists(twists: np.ndarray) -> np.ndarray:
    """Number (n,) of the class nearest to each twist (n, 2)."""
    return np.square(twists[:, None] - TWISTS[None]).sum(axis=2).argmin(axis=1)


def mirrored(samples: list[tuple[Samples, np.ndarray]]) -> tuple[np.ndarray, np.ndarray]:
    """Features and labels of all samples, and of the same seen in a mirror: left is right."""
    inputs = {name: np.concatenate([one[name] for one, _ in samples]) for name in INPUTS}
    labels = np.concatenate([labels for _, labels in samples])
    sides = np.array([1.0, -1.0, 1.0, -1.0], np.float32)
    other = {
        "scan": inputs["scan"][:, ::-1],
        "goal": inputs["goal"] * sides[:3],
        "velocity": inputs["velocity"] * sides,
        "reference": inputs["reference"] * sides,
    }
    swapped = nearest_twists(TWISTS * [1.0, -1.0])
    both = np.concatenate([features(inputs), features(other)])
    return both, np.concatenate([labels, swapped[labels]])


def train(inputs: np.ndarray, labels: np.ndarray, seed: int) -> tuple[Network, float]:
    """A network fitted to features and labels, and its loss."""
    classifier = MLPClassifier(LAYERS, alpha=1e-4, learning_rate_init=1e-3, random_state=seed)
    mean, scale = inputs.mean(axis=0), inputs.std(axis=0) + 1e-3
    scaled = ((inputs - mean) / scale).astype(np.float32)
    rng = np.random.default_rng(seed)
    classifier.partial_fit(scaled[:1], labels[:1], classes=np.arange(len(TWISTS)))
    for _ in range(EPOCHS):
        order = rng.permutation(len(scaled))
        for first in range(0, len(order), BATCH):
            batch = order[first : first + BATCH]
            classifier.partial_fit(scaled[batch], labels[batch])
    weights, biases = [*classifier.coefs_], [*classifier.intercepts_]
    biases[0] = biases[0] - (mean / scale) @ weights[0]  # the scaling becomes part of the network
    weights[0] = weights[0] / scale[:, None]
    return Network(weights, biases), float(classifier.loss_)


EPOCHS = 12
"""Passes over all samples."""

BATCH = 512
"""Samples of one step of the optimizer."""


def onnx_model(network: Network) -> ModelProto:
    """The policy as an ONNX model: tensors of the observation in, `action` (1, 4) out."""
    constants = {
        "near": NEAR_M, "tenth": 0.1, "one": 1.0,
        "actions": np.insert(TWISTS, [1, 1], 0.0, axis=1), "axis": np.array([1], np.int64),
    }  # fmt: skip
    nodes = [
        ("Add", ["scan", "near"], "scan_far", {}),
        ("Div", ["near", "scan_far"], "scan_near", {}),
        ("Mul", ["scan", "tenth"], "scan_tenth", {}),
        ("Mul", ["goal", "goal"], "goal_square", {}),
        ("ReduceSum", ["goal_square", "axis"], "away_square", {"keepdims": 1}),
        ("Sqrt", ["away_square"], "away", {}),
        ("Add", ["away", "one"], "away_one", {}),
        ("Div", ["goal", "away_one"], "goal_short", {}),
        ("Mul", ["away", "tenth"], "away_tenth", {}),
        ("Div", ["one", "away_one"], "away_near", {}),
        (
            "Concat",
            ["scan_near", "scan_tenth", "goal_short", "away_tenth", "away_near", *INPUTS[2:]],
            "layer_0",
            {"axis": 1},
        ),
    ]
    last = len(network.weights) - 1
    for k, (weights, biases) in enumerate(zip(network.weights, network.biases, strict=True)):
        constants |= {f"weights_{k}": weights, f"biases_{k}": biases}
        nodes.append(("Gemm", [f"layer_{k}", f"weights_{k}", f"biases_{k}"], f"sum_{k}", {}))
        if k < last:
            nodes.append(("Relu", [f"sum_{k}"], f"layer_{k + 1}", {}))
    nodes.append(("ArgMax", [f"sum_{last}"], "twist", {"axis": 1, "keepdims": 0}))
    nodes.append(("Gather", ["actions", "twist"], "learned", {"axis": 0}))
    constants |= APPROACH
    nodes += approach()
    graph = helper.make_graph(
        [
            helper.make_node(op, given, [out] if isinstance(out, str) else out, **more)
            for op, given, out, more in nodes
        ],
        "policy",
        [
            helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, *OBSERVATION[name].shape])
            for name in INPUTS
        ],
        [helper.make_tensor_value_info("action", TensorProto.FLOAT, [1, 4])],
        [numpy_helper.from_array(_float32(value), name) for name, value in constants.items()],
    )
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)


APPROACH = {
    "zero": np.zeros((1, 1)), "rest": np.zeros((1, 4)),
    "full": np.ones((1, 1)), "slow": 0.1 * np.ones(()), "half": 0.5 * np.ones(()),
    "gain": 2.0 * np.ones((1, 1)), "low": -np.ones(()), "high": np.ones(()),
    "begin_m": np.ones((1, 1)), "end_m": 0.12 * np.ones((1, 1)),
    "parts": np.array([1, 1, 1], np.int64),
}  # fmt: skip
"""Constants of the last metre."""


def approach() -> list[tuple[str, list[str], str | list[str], dict[str, int]]]:
    """Nodes of the last metre, which is a rule: turn to the goal, drive at it, rest at 0.12 m.

    The classes are too coarse to come to rest within the tolerance.
    """
    return [
        ("Split", ["goal", "parts"], ["x", "y", "z"], {"axis": 1}),
        ("Max", ["away", "end_m"], "away_some", {}),
        ("Div", ["y", "away_some"], "bend", {}),
        ("Mul", ["bend", "gain"], "turn_wide", {}),
        ("Clip", ["turn_wide", "low", "high"], "turn_ahead", {}),
        ("Less", ["x", "zero"], "behind", {}),
        ("Where", ["behind", "full", "turn_ahead"], "turn", {}),
        ("Clip", ["x", "slow", "half"], "speed", {}),
        ("Abs", ["y"], "aside", {}),
        ("Less", ["aside", "x"], "ahead", {}),
        ("Where", ["ahead", "speed", "zero"], "forward", {}),
        ("Concat", ["forward", "zero", "zero", "turn"], "rule", {"axis": 1}),
        ("Less", ["away", "end_m"], "arrived", {}),
        ("Where", ["arrived", "rest", "rule"], "near_action", {}),
        ("Less", ["away", "begin_m"], "near_goal", {}),
        ("Where", ["near_goal", "near_action", "learned"], "action", {}),
    ]


def _float32(value: object) -> np.ndarray:
    array = np.asarray(value)
    return array if array.dtype == np.int64 else array.astype(np.float32)
