"""Quoted output of the docs: checked against what was printed, and brought up to date with it."""

import re
from difflib import SequenceMatcher

import numpy as np

TIMES = (
    r"(?<=simulated in )\d+\.\d(?= s)|(?<=; )\d+\.\d(?= s;)|(?<=log )\d+\.\d(?= MB/min)"
    r"|sense [\d.]+, map [\d.]+, costmap [\d.]+, plan [\d.]+"
)
"""Wall times, and sizes that depend on them, which vary from run to run."""

NOISE = TIMES + r"|\b[0-9a-f]{12,32}\b"
"""The same, and hashes, which vary by machine."""

LEFT_OUT = "..."
"""Stands in a quoted line for any text."""

PRINTED = 2.0
"""Score of a quoted line for a line that it quotes, above that of any other, which is at most 1."""

TOKEN = re.compile(r"\w+|\s+|[^\w\s]")


def check_quote(quote, output):
    """Assert that each quoted line was printed, in this order; `...` matches anything."""
    left = output.splitlines()
    for line in filter(str.strip, quote.splitlines()):
        at = next((at for at, other in enumerate(left) if quotes(line, other)), None)
        assert at is not None, f"the page quotes\n{line}\nbut what was printed is\n{output}"
        left = left[at + 1 :]


def updated_quote(quote, output):
    """Return a quote with each line that was not printed replaced by the one in its place.

    Quoted lines stand for printed ones in their order, each for another, so that all together are
    as similar as can be. A line keeps its wall times, and what its `...` leave out.

    Raises:
        ValueError: Fewer lines were printed than are quoted.
    """
    lines = quote.splitlines()
    quoted = [at for at, line in enumerate(lines) if line.strip()]
    printed = [line.rstrip() for line in output.splitlines() if line.strip()]
    if len(quoted) > len(printed):
        raise ValueError(f"{len(quoted)} lines quoted, {len(printed)} printed:\n{quote}\n{output}")
    for at, place in zip(quoted, _places([lines[at] for at in quoted], printed), strict=True):
        if not quotes(lines[at], printed[place], noise=TIMES):
            lines[at] = _left_out_alike(lines[at], printed[place])
    return "\n".join([*lines, ""])


def quotes(line, printed, noise=NOISE):
    """Return whether a quoted line stands for a printed one, apart from noise."""
    parts = map(re.escape, _blurred(line, noise).split(LEFT_OUT))
    return re.fullmatch(".*".join(parts), _blurred(printed, noise)) is not None


def _blurred(line, noise=NOISE):
    """Return a line without its noise."""
    return " ".join(re.sub(noise, "#", line).split())


def _places(quoted, printed):
    """Return which printed line each quoted one stands for: ascending, of the greatest score."""
    spare = len(printed) - len(quoted) + 1  # places that each quoted line can be at
    best = np.zeros((len(quoted) + 1, spare))
    chosen = np.zeros((len(quoted), spare), int)
    for row in reversed(range(len(quoted))):
        scores = [_score(quoted[row], line) for line in printed[row : row + spare]]
        totals = scores + best[row + 1]
        for shift in reversed(range(spare)):
            chosen[row, shift] = shift + totals[shift:].argmax()
            best[row, shift] = totals[chosen[row, shift]]
    shift, places = 0, []
    for row in range(len(quoted)):
        shift = chosen[row, shift]
        places.append(row + shift)
    return places


def _score(line, printed):
    if quotes(line, printed):
        return PRINTED
    return SequenceMatcher(None, _blurred(line), _blurred(printed), autojunk=False).ratio()


def _left_out_alike(line, printed):
    """Return a printed line with `...` where a similar quoted line has them."""
    parts = line.split(LEFT_OUT)
    ends = np.cumsum([len(TOKEN.findall(part)) for part in parts])
    quoted = [token.strip() for part in parts for token in TOKEN.findall(part)]
    tokens = TOKEN.findall(printed)
    matcher = SequenceMatcher(None, quoted, [token.strip() for token in tokens], autojunk=False)
    steps = matcher.get_opcodes()
    shown = [0]
    for end in ends[:-1]:
        shown += [_image(steps, end, before=True), _image(steps, end, before=False)]
    shown = np.maximum.accumulate([*shown, len(tokens)])
    kept = ["".join(tokens[a:b]) for a, b in zip(shown[::2], shown[1::2], strict=True)]
    return LEFT_OUT.join(kept)


def _image(steps, at, before):
    """Return where a place between tokens of one line is in the other, by the edits to get there.

    Tokens that are replaced keep their number next to the place; what is added there is left out.
    """
    for _, a, b, c, d in steps:
        if before and a < at <= b:
            return min(c + at - a, d)
        if not before and a <= at < b:
            return max(d - (b - at), c)
    return 0 if before else steps[-1][4]
