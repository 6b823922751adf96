"""The digest of a world's shape: the same for copies and spellings, another for another world."""

import re

import pytest

from wayproof.models.world_files.options import Ends, Found
from wayproof.models.world_files.parts import Part
from wayproof.models.world_files.shape import shape_digest
from wayproof.models.world_files.world_file import world_text

ENDS = Ends((-3.0, -3.0, -0.5), (3.0, 3.0, 3.0), (-2.0, 0.0, 0.0), 0.0, (2.0, 0.0, 0.0))
PARTS = [
    Part("box", (0.2, 0.2, 1.0), (0.0, 1.5, 1.0), kind="pillar"),
    Part("box", (0.1, 2.0, 1.0), (2.0, 0.0, 1.0), kind="wall"),
]
TEXT = world_text(Found(parts=PARTS), ENDS, "room")

SPELLINGS = {
    "a comment": TEXT.replace("<worldbody>", "<worldbody><!-- another world -->"),
    "another name": TEXT.replace('"room"', '"hall"').replace("pillar_0", "column"),
    "another colour": re.sub('rgba="[^"]*"', 'rgba="1 0 0 1"', TEXT),
    "other numbers": TEXT.replace('"0.2 0.2 1"', '"0.20000 2e-1 1.0000001"'),
    "another goal": TEXT.replace('wayproof_goal" data="2 0 0"', 'wayproof_goal" data="2 1 0"'),
    "another order": re.sub(r'( *<geom name="pillar.*\n)( *<geom name="wall.*\n)', r"\2\1", TEXT),
}


@pytest.mark.parametrize("name", SPELLINGS)
def test_a_copy_has_the_digest_of_its_world(name):
    assert SPELLINGS[name] != TEXT
    assert shape_digest(SPELLINGS[name]) == shape_digest(TEXT)


@pytest.mark.parametrize("pillar", ['"0.21 0.2 1"', '"0.2 0.2 2"'])
def test_another_world_has_another_digest(pillar):
    assert shape_digest(TEXT.replace('"0.2 0.2 1"', pillar)) != shape_digest(TEXT)
