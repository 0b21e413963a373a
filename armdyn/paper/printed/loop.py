"""Section 4's PID loop: its gains, its sign of k_D, and when its arm counts as arrived."""

from typing import Literal

from armdyn.control.laws.pid import PidGains
from armdyn.control.tracking.arrival import ArrivalRule

GAINS = PidGains(kp=30.0, ki=50.0, kd=10.0)
"""Eqs (32)-(34): the same for every joint of R, RR and RRR."""

DURATION = 10.0
"""Duration of Examples 4 to 6 [s]."""

PAPER_RULE: ArrivalRule = "last_entry_first_joint"
"""Rule of the paper's times of arrival: it uses joint 1 alone."""

DerivativeSign = Literal["corrected", "printed"]
"""Sign of k_D θ̇: "corrected" is -k_D θ̇, which (27) says as ė = -θ̇; "printed" is +k_D θ̇ of (28)-(30)."""

ERROR_RATES: dict[DerivativeSign, float] = {"corrected": -1.0, "printed": 1.0}
"""ė over θ̇: the `error_rate` of `continuous_pid.simulate`."""
