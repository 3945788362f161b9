"""Launching: how a kernel is spread over cores or handed to a GPU, and points sorted by cells."""
