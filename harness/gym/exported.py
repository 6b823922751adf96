"""Export of a trained network as a policy that `--stack policy:FILE.onnx` loads."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.interface.policy import OUTPUT, PolicyStack
from wayproof.harness.interface.policy_tensors import ACTION, OBSERVATION
from wayproof.harness.outputs import written_whole

Array = NDArray[np.floating[Any]]

CLIP = 10.0
"""Bound of an observation that was normalised, as Stable-Baselines3 has it."""


def save_policy(
    path: Path | str,
    layers: Sequence[tuple[Array, Array]],
    *,
    activation: str = "Tanh",
    normal: tuple[Array, Array] | None = None,
) -> None:
    """Write a network of full layers over the flat observation; its last one is the action.

    Args:
        path: The file.
        layers: Weights (out, in) and biases (out,) of each.
        activation: Name of ONNX's operator between them, such as `Tanh` or `Relu`.
        normal: Mean and standard deviation of the observations, where these were normalised.

    Raises:
        InputError: The layers do not fit the observation and the action, or `onnx` is missing.
    """
    try:
        from onnx import TensorProto, helper, numpy_helper
    except ImportError:
        raise InputError("save_policy: expected onnx to be installed (the extra 'train')") from None
    constants: dict[str, Any] = {}
    nodes = [helper.make_node("Concat", [*OBSERVATION], ["flat"], axis=1)]
    value = "flat"
    if normal is not None:
        constants |= {"mean": normal[0], "deviation": normal[1], "low": -CLIP, "high": CLIP}
        nodes.append(helper.make_node("Sub", ["flat", "mean"], ["centred"]))
        nodes.append(helper.make_node("Div", ["centred", "deviation"], ["scaled"]))
        nodes.append(helper.make_node("Clip", ["scaled", "low", "high"], ["normal"]))
        value = "normal"
    for k, (weights, biases) in enumerate(layers):
        constants |= {f"weights_{k}": weights, f"biases_{k}": biases}
        last = k == len(layers) - 1
        given, out = [value, f"weights_{k}", f"biases_{k}"], OUTPUT if last else f"sum_{k}"
        nodes.append(helper.make_node("Gemm", given, [out], transB=1))
        if not last:
            value = f"layer_{k}"
            nodes.append(helper.make_node(activation, [out], [value]))
    tensors = {**{name: one.shape for name, one in OBSERVATION.items()}, OUTPUT: ACTION.shape}
    *inputs, output = (
        helper.make_tensor_value_info(name, TensorProto.FLOAT, [1, *shape])
        for name, shape in tensors.items()
    )
    arrays = [
        numpy_helper.from_array(np.asarray(one, np.float32), name)
        for name, one in constants.items()
    ]
    graph = helper.make_graph(nodes, "policy", inputs, [output], arrays)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)
    with written_whole(Path(path), "policy") as temporary:
        temporary.write_bytes(model.SerializeToString())
        PolicyStack(temporary)  # which runs it once


def save_sb3(path: Path | str, model: Any, normal: Any = None) -> None:
    """Write the policy of a PPO or A2C of Stable-Baselines3, trained on a flat environment.

    Args:
        path: The file.
        model: The trained model, with its `MlpPolicy`.
        normal: The `VecNormalize` that it was trained behind, if there was one.

    Raises:
        InputError: As of `save_policy`.
    """
    modules = [*model.policy.mlp_extractor.policy_net, model.policy.action_net]
    layers, between = [], "Tanh"
    for module in modules:
        if hasattr(module, "weight"):
            weights, biases = (one.detach().cpu().numpy() for one in (module.weight, module.bias))
            layers.append((weights, biases))
        else:
            between = {"ReLU": "Relu"}.get(type(module).__name__, type(module).__name__)
    spread = None
    if normal is not None:
        spread = normal.obs_rms.mean, np.sqrt(normal.obs_rms.var + normal.epsilon)
    save_policy(path, layers, activation=between, normal=spread)
