"""Drawn recordings are read right, counted or refused, never silently wrong."""

import os
import tempfile
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.harness.recordings.bags.drawn import Plan, Recorder, read

NAN, INF = float("nan"), float("inf")
CODES = st.sets(st.sampled_from([NAN, INF, -INF, 0.0, -1.0]), max_size=3).map(tuple)
OF_ALL = ["static_corrected", "static_missing", "gap", "late_start", "shuffled", "by_topic"]
OF_ALL += ["odometry", "two_parents", "broken_poses", "sweeps_shuffled"]
OF_SCANS = ["two_frames", "slash", "maximum_varies", "maximum_is_code", "increment_halved"]
OF_DEPTHS = ["big_endian", "padded", "intrinsics_change"]
TIMES = [
    ("time", "f4", 1.0),
    ("time", "f4", 0.0),
    ("time", "f4", 1e3),
    ("time", "f4", 1e6),
    ("timestamp", "f8", 1.0),
    ("timestamp", "f8", 1e6),
    ("timestamp", "f8", 1e9),
    ("offset_time", "u4", 1e9),
    ("t", "u4", 1e6),
    ("t", "u4", 1e3),
    ("t", "i4", 1e9),
]
"""Field, type and units in a second of the times of points; 0 of a share of the period."""

EXAMPLES = int(os.environ.get("DRAWN_RECORDINGS", "30"))


def changes(*more):
    return st.sets(st.sampled_from([*OF_ALL, *more]), max_size=2).map(
        lambda one: tuple(sorted(one))
    )


PLACES = st.tuples(st.floats(-0.4, 0.4), st.floats(-0.3, 0.3), st.floats(-3.1, 3.1))
SHARED = {"kind": st.sampled_from(["mcap", "sqlite", "ros1"]), "turn": st.floats(-1.5, 1.5)}
SHARED["set_back"] = st.sampled_from([0.0, 0.0, 0.0, 0.06, 0.13, 0.2, 0.4, 0.77, 1.2])
SCANS = st.builds(
    Plan,
    sensor=st.just("scan"),
    mount=PLACES,
    increment_scale=st.sampled_from([1.0, 1.0, 1.0, 1.0, 0.0, 1e-3, 2.0, 1e3, 1e6, 1e9]),
    is_reversed=st.booleans(),
    codes=CODES.map(lambda one: (*one, 65.535)),
    changes=changes(*OF_SCANS),
    **SHARED,
)


@st.composite
def clouds(draw):
    name, kind, scale = draw(st.sampled_from(TIMES))
    origins = (
        ["epoch"] if kind == "f8" else ["first"] if kind == "u4" else ["first", "middle", "last"]
    )
    return Plan(
        sensor="cloud",
        time_field=name,
        time_type=kind,
        time_scale=scale,
        time_origin="first" if scale == 0.0 else draw(st.sampled_from(origins)),
        time_offset=draw(st.sampled_from([0.0, 0.0, 37.0])) if kind == "f8" else 0.0,
        codes=draw(CODES.map(lambda one: tuple(code for code in one if code != -1.0))),
        mount=draw(PLACES),
        changes=draw(changes("few_wrong")),
        **{key: draw(one) for key, one in SHARED.items()},
    )


@st.composite
def depths(draw):
    encoding = draw(st.sampled_from(["16UC1", "mono16", "32FC1"]))
    floats = ["millimetres"] if encoding == "32FC1" else []
    return Plan(
        sensor="depth",
        encoding=encoding,
        info=draw(st.sampled_from(["K", "P", "binned", "roi", "distorted"])),
        codes=draw(CODES) if encoding == "32FC1" else (*draw(CODES), 65.535),
        mount=draw(PLACES),
        changes=draw(changes(*OF_DEPTHS, *floats)),
        **{key: draw(one) for key, one in SHARED.items()},
    )


@pytest.mark.parametrize("plans", [SCANS, clouds(), depths()], ids=["scans", "clouds", "depths"])
def test_no_drawn_recording_is_silently_wrong(plans):
    @settings(
        max_examples=EXAMPLES // 3,
        deadline=None,
        derandomize=EXAMPLES == 30,
        suppress_health_check=list(HealthCheck),
    )
    @given(plan=plans, seed=st.integers(0, 2**31))
    def check(plan, seed):
        with tempfile.TemporaryDirectory() as folder:
            found = read(
                Recorder(plan, seed).record(
                    Path(folder) / ("bag.bag" if plan.kind == "ros1" else "bag")
                )
            )
        assert not found.is_silent_and_wrong, (plan, found)
        if not (plan.changes or plan.codes or plan.set_back) and plan.increment_scale == 1.0:
            assert found.refused or found.wrong <= 0.02, (plan, found)

    check()


@pytest.mark.parametrize("sensor", ["scan", "cloud", "depth"])
def test_what_a_driver_records_well_is_read_whole(tmp_path, sensor):
    found = read(Recorder(Plan(sensor=sensor), 0).record(tmp_path / "bag"))
    assert (found.refused, found.faults, found.wrong) == ("", {}, 0.0)
    assert found.returns >= 1000
