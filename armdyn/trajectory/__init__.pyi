from armdyn.trajectory.pieces import Load as Load
from armdyn.trajectory.pieces import Piece as Piece
from armdyn.trajectory.samples import LEAST_STEP as LEAST_STEP
from armdyn.trajectory.samples import Samples as Samples
from armdyn.trajectory.value import HOLDS as HOLDS
from armdyn.trajectory.value import Hold as Hold
from armdyn.trajectory.value import Sample as Sample
from armdyn.trajectory.value import Trajectory as Trajectory
