"""Objectives, problems and the search for the best gait or body."""
