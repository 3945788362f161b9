"""Exact and empirical solutions; imports nothing of ours."""
