"""The numerically hard cases, listed in `battery`: each gives correct digits or a refusal."""
