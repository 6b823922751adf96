"""Network of an ONNX file as a predictor: a box of states in, log-odds out.

One input, float32: (1, 2, nx, ny, nz) cells, or (1, 2, nx, ny) columns between step height and a
lintel; the first channel is 1 where occupied, the second where free. One output, float32, of the
same cells or columns without the channels, or with one. Sizes that the file fixes fix the box.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from wayproof.harness.errors import InputError
from wayproof.harness.interface.policy import check_node, load_model
from wayproof.harness.prediction.predictor import MapBox
from wayproof.maps.states import FREE, OCCUPIED

WHAT = "predictor"


class OnnxPredictor:
    """Answers with the output of a network, on one thread.

    Attributes:
        name: Name of the file.
        shape: Cells of the box along x, y and z that the network takes; None where it takes any.
    """

    def __init__(self, path: Path) -> None:
        """Load a network, and check its input and output.

        Raises:
            InputError: There is no such file, it is no model, its input or output is another, or
                ONNX Runtime is not installed.
        """
        self.name = path.name
        self._session = load_model(path, WHAT)
        inputs, outputs = self._session.get_inputs(), self._session.get_outputs()
        if len(inputs) != 1 or len(outputs) != 1:
            raise InputError(
                f"{WHAT} '{path}': got {len(inputs)} inputs and {len(outputs)} outputs, expected "
                "one of each"
            )
        self._input, self._output = inputs[0], outputs[0].name
        self._columns = len(self._input.shape) == 4
        cells = 1, 2, "nx", "ny", "nz"
        check_node(f"{WHAT} '{path}'", self._input, cells, cells[:4])
        sizes = [size if isinstance(size, int) else None for size in self._input.shape[2:]]
        self.shape = sizes[0], sizes[1], None if self._columns else sizes[2]

    def predict(self, box: MapBox) -> NDArray[np.floating]:
        """Return the output for a box, without batch and channel."""
        if self._columns:
            parts = list(box.columns()[:2])
        else:
            parts = [box.states == OCCUPIED, box.states == FREE]
        states = np.stack(parts).astype(np.float32)[None]
        answer = self._session.run([self._output], {self._input.name: states})[0]
        expected = parts[0].shape
        if answer.shape in ((1, *expected), (1, 1, *expected)):
            return answer.reshape(expected)
        return answer  # refused with its shape
