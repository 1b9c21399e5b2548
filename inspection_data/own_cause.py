"""A cause of your own: frozen grease drags on the plunger link, in proportion to the degrees below
0 °C.
"""

import numpy as np

from mlg_troubleshoot.diagnosis import Cause
from mlg_troubleshoot.diagnosis.causes.base import filled, offset


class FrozenGrease(Cause):
    name, needs = "frozen_grease", ("temperature_c",)
    parameter, trial, sign = "drag_in_per_c", -1e-5, -1
    sentence = "Frozen grease drags on the plunger link: the reading falls short below 0 °C"
    inspect = "Grease of the plunger link: clean, and grease with the type for low temperatures"
    separates = "one gear read frozen, then again with the plunger link warmed"

    def adjust(self, scene, _candidate, value):
        frost = np.maximum(0.0 - filled(scene.table.quantities["temperature_c"], 0.0), 0.0)
        return offset(scene, frost, value)
