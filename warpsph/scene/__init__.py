"""What a user may write, with units, and plain words for whatever is wrong with it; computes nothing."""
