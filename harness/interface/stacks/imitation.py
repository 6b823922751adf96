"""A learned policy: `dwa` imitated by DAgger, with the scan of one instant and no memory.

Ross, Gordon and Bagnell 2011, "A reduction of imitation learning and structured prediction to
no-regret online learning", AISTATS. `examples/policy/train.py` trained it, with the quadruped, in
warehouses, offices, forests and crossings of seeds 1000 to 1011. The last metre is a rule.
"""

from __future__ import annotations

from pathlib import Path

from wayproof.harness.interface.policy import PolicyStack

WEIGHTS = Path(__file__).with_name("imitation.onnx")
"""The policy."""


class Imitation(PolicyStack):
    """Imitates `dwa` by a learned policy without memory; needs ONNX Runtime."""

    def __init__(self) -> None:
        """Load the policy.

        Raises:
            InputError: ONNX Runtime is not installed.
        """
        super().__init__(WEIGHTS)
