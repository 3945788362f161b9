"""One room for each way to solve the equations of flow: what a particle has, and the acts of a step in order."""
