"""Rigid bodies before they touch water: mass and inertia, prescribed motions, contact."""
