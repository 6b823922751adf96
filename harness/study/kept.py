"""What a run of a study keeps of an earlier one: how many episodes, from when, by which code."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime

from wayproof.harness.config import BUILTIN, PLUGIN
from wayproof.harness.interface.connect import code_digest, is_users
from wayproof.harness.prediction_config import ONNX_FILE
from wayproof.harness.study.plan import Planned
from wayproof.harness.study.store import Store

DIGITS = 12
"""Digits of a digest that are shown."""


def kept_in_words(planned: Sequence[Planned], store: Store) -> list[str]:
    """Return a line on the episodes that are kept, and one on each code of the user's."""
    logs = [path for one in planned if (path := store.log(one.key)).is_file()]
    lines = []
    if logs:
        newest = datetime.fromtimestamp(max(path.stat().st_mtime for path in logs))
        lines.append(f"kept: {len(logs)} of an earlier run, the newest of {newest:%Y-%m-%d %H:%M}")
    configs = [one.config for one in planned]
    stacks = dict.fromkeys((one.stack.name, one.stack.version) for one in configs)
    lines += [_stack_in_words(*one) for one in stacks if one[0] != BUILTIN and is_users(one[0])]
    others = [("planner", one.planner.name) for one in configs]
    others += [("predictor", one.prediction.source) for one in configs if one.runs_predictor]
    lines += [
        f"{what} {name}: code {digest[:DIGITS]}"
        for what, name in dict.fromkeys(others)
        if (PLUGIN in name or name.endswith(ONNX_FILE)) and (digest := code_digest(name))
    ]
    return lines


def _stack_in_words(name: str, version: str) -> str:
    """Return by what an episode of a stack counts as one of the same stack."""
    digest = code_digest(name)
    if digest:
        return f"stack {name}: code {digest[:DIGITS]}{f', version {version}' if version else ''}"
    if version:
        return f"stack {name}: version {version}"
    return (
        f"stack {name}: its code is not read, so episodes are kept when it changes; name it with "
        "--set stack.version=NAME"
    )
