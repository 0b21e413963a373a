"""Output formats of a motion, one class in one file each, and their registry.

`FORMATS` has them by name, `register` adds one. `armdyn export --help` lists them without loading numpy: modules of
formats load it where they use it.
"""

from armdyn.trajectory.formats.csv_table import CsvTable as CsvTable
from armdyn.trajectory.formats.mujoco import Mujoco as Mujoco
from armdyn.trajectory.formats.output_format import FORMATS as FORMATS
from armdyn.trajectory.formats.output_format import OutputFormat as OutputFormat
from armdyn.trajectory.formats.output_format import register as register
from armdyn.trajectory.formats.programs import PandaPython as PandaPython
from armdyn.trajectory.formats.programs import UrRtde as UrRtde
from armdyn.trajectory.formats.programs import UrScript as UrScript
from armdyn.trajectory.formats.ros2 import Ros2 as Ros2

for _kind in (CsvTable, Ros2, Mujoco, UrScript, UrRtde, PandaPython):
    register(_kind)
