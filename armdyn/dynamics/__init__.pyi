from armdyn.dynamics.numeric import forward_dynamics as forward_dynamics
from armdyn.dynamics.numeric import inverse_dynamics as inverse_dynamics
from armdyn.dynamics.symbolic import Dynamics as Dynamics
