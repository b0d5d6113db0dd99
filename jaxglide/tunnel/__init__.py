"""The virtual wind tunnel: a held attitude, its loads, trim and glide polar."""
