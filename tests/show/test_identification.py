"""The report of an identification."""

import re

import pytest

import armdyn as ad
from armdyn.errors import ProblemError
from armdyn.show.identification import write_identification
from oracles import robot_named
from simulated_logs import simulated_log

RRR = robot_named("rrr")


@pytest.mark.parametrize("held_out", [0.25, 0])
def test_the_page_has_torques_numbers_and_unknowns(tmp_path, held_out):
    arm = RRR.with_payload(ad.Payload(mass=0.12)).with_friction(0.02, 0.03)
    estimate = ad.identify(RRR, simulated_log(arm, duration=3.0), "payload", ad.IdentifyOptions(held_out=held_out))
    page = write_identification(estimate, tmp_path / "report.html").read_text()
    assert "<script" not in page and "http" not in page.replace("http-equiv", "") and "{{" not in page
    assert page.count("<polyline") == (9 if held_out else 0)
    assert ("Identified, not judged" in page) == (not held_out)
    for joint in RRR.joint_names:
        assert f"damping of {joint}" in page
    margin = next(one for one in estimate.parameters if one.name == "mass of payload")
    assert f"± {margin.interval[1] - margin.value:.2g} kg" in page
    unseen = [one for one in estimate.parameters if not one.measured]
    assert f"Numbers that the logs do not determine ({len(unseen)})" in page
    assert len(re.findall('class="interval"', page)) == len(estimate.parameters) - len(unseen)


def test_anything_else_is_refused(tmp_path):
    with pytest.raises(ProblemError, match="estimate is 1"):
        write_identification(1, tmp_path / "x.html")
