"""MuJoCo's XML: keyframes and motors."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from armdyn.arguments import Checked, checked, flag
from armdyn.errors import TrajectoryError
from armdyn.trajectory.formats.output_format import joint_names

if TYPE_CHECKING:
    from armdyn.trajectory.samples import Samples

_NO_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
"""Characters that XML 1.0 does not have: https://www.w3.org/TR/xml/#charsets."""


@dataclass(frozen=True)
class Mujoco(Checked):
    """A keyframe per stamp, to include in a model: https://mujoco.readthedocs.io/en/stable/XMLreference.html.

    Attributes:
        motors: write a motor per joint, too.
    """

    name: ClassVar[str] = "mujoco"
    suffix: ClassVar[str] = ".xml"
    summary: ClassVar[str] = "keyframes and motors, to include in a model"

    motors: bool = checked(flag, True)

    def text(self, samples: Samples) -> str:
        """See `Samples.to_mjcf`.

        Raises:
            TrajectoryError: joints have no names, or one that XML cannot say; or the payload changes.
        """
        if len({(one.load, one.model_hash) for one in samples.pieces}) > 1:
            raise TrajectoryError(
                f"the payload changes along the motion of {len(samples.pieces)} pieces, and a MuJoCo model has one: "
                "write each piece by itself: armdyn export --piece, or trajectory.split() in Python"
            )
        names = [_attribute(name) for name in joint_names(samples)]
        lines = [f"<mujoco model={_attribute(samples.name or 'motion')}>"]
        if self.motors:
            lines += ["  <actuator>", *(f"    <motor name={name} joint={name}/>" for name in names), "  </actuator>"]
        lines.append("  <keyframe>")
        for t, q, v, tau in zip(*(getattr(samples, what).tolist() for what in ("t", "q", "v", "tau")), strict=True):
            q, v, tau = (" ".join(map(repr, row)) for row in (q, v, tau))
            lines.append(f'    <key time="{t!r}" qpos="{q}" qvel="{v}" ctrl="{tau}"/>')
        return "\n".join([*lines, "  </keyframe>", "</mujoco>", ""])


def _attribute(name: str) -> str:
    from xml.sax.saxutils import quoteattr  # it loads urllib, which nothing else needs

    return quoteattr(xml_name(name))


def xml_name(name: str) -> str:
    """Check that XML can hold a name.

    Raises:
        TrajectoryError: it cannot.
    """
    if _NO_XML.search(name):
        raise TrajectoryError(f"the name {name[:80]!r} has characters that XML cannot say")
    return name
