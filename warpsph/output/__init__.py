"""All that leaves a run: records, checkpoints, pictures, the USD cache, the report."""
