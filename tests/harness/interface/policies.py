"""Policies to put on trial, made by hand: ONNX graphs of a few nodes."""

from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper

AHEAD = (0.5, 0.0, 0.0, 0.2)


def constant(action=AHEAD, name="action", shape=(1, 4), **inputs):
    """A model that answers the same action to whatever it observes, its first input times 0 added.

    Args:
        action: The answer.
        name: Of the output.
        shape: Of the output, as it is declared.
        inputs: Shape of each input by name, as it is declared.
    """
    inputs = inputs or {"sigma": [1, 2]}
    first = next(iter(inputs))
    nodes = [
        helper.make_node("ReduceSum", [first], ["sum"], keepdims=0),
        helper.make_node("Mul", ["sum", "zero"], ["nothing"]),
        helper.make_node("Add", ["nothing", "answer"], [name]),
    ]
    constants = {"zero": np.zeros((), np.float32), "answer": np.array([action], np.float32)}
    return model(nodes, inputs, {name: shape}, constants)


def of_varying_shape():
    """A model whose output has a shape that only a run shows."""
    nodes = [
        helper.make_node("Reshape", ["sigma", "four"], ["deep"]),
        helper.make_node("NonZero", ["deep"], ["places"]),
        helper.make_node("Transpose", ["places"], ["rows"]),
        helper.make_node("Cast", ["rows"], ["action"], to=TensorProto.FLOAT),
    ]
    four = {"four": np.array([1, 1, 1, 2], np.int64)}
    return model(nodes, {"sigma": [1, 2]}, {"action": [None, 4]}, four)


def model(nodes, inputs, outputs, constants):
    """A model of nodes; shapes by name, float32."""
    infos = [
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape) for name, shape in each]
        for each in (inputs.items(), outputs.items())
    ]
    tensors = [numpy_helper.from_array(value, name) for name, value in constants.items()]
    graph = helper.make_graph(nodes, "policy", *infos, tensors)
    return helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=9)


def saved(path: Path, made) -> Path:
    """Save a model."""
    path.write_bytes(made.SerializeToString())
    return path


def with_external_weights(made, location: str):
    """The same model with its action in another file."""
    for tensor in made.graph.initializer:
        if tensor.name == "answer":
            tensor.ClearField("raw_data")
            tensor.data_location = TensorProto.EXTERNAL
            for key, value in (("location", location), ("offset", "0"), ("length", "16")):
                tensor.external_data.add(key=key, value=value)
    return made
