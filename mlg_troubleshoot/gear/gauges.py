"""How well gauges read, as standard uncertainties: what a reading has that states none, and what
better gauges reach.
"""

# A clearance reading that states none, taken by hand: assumed. [in]
DEFAULT_GAUGE_U_IN = 0.0005
# A plunger reading that states none: hand-held gauges read it to 0.0015 to 0.002 in, assumed to be
# the larger. [in]
DEFAULT_PLUNGER_U_IN = 0.002
# What better gauges can reach: bore gauges and micrometers. [in]
BETTER_GAUGES_IN = (0.0004, 0.0003)
