"""Predictors of the space that was not measured."""

from wayproof.harness.prediction.completion import Completion
from wayproof.harness.prediction.predictor import PREDICTED_LAYERS, Predictor, View

PREDICTORS: dict[str, type[Predictor]] = {"completion": Completion}
"""Predictors by name."""

__all__ = ["PREDICTED_LAYERS", "PREDICTORS", "Completion", "Predictor", "View"]
