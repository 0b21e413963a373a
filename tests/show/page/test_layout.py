"""Nothing of a report or of the paper's page is covered, cut off or broken, on a phone and on a wide screen."""

import pytest

import armdyn as ad
from armdyn.show.page.facts import Facts
from armdyn.show.page.motions import ShownMotion, Subject
from armdyn.show.page.report import report_html, report_of
from show.browser import open_page, resize
from show.page.runs import FACTS

pytestmark = pytest.mark.slow

PHONE, WIDE = {"width": 390, "height": 844}, {"width": 1920, "height": 1080}

COVERED = """() => {
  const player = document.getElementById("player").getBoundingClientRect();
  return [...document.querySelectorAll(".now .row *, #plots *")].filter(node => {
    const box = node.getBoundingClientRect();
    return box.height && box.top < player.bottom - 1 && box.bottom > player.top + 1 && box.left < player.right
      && box.right > player.left;
  }).length;
}"""
CUT = """() => [...document.querySelectorAll("main *, nav *")].filter(node => {
  const box = node.getBoundingClientRect(), hidden = node.scrollWidth - node.clientWidth > 1;
  return box.width && (box.right > innerWidth + 1 || (getComputedStyle(node).overflowX === "auto" && hidden));
}).map(node => `${node.tagName}.${node.className}`)"""
"""Elements beyond the page's edge, or visible only by scrolling sideways."""
BROKEN = """words => {
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT), broken = [];
  while (texts.nextNode()) for (const word of words) {
    const at = texts.currentNode.data.indexOf(word);
    if (at < 0 || texts.currentNode.parentElement.closest("script, style")) continue;
    const range = document.createRange();
    range.setStart(texts.currentNode, at);
    range.setEnd(texts.currentNode, at + word.length);
    if (new Set([...range.getClientRects()].map(box => Math.round(box.top))).size > 1) broken.push(word);
  }
  return broken;
}"""


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """Of one motion of a UR5, whose joints have long names, and of two side by side."""
    robot = ad.Robot.from_library("ur5")
    fast, slow = (ad.ramp(robot, [-1.0, -1.5, 0, 0, 0, 0], [-0.8, -1.7, 0.6, 0.3, 0, 0], T) for T in (0.239, 0.31))
    six = {"payload_mass": 0.35} | dict.fromkeys(("effort_upper", "effort_lower", "velocity"), (-0.006,) * 6)
    decides = [{"limit": "torque limit", "joint": "shoulder_pan_joint", "part": 0.275}]
    facts = FACTS | {"arcs": [], "sensitivities": six, "decides": decides, "local_optima": [0.2431]}
    facts |= {"duration": 0.239}
    moves = (
        ShownMotion("minimum time", fast, Facts(facts)),
        ShownMotion("planned", slow, Facts({"optimal_duration": 0.2, "ratio": 4.177, "feasible": True})),
    )
    folder = tmp_path_factory.mktemp("reports")
    for name, some in (("one", moves[:1]), ("two", moves)):
        (folder / f"{name}.html").write_text(report_html(report_of(Subject.of(robot), some, "ur5")))
    return robot, folder


@pytest.fixture(scope="module", params=["one", "two"])
def opened(request, chromium, reports):
    """Robot, name of a report, and its page, which tests give their size, with its errors."""
    robot, folder = reports
    with open_page(chromium, folder / f"{request.param}.html", **PHONE) as (page, _, errors):
        yield robot, request.param, page, errors


def test_on_a_phone_nothing_is_covered_cut_or_broken(opened):
    robot, _, page, errors = opened
    resize(page, PHONE)
    for y in (0, 200, 400, 700, 1200):
        page.evaluate(f"scrollTo(0, {y})")
        assert page.evaluate(COVERED) == 0
    assert page.evaluate(CUT) == []
    assert page.evaluate(BROKEN, [*robot.joint_names, *(one.removesuffix("_joint") for one in robot.joint_names)]) == []
    assert not errors


@pytest.mark.parametrize("size", [WIDE, {"width": 1280, "height": 800}])
def test_on_a_wide_page_there_is_no_blank_below_the_arm(opened, size):
    _, name, page, _ = opened
    resize(page, size)
    left, right = (page.locator(one).bounding_box() for one in (".left", ".right"))
    assert left["y"] + left["height"] == pytest.approx(right["y"] + right["height"], abs=1)
    last = page.locator(".now .row:visible").last.bounding_box()
    assert left["y"] + left["height"] - last["y"] - last["height"] < 20
    assert page.evaluate(COVERED) == 0
    player = page.locator("#player").bounding_box()
    assert player["y"] + player["height"] <= size["height"]  # seen at once
    if name == "two" and size == WIDE:
        one_quantity_has_one_number_of_digits(page)


def one_quantity_has_one_number_of_digits(page):
    text = page.evaluate("document.body.innerText")
    assert "0.2390 s" in text and "0.239 s" not in text
    assert "0.3100 s" in text and "0.31 s" not in text
    for k in range(3):
        column = page.locator(f".now .row:not(.head) .value:nth-of-type({k + 1}):visible").all_inner_texts()
        assert len(column) == 6 and len({len(one.split()[0].partition(".")[2]) for one in column}) == 1
