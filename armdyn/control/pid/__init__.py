"""The paper's loop: PID around an arm as one differential equation, continuous in time."""
