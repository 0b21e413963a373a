"""PID control of an arm: gains, closed-loop simulation, stability at the goal."""

from armdyn.control.closed_loop import PidRun, simulate_pid
from armdyn.control.pid import PidGains
from armdyn.control.stability import closed_loop_eigenvalues

__all__ = ["PidGains", "PidRun", "closed_loop_eigenvalues", "simulate_pid"]
