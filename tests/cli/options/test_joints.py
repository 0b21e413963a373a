import armdyn as ad
from armdyn.cli.options.joints import carried_words


def test_a_payload_in_another_frame_than_the_goals_is_said():
    """The tip ee_link of a UR5 is turned against tool0."""
    goals = {frame: ad.GoalPose(frame, (0.4, 0.2, 0.4)) for frame in ("tool0", "ee_link")}

    def said(goal, **place):
        payload = ad.Payload(mass=1.0, **place)
        return carried_words(ad.Robot.from_library("ur5", payload=payload), goals[goal])["carries"]

    default = "payload of 1 kg in the frame 'ee_link'"
    assert said("ee_link") == default
    assert (
        said("tool0") == f"{default}; the goal is one of 'tool0', placed otherwise: --payload-frame tool0 puts it there"
    )
    assert said("tool0", frame="ee_link") == default  # who names it means it
