"""`wayproof bench falsify`: how many episodes it takes to find a planted weakness.

A short thin glass pole stands beside the path of a drone (`harness.bench.episodes.glass_pole`).
Each repeat searches with another seed, in two processes: by evolution within a budget, and at
random within three times that budget.
"""

from __future__ import annotations

from wayproof.harness.bench.episodes.glass_pole import SPACE, cross_pole_room, pole_room
from wayproof.harness.bench.jobs import run_jobs
from wayproof.harness.bench.table import Document, Progress
from wayproof.harness.study.falsify.search import search
from wayproof.harness.warm_up import warm_up

BUDGET = 100
RANDOM_BUDGET = 3 * BUDGET


def bench_falsify(repeats: int, seed: int, progress: Progress) -> list[Document]:
    """Search with each seed; a row for each, then a summary."""
    warm_up(pole_room(None).config)
    found = {}
    for job, row in run_jobs([(each,) for each in range(seed, seed + repeats)], _repeat):
        progress(f"seed {row['seed']}: {row['evolution']} by evolution, {row['random']} at random")
        found[job] = row
    rows = [found[job] for job in sorted(found)]
    return [*rows, _all(rows)]


def _repeat(seed: int) -> Document:
    warm_up(pole_room(None).config)
    evolved = search(SPACE, cross_pole_room, BUDGET, seed)
    drawn = search(
        SPACE, evaluate=cross_pole_room, budget=RANDOM_BUDGET, seed=seed, method="random"
    )
    return {
        "seed": seed,
        "evolution": evolved.episodes,
        "found": evolved.failing is not None,
        "random": drawn.episodes,
        "random_found": drawn.failing is not None,
        "random_within_budget": drawn.failing is not None and drawn.episodes <= BUDGET,
    }


def _all(rows: list[Document]) -> Document:
    """Summarise how often each method succeeds within the budget, and which one is quicker."""
    return {
        "repeats": len(rows),
        "budget": BUDGET,
        "evolution_found": sum(row["found"] for row in rows),
        "random_found": sum(row["random_within_budget"] for row in rows),
        "evolution_quicker": sum(row["found"] and row["random"] > row["evolution"] for row in rows),
    }
