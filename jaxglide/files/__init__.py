"""Saved results, opened again; nothing here loads Matplotlib."""
