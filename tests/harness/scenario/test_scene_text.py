"""Scenes from logs that refer to no other file."""

import re

import mujoco
import pytest

from tests.tools.small_log import COMMITTED
from wayproof.harness.errors import InputError
from wayproof.harness.log.reader import open_log
from wayproof.harness.scenario.scene_text import safe_scene


def scene(inside, head=""):
    return f"<mujoco>{head}<worldbody>{inside}</worldbody></mujoco>"


TEXTURES = '<texture builtin="flat" width="2048" height="2048"/>' * 400


def test_our_own_scenes_pass():
    text = open_log(COMMITTED).scene
    assert safe_scene(text).count("<geom") == text.count("<geom")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (scene("", '<include file="/etc/passwd"/>'), "<include> is refused"),
        (scene("", '<asset><mesh name="a" file="../a.obj"/></asset>'), "<mesh file=...>"),
        (scene("", '<asset><texture fileright="a.png"/></asset>'), "<texture fileright=...>"),
        (scene("", '<compiler meshdir="/"/>'), "<compiler meshdir=...>"),
        (scene("", '<extension><plugin plugin="a.b"/></extension>'), "<extension> is refused"),
        (scene('<replicate count="1000000"><geom/></replicate>'), "<replicate> is refused"),
        (scene("", '<size memory="900G"/>'), "<size memory=...>"),
        (scene("", '<asset><texture width="99999" height="1"/></asset>'), "at most 2048"),
        (scene("", '<option timestep="1e-9"/>'), "timestep 1e-9"),
        (scene("", '<option timestep="soon"/>'), "expected a number"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><mujoco/>', "a document type"),
        ("<mujoco><worldbody>", "no element found"),
        ("<robot/>", "expected <mujoco>"),
        (scene("<body/>" * 60_000), "more than 50000 elements"),
        (scene("", '<size nuser_body="300000000"/>'), "<size>: nuser_body 3e+08, expected at most"),
        (scene("", '<option ccd_iterations="2000000000"/>'), "ccd_iterations 2e+09"),
        (scene("", '<option noslip_iterations="2000000000"/>'), "noslip_iterations 2e+09"),
        (scene("", '<custom><numeric name="a" size="400000000"/></custom>'), "size 4e+08"),
        (scene("", f"<asset>{TEXTURES}</asset>"), "pixels of all textures"),
        (scene("", '<asset><hfield nrow="40000" ncol="40000"/></asset>'), "heights of all fields"),
        (scene("", '<asset><hfield file="a.png"/></asset>'), "<hfield file=...>"),
        (scene("<body>" * 20_000 + "</body>" * 20_000), "more than 100 elements within one"),
    ],
)
def test_what_reaches_outside_or_multiplies_is_refused(text, said):
    with pytest.raises(InputError, match=re.escape(said)):
        safe_scene(text)


def test_text_that_mujoco_saves_as_cdata_is_read_again():
    spec = mujoco.MjSpec()
    spec.add_text(name="quoted", data='{"speed": [2.0]}')
    spec.compile()
    saved = spec.to_xml()
    assert "CDATA" in saved
    model = mujoco.MjModel.from_xml_string(safe_scene(saved))
    first = model.text_adr[0]
    assert model.text_data[first : first + model.text_size[0] - 1] == b'{"speed": [2.0]}'
