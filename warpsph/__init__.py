"""Smoothed particle hydrodynamics on NVIDIA Warp: landslide waves and free-surface flow from one YAML scene."""

__version__ = "0.1.0"
