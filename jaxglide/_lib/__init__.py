"""What every room stands on: array types, safe numerics, checks, derivatives, files."""
