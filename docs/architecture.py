"""Picture of the packages in their order, drawn from their imports: `docs/architecture.svg`."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path

from tests.test_layers import ALLOWED, LAYERS, imported_names, package_of, part_of

ROOT = Path(__file__).resolve().parents[1]
BELOW = ("models", "planners", "maps")
"""Packages beneath the harness, each in a row of its own."""

CHAR, HIGH, GAP, STEP, LEFT, WIDE = 6.6, 20, 10, 34, 90, 890
"""Width of a letter, height of a box, gap, height of a row, widths of names and boxes, px."""

COLORS = {True: "#dbeafe", False: "#f4f4f5"}
"""Of folders, and of single files."""


def drawing() -> str:
    """The rows of `LAYERS`, top to bottom; lines join folders, where no other line implies them."""
    rows = {name: parts for name, parts in reversed(LAYERS.items())}
    rows |= {name: (name,) for name in BELOW}
    boxes, lines = {}, []
    for number, (name, parts) in enumerate(rows.items()):
        y = GAP + number * STEP
        title = "" if name in BELOW else name
        lines.append(f'<text x="{GAP}" y="{y + 14}" fill="#71717a">{title}</text>')
        spare = WIDE - sum(map(_width, parts))
        x = LEFT + spare / len(parts) / 2
        for part in parts:
            boxes[part] = (x, y, _width(part))
            x += _width(part) + spare / len(parts)
    edges = [_edge(boxes[one], boxes[other]) for one, other in sorted(joined(imports()))]
    lines = [*edges, *lines, *(_box(part, *place) for part, place in boxes.items())]
    size = f"{LEFT + WIDE} {len(rows) * STEP + GAP}"
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size}" '
    head += 'font-family="monospace" font-size="11">'
    back = '<rect width="100%" height="100%" fill="white"/>'
    return "\n".join([head, back, *lines, "</svg>"]) + "\n"


def imports() -> dict[str, set[str]]:
    """Parts of the harness and packages below it that each of them imports."""
    found: dict[str, set[str]] = defaultdict(set)
    for package in ALLOWED:
        for source in sorted((ROOT / package).rglob("*.py")):
            names = imported_names(source)
            if package == "harness":
                part = source.relative_to(ROOT / package).with_suffix("").parts[0]
                found[part] |= {part_of(name) for name in names} - {None, part}
            else:
                part = package
            found[part] |= {package_of(name) for name in names} & set(BELOW) - {part}
    del found["__init__"]
    return dict(found)


def joined(direct: dict[str, set[str]]) -> set[tuple[str, str]]:
    """Pairs of folders of which the first imports the second, also by way of files."""

    def reached(part: str) -> set[str]:
        further = [reached(other) for other in direct.get(part, ())]
        return direct.get(part, set()).union(*further)

    reach = {part: set(filter(_is_folder, reached(part))) for part in direct if _is_folder(part)}
    return {
        (part, other)
        for part, others in reach.items()
        for other in others
        if not any(other in reach.get(between, ()) for between in others)
    }


def _width(part: str) -> float:
    return CHAR * len(part) + 12


def _is_folder(part: str) -> bool:
    return (ROOT / "harness" / part).is_dir() or part in BELOW


def _box(part: str, x: float, y: int, wide: float) -> str:
    rect = f'<rect x="{x:g}" y="{y}" width="{wide:g}" height="{HIGH}" rx="3" '
    rect += f'fill="{COLORS[_is_folder(part)]}" stroke="#a1a1aa"/>'
    return f'{rect}<text x="{x + 6:g}" y="{y + 14}">{part}</text>'


def _edge(upper: tuple[float, int, float], lower: tuple[float, int, float]) -> str:
    x, y, wide = upper
    to_x, to_y, to_wide = lower
    begin, end = x + wide / 2, to_x + to_wide / 2
    y += HIGH
    bend = (to_y - y) / 2
    curve = f"M{begin:g} {y} C{begin:g} {y + bend:g} {end:g} {to_y - bend:g} {end:g} {to_y}"
    return f'<path d="{curve}" fill="none" stroke="#60a5fa"/>'
