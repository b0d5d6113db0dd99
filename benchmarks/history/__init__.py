"""What `asv` times at one commit after the other; see `benchmarks/README.md`."""
