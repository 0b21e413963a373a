from armdyn.identification.estimate import Estimate as Estimate
from armdyn.identification.estimate import Estimated as Estimated
from armdyn.identification.estimate import Judged as Judged
from armdyn.identification.estimation import IdentifyOptions as IdentifyOptions
from armdyn.identification.estimation import identify as identify
from armdyn.identification.fitting import FitOptions as FitOptions
from armdyn.identification.log import Log as Log
