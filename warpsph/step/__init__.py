"""One room for each act of a time step; `step.step` tells their order."""
